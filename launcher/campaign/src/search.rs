//! Tunes the gains of the controllers of a campaign by one procedure with one budget, so that the comparison is fair.
//!
//! A search by CMA-ES (Hansen, arXiv 1604.00772) begins at the settings of the file and minimises the mean cost of the
//! training flights. A flight that does not pass costs 1; one that passes costs `e / (1 m + e)`, where `e` is its RMS
//! position error. Factors stay between 1/1000 and 1000. Values are rounded to three digits before they are flown, so
//! that the printed values are those that were flown. The result is the best try, or the settings of the file if none
//! was better. A factor that ends at 1/1000 or 1000 is named, because the best one may lie beyond.

use std::fmt::Write as _;

use anyhow::{Context, ensure};
use cmaes::{CMAESOptions, DVector};
use rayon::prelude::*;
use settings::Given;
use toml::Value;

use crate::columns;
use crate::file::Campaign;
use crate::plan::Plan;
use crate::row::{self, FlightRow, Standing};
use crate::table::Cell;
use crate::tune::{Tune, at, merged, population, starts};

/// Largest factor of a group, and the inverse of the smallest.
const WIDEST: f64 = 1000.0;
/// Initial spread of the logarithms of the factors.
const SPREAD: f64 = 0.5;
/// Seed of the search itself: the same for every controller.
const SEARCH_SEED: u64 = 1;
/// Position error at which a passed flight costs 0.5 \[m\]; a failed flight costs 1.
const HALF_M: f64 = 1.0;
/// Digits that a tuned value keeps.
const DIGITS: i32 = 3;

/// Result of a search.
#[derive(Debug, Clone)]
pub struct Tuned {
    pub controller: String,
    /// Tuned settings; an array of which elements were scaled is given whole.
    pub settings: Vec<(String, Value)>,
    /// Mean cost with the settings of the file, and with the tuned ones.
    pub cost: [f64; 2],
    pub flights: u64,
    /// Groups whose factor is at a border of the search: their keys, and the factor.
    pub at_border: Vec<(Vec<String>, f64)>,
}

/// Search of the settings of one controller.
struct Search<'a> {
    plan: &'a Plan,
    controller: usize,
    /// Keys and values of the file, by group.
    groups: Vec<Vec<(String, f64)>>,
}

/// Searches the settings of each controller, or of those in `only` unless it is empty. Calls `show` after each try with
/// controller, flights so far and least cost. Returns `None` if `go_on` returned `false` before the end.
pub fn search(
    tune: &Tune,
    campaign: &Campaign,
    only: &[String],
    go_on: impl Fn() -> bool + Sync,
    mut show: impl FnMut(&str, u64, f64),
) -> anyhow::Result<Option<Vec<Tuned>>> {
    for name in only {
        let known: Vec<&str> = tune.scale.keys().map(String::as_str).collect();
        ensure!(tune.scale.contains_key(name), "[tune.scale] has no `{name}`; it has {}", known.join(", "));
    }
    let plan = Plan::new(campaign.clone().drawn_anew(tune.seed, tune.samples))?;
    let mut found = vec![];
    for (name, groups) in tune.scale.iter().filter(|(name, _)| only.is_empty() || only.contains(name)) {
        let controller = plan.campaign.controllers.iter().position(|(controller, _)| controller == name);
        let controller = controller.context("checked when the file was read")?;
        let search = Search { plan: &plan, controller, groups: starts(&campaign.controllers[controller].1, groups)? };
        let show = |flights, cost| show(name, flights, cost);
        let Some(tuned) = search.run(tune.flights, &go_on, show)? else { return Ok(None) };
        found.push(tuned);
    }
    Ok(Some(found))
}

