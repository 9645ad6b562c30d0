//! Plan of the flights of a campaign. Each flight is a function of the campaign and of its number, so that any part of
//! the flights can be flown anywhere.
//!
//! Flights are numbered by sample first, then by listed values (the last key changes fastest), then by controller. So
//! flights that are compared have consecutive numbers, and the same drawn values, seeds and random faults.

use anyhow::{Context, bail, ensure};
use flight::scenario;
use rand::RngExt;
use settings::{Fault, FaultKind, FaultTarget, Scenario, ScenarioError, check_fault};
use toml::Value;

use crate::file::{CASE, Campaign, SEED};
use crate::random_faults::RandomFaults;
use crate::sampling::{Points, Purpose, stream};
use crate::table::{Cell, ColumnType, cell_of};
use crate::variation::{Factor, Values};

/// Largest number of flights that are tried to find one that can be flown.
const LOOKED_AT: u64 = 64;

#[derive(Debug, Clone)]
pub struct Plan {
    pub campaign: Campaign,
    points: Points,
    /// Pairs of target and kind that the random faults are drawn from.
    pairs: Vec<(FaultTarget, FaultKind)>,
}

/// One coordinate of the plan: the number of its values, and the distance between the flight numbers of neighbouring
/// values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlanAxis {
    pub values: u64,
    pub step: u64,
}

/// One flight of a plan.
#[derive(Debug)]
pub struct PlannedFlight {
    pub number: u64,
    pub controller: String,
    /// Values of the factors, in the order of the factors.
    pub values: Vec<Value>,
    /// Seed; `None` if it stands only in a scenario that cannot be flown.
    pub seed: Option<u64>,
    /// Random faults of the flight.
    pub faults: Vec<Fault>,
    /// Scenario, or the reason why the flight cannot be flown.
    pub scenario: Result<Scenario, ScenarioError>,
}

impl PlanAxis {
    /// Returns the index of a flight's value.
    pub fn place(self, number: u64) -> u64 {
        number / self.step % self.values
    }
}

impl Plan {
    /// Makes the plan of a campaign.
    ///
    /// # Errors
    /// The random faults cannot be drawn, or would begin after the end of a flight.
    pub fn new(campaign: Campaign) -> anyhow::Result<Self> {
        let drawn = campaign.factors.iter().filter(|factor| matches!(factor.values, Values::Drawn(_)));
        let drawn: Vec<&str> = drawn.map(|factor| factor.key.as_str()).collect();
        let points = Points::new(campaign.sampling(), campaign.seed(), campaign.samples().unwrap_or(1), &drawn);
        let pairs = match campaign.random_faults() {
            Some(faults) => {
                let scenarios = campaign.givens(None).into_iter().map(|given| given.scenario(&[]));
                let scenarios: Vec<Scenario> = scenarios.collect::<Result<_, _>>()?;
                let varied = campaign.factors.iter().find(|factor| factor.key == "run.duration_s");
                let number = |value: &Value| value.as_float().or(value.as_integer().map(|n| n as f64));
                let durations_s: Vec<f64> = match varied {
                    Some(factor) => factor.values.ends().iter().filter_map(number).collect(),
                    None => scenarios.iter().map(|scenario| scenario.run.duration_s).collect(),
                };
                for duration_s in durations_s {
                    faults.check_end(duration_s).context("[random_faults]")?;
                }
                faults.pairs(&scenarios).context("[random_faults]")?
            }
            None => vec![],
        };
        Ok(Self { campaign, points, pairs })
    }

    pub fn flights(&self) -> u64 {
        self.campaign.flights()
    }

    /// Returns the keys of the listed values in the order of the factors, with their axes.
    pub fn listed_axes(&self) -> Vec<(&str, PlanAxis)> {
        let mut step = self.campaign.controllers.len() as u64;
        let listed = self.campaign.factors.iter().rev().filter_map(|factor| {
            let Values::Listed(list) = &factor.values else { return None };
            let axis = PlanAxis { values: list.len() as u64, step };
            step *= axis.values;
            Some((factor.key.as_str(), axis))
        });
        let mut axes: Vec<(&str, PlanAxis)> = listed.collect();
        axes.reverse();
        axes
    }

