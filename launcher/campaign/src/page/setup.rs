//! What all flights have in common: the program, what was drawn and how, the bounds, the campaign file.

use flight::event::name;
use view::bounds;
use view::draw::{escape, list, short};
use view::metrics::Metrics;

use crate::plan::Plan;
use crate::shard;

/// As many flights, evenly spread over the plan, tell whether a bound is the same in all.
const LOOKED_AT: u64 = 64;

/// A bound that a flight must stay inside of to be passed.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// Column of the table of flights.
    pub metric: &'static str,
    words: [&'static str; 2],
    /// `None` where it is not the same in all flights.
    pub limit: Option<f64>,
}

/// The bounds of the flights of a plan.
pub fn bounds(plan: &Plan) -> Vec<Bound> {
    let count = plan.flights().min(LOOKED_AT);
    let flights = (0..count).map(|i| plan.flight(i * plan.flights() / count));
    let mut all: Vec<Bound> = vec![];
    let mut flown = 0;
    let mut seen: Vec<usize> = vec![];
    for scenario in flights.filter_map(|flight| flight.scenario.ok()) {
        flown += 1;
        // Against metrics of 0 every bound is judged.
        for check in bounds::check(&scenario, &Metrics::default()) {
            match all.iter().position(|bound| bound.metric == check.metric) {
                None => {
                    all.push(Bound { metric: check.metric, words: check.words, limit: Some(check.limit) });
                    seen.push(1);
                }
                Some(i) => {
                    all[i].limit = all[i].limit.filter(|limit| *limit == check.limit);
                    seen[i] += 1;
                }
            }
        }
    }
    for (bound, seen) in all.iter_mut().zip(seen) {
        bound.limit = bound.limit.filter(|_| seen == flown);
    }
    all
}

/// When a flight is passed, in words.
pub fn passed(bounds: &[Bound]) -> String {
    let word = |bound: &Bound| {
        let [words, unit] = bound.words;
        match bound.limit {
            Some(limit) => format!("{words} at most {} {unit}", short(limit)),
            None => format!("{words} by a limit that is not the same in all flights"),
        }
    };
    let inside = match bounds {
        [] => "No bound is set.".to_owned(),
        _ => format!("Its bounds: {}.", bounds.iter().map(word).collect::<Vec<_>>().join("; ")),
    };
    format!(
        "A flight is passed when it is flown to its end or landed, no process is lost, and it stays inside its bounds. {inside}"
    )
}

/// The section of what was flown.
pub fn section(plan: &Plan) -> String {
    let campaign = &plan.campaign;
    let sampling = name(campaign.sampling());
    let samples = campaign.samples().map(|samples| ("samples".to_owned(), format!("{samples}, {sampling}")));
    let facts = [
        ("flights planned".to_owned(), plan.flights().to_string()),
        ("controllers".to_owned(), campaign.controllers.len().to_string()),
        ("seed of what is drawn".to_owned(), campaign.seed().to_string()),
        ("SHA-256 of the campaign".to_owned(), campaign.hash()[..12].to_owned()),
    ];
    format!(
        "<section id=\"setup\"><h2>What was flown</h2><p>Program <code>{}</code>.</p><div class=\"facts-list\">{}</div><details><summary>The campaign with its \
         scenario: all settings that are not defaults, what varies, the controllers</summary><pre>{}</pre></details></section>",
        escape(&shard::program()),
        list(facts.into_iter().chain(samples)),
        escape(&campaign.merged())
    )
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Campaign;

    fn of(text: &str) -> Vec<(&'static str, Option<f64>)> {
        let plan = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        bounds(&plan).into_iter().map(|bound| (bound.metric, bound.limit)).collect()
    }

    #[test]
    fn bounds_are_those_of_all_flights() {
        assert_eq!(of("seeds = 3"), [("max_position_error_m", Some(1.5)), ("max_fallback_s", Some(2.0))]);
        let varied = "[vary]\nbounds.max_position_error_m = [0.1, 0.2]\nbounds.final_position_error_m = [1.0, inf]";
        let expected =
            [("max_position_error_m", None), ("final_position_error_m", None), ("max_fallback_s", Some(2.0))];
        assert_eq!(of(varied), expected);
    }
}
