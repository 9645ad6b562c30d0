//! Tests of the mixer on each rung of the ladder, and of the snapshot.

use airframe::Trim;
use contract::actuation::Actuation;
use contract::message::{Actuators, Controls, SolveStatus, Stamp, State, mixer_flags as flags};
use contract::snapshot::{self, SNAPSHOT_WORDS};
use proptest::prelude::*;
use runtime::node::Core;
use settings::{Profile, Scenario};

use super::any_demand;
use crate::Mixer;
use crate::damage::{BrokenPart, Damage};

/// Demand to climb at `tick`.
fn climb(tick: u64) -> Controls {
    let stamp = Stamp { tick, sequence: tick + 1, ..Stamp::default() };
    Controls { stamp, demand: [-1.0, 0.0, 0.0, 0.0], ..Controls::default() }
}

/// State of a hover at trim at `tick`.
fn hover(scenario: &Scenario, tick: u64) -> State {
    let trim = Trim::solve(&scenario.airframe, false);
    let stamp = Stamp { tick, sequence: tick + 1, ..Stamp::default() };
    let mut state = State { stamp, command_in_force: trim.actuation.into(), ..State::default() };
    state.measured.attitude_rad[0] = trim.roll_rad;
    state
}

/// Answers from tick 10 on, after which demands end; states end after tick `states_until`.
fn silence(rate_hz: u32, states_until: u64, ticks: u64) -> Vec<Actuators> {
    let mut scenario = Scenario::default();
    scenario.run.rate_hz = rate_hz;
    let mut mixer = Mixer::new(&scenario);
    let answer = |tick: u64| mixer.step(tick, &climb(tick.min(10)), &hover(&scenario, tick.min(states_until)));
    let answers: Vec<Actuators> = (0..10 + ticks).map(answer).collect();
    answers[10..].to_vec()
}

#[test]
fn without_demands_the_mixer_holds_then_levels_then_descends() {
    for rate_hz in [50, 100, 500, 2000] {
        let answers = silence(rate_hz, u64::MAX, 3 * u64::from(rate_hz));
        let climbing = answers[0].command;
        for (age, answer) in answers.iter().enumerate() {
            let age_s = age as f64 / f64::from(rate_hz);
            let rung = match age_s {
                ..0.015 => 0,
                ..0.03 => flags::HELD,
                ..2.0 => flags::LEVELLED,
                _ => flags::DESCENDING,
            };
            assert_eq!(answer.flags, rung, "{age_s} s at {rate_hz} Hz");
            let thrust = |command: Actuation| command.rotor_speed.map(|omega| omega * omega).iter().sum::<f64>();
            let ours = thrust(answer.command.into());
            let level = thrust(Trim::solve(&Scenario::default().airframe, false).actuation);
            match rung {
                0 | flags::HELD => assert_eq!(answer.command, climbing),
                flags::LEVELLED => assert!((ours / level - 1.0).abs() < 1e-12, "hover thrust"),
                _ => assert!(ours < level, "less than hover"),
            }
        }
    }
}

#[test]
fn without_states_too_the_mixer_commands_trim_and_then_cuts() {
    let trim = Trim::solve(&Scenario::default().airframe, false).actuation;
    for (age, answer) in silence(100, 10, 100).iter().enumerate() {
        let expected = match age {
            0 | 1 => 0,
            2 => flags::HELD,
            3 | 4 => flags::LEVELLED,
            5..50 => flags::TRIM_ONLY,
            _ => flags::CUT,
        };
        assert_eq!(answer.flags, expected, "{age} ticks");
        match answer.flags {
            flags::TRIM_ONLY => assert_eq!(Actuation::from(answer.command), trim),
            flags::CUT => assert_eq!(Actuation::from(answer.command), Actuation { rotor_speed: [0.0; 3], ..trim }),
            _ => (),
        }
    }
}

#[test]
fn a_demand_alone_is_flown_without_a_state() {
    let scenario = Scenario::default();
    let mut mixer = Mixer::new(&scenario);
    for tick in 0..300 {
        assert_eq!(mixer.step(tick, &climb(tick), &State::default()).flags, 0);
    }
}

#[test]
fn before_the_first_message_there_is_no_thrust() {
    let mut mixer = Mixer::new(&Scenario::default());
    let nothing = (Controls::default(), State::default());
    assert_eq!(mixer.step(0, &nothing.0, &nothing.1).flags, flags::CUT);
    let state = hover(&Scenario::default(), 1);
    assert_eq!(mixer.step(1, &nothing.0, &state).flags, flags::DESCENDING, "no demand ever came");
    assert_eq!(mixer.step(2, &climb(2), &state).flags, 0);
}

