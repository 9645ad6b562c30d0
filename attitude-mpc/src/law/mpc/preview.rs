//! Reference over the horizon, from the preview in REFERENCE (`guidance.preview_s`).
//!
//! ```text
//!   moment of the reference     demand acts
//!      |--------- age --------------|--- Ts ---|--- Ts ---| ...
//!      r                            x_0        x_1        x_2
//!      |-------------|-------------|-------------|-------------|      elements of the preview, straight lines between
//! ```
//!
//! If the delay is measured, the moment of a reference is the instant at which the command that answers it acts.
//! Otherwise it is the sample of the reference. `x_k` follows the reference of its own moment, `r + dr_k`, also if the
//! reference is old: a preview makes up for references that are late or lost. The rates follow the slope of the angles.
//! After the last element of the preview the reference stays constant. Tests `the_gain_minimises_the_printed_cost`,
//! `an_old_reference_with_a_preview_is_as_good_as_a_new_one`.

use airframe::linear::STATES;
use contract::message::PREVIEW;
use nalgebra::{DVector, SVector};

use crate::goal::Goal;
use crate::law::mpc::condensed::RATES;

/// Writes the changes `dr_1..` of the reference, seven to a sample, for a horizon that begins `start_ns` after the
/// moment of the goal.
pub fn write_changes(goal: &Goal, start_ns: f64, sample_ns: u64, changes: &mut DVector<f64>) {
    for (change, k) in changes.as_mut_slice().chunks_exact_mut(STATES).zip(1_u32..) {
        let after_ns = start_ns + f64::from(k) * sample_ns as f64;
        change.copy_from_slice(change_at(goal, after_ns).as_slice());
    }
}

/// Change of the reference `after_ns` after the moment of the goal.
fn change_at(goal: &Goal, after_ns: f64) -> SVector<f64, STATES> {
    let mut change = SVector::zeros();
    if goal.preview_step_ns == 0 {
        return change;
    }
    let step_ns = goal.preview_step_ns as f64;
    let place = (after_ns / step_ns).clamp(0.0, PREVIEW as f64);
    let next = (libm::floor(place) as usize).min(PREVIEW - 1);
    let element = |number: usize| {
        let ahead = goal.preview[number];
        let [phi, theta, psi] = ahead.attitude_rad;
        [ahead.w_mps, phi, theta, psi]
    };
    let [from, to] = [next.checked_sub(1).map_or([0.0; RATES], element), element(next)];
    let is_over = place >= PREVIEW as f64;
    for i in 0..RATES {
        change[i] = from[i] + (to[i] - from[i]) * (place - next as f64);
    }
    for i in 0..goal.rates_radps.len() {
        let slope = if is_over { 0.0 } else { (to[1 + i] - from[1 + i]) / (step_ns * 1e-9) };
        change[RATES + i] = slope - goal.rates_radps[i];
    }
    change
}

#[cfg(test)]
mod tests {
    use contract::message::{Ahead, Reference};
    use settings::{DelayCompensation, Model, Scenario};

    use super::*;
    use crate::AttitudeMpc;
    use crate::tests::hover;

    const STEP_NS: u64 = 40_000_000;

    /// Goal whose angles and w rise at 1, 2, 3 and 4 per second.
    fn rising() -> Goal {
        let ahead = |number: usize| {
            let s = (number + 1) as f64 * 0.04;
            Ahead { attitude_rad: [s, 2.0 * s, 3.0 * s], w_mps: 4.0 * s }
        };
        let rates_radps = [0.1, 0.2, 0.3];
        Goal { preview_step_ns: STEP_NS, preview: std::array::from_fn(ahead), rates_radps, ..Goal::default() }
    }

    #[test]
    fn between_the_elements_the_reference_goes_straight_and_after_the_last_it_stays() {
        let end_s = 0.04 * PREVIEW as f64;
        for (at_s, slope) in [(0.0, 1.0), (0.013, 1.0), (0.04, 1.0), (0.1, 1.0), (end_s, 0.0), (7.0, 0.0)] {
            let change = change_at(&rising(), at_s * 1e9);
            let s = f64::min(at_s, end_s);
            let expected = [4.0 * s, s, 2.0 * s, 3.0 * s, slope - 0.1, 2.0 * slope - 0.2, 3.0 * slope - 0.3];
            for (ours, expected) in change.iter().zip(expected) {
                assert!((ours - expected).abs() < 1e-12, "at {at_s} s: {change}");
            }
        }
    }

    #[test]
    fn without_a_preview_nothing_changes() {
        let goal = Goal { preview_step_ns: 0, ..rising() };
        assert_eq!(change_at(&goal, 1e8), SVector::<f64, STATES>::zeros());
    }

    #[test]
    fn an_old_reference_with_a_preview_is_as_good_as_a_new_one() {
        for (model, delay) in
            [(Model::Hover, DelayCompensation::Sample(true)), (Model::Scheduled, DelayCompensation::Sample(false))]
        {
            let mut scenario = Scenario::default();
            (scenario.attitude.mpc.model, scenario.attitude.delay_compensation) = (model, delay);
            scenario.guidance.preview_s = STEP_NS as f64 * 1e-9 * PREVIEW as f64;
            // The reference moves until 240 ms, which is an element of both previews.
            let demand = |of: u64| {
                let mut mpc = AttitudeMpc::new(&scenario);
                let (state, level) = hover(&mpc, 8);
                let mut reference = Reference { preview_step_ns: STEP_NS, ..level };
                reference.stamp.tick = of;
                let course = |ns: u64| [0.1, -0.2, 0.3, 0.4].map(|slope| slope * ns.min(240_000_000) as f64 * 1e-9);
                let roll_trim_rad = mpc.model.trim.roll_rad;
                let [phi, theta, psi, w_mps] = course(of * 10_000_000);
                (reference.attitude_rad, reference.w_mps) = ([phi + roll_trim_rad, theta, psi], w_mps);
                for (ahead, number) in reference.preview.iter_mut().zip(1..) {
                    let later = course(of * 10_000_000 + number * STEP_NS);
                    ahead.attitude_rad = [later[0] - phi, later[1] - theta, later[2] - psi];
                    ahead.w_mps = later[3] - w_mps;
                }
                mpc.step(8, &state, &reference).demand
            };
            let (new, old) = (demand(8), demand(4));
            assert!(new.iter().all(|u| u.abs() > 1e-5), "{model:?}: {new:?}");
            for (new, old) in new.iter().zip(old) {
                assert!((new - old).abs() < 1e-9 * new.abs(), "{model:?}: {new} {old}");
            }
        }
    }
}
