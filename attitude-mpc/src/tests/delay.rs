//! Tests of the measured delay: predictions against a vehicle that is the controller's own linear model.

use contract::delay::MAX_DELAY;
use nalgebra::DVector;
use settings::{DelayCompensation, DelayName, Law};

use super::*;

const SAMPLE_NS: u64 = 10_000_000;

/// Controller without lag in its model, so that a command acts on the linear model at once, and without a disturbance
/// estimate, because the estimate expects commands to act from a sample on.
fn controller() -> AttitudeMpc {
    let mut scenario = fixture::without_estimate();
    scenario.attitude.law = Law::Lqr;
    scenario.attitude.mpc.constraints = Constraints::None;
    scenario.attitude.actuator_lag_model_s = 0.0;
    scenario.attitude.delay_compensation = DelayCompensation::Named(DelayName::Measured);
    AttitudeMpc::new(&scenario)
}

/// Command that gives the inputs `u`.
fn command(mpc: &AttitudeMpc, u: &Vector4<f64>) -> Actuation {
    let squares = mpc.model.mixing.trim + mpc.model.mixing.inverse * u;
    let front = squares[0].hypot(squares[1]).sqrt();
    Actuation { rotor_speed: [front, squares[2].sqrt(), squares[3].sqrt()], tilt_rad: squares[0].atan2(squares[1]) }
}

/// Flies the linear model for 80 samples after a step of the attitude reference. Every demand is delayed by `delay_ns`;
/// the demand of the tick `lost` has no effect. Returns, for the demand of each tick, the largest error of the state
/// that was predicted for the moment at which it acts.
fn prediction_errors(delay_ns: u64, lost: Option<u64>) -> Vec<f64> {
    let mut mpc = controller();
    let mut x = DVector::zeros(STATES);
    let (mut demands, mut predicted, mut errors) = (vec![], vec![], vec![]);
    let (mut in_force, mut applied) = (Vector4::zeros(), 0);
    for tick in 0..80_u64 {
        let (mut state, mut reference) = hover(&mpc, tick);
        state.measured.velocity_mps[2] = x[0];
        state.measured.attitude_rad = [x[1] + mpc.model.trim.roll_rad, x[2], x[3]];
        state.measured.rates_radps = [x[4], x[5], x[6]];
        state.command_in_force = command(&mpc, &in_force).into();
        (state.applied_sequence, state.applied_age_ns) = (applied, if applied == 0 { 0 } else { delay_ns });
        reference.attitude_rad[1] = 0.02;
        reference.attitude_rad[2] = if tick > 30 { 0.02 } else { 0.0 };
        demands.push(Vector4::from(mpc.step(tick, &state, &reference).demand));
        predicted.push(mpc.work.start.clone());

        // Moves the vehicle to the next sample in pieces; a piece ends when a demand is due.
        let (begin_ns, end_ns) = (tick * SAMPLE_NS, (tick + 1) * SAMPLE_NS);
        let mut now_ns = begin_ns;
        while now_ns < end_ns {
            if let Some(due) = now_ns.checked_sub(delay_ns).filter(|since| since % SAMPLE_NS == 0) {
                let of = due / SAMPLE_NS;
                errors.push((&x - &predicted[of as usize]).amax());
                if lost != Some(of) {
                    (in_force, applied) = (demands[of as usize], of + 1);
                }
            }
            let switch_ns = begin_ns + delay_ns % SAMPLE_NS;
            let until_ns = if now_ns < switch_ns { switch_ns } else { end_ns };
            let time_s = (until_ns - now_ns) as f64 * 1e-9;
            mpc.model.advance(&mut x, &in_force, &Vector4::zeros(), time_s);
            now_ns = until_ns;
        }
    }
    errors
}

#[test]
fn the_prediction_is_the_state_at_which_the_demand_acts() {
    for delay_ns in [0, 400_000, 3_700_000, 10_000_000, 23_000_000, 50_500_000, 99_999_999, 160_000_000] {
        let errors = prediction_errors(delay_ns, None);
        // Before the first command has acted the delay is unknown.
        let known = (delay_ns / SAMPLE_NS + 1) as usize;
        let worst = errors[known..].iter().copied().fold(0.0, f64::max);
        assert!(worst < 1e-12, "{worst:e} off after {delay_ns} ns");
        let moved = errors[..known].iter().copied().fold(0.0, f64::max);
        assert!(delay_ns < SAMPLE_NS || moved > 1e-5, "a delay that is not known shows: {moved:e}");
    }
}

#[test]
fn a_demand_that_was_lost_does_not_act_in_the_prediction() {
    for delay_ns in [3_700_000, 23_000_000, 50_000_000] {
        let lost = 40;
        let errors = prediction_errors(delay_ns, Some(lost));
        // The effect of a demand that is due at a sample is known one sample later.
        let known = lost as usize + delay_ns.div_ceil(SAMPLE_NS) as usize + usize::from(delay_ns % SAMPLE_NS == 0);
        let worst = |errors: &[f64]| errors.iter().copied().fold(0.0, f64::max);
        assert!(worst(&errors[20..=lost as usize]) < 1e-12, "what acts before it is known");
        assert!(worst(&errors[known..]) < 1e-12, "{:e} off after {delay_ns} ns", worst(&errors[known..]));
        assert!(delay_ns < SAMPLE_NS || worst(&errors[lost as usize..known]) > 1e-9, "until then it was expected");
    }
}

#[test]
fn a_wild_age_is_bounded_and_forgotten() {
    let mut mpc = controller();
    let mut answer = |tick: u64, age_ns| {
        let (mut state, mut reference) = hover(&mpc, tick);
        (state.applied_sequence, state.applied_age_ns) = (tick + 1, age_ns);
        reference.attitude_rad[1] = 0.05;
        let demand = mpc.step(tick, &state, &reference).demand;
        (mpc.memory.delay.samples(SAMPLE_NS), demand)
    };
    for tick in 0..20 {
        assert_eq!(answer(tick, 25_000_000).0, (2, 5e6));
    }
    for (tick, age_ns) in (20..120).zip([u64::MAX, 1 << 60, 0].into_iter().cycle()) {
        let ((whole, rest_ns), demand) = answer(tick, age_ns);
        assert!(whole <= MAX_DELAY && (0.0..=1e7).contains(&rest_ns), "{whole} samples and {rest_ns} ns");
        assert!(demand.iter().all(|u| u.abs() < 10.0), "{demand:?}");
    }
    for tick in 120..300 {
        answer(tick, 25_000_000);
    }
    let ((whole, rest_ns), _) = answer(300, 25_000_000);
    assert!((whole as f64 * 1e7 + rest_ns - 25e6).abs() < 10.0, "{whole} samples and {rest_ns} ns");
}

#[test]
fn a_controller_without_memory_takes_the_command_in_force_for_its_demands() {
    let mut mpc = controller();
    let u = Vector4::new(-0.5, 0.05, 0.02, 0.01);
    let (mut state, reference) = hover(&mpc, 700);
    state.command_in_force = command(&mpc, &u).into();
    (state.applied_sequence, state.applied_age_ns) = (1234, 35_000_000);
    mpc.step(700, &state, &reference);
    let mut expected = mpc.work.x.clone();
    mpc.model.advance(&mut expected, &u, &Vector4::zeros(), 0.035);
    assert!((&mpc.work.start - expected).amax() < 1e-12, "{}", mpc.work.start);
}