    /// Returns the flight of a number below [`flights`](Self::flights); with `[limit]` the flight at the safe end.
    pub fn flight(&self, number: u64) -> PlannedFlight {
        let at_safe_end = self.campaign.limit().map(|limit| limit.setting(0));
        self.flight_with(number, at_safe_end.as_slice())
    }

    /// Returns the flight of a number, with `settings` on top of the settings of its controller.
    pub fn flight_with(&self, number: u64, settings: &[(String, Value)]) -> PlannedFlight {
        let controllers = &self.campaign.controllers;
        let controller = (number % controllers.len() as u64) as usize;
        let sample = number / (self.flights() / self.campaign.samples().unwrap_or(1));
        let mut axes = self.listed_axes().into_iter();
        let mut point = self.points.point(sample).into_iter();
        let mut value = |factor: &Factor| match &factor.values {
            Values::Drawn(distribution) => distribution.quantile(point.next().unwrap_or(0.5)), // one per drawn factor
            Values::Listed(list) => {
                list[axes.next().map_or(0, |(_, axis)| axis.place(number)) as usize].clone() // each list has an axis
            }
        };
        let values: Vec<Value> = self.campaign.factors.iter().map(&mut value).collect();
        let varied = self.campaign.factors.iter().position(|factor| factor.key == SEED);
        let given_seed = match varied {
            Some(i) => values[i].as_integer().map(|seed| seed as u64),
            None => self
                .campaign
                .samples()
                .map(|_| stream(self.campaign.seed(), Purpose::Seeds, sample).random::<u32>().into()),
        };
        let faults = self.campaign.random_faults();
        let faults = faults.map_or(vec![], |faults| faults.draw(&self.pairs, self.campaign.seed(), sample));
        let scenario = self.scenario(number, given_seed, controller, &values, &faults, settings);
        let seed = given_seed.or(scenario.as_ref().ok().map(|scenario| scenario.run.seed));
        PlannedFlight { number, controller: controllers[controller].0.clone(), values, seed, faults, scenario }
    }

    fn scenario(
        &self,
        number: u64,
        seed: Option<u64>,
        controller: usize,
        values: &[Value],
        faults: &[Fault],
        more: &[(String, Value)],
    ) -> Result<Scenario, ScenarioError> {
        let keys = self.campaign.factors.iter().map(|factor| factor.key.clone());
        let mut settings: Vec<(String, Value)> = keys.zip(values.iter().cloned()).collect();
        let case = take_case(&mut settings);
        let given = self.campaign.given(controller, case.as_deref());
        settings.extend_from_slice(more);
        settings.extend(seed.map(|seed| (SEED.to_owned(), Value::Integer(seed as i64))));
        let mut scenario = given.scenario(&settings)?;
        for fault in faults {
            check_fault(&scenario, fault)?;
        }
        scenario.fault.extend(faults);
        scenario.name = format!("{}-{number}", self.campaign.name());
        Ok(scenario)
    }

