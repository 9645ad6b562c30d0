//! Bounds that a flight must stay inside to pass: the scenario's `[bounds]`, and the defaults below for bounds not set.
//!
//! | bound | default |
//! |---|---|
//! | `max_position_error_m` | 1.5 m for profile robust, 2 m for paper; plus the largest jump of the mission, the distance of the start from the trajectory, and 3 m for a start that is no hover |
//! | `max_fallback_s` | 2 s: from then on the mixer brings the vehicle down |
//!
//! `inf` lifts a bound.

use std::borrow::Cow;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Bounds, Initial, Profile, Scenario, plan};

use crate::metrics::{Metrics, or_nan};

/// Additional position error allowed for a start that is no hover \[m\].
const UPSET_M: f64 = 3.0;
/// Time that the mixer flies without a demand before it brings the vehicle down \[s\].
const FALLBACK_S: f64 = 2.0;

/// One bound compared with the flight.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct BoundCheck {
    /// Name of the metric in run.json.
    pub metric: Cow<'static, str>,
    /// Largest allowed value, in the unit of the metric.
    pub limit: f64,
    /// Value of the flight; null if the flight has none.
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub measured: f64,
    /// `true` if the bound is kept.
    pub ok: bool,
    /// Name of the metric for people, and its unit; not in run.json.
    #[serde(skip)]
    pub words: [&'static str; 2],
}

/// Returns the bounds of `scenario`, with the defaults for those that it does not set.
pub fn bounds(scenario: &Scenario) -> Bounds {
    let own = &scenario.bounds;
    Bounds {
        max_position_error_m: own.max_position_error_m.or_else(|| Some(position_error_m(scenario))),
        max_fallback_s: own.max_fallback_s.or(Some(FALLBACK_S)),
        ..own.clone()
    }
}

/// Compares every bound of `scenario` with the flight's `metrics`.
pub fn check(scenario: &Scenario, metrics: &Metrics) -> Vec<BoundCheck> {
    let (b, m) = (bounds(scenario), metrics);
    let (last, last_m) = (b.final_position_error_m, m.final_position_error_m);
    let all = [
        ("max_position_error_m", b.max_position_error_m, m.max_position_error_m, ["position error", "m"]),
        ("max_altitude_error_m", b.max_altitude_error_m, m.max_altitude_error_m, ["altitude error", "m"]),
        ("final_position_error_m", last, last_m, ["position error at the end", "m"]),
        ("max_fallback_s", b.max_fallback_s, m.fallback_s, ["mixer on its fallback", "s"]),
    ];
    let judged = all.into_iter().filter_map(|(metric, limit, measured, words)| {
        let limit = limit.filter(|limit| limit.is_finite())?;
        Some(BoundCheck { metric: metric.into(), limit, measured, ok: measured <= limit, words })
    });
    judged.collect()
}

/// Time since which a flight is outside a bound that applies at every sample.
#[derive(Debug, Clone)]
pub struct Outside {
    bounds: Bounds,
    /// Time of the first sample outside a bound \[s\]; `None` if there is none.
    pub since_s: Option<f64>,
}

impl Outside {
    pub fn new(scenario: &Scenario) -> Self {
        Self { bounds: bounds(scenario), since_s: None }
    }

    /// Takes in the `metrics` until now, at the time `t_s` of the newest sample.
    pub fn observe(&mut self, t_s: f64, metrics: &Metrics) {
        let (b, m) = (&self.bounds, metrics);
        let is_outside = [
            (b.max_position_error_m, m.max_position_error_m),
            (b.max_altitude_error_m, m.max_altitude_error_m),
            (b.max_fallback_s, m.fallback_s),
        ]
        .iter()
        .any(|(bound, measured)| bound.is_some_and(|bound| *measured > bound));
        if is_outside && self.since_s.is_none() {
            self.since_s = Some(t_s);
        }
    }
}

/// Default bound on the position error of a scenario that sets none \[m\].
fn position_error_m(scenario: &Scenario) -> f64 {
    let usual_m = match scenario.profile {
        Profile::Robust => 1.5,
        Profile::Paper => 2.0,
    };
    let plan = plan::build(scenario);
    let begins_m = plan.at(0.0).position_m;
    let Initial { position_m, velocity_mps, attitude_deg, rates_radps, .. } = scenario.initial;
    let hovers = [velocity_mps, attitude_deg, rates_radps] == [[0.0; 3]; 3];
    let upset_m = if hovers { 0.0 } else { UPSET_M };
    usual_m + plan.jump_m() + distance_m(begins_m, position_m) + upset_m
}

fn distance_m(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::load;

    fn error_m(set: &[&str]) -> f64 {
        let set: Vec<String> = set.iter().map(|&set| set.to_owned()).collect();
        bounds(&load(None, &set).unwrap()).max_position_error_m.unwrap()
    }

    #[test]
    fn profile_and_mission_decide_a_bound_that_the_scenario_does_not_set() {
        assert_eq!(error_m(&[]), 1.5, "a smooth mission asks for no more");
        assert_eq!(error_m(&["profile=\"paper\""]), 2.0);
        let jump = "{kind='loiter', duration_s=1}, {kind='jump', point_m=[3, 4, 0], duration_s=1}";
        assert_eq!(error_m(&[&format!("mission.part=[{jump}]")]), 1.5 + 5.0);
        assert_eq!(error_m(&["initial.position_m=[0.0,2.0,0.0]"]), 3.5);
        assert_eq!(error_m(&["initial.rates_radps=[3.0,0.0,0.0]"]), 4.5);
        assert_eq!(error_m(&["bounds.max_position_error_m=0.1"]), 0.1);
    }

    #[test]
    fn a_bound_can_be_lifted() {
        let scenario = load(None, &["bounds.max_position_error_m=inf".into()]).unwrap();
        let metrics = Metrics { max_position_error_m: 400.0, fallback_s: 2.5, ..Metrics::default() };
        let outside: Vec<_> = check(&scenario, &metrics).into_iter().filter(|v| !v.ok).map(|v| v.metric).collect();
        assert_eq!(outside, ["max_fallback_s"]);
    }

    #[test]
    fn a_flight_is_outside_since_its_first_sample_beyond_a_bound() {
        let scenario = load(None, &["bounds.max_position_error_m=0.1".into()]).unwrap();
        let mut outside = Outside::new(&scenario);
        for (t_s, max_position_error_m) in [(0.0, 0.05), (1.0, 0.1), (2.0, 0.2), (3.0, 0.3)] {
            outside.observe(t_s, &Metrics { max_position_error_m, ..Metrics::default() });
        }
        assert_eq!(outside.since_s, Some(2.0));
    }
}