#[test]
fn a_fresh_demand_leads_back_to_the_top() {
    let scenario = Scenario::default();
    let mut mixer = Mixer::new(&scenario);
    mixer.step(0, &climb(0), &hover(&scenario, 0));
    assert_eq!(mixer.step(400, &climb(0), &hover(&scenario, 0)).flags, flags::CUT);
    assert_eq!(mixer.step(401, &climb(0), &hover(&scenario, 401)).flags, flags::DESCENDING);
    assert_eq!(mixer.step(402, &climb(402), &hover(&scenario, 402)).flags, 0);
}

#[test]
fn demands_that_are_not_finite_or_repeated_do_not_renew_the_age() {
    let scenario = Scenario::default();
    let spoil: [fn(&mut Controls); 4] = [
        |controls| controls.demand[1] = f64::NAN,
        |controls| controls.demand[3] = f64::NEG_INFINITY,
        |controls| controls.status = SolveStatus::BadInput as u64,
        |controls| controls.status = SolveStatus::Stale as u64,
    ];
    for spoil in spoil {
        let mut mixer = Mixer::new(&scenario);
        let good = mixer.step(0, &climb(0), &hover(&scenario, 0));
        for tick in 1..10 {
            let mut controls = climb(tick);
            spoil(&mut controls);
            let answer = mixer.step(tick, &controls, &hover(&scenario, tick));
            let bad = if controls.demand.iter().all(|u| u.is_finite()) { 0 } else { flags::BAD_INPUT };
            let rung = [0, flags::HELD, flags::LEVELLED][(tick as usize - 1).min(2)];
            assert_eq!(answer.flags, rung | bad, "tick {tick}");
            assert!(tick > 2 || answer.command == good.command);
        }
    }
}

#[test]
fn levelling_and_descending_take_the_disturbance_estimate_into_account() {
    let scenario = Scenario::default();
    let trim = Trim::solve(&scenario.airframe, false).actuation.rotor_speed;
    for (tick, rung) in [(10, flags::LEVELLED), (300, flags::DESCENDING)] {
        let mut mixer = Mixer::new(&scenario);
        let mut controls = climb(0);
        controls.disturbance = [0.0, -0.1, 0.0, 0.0]; // a moment that pitches the nose down
        mixer.step(0, &controls, &hover(&scenario, 0));
        let [front, right, left] = mixer.step(tick, &controls, &hover(&scenario, tick)).command.rotor_speed;
        assert_eq!(mixer.step(tick, &controls, &hover(&scenario, tick)).flags, rung);
        assert!(front / right > trim[0] / trim[1] && front / left > trim[0] / trim[2], "nose up: {rung}");
    }
}

#[test]
fn a_terminated_flight_stays_without_thrust_whatever_comes() {
    let scenario = Scenario::default();
    let mut mixer = Mixer::new(&scenario);
    mixer.memory.damage = Damage::from(BrokenPart::Rotor(1));
    for tick in 0..5 {
        let answer = mixer.step(tick, &climb(tick), &hover(&scenario, tick));
        assert_eq!((answer.flags, answer.command.rotor_speed), (flags::CUT | flags::TERMINATED, [0.0; 3]));
    }
}

#[test]
fn evidence_advances_by_the_time_between_two_states() {
    let scenario = Scenario::default();
    let mut mixer = Mixer::new(&scenario);
    let (first, mut second) = (hover(&scenario, 5), hover(&scenario, 7));
    mixer.step(5, &climb(5), &first);
    let before = mixer.memory.evidence;
    second.command_in_force.rotor_speed[0] *= 1.1;
    second.measured.velocity_mps[2] = 0.1;
    mixer.step(7, &climb(7), &second);
    let command = Actuation::from(second.command_in_force);
    let expected = mixer.rotors.observe(&before, [&first.measured, &second.measured], &command, 0.02);
    assert_eq!(mixer.memory.evidence, expected);
    assert_ne!(expected, before);
}

/// Answers without a demand to a vehicle that stands level on the ground, or hovers if no ground is `present`.
fn on_the_ground(present: bool) -> (Scenario, Vec<Actuators>) {
    let mut scenario = Scenario::default();
    scenario.plant.ground.present = present;
    let mut mixer = Mixer::new(&scenario);
    let answer = |tick: u64| {
        let mut state = hover(&scenario, tick);
        state.measured.attitude_rad[0] = 0.0;
        mixer.step(tick, &Controls::default(), &state)
    };
    let answers = (0..300).map(answer).collect();
    (scenario, answers)
}