    /// Checks that every listed value and the ends of every distribution can be flown, either alone with the settings
    /// of a controller or in one of the first flights, and that every controller can be flown.
    ///
    /// # Errors
    /// Nothing varies, or a value or controller cannot be flown; the message has the first one, and says what to do.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!(
            self.flights() > 1 || self.campaign.limit().is_some(),
            "nothing varies: give `seeds`, [vary], [limit], or several controllers; `trefoil fly` flies one flight"
        );
        for (i, factor) in self.campaign.factors.iter().enumerate() {
            for value in factor.values.ends() {
                let mut alone = vec![(factor.key.clone(), value.clone())];
                let case = take_case(&mut alone);
                let givens = self.campaign.givens(case.as_deref());
                let refusal = first_if_all(givens.into_iter().map(|given| given.scenario(&alone).err()));
                let Some(error) = refusal else { continue };
                let mut flights = (0..self.flights().min(LOOKED_AT)).map(|number| self.flight(number));
                if !flights.any(|flight| flight.values[i] == value && flight.scenario.is_ok()) {
                    bail!("[vary] `{}` = {value}: {}", factor.key, error.in_one_line());
                }
            }
        }
        self.check_limit()?;
        (0..self.campaign.controllers.len() as u64).try_for_each(|number| self.check_controller(number))
    }

    /// Checks that both ends of the range of `[limit]`, and the value next to `from`, can be flown.
    fn check_limit(&self) -> anyhow::Result<()> {
        let Some(limit) = self.campaign.limit() else { return Ok(()) };
        for step in [0, 1, limit.steps()] {
            let (key, value) = limit.setting(step);
            let flight = |number| self.flight_with(number, &[(key.clone(), value.clone())]);
            let refusals = (0..self.flights().min(LOOKED_AT)).map(|number| flight(number).refusal());
            if let Some(refusal) = first_if_all(refusals) {
                bail!("[limit] `{key}` = {value}: {refusal}");
            }
        }
        Ok(())
    }

    /// Checks that controller `number` can be flown in one of at most 64 flights, spread over the campaign.
    fn check_controller(&self, number: u64) -> anyhow::Result<()> {
        let controllers = self.campaign.controllers.len() as u64;
        let all = self.flights() / controllers;
        let looked_at = all.min(LOOKED_AT);
        let flights = (0..looked_at).map(|i| self.flight(i * all / looked_at * controllers + number));
        let refusals = flights.map(|flight| flight.scenario.and_then(|scenario| scenario::check(&scenario)).err());
        let Some(error) = first_if_all(refusals) else { return Ok(()) };
        let (name, why) = (&self.campaign.controllers[number as usize].0, error.in_one_line());
        bail!("no flight of the controller `{name}` can be flown: {why}")
    }

    /// Columns that describe a flight: its number, controller, values, seed and random faults.
    pub fn columns(&self) -> Vec<(String, ColumnType)> {
        let mut columns = vec![("flight".to_owned(), ColumnType::Int), ("controller".to_owned(), ColumnType::Text)];
        let others = self.campaign.factors.iter().filter(|factor| factor.key != SEED);
        columns.extend(others.map(|factor| (factor.key.clone(), factor.values.kind())));
        columns.push((SEED.into(), ColumnType::Int));
        columns.extend(self.campaign.random_faults().into_iter().flat_map(RandomFaults::columns));
        columns
    }

    /// Cells of [`columns`](Self::columns).
    pub fn cells(&self, flight: &PlannedFlight) -> Vec<Cell> {
        let mut cells = vec![Cell::Int(flight.number as i64), Cell::Text(flight.controller.clone())];
        let others = self.campaign.factors.iter().zip(&flight.values).filter(|(factor, _)| factor.key != SEED);
        cells.extend(others.map(|(factor, value)| cell_of(factor.values.kind(), value)));
        cells.push(flight.seed.map_or(Cell::None, |seed| Cell::Int(seed as i64)));
        cells.extend(self.campaign.random_faults().into_iter().flat_map(|faults| faults.cells(&flight.faults)));
        cells
    }
}

/// Returns the first refusal if every flight is refused; else `None`.
fn first_if_all<T>(refusals: impl Iterator<Item = Option<T>>) -> Option<T> {
    refusals.collect::<Option<Vec<T>>>()?.into_iter().next()
}

/// Removes the name of the case from the values of a flight, and returns it; `None` if there is no case.
fn take_case(values: &mut Vec<(String, Value)>) -> Option<String> {
    let place = values.iter().position(|(key, _)| key == CASE)?;
    values.remove(place).1.as_str().map(str::to_owned)
}