impl Search<'_> {
    /// Returns the best settings that `budget` flights find; `None` if `go_on` returned `false`.
    fn run(
        &self,
        budget: u64,
        go_on: &(impl Fn() -> bool + Sync),
        mut show: impl FnMut(u64, f64),
    ) -> anyhow::Result<Option<Tuned>> {
        let (name, given) = &self.plan.campaign.controllers[self.controller];
        let at_start = self.cost(&vec![0.0; self.groups.len()], go_on);
        let a_try = self.plan.flights() / self.plan.campaign.controllers.len() as u64;
        let mut flights = a_try;
        let (mut best, mut least) = (vec![0.0; self.groups.len()], at_start);
        let generations = (budget - a_try) / (a_try * population(self.groups.len()) as u64);
        let objective = |x: &DVector<f64>| {
            let factors: Vec<f64> = x.iter().copied().collect();
            let cost = self.cost(&factors, go_on);
            flights += a_try;
            if cost < least {
                (best, least) = (factors, cost);
            }
            show(flights, least);
            cost
        };
        CMAESOptions::new(vec![0.0; self.groups.len()], SPREAD)
            .population_size(population(self.groups.len()))
            .max_generations(generations as usize)
            .seed(SEARCH_SEED)
            .build(objective)
            .map_err(|error| anyhow::anyhow!("the search cannot begin: {error:?}"))?
            .run();
        if !go_on() {
            return Ok(None);
        }
        let settings = whole(given, &self.settings(&best))?;
        let at_border = self.at_border(&best);
        Ok(Some(Tuned { controller: name.clone(), settings, cost: [at_start, least], flights, at_border }))
    }

    /// Returns the keys of the groups whose factor, given as logarithm, is at a border, with the factor.
    fn at_border(&self, logarithms: &[f64]) -> Vec<(Vec<String>, f64)> {
        let at_border = |(group, logarithm): (&Vec<(String, f64)>, &f64)| {
            let border = if *logarithm < 0.0 { 1.0 / WIDEST } else { WIDEST };
            let is_there = logarithm.abs() >= libm::log(WIDEST);
            is_there.then(|| (group.iter().map(|(key, _)| key.clone()).collect(), border))
        };
        self.groups.iter().zip(logarithms).filter_map(at_border).collect()
    }

    /// Scales the settings by factors, given as logarithms.
    fn settings(&self, logarithms: &[f64]) -> Vec<(String, Value)> {
        let scaled = |(group, logarithm): (&Vec<(String, f64)>, &f64)| {
            let widest = libm::log(WIDEST);
            let factor = libm::exp(logarithm.clamp(-widest, widest));
            group.iter().map(|(key, start)| (key.clone(), Value::Float(rounded(start * factor)))).collect::<Vec<_>>()
        };
        self.groups.iter().zip(logarithms).flat_map(scaled).collect()
    }

    /// Flies the training flights and returns their mean cost; a flight stopped by `go_on` costs 1.
    fn cost(&self, logarithms: &[f64], go_on: &(impl Fn() -> bool + Sync)) -> f64 {
        let settings = self.settings(logarithms);
        let controllers = self.plan.campaign.controllers.len();
        let numbers: Vec<u64> = (self.controller as u64..self.plan.flights()).step_by(controllers).collect();
        let one = |number: &u64| match row::fly(&self.plan.flight_with(*number, &settings), go_on, |_| {}) {
            Some(outcome) => cost(&outcome),
            None => 1.0,
        };
        let costs: Vec<f64> = numbers.par_iter().map(one).collect();
        costs.iter().sum::<f64>() / costs.len() as f64 // summed in order: the same on any number of cores
    }
}

impl Tuned {
    /// Returns the settings as TOML for the file, with the costs in a comment.
    pub fn to_toml(&self) -> String {
        let [before, after] = self.cost;
        let mut text = format!("# cost {before:.4} before, {after:.4} after {} flights\n", self.flights);
        for (keys, factor) in &self.at_border {
            let (keys, more) = (keys.join("`, `"), if *factor < 1.0 { "less" } else { "more" });
            let _ = writeln!(text, "# the best factor of `{keys}` is {factor} or {more}: the search ends there");
        }
        let _ = writeln!(text, "[controller.{}]", self.controller);
        for (key, value) in &self.settings {
            let _ = writeln!(text, "{key} = {value}");
        }
        text
    }
}

/// Cost of a training flight, from 0 to 1.
fn cost(outcome: &FlightRow) -> f64 {
    let column = columns::of_the_outcome().iter().position(|(name, _)| name == "rms_position_error_m");
    match (outcome.standing, column.and_then(|column| outcome.cells.get(column))) {
        (Standing::Passed, Some(Cell::Real(error_m))) => error_m / (HALF_M + error_m),
        _ => 1.0,
    }
}

/// Replaces settings of array elements by settings of the whole arrays, each array once.
fn whole(given: &Given, settings: &[(String, Value)]) -> anyhow::Result<Vec<(String, Value)>> {
    let merged = merged(given, settings)?;
    let is_number = |name: &str| name.parse::<usize>().is_ok();
    let array = |key: &str| key.split('.').take_while(|name| !is_number(name)).collect::<Vec<_>>().join(".");
    let mut keys: Vec<String> = settings.iter().map(|(key, _)| array(key)).collect();
    keys.sort_unstable();
    keys.dedup();
    Ok(keys.into_iter().filter_map(|key| at(&merged, &key).cloned().map(|value| (key, value))).collect())
}