#[test]
fn on_the_ground_the_mixer_idles_and_then_disarms_for_good() {
    let (scenario, answers) = on_the_ground(true);
    let first = |flag: u64| answers.iter().position(|answer| answer.flags == flag);
    let (contact, disarmed) = (first(flags::GROUND_CONTACT).expect("idle"), first(flags::DISARMED).expect("stopped"));
    assert!(answers[..contact].iter().all(|answer| answer.flags & !flags::PROJECTED == flags::DESCENDING));
    assert_eq!((contact, disarmed - contact), (50, 100), "half a second, and a second");
    assert_eq!(answers[contact].command.rotor_speed, [scenario.idle_speed(); 3]);
    assert!(answers[disarmed..].iter().all(|answer| answer.command.rotor_speed == [0.0; 3]));
    assert!(answers.iter().all(|answer| flags::fallback(answer.flags) == (answer.flags & flags::DESCENDING != 0)));
}

#[test]
fn without_a_ground_the_mixer_neither_idles_nor_disarms() {
    let (_, answers) = on_the_ground(false);
    assert!(answers.iter().all(|answer| answer.flags & !flags::PROJECTED == flags::DESCENDING));
}

#[test]
fn a_bad_snapshot_changes_nothing() {
    let scenario = Scenario::default();
    let mut mixer = Mixer::new(&scenario);
    mixer.step(0, &climb(0), &hover(&scenario, 0));
    let memory = mixer.memory;
    let mut torn = mixer.snapshot();
    torn[9] ^= 1;
    let mut bad = memory;
    bad.evidence.dead_s[2] = f64::INFINITY;
    for snapshot in [torn, snapshot::pack(&bad), [0; SNAPSHOT_WORDS]] {
        assert!(!mixer.restore(&snapshot));
        assert_eq!(mixer.memory, memory);
    }
}

proptest! {
    #[test]
    fn any_bits_of_any_age_give_a_command_inside_the_limits_or_none(
        messages in prop::collection::vec((any_demand(), prop::array::uniform12(prop::num::f64::ANY), 0_u64..300, 0_u64..60), 1..20),
        paper: bool,
    ) {
        let scenario = Scenario::from(if paper { Profile::Paper } else { Profile::Robust });
        let (limits, mut mixer) = (scenario.limits(), Mixer::new(&scenario));
        let mut tick = 0;
        for (demand, numbers, demand_age, state_age) in messages {
            tick += state_age;
            let mut controls = climb(tick.saturating_sub(demand_age));
            controls.demand = demand;
            let mut state = hover(&scenario, tick.saturating_sub(state_age / 2));
            state.measured.velocity_mps.copy_from_slice(&numbers[..3]);
            state.measured.attitude_rad.copy_from_slice(&numbers[3..6]);
            state.measured.rates_radps.copy_from_slice(&numbers[6..9]);
            state.command_in_force.rotor_speed.copy_from_slice(&numbers[9..]);
            let Actuators { command, flags, .. } = mixer.step(tick, &controls, &state);
            prop_assert!(command.tilt_rad.abs() <= limits.tilt_max_rad);
            for (omega, max) in command.rotor_speed.iter().zip(limits.rotor_speed_max) {
                let inside = (limits.rotor_speed_min..=max).contains(omega);
                let cut = flags & flags::CUT != 0;
                prop_assert!((cut && *omega == 0.0) || (!cut && inside), "{}", omega);
            }
        }
    }

    #[test]
    fn a_restored_node_answers_bit_by_bit_like_the_one_it_continues(
        path in prop::collection::vec((prop::array::uniform9(-1.0..1.0_f64), prop::array::uniform4(-3.0..3.0_f64), 0_u64..8), 2..60),
        until in 0_usize..60, paper: bool,
    ) {
        let scenario = Scenario::from(if paper { Profile::Paper } else { Profile::Robust });
        let (mut mixer, mut continued) = (Mixer::new(&scenario), None);
        for (tick, (numbers, demand, late)) in (0..).zip(path) {
            if tick == until as u64 {
                let mut candidate = Mixer::new(&scenario);
                prop_assert!(candidate.restore(&mixer.snapshot()));
                continued = Some(candidate);
            }
            let mut controls = climb(tick.saturating_sub(late));
            (controls.demand, controls.disturbance) = (demand, demand.map(|u| 0.1 * u));
            let mut state = hover(&scenario, tick.saturating_sub(late / 2));
            state.measured.velocity_mps.copy_from_slice(&numbers[..3]);
            state.measured.attitude_rad.copy_from_slice(&numbers[3..6]);
            state.measured.rates_radps.copy_from_slice(&numbers[6..]);
            let answer = mixer.step(tick, &controls, &state);
            if let Some(continued) = &mut continued {
                prop_assert_eq!(continued.step(tick, &controls, &state), answer);
                prop_assert_eq!(continued.memory, mixer.memory);
            }
        }
    }
}
