//! Tests of missing states and references, and of the snapshot.

use contract::message::{Controls, Reference, SolveStatus, State, guidance_flags};
use contract::snapshot::{self, SNAPSHOT_WORDS, Snapshot};
use proptest::prelude::*;
use runtime::node::Core;
use settings::{Constraints, DelayCompensation, DelayName, Law, Profile, Scenario, SolverName, StateConstraints};

use super::{hover, violent_turn};
use crate::memory::{MAX_DISCS, WarmStart, Whole};
use crate::{AttitudeMpc, fixture};

#[test]
fn without_a_fresh_state_the_demand_is_repeated_with_status_stale() {
    for profile in [Profile::Paper, Profile::Robust] {
        let mut mpc = AttitudeMpc::new(&Scenario::from(profile));
        let (state, mut reference) = hover(&mpc, 0);
        let none = mpc.step(0, &State::default(), &reference);
        assert_eq!((none.status, none.demand), (SolveStatus::Stale as u64, [0.0; 4]));
        reference.w_mps = -0.5;
        let good = mpc.step(0, &state, &reference);
        let memory = mpc.memory;
        for tick in 1..100 {
            reference.stamp.tick = tick;
            let stale = mpc.step(tick, &state, &reference);
            assert_eq!(stale, Controls { status: SolveStatus::Stale as u64, ..good });
            assert_eq!(mpc.memory, memory, "and nothing is remembered");
        }
        let (state, reference) = hover(&mpc, 100);
        assert_eq!(mpc.step(100, &state, &reference).status, SolveStatus::Explicit as u64);
    }
}

#[test]
fn a_missing_reference_shows_in_the_status_from_its_first_tick_on() {
    let mut mpc = AttitudeMpc::new(&Scenario::default());
    let (_, reference) = hover(&mpc, 3);
    for (tick, status) in [(3, SolveStatus::Explicit), (4, SolveStatus::NoReference), (300, SolveStatus::NoReference)] {
        let (state, _) = hover(&mpc, tick);
        assert_eq!(mpc.step(tick, &state, &reference).status, status as u64, "tick {tick}");
    }
    let (state, repeated) = hover(&mpc, 301);
    let repeated = Reference { flags: guidance_flags::STALE, ..repeated };
    assert_eq!(mpc.step(301, &state, &repeated).status, SolveStatus::NoReference as u64, "one that only repeats");
    let (state, reference) = hover(&mpc, 302);
    assert_eq!(mpc.step(302, &state, &reference).status, SolveStatus::Explicit as u64);
    assert!(!SolveStatus::repeated(SolveStatus::NoReference as u64), "the demand is a new one all the same");
}

/// Demands at hover; after tick 0 there are no new references, or only repeated ones with `flags`.
fn without_references(flags: u64) -> Vec<[f64; 4]> {
    let mut scenario = Scenario::default();
    scenario.attitude.mpc.constraints = Constraints::None; // the descent must not depend on the limits
    // The demand must not depend on the demand before it.
    scenario.attitude.delay_compensation = DelayCompensation::Sample(false);
    let mut mpc = AttitudeMpc::new(&scenario);
    let answer = |tick| {
        let (state, mut reference) = hover(&mpc, tick);
        (reference.w_mps, reference.attitude_rad[1]) = (-0.5, 0.1);
        if flags == 0 {
            reference.stamp.tick = 0;
        } else if tick > 0 {
            reference.flags = flags;
        }
        mpc.step(tick, &state, &reference).demand
    };
    (0..300).map(answer).collect()
}

#[test]
fn without_references_the_demand_holds_then_levels_then_descends() {
    for flags in [0, guidance_flags::STALE, guidance_flags::BAD_INPUT] {
        let demands = without_references(flags);
        let [col, lon] = [0, 1];
        assert!(demands[0][col] < -0.1 && demands[0][lon] > 0.01, "up, and nose up");
        for (tick, demand) in demands.iter().enumerate() {
            match tick {
                ..50 => assert_eq!(*demand, demands[0], "tick {tick}"),
                50..200 => assert!(demand.iter().all(|u| u.abs() < 1e-9), "level at tick {tick}: {demand:?}"),
                _ => assert!(demand[col] > 0.1 && demand[lon].abs() < 1e-9, "down at tick {tick}: {demand:?}"),
            }
        }
    }
}