impl PlannedFlight {
    /// Returns the reason why the flight cannot be flown, in one line.
    pub fn refusal(&self) -> Option<String> {
        self.scenario.as_ref().err().map(ScenarioError::in_one_line)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use super::*;

    fn plan(text: &str) -> Plan {
        Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap()
    }

    const TWO: &str = "[controller.a]\nattitude.law = 'lqr'\n[controller.b]\nattitude.law = 'pid'\n";

    #[test]
    fn controllers_are_compared_on_the_same_flights() {
        let plan = plan(&format!(
            "samples = 3\n[vary]\nrun.command_delay_ms = [0, 10]\nplant.airframe.mass_kg = {{ uniform = [1.0, 1.2] }}\n\
             [random_faults]\ncount = [1, 2]\nat_s = [1, 2]\nfor_s = [1, 2]\n{TWO}"
        ));
        assert_eq!(plan.flights(), 3 * 2 * 2);
        let flights: Vec<PlannedFlight> = (0..12).map(|number| plan.flight(number)).collect();
        for pair in flights.chunks(2) {
            assert_eq!([&pair[0].controller, &pair[1].controller], ["a", "b"]);
            assert_eq!(
                (&pair[0].values, pair[0].seed, &pair[0].faults),
                (&pair[1].values, pair[1].seed, &pair[1].faults)
            );
        }
        assert_ne!(flights[0].values[1], flights[2].values[1], "the listed ones change within a sample");
        assert_eq!(flights[0].seed, flights[2].seed);
        assert!(flights[0].seed != flights[4].seed && flights[0].values[0] != flights[4].values[0]);
        let flown = flights[0].scenario.as_ref().unwrap();
        assert_eq!(flown.fault, flights[0].faults);
        assert_eq!(Some(flown.plant.airframe.mass_kg.unwrap()), flights[0].values[0].as_float());
    }

    #[test]
    fn more_samples_leave_the_first_ones_unchanged() {
        let [few, many] = [3, 30].map(|n| {
            plan(&format!(
                "samples = {n}\n[settings]\nattitude.mpc.constraints = 'cone'\n[vary]\n\
            attitude.mpc.max_iterations = {{ integer = [20, 30] }}"
            ))
        });
        for number in 0..3 {
            assert_eq!(few.flight(number).scenario.unwrap(), many.flight(number).scenario.unwrap());
        }
    }

    /// Cells of the drawn columns, of `run.seed` and of the random faults, by the name of the column, from the first
    /// flight of each sample.
    fn drawn(text: &str) -> BTreeMap<String, Vec<Cell>> {
        let plan = plan(text);
        let a_sample = plan.flights() / plan.campaign.samples().unwrap();
        let mut columns: BTreeMap<String, Vec<Cell>> = BTreeMap::new();
        for number in (0..plan.flights()).step_by(a_sample as usize) {
            for ((name, _), cell) in plan.columns().into_iter().zip(plan.cells(&plan.flight(number))) {
                columns.entry(name).or_default().push(cell);
            }
        }
        let listed: Vec<&str> = plan.listed_axes().into_iter().map(|(key, _)| key).collect();
        columns
            .retain(|name, _| !["flight", "controller"].contains(&name.as_str()) && !listed.contains(&name.as_str()));
        columns
    }

    #[test]
    fn a_column_of_draws_does_not_depend_on_the_rest_of_the_file() {
        let two =
            ["plant.airframe.mass_kg = { uniform = [1.0, 1.2] }\n", "run.command_delay_ms = { uniform = [0, 9] }\n"];
        let more =
            "initial.attitude_deg.0 = { uniform = [-9, 9] }\nattitude.mpc.max_iterations = { integer = [20, 30] }\n";
        let listed = "attitude.mpc.control_horizon_s = [0.04, 0.05]\n";
        let faults = "[random_faults]\ncount = [1, 3]\nat_s = [1, 2]\nfor_s = [1, 2]\nkinds = ['drop', 'delay']\n";
        let cases = "[case.calm]\n[case.long]\nrun.duration_s = 30.0\n";
        for sampling in ["random", "latin-hypercube"] {
            let of = |vary: &str, rest: &str| {
                drawn(&format!("samples = 20\nsampling = '{sampling}'\n[vary]\n{vary}{faults}{rest}"))
            };
            let [one, other] = two;
            let alone = of(&two.concat(), "");
            assert!(alone.len() > 3 && alone.contains_key("random_fault.2.kind"), "{:?}", alone.keys());
            for (vary, rest) in [
                (format!("{other}{one}"), ""),
                (format!("{more}{one}{other}"), ""),
                (format!("{one}{more}{listed}{other}"), TWO),
                (format!("{one}{other}"), cases),
                (
                    format!("{one}{other}{more}"),
                    "[controller.b]\nattitude.law = 'pid'\n[controller.a]\nattitude.law = 'lqr'\n",
                ),
            ] {
                let with = of(&vary, rest);
                for (name, cells) in &alone {
                    assert_eq!(cells, &with[name], "{sampling}: `{name}` with {vary}{rest}");
                }
            }
            let without = of(one, "");
            assert!(without.iter().all(|(name, cells)| cells == &alone[name]), "{sampling}: a key less");
        }
    }

    #[test]
    fn sobol_dimensions_are_in_the_order_of_the_file() {
        let of = |vary: &str| drawn(&format!("samples = 16\nsampling = 'sobol'\n[vary]\n{vary}"));
        let [one, other] =
            ["run.command_delay_ms = { uniform = [0, 9] }\n", "attitude.mpc.max_iterations = { integer = [20, 30] }\n"];
        let first = "initial.attitude_deg.0 = { uniform = [-9, 9] }\n";
        let alone = of(&[one, other].concat());
        let with = of(&[one, other, first].concat());
        assert!(alone.iter().all(|(name, cells)| cells == &with[name]), "a key at the end changes nothing");
        assert_ne!(
            alone["attitude.mpc.max_iterations"],
            of(&[first, one, other].concat())["attitude.mpc.max_iterations"],
            "one before does"
        );

        let text = format!(
            "samples = 16\nsampling = 'sobol'\n[vary]\nattitude.mpc.control_horizon_s = [0.04, 0.05]\n\
             {one}{other}{first}"
        );
        let merged = plan(&text).campaign.merged();
        assert_eq!(drawn(&text), drawn(&merged), "the folder's own file draws the same: {merged}");
        assert_eq!(plan(&text).campaign.hash(), plan(&merged).campaign.hash());
    }

    #[test]
    fn contradicting_settings_are_an_invalid_flight_and_a_value_that_never_flies_is_an_error() {
        let both = plan(
            "[vary]\nattitude.mpc.prediction_horizon_s = [0.04, 0.2]\nattitude.mpc.control_horizon_s = [0.03, 0.05]",
        );
        both.check().unwrap();
        let flies: Vec<bool> = (0..4).map(|number| both.flight(number).scenario.is_ok()).collect();
        assert_eq!(flies, [true, true, false, true], "4 samples with 5 moves");
        let said = plan("[vary]\nplant.airframe.mass_kg = [1.1, -1.0]").check().unwrap_err().to_string();
        assert!(said.contains("[vary] `plant.airframe.mass_kg` = -1.0"), "{said}");
        let no_controller =
            "attitude.mpc.q = [0, 0, 0, 1e12, 0, 0, 0]\nattitude.mpc.r = [1e-12, 1e-12, 1e-12, 1e-12]\n";
        for (settings, expected) in [
            (no_controller, "`attitude.mpc.r` is so small"),
            ("attitude.mpc.control_horizon_s = 0.3\n", "`attitude.mpc.control_horizon_s` = 0.3"),
        ] {
            let said = plan(&format!("[vary]\nplant.airframe.mass_kg = [1.0, 1.1]\n{TWO}[controller.c]\n{settings}"))
                .check()
                .unwrap_err()
                .to_string();
            assert!(said.contains("the controller `c` can") && said.contains(expected), "{said}");
        }
        let said = plan("[vary]\nattitude.mpc.qq = [1, 2]").check().unwrap_err().to_string();
        assert!(said.contains("unknown key `attitude.mpc.qq`") && said.contains("did you mean"), "{said}");
    }

    #[test]
    fn a_random_fault_begins_before_the_shortest_flight_ends() {
        let text = "samples = 3\n[vary]\nrun.duration_s = [20, 10.0]\n[random_faults]\ncount = [1, 1]\nat_s = [1, 12]\nfor_s = [1, 2]";
        let refused = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap_err();
        assert!(format!("{refused:#}").contains("a flight ends after 10 s"), "{refused:#}");
        plan(&text.replace("10.0", "13.0"));
    }

    #[test]
    fn each_cell_has_the_kind_of_its_column() {
        let plan = plan(
            "seeds = [7, 9]\n[vary]\nattitude.law = ['mpc', 'lqr']\nplant.airframe.mass_kg = [1, 1.2]\n\
             mixer.projection = [true]",
        );
        let columns = plan.columns();
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(
            names,
            ["flight", "controller", "attitude.law", "mixer.projection", "plant.airframe.mass_kg", "run.seed"]
        );
        let cells = plan.cells(&plan.flight(1));
        assert_eq!(cells[2..], [Cell::Text("mpc".into()), Cell::Bool(true), Cell::Real(1.0), Cell::Int(9)]);
        assert!(columns.iter().zip(&cells).all(|((_, kind), cell)| cell.is(*kind)));
    }
}