/// Rounds to [`DIGITS`] significant digits.
fn rounded(x: f64) -> f64 {
    format!("{x:.*e}", DIGITS as usize - 1).parse().unwrap_or(x)
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    const FILE: &str = "samples = 2\n[settings]\nrun.duration_s = 2.0\nmission.trajectory = 'hover'\n\
        [vary]\ninitial.attitude_deg.0 = { uniform = [-30.0, 30.0] }\n\
        [controller.pid]\nattitude.law = 'pid'\nattitude.mpc.constraints = 'none'\n[controller.lqr]\n\
        attitude.law = 'lqr'\n\
        [tune]\nseed = 5\nsamples = 2\nflights = 40\n[tune.scale]\n\
        pid = [['attitude.pid.kp.1', 'attitude.pid.kp.2'], ['attitude.pid.kd.1']]\n";

    fn read(text: &str) -> anyhow::Result<Campaign> {
        Campaign::read(text, "x.toml", "x", Path::new(""))
    }

    #[test]
    fn a_search_repeats_and_finds_gains_that_cost_what_it_says() {
        // The gains begin far too weak, so that there is something to find.
        let file =
            FILE.replace("attitude.law = 'pid'\n", "attitude.law = 'pid'\nattitude.pid.kp = [4.0, 12.0, 12.0, 48.0]\n");
        let searched = |text: &str| {
            let campaign = read(text).unwrap();
            search(campaign.tune().unwrap(), &campaign, &[], || true, |_, _, _| {}).unwrap().unwrap()
        };
        let (once, twice) = (searched(&file), searched(&file));
        assert_eq!(once[0].to_toml(), twice[0].to_toml());
        let [before, after] = once[0].cost;
        assert!(after < 0.9 * before, "it finds better gains: {before} {after}");
        assert!(once[0].flights <= 40, "the budget holds: {}", once[0].flights);
        let keys: Vec<&str> = once[0].settings.iter().map(|(key, _)| key.as_str()).collect();
        assert_eq!(keys, ["attitude.pid.kd", "attitude.pid.kp"], "whole arrays, which a file can have");
        let text = FILE.replace("attitude.mpc.constraints = 'none'\n", once[0].to_toml().split_once("]\n").unwrap().1);
        let from_there = searched(&text);
        assert_eq!(from_there[0].cost[0].to_bits(), after.to_bits(), "the printed settings cost what it says");
        assert!(from_there[0].cost[1] <= after, "{:?}", from_there[0].cost);
    }

    #[test]
    fn a_factor_at_the_border_of_the_search_is_named() {
        let campaign = read(FILE).unwrap();
        let plan = Plan::new(campaign.clone()).unwrap();
        let groups = starts(&campaign.controllers[0].1, &campaign.tune().unwrap().scale["pid"]).unwrap();
        let search = Search { plan: &plan, controller: 0, groups };
        let beyond = libm::log(WIDEST) + 1.0;
        let tuned = |logarithms: &[f64]| Tuned {
            controller: "pid".into(),
            settings: search.settings(logarithms),
            cost: [0.5, 0.4],
            flights: 40,
            at_border: search.at_border(logarithms),
        };
        let text = tuned(&[beyond, -beyond]).to_toml();
        assert!(text.contains("factor of `attitude.pid.kp.1`, `attitude.pid.kp.2` is 1000 or more"), "{text}");
        assert!(text.contains("factor of `attitude.pid.kd.1` is 0.001 or less"), "{text}");
        assert!(!tuned(&[1.0, -1.0]).to_toml().contains("the search ends"));
    }

    #[test]
    fn the_campaign_does_not_depend_on_how_it_was_tuned() {
        let (with, without) = (read(FILE).unwrap(), read(FILE.split_once("[tune]").unwrap().0).unwrap());
        assert_eq!(with.hash(), without.hash());
    }

    #[test]
    fn a_mistake_in_the_tuning_is_named() {
        for (from, to, expected) in [
            ("pid = [[", "pdi = [[", "[controller.pdi]"),
            ("attitude.pid.kp.1", "attitude.pid.kp.7", "`attitude.pid.kp.7` is no number"),
            ("attitude.pid.kd.1", "guidance.lead_s", "no factor changes"),
            (", ['attitude.pid.kd.1']", "", "at least 2"),
            ("flights = 40", "flights = 3", "one generation"),
            ("seed = 5\nsamples = 2", "seed = 5\nsamples = 0", "1 or more"),
        ] {
            let said = format!("{:#}", read(&FILE.replace(from, to)).expect_err(to));
            assert!(said.contains(expected), "{to}: {said}");
        }
    }
}