#[test]
fn a_new_reference_is_followed_again() {
    let mut scenario = Scenario::default();
    scenario.attitude.delay_compensation = DelayCompensation::Sample(false); // no dependence on earlier demands
    let mut mpc = AttitudeMpc::new(&scenario);
    let (state, reference) = hover(&mpc, 400);
    assert!(mpc.step(400, &state, &Reference::default()).demand[0] > 0.1, "none came: down");
    let (state, _) = hover(&mpc, 401);
    assert!(mpc.step(401, &state, &reference).demand[0].abs() < 1e-9);
}

#[test]
fn a_bad_snapshot_changes_nothing() {
    let mut mpc = AttitudeMpc::new(&Scenario::default());
    let (state, reference) = violent_turn(&mpc, 0);
    mpc.step(0, &state, &reference);
    let memory = mpc.memory;
    let mut torn = mpc.snapshot();
    torn[20] ^= 1;
    let mut bad = memory;
    bad.delay.outputs[3][1] = f64::NAN;
    let bad = snapshot::pack(&Whole { memory: bad, warm_start: WarmStart::default() });
    let other_model = AttitudeMpc::new(&Scenario::from(Profile::Paper)).snapshot();
    for snapshot in [torn, bad, other_model, [0; SNAPSHOT_WORDS]] {
        assert!(!mpc.restore(&snapshot));
        assert_eq!(mpc.memory, memory);
    }
}

#[test]
fn a_warm_start_with_unknown_or_repeated_constraints_is_refused() {
    let mut scenario = fixture::constrained();
    scenario.attitude.mpc.solver = SolverName::ActiveSet;
    let mut mpc = AttitudeMpc::new(&scenario);
    let mut restore = |count: u64, places: [u16; 2]| {
        let mut warm_start = WarmStart { count, ..WarmStart::default() };
        warm_start.places.as_flattened_mut()[..2].copy_from_slice(&places);
        mpc.restore(&snapshot::pack(&Whole { memory: mpc.memory, warm_start }))
    };
    assert!(restore(2, [3, 4]));
    for (count, places) in [(2, [9999, 3]), (2, [3, 3]), (4 * MAX_DISCS as u64 + 1, [3, 4])] {
        assert!(!restore(count, places), "{count} of {places:?}");
    }
    let (state, reference) = violent_turn(&mpc, 0);
    assert_eq!(mpc.step(0, &state, &reference).status, SolveStatus::Solved as u64);
}

/// Flies `path` with a controller. An element has (w, phi, theta, p, q, r, heading reference) and a lateness. From tick
/// `until` on a candidate that restored a snapshot answers too; returns the pairs of answers.
fn continued(scenario: &Scenario, path: &[([f64; 7], u64)], until: usize) -> Vec<[Controls; 2]> {
    let (mut mpc, mut candidate) = (AttitudeMpc::new(scenario), None);
    let mut pairs = vec![];
    for (tick, ([w, phi, theta, p, q, r, heading], late)) in path.iter().enumerate() {
        if tick == until {
            let snapshot: Snapshot = mpc.snapshot();
            let mut other = AttitudeMpc::new(scenario);
            assert!(other.restore(&snapshot));
            candidate = Some(other);
        }
        let tick = tick as u64;
        let (mut state, mut reference) = hover(&mpc, tick.saturating_sub(late / 2)); // some messages come a tick late
        state.measured.velocity_mps[2] = *w;
        state.measured.attitude_rad = [*phi, *theta, 0.0];
        state.measured.rates_radps = [*p, *q, *r];
        (state.applied_sequence, state.applied_age_ns) = (tick, 15_000_000 * late);
        reference.attitude_rad[2] = *heading;
        let [one, other] = [Some(&mut mpc), candidate.as_mut()]
            .map(|mpc| mpc.map(|mpc| Controls { solve_ns: 0, ..mpc.step(tick, &state, &reference) }));
        pairs.extend(one.zip(other).map(|(one, other)| [one, other]));
    }
    pairs
}

