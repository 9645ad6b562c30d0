//! Decay of a perturbation of the hover, and the margins of delay and lag.
//!
//! The flight begins beside the hover. Its energy is the sum of the squared changes of the motion from sample to
//! sample. The perturbation decays if the last third of the flight has less energy than the middle third, and if no
//! angle ever leaves the hover by [`MAX_ANGLE_RAD`]. The flight takes [`SHORT_S`], or [`LONG_S`] if the two energies
//! are about equal then.

use contract::message::{Kinematics, Truth};
use runtime::node::Open;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Initial, Scenario};

use super::held::HELD;
use super::small::{SMALL, fly};

/// Largest angle from the hover in small motions, two hundred times the perturbation \[rad\].
const MAX_ANGLE_RAD: f64 = 0.2;
/// Duration of a flight \[s\]: longer than one oscillation of the position.
const SHORT_S: f64 = 8.0;
/// Duration of a flight whose decay is not clear after [`SHORT_S`], as near a margin \[s\].
const LONG_S: f64 = 24.0;
/// Ratio of two energies from which on they are not about equal.
const CLEAR: f64 = 10.0;
/// Share of the energy of the first third below which the energy of the last third is rounding.
const ROUNDING: f64 = 1e-16;
/// Step of the search for a margin, before it is refined to 1 ms \[ms\].
const GRID_MS: f64 = 50.0;

/// Margin of a loop that is stable as set.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Margin {
    /// Largest value at which the loop is stable, the scenario's own value included \[ms\].
    pub ms: f64,
    /// `true` if larger values were not tried: the margin is this or more.
    pub or_more: bool,
}

impl Margin {
    /// Searches for the smallest value that makes the loop unstable, above `own_ms`, at which the loop is stable: first
    /// among the multiples of `GRID_MS` up to `max_ms`, then by bisection over the whole milliseconds below the
    /// multiple found.
    pub fn search(own_ms: f64, max_ms: f64, is_stable: impl Fn(f64) -> bool) -> Self {
        let mut ms = own_ms;
        let unstable_ms = loop {
            let next_ms = ((ms / GRID_MS).floor() + 1.0) * GRID_MS;
            if next_ms > max_ms {
                return Self { ms, or_more: true };
            }
            if !is_stable(next_ms) {
                break next_ms;
            }
            ms = next_ms;
        };
        let mut too_large_ms = unstable_ms;
        loop {
            let between_ms = f64::midpoint(ms, too_large_ms).floor();
            if between_ms <= ms {
                return Self { ms, or_more: false };
            }
            let end_ms = if is_stable(between_ms) { &mut ms } else { &mut too_large_ms };
            *end_ms = between_ms;
        }
    }

    /// Describes the margin for people.
    pub fn words(&self) -> String {
        let tenths = (self.ms * 10.0).round() / 10.0;
        format!("{tenths} ms{}", if self.or_more { " or more" } else { "" })
    }
}

/// Returns whether a perturbation of position and attitude decays with the controllers of `scenario` and the vehicle of
/// the scenario `vehicle`.
pub fn decays(scenario: &Scenario, vehicle: &Scenario) -> bool {
    let initial = Initial { position_m: [SMALL; 3], ..turned(&scenario.initial) };
    let all = |m: &Kinematics| m.position_m.into_iter().chain(m.velocity_mps).chain(attitude(m)).collect();
    decays_from(&initial, scenario, vehicle, ring::nodes::open, all)
}

/// Returns whether a perturbation of w and the attitude decays while the references of the attitude loop are held.
pub fn attitude_decays(scenario: &Scenario) -> bool {
    let initial = Initial { velocity_mps: [0.0, 0.0, SMALL], ..turned(&scenario.initial) };
    let own = |m: &Kinematics| m.velocity_mps.into_iter().skip(2).chain(attitude(m)).collect();
    decays_from(&initial, scenario, scenario, HELD, own)
}

/// Returns `initial` with each Euler angle increased by [`SMALL`].
fn turned(initial: &Initial) -> Initial {
    Initial { attitude_deg: initial.attitude_deg.map(|deg| deg + SMALL.to_degrees()), ..initial.clone() }
}

/// Attitude and body rates.
fn attitude(motion: &Kinematics) -> impl Iterator<Item = f64> {
    motion.attitude_rad.into_iter().chain(motion.rates_radps)
}

/// Returns whether the perturbation `initial` decays, judged by the numbers that `of` takes from the motion.
fn decays_from(
    initial: &Initial,
    scenario: &Scenario,
    vehicle: &Scenario,
    guidance: Open,
    of: impl Fn(&Kinematics) -> Vec<f64>,
) -> bool {
    let perturbed = |scenario: &Scenario| Scenario { initial: initial.clone(), ..scenario.clone() };
    let (mut energies, mut before, mut hover_rad) = (vec![], None, None);
    let short = (SHORT_S / scenario.sample_s()) as usize;
    let is_clear = |[_, middle, last]: [f64; 3]| last > CLEAR * middle || middle > CLEAR * last;
    let mut is_inside = true;
    let watch = |truth: &Truth| {
        let numbers = of(&truth.actual);
        let changes = before.iter().flatten().zip(&numbers).map(|(before, now)| now - before);
        energies.push(changes.map(|change: f64| change * change).sum());
        before = Some(numbers);
        let attitude = truth.actual.attitude_rad;
        let angles = attitude.iter().zip(hover_rad.get_or_insert(attitude));
        is_inside = angles.into_iter().all(|(now, hover)| (now - *hover).abs() < MAX_ANGLE_RAD);
        is_inside && !(energies.len() == short && is_clear(thirds(&energies)))
    };
    let flew = fly(&perturbed(scenario), &perturbed(vehicle), guidance, LONG_S, watch);
    let [first, middle, last] = thirds(&energies);
    is_inside && (flew || energies.len() == short) && (last < middle || last <= ROUNDING * first)
}

/// Sums of the thirds of a series.
fn thirds(series: &[f64]) -> [f64; 3] {
    std::array::from_fn(|i| series[series.len() * i / 3..series.len() * (i + 1) / 3].iter().sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_margin_is_the_last_millisecond_before_the_loss() {
        let found = |own_ms, max_ms, loss_ms: f64| Margin::search(own_ms, max_ms, |ms| ms < loss_ms);
        let margin = |ms, or_more| Margin { ms, or_more };
        assert_eq!(found(0.0, 200.0, 58.3), margin(58.0, false));
        assert_eq!(found(0.0, 200.0, 5.5), margin(5.0, false));
        assert_eq!(found(0.0, 200.0, 0.5), margin(0.0, false));
        assert_eq!(found(2.5, 200.0, 2.9), margin(2.5, false));
        assert_eq!(found(2.5, 200.0, 3.1), margin(3.0, false));
        assert_eq!(found(30.0, 250.0, 249.5), margin(249.0, false));
        assert_eq!(found(30.0, 250.0, 1e3), margin(250.0, true));
        assert_eq!(found(300.0, 250.0, 1e3), margin(300.0, true), "nothing is tried");
        assert_eq!(found(2.5, 200.0, 2.9).words(), "2.5 ms");
        assert_eq!(found(30.0, 250.0, 1e3).words(), "250 ms or more");
    }
}
