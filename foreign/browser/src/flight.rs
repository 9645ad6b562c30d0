//! A flight of the shipped survey, from settings to JSON.

use std::array::from_fn;

use base64::prelude::{BASE64_STANDARD, Engine};
use contract::message::{PlantStatus, State};
use contract::topic::Topic;
use guidance::Trajectory;
use plant::tricopter::Tricopter;
use ring::count::Count;
use ring::nodes;
use ring::record::Record;
use ring::samples::Samples;
use ring::states::{StateHash, length_m, position_error_m};
use ring::stepped::Stepped;
use serde_json::{Map, Value, json};
use settings::{Scenario, load_text};

/// Shipped scenario that is flown.
const SURVEY: &str = include_str!("../../../scenarios/survey.toml");
/// Columns of the figures, by their names in the scripts of the report.
const COLUMNS: [&str; 7] = ["x", "y", "z", "x_wanted", "y_wanted", "z_wanted", "error"];

/// Flies the survey with `settings` on top, one `key=value` a line, and returns a JSON object:
///
/// | key | value |
/// |---|---|
/// | `state_hash` | hash of the flight, as in `docs/hashes.md` |
/// | `whole` | whether the flight came to its end: the vehicle did not diverge, and no node was lost |
/// | `flown_s` | time of the last sample |
/// | `max_position_error_m`, `rms_position_error_m` | as in run.json |
/// | `figures` | data of the report's scripts |
/// | `error` | reason why the settings were refused; then there is no other key |
pub fn fly(settings: &str) -> String {
    let overrides = settings.lines().filter(|line| !line.trim().is_empty()).map(str::to_owned);
    let overrides: Vec<String> = overrides.chain(["run.mode=inprocess".into()]).collect();
    let refused = |why: &dyn ToString| json!({ "error": why.to_string() }).to_string();
    let scenario = match load_text(SURVEY, "scenarios/survey.toml", &overrides) {
        Ok(scenario) => scenario,
        Err(error) => return refused(&error),
    };
    let mut course = Course::new(&scenario);
    let ring =
        Stepped::new(&scenario, Box::new(Tricopter::new(&scenario)), true, [nodes::open; Topic::OF_CONTROLLERS.len()]);
    let flown = ring.and_then(|ring| {
        let watch = |record: &Record| {
            course.observe(record);
            true
        };
        ring.fly(watch, |_| {})
    });
    match flown {
        Ok(_) => course.answer(&scenario).to_string(),
        Err(error) => refused(&error),
    }
}

/// Course of a flight, gathered message by message.
struct Course {
    trajectory: Trajectory,
    sample_s: f64,
    count: Count,
    samples: Samples,
    hash: StateHash,
    last: State,
    /// Rows of the [`COLUMNS`].
    rows: Vec<[f32; COLUMNS.len()]>,
    max_error_m: f64,
    square_sum_m2: f64,
}

impl Course {
    fn new(scenario: &Scenario) -> Self {
        Self {
            trajectory: Trajectory::new(scenario),
            sample_s: scenario.sample_s(),
            count: Count::default(),
            samples: Samples::default(),
            hash: StateHash::default(),
            last: State::default(),
            rows: vec![],
            max_error_m: 0.0,
            square_sum_m2: 0.0,
        }
    }

    fn observe(&mut self, record: &Record) {
        if self.count.gap(record).is_none() {
            return;
        }
        let Some(sample) = self.samples.join(record) else { return };
        self.hash.observe(&sample);
        let wanted_m = self.trajectory.at(sample.truth.tick as f64 * self.sample_s).position_m;
        let error_m = length_m(position_error_m(wanted_m, &sample.truth));
        let [x, y, z] = sample.truth.actual.position_m;
        let [x_wanted, y_wanted, z_wanted] = wanted_m;
        self.rows.push([x, y, z, x_wanted, y_wanted, z_wanted, error_m].map(|value| value as f32));
        self.max_error_m = self.max_error_m.max(error_m);
        self.square_sum_m2 += error_m * error_m;
        self.last = sample.state;
    }

    fn answer(&self, scenario: &Scenario) -> Value {
        let column = |i: usize| {
            let bytes: Vec<u8> = self.rows.iter().flat_map(|row| row[i].to_le_bytes()).collect();
            (COLUMNS[i].to_owned(), Value::from(BASE64_STANDARD.encode(bytes)))
        };
        let columns: Map<_, _> = from_fn::<_, { COLUMNS.len() }, _>(column).into_iter().collect();
        let bound = scenario.bounds.max_position_error_m;
        let bound = bound.map(|y| json!({ "y": y, "label": "bound", "span_s": null }));
        json!({
            "state_hash": self.hash.text(),
            "whole": self.last.status == PlantStatus::Finished as u64,
            "flown_s": self.last.stamp.tick as f64 * self.sample_s,
            "max_position_error_m": self.max_error_m,
            "rms_position_error_m": (self.square_sum_m2 / self.rows.len() as f64).sqrt(),
            "figures": {
                "rows": self.rows.len(),
                "begin_s": 0.0,
                "dt_s": self.sample_s,
                "realtime": false,
                "columns": columns,
                "lines": { "error": bound.into_iter().collect::<Vec<_>>() },
                "happened": { "faults": [], "absences": [], "phases": [], "events": [] },
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(settings: &str) -> Value {
        serde_json::from_str(&fly(settings)).expect("the answer is JSON")
    }

    #[test]
    fn the_survey_without_settings_has_the_hash_of_the_page() {
        let flight = flown("run.duration_s=60.0\n");
        let page = include_str!("../../../docs/hashes.md");
        let hash = flight["state_hash"].as_str().expect("a hash");
        assert!(page.contains(&format!("| `scenarios/survey.toml` | `{hash}` |")), "{hash}");
        assert_eq!((&flight["whole"], &flight["figures"]["rows"]), (&json!(true), &json!(6001)));
        assert!(flight["max_position_error_m"].as_f64() < scenario_bound(), "{flight}");
    }

    fn scenario_bound() -> Option<f64> {
        load_text(SURVEY, "survey", &[]).expect("it is shipped").bounds.max_position_error_m
    }

    #[test]
    fn a_late_command_costs_accuracy_and_one_that_is_too_late_the_flight() {
        let [soon, late, too_late] =
            [0, 60, 400].map(|ms| flown(&format!("run.duration_s=10.0\nrun.command_delay_ms={ms}")));
        let error = |flight: &Value| flight["rms_position_error_m"].as_f64().expect("a number");
        assert!(error(&late) > error(&soon), "{} {}", error(&late), error(&soon));
        assert_eq!(too_late["whole"], json!(false), "{} {}", error(&soon), error(&late));
    }

    #[test]
    fn refused_settings_are_told() {
        let refused = flown("run.command_delay_ms=-1");
        assert!(refused["error"].as_str().expect("a reason").contains("command_delay_ms"), "{refused}");
    }
}