#[test]
fn a_restored_controller_continues_with_the_gain_of_the_estimate() {
    let scenario = Scenario::default();
    let wobbling = |tick: u32| {
        let sway = (0.3 * f64::from(tick)).sin();
        ([0.2 * sway, -0.19 + 0.02 * sway, 0.03 * sway, 0.1 * sway, -0.1 * sway, 0.05 * sway, 0.1], 1)
    };
    let path: Vec<_> = (0..60).map(wobbling).collect();
    let pairs = continued(&scenario, &path, 10);
    assert_eq!(pairs.len(), 50);
    for [one, other] in pairs {
        assert_eq!(bytemuck::bytes_of(&one), bytemuck::bytes_of(&other), "bit by bit");
        assert_ne!(one.disturbance, [0.0; 4]);
    }
    let (mut mpc, mut other) = (AttitudeMpc::new(&scenario), AttitudeMpc::new(&scenario));
    let trim = mpc.model.trim.actuation;
    super::fly(&mut mpc, 0..10, trim);
    assert!(other.restore(&mpc.snapshot()));
    assert_eq!(other.memory.gain.to_bits(), mpc.memory.gain.to_bits());
    assert!(mpc.memory.gain < 0.1 && mpc.memory.gain > scenario.attitude.disturbance_gain, "{}", mpc.memory.gain);
}

#[test]
fn a_plan_of_many_moves_at_its_limits_is_continued_bit_by_bit() {
    for (moves, fits) in [(20, true), (60, false)] {
        let mut scenario = fixture::constrained();
        let horizon_s = f64::from(moves) * scenario.sample_s();
        (scenario.attitude.mpc.prediction_horizon_s, scenario.attitude.mpc.control_horizon_s) = (horizon_s, horizon_s);
        (scenario.attitude.mpc.solver, scenario.attitude.mpc.max_iterations) = (SolverName::ActiveSet, 1000);
        let tumbling = |tick: u32| ([20.0 - f64::from(tick), 1.2, -1.2, 10.0, 10.0, 10.0, 3.0], 0);
        let path: Vec<_> = (0..8).map(tumbling).collect();
        for [one, other] in continued(&scenario, &path, 4) {
            assert_eq!(one, other);
            assert_eq!(one.status, SolveStatus::Solved as u64);
        }
        let mut mpc = AttitudeMpc::new(&scenario);
        let (mut state, reference) = violent_turn(&mpc, 0);
        (state.measured.velocity_mps[2], state.measured.rates_radps) = (20.0, [10.0; 3]);
        mpc.step(0, &state, &reference);
        let held = snapshot::unpack::<Whole>(&mpc.snapshot()).expect("its own").warm_start.count;
        assert!(if fits { held > 26 } else { held == 0 }, "{moves} moves hold {held}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_restored_node_answers_bit_by_bit_like_the_one_it_continues(
        path in prop::collection::vec((prop::array::uniform7(-1.5..1.5_f64), 0_u64..3), 4..30), until in 1_usize..4,
        [paper, own, soft, measured] in prop::array::uniform4(prop::bool::ANY),
        moves in prop::sample::select(&[5, 5, 20, 40][..]),
        law in prop::sample::select(&[Law::Mpc, Law::Mpc, Law::Mpc, Law::Pid, Law::Geometric, Law::Indi][..]),
    ) {
        let mut scenario = Scenario::from(if paper { Profile::Paper } else { Profile::Robust });
        scenario.attitude.mpc.solver = if own { SolverName::ActiveSet } else { SolverName::Clarabel };
        scenario.attitude.mpc.state_constraints = if soft { StateConstraints::Soft } else { StateConstraints::None };
        scenario.attitude.mpc.constraints = Constraints::Cone;
        scenario.attitude.disturbance_gain = 0.1;
        if measured {
            scenario.attitude.delay_compensation = DelayCompensation::Named(DelayName::Measured);
        }
        scenario.attitude.mpc.time_limit_ms = 0.0;
        scenario.attitude.law = law;
        scenario.attitude.mpc.control_horizon_s = f64::from(moves) * scenario.sample_s();
        let mpc = &mut scenario.attitude.mpc;
        mpc.prediction_horizon_s = mpc.prediction_horizon_s.max(mpc.control_horizon_s);
        for [one, other] in continued(&scenario, &path, until) {
            prop_assert_eq!(one, other);
        }
    }
}
