use contract::message::ActuationMsg;
use proptest::prelude::*;

use super::*;
use crate::Plant;

const MS: u64 = 1_000_000;

fn line(delay_ms: f64, jitter_ms: f64, drop_probability: f64, seed: u64) -> CommandLine {
    let mut scenario = Scenario::default();
    scenario.run.command_delay_ms = delay_ms;
    scenario.run.command_jitter_ms = jitter_ms;
    scenario.run.command_drop_probability = drop_probability;
    scenario.run.seed = seed;
    CommandLine::new(&scenario, Actuation::default())
}

/// Message with number `sequence`, computed from sample `tick`.
fn message(tick: u64, sequence: u64) -> Actuators {
    let command = ActuationMsg { rotor_speed: [sequence as f64; 3], tilt_rad: 0.1 };
    Actuators { stamp: Stamp { tick, sequence, ..Stamp::default() }, command, flags: 0 }
}

/// Sequence number in force at `now_ns`.
fn at(line: &mut CommandLine, now_ns: u64) -> u64 {
    line.switch(now_ns);
    line.in_force().sequence
}

#[test]
fn a_command_takes_effect_after_arrival_and_delay_and_not_before() {
    let mut line = line(4.5, 0.0, 0.0, 0);
    line.receive(&message(3, 1), 31 * MS);
    assert_eq!(line.next_switch_ns(), 35 * MS + MS / 2);
    assert_eq!(at(&mut line, 35 * MS), 0);
    assert_eq!(at(&mut line, 35 * MS + MS / 2), 1);
    assert_eq!(line.in_force().actuation, message(3, 1).command.into());
    assert_eq!(line.in_force().age_ns, 5 * MS + MS / 2, "from sample 3, at 30 ms");
    assert_eq!(line.next_switch_ns(), 35 * MS + MS / 2 + CUT_NS, "nothing but the cut is to come");
}

#[test]
fn with_a_long_delay_several_commands_are_on_their_way() {
    let mut line = line(35.0, 0.0, 0.0, 0);
    for k in 0..100 {
        line.receive(&message(k, k + 1), 10 * MS * k);
        let expected = if k < 4 { 0 } else { k - 3 };
        assert_eq!(at(&mut line, 10 * MS * k), expected, "sample {k}: that of sample k - 4, 40 ms old");
    }
}

#[test]
fn an_answer_to_a_future_sample_is_ignored() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    for tick in [4, 5, u64::MAX] {
        line.receive(&message(tick, 1), 35 * MS);
    }
    assert_eq!(at(&mut line, 35 * MS), 0);
    line.receive(&message(3, 2), 36 * MS);
    assert_eq!(at(&mut line, 36 * MS), 2, "and does not block later ones");
}

#[test]
fn an_older_command_never_replaces_a_newer_one() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    line.receive(&message(0, 2), 5 * MS);
    line.receive(&message(0, 1), 6 * MS);
    assert_eq!(at(&mut line, 7 * MS), 2);
    line.receive(&message(0, 2), 8 * MS);
    assert_eq!(line.next_switch_ns(), 5 * MS + CUT_NS, "the same one again changes nothing");
}

#[test]
fn an_older_command_may_act_until_the_newer_one_does() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    line.receive(&message(0, 2), 5 * MS);
    line.receive(&message(0, 1), 3 * MS);
    assert_eq!(at(&mut line, 4 * MS), 1);
    assert_eq!(at(&mut line, 5 * MS), 2);
}

#[test]
fn a_newer_command_that_is_faster_removes_the_older_one() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    line.receive(&message(0, 1), 6 * MS);
    line.receive(&message(0, 2), 4 * MS);
    assert_eq!(at(&mut line, 5 * MS), 2);
    assert_eq!(at(&mut line, 7 * MS), 2);
}

#[test]
fn commands_of_a_process_that_takes_over_take_effect_though_it_counts_anew() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    line.receive(&message(8, 900), 80 * MS);
    assert_eq!(at(&mut line, 81 * MS), 900);
    let mut reborn = message(9, 1);
    reborn.stamp.epoch = 1;
    line.receive(&reborn, 90 * MS);
    assert_eq!(at(&mut line, 91 * MS), 1);
    line.receive(&message(8, 901), 92 * MS);
    assert_eq!(at(&mut line, 93 * MS), 1, "a late word of the one before is not");
    line.receive(&message(10, 902), 100 * MS);
    assert_eq!(at(&mut line, 101 * MS), 902, "but it is when it is active again");
}

#[test]
fn a_command_without_a_successor_is_cut() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    line.receive(&message(10, 7), 100 * MS);
    line.switch(100 * MS);
    let given = line.in_force().actuation;
    assert_eq!(line.next_switch_ns(), 100 * MS + CUT_NS);
    line.switch(99 * MS + CUT_NS);
    assert_eq!((line.in_force().actuation, line.is_cut), (given, false));
    line.switch(100 * MS + CUT_NS);
    assert_eq!(line.in_force().actuation, Actuation { rotor_speed: [0.0; 3], ..given }, "the tilt is held");
    assert_eq!((line.is_cut, line.in_force().sequence), (true, 7));
    assert_eq!(line.next_switch_ns(), u64::MAX, "it is cut once");
    line.receive(&message(10, 7), 700 * MS);
    line.switch(700 * MS);
    assert!(line.is_cut, "the same one again does not revive it");
    line.receive(&message(70, 8), 710 * MS);
    assert_eq!(line.next_switch_ns(), 710 * MS);
    line.switch(710 * MS);
    assert_eq!((line.in_force().actuation, line.is_cut), (message(70, 8).command.into(), false));
    assert_eq!(line.next_switch_ns(), 710 * MS + CUT_NS, "and the time counts again");
}

#[test]
fn the_trim_command_of_the_start_is_cut_as_late_as_any_other() {
    let cut_at = |delay_ms: f64, time_ns: u64| {
        let mut line = line(delay_ms, 0.0, 0.0, 0);
        line.receive(&message(0, 1), 0);
        line.switch(time_ns);
        line.is_cut
    };
    assert!(!cut_at(600.0, CUT_NS - 1) && cut_at(600.0, CUT_NS) && !cut_at(600.0, 600 * MS));
    assert!(!cut_at(500.0, CUT_NS), "what takes effect at that instant is in time");
}

#[test]
fn without_commands_the_vehicle_hovers_half_a_second_and_then_falls() {
    let mut scenario = Scenario::default();
    scenario.plant.rotor_speed_min = 200.0;
    let mut plant = Plant::new(&scenario);
    let trim = plant.sample().command_in_force;
    plant.advance(50).unwrap();
    let held = plant.truth();
    assert!(held.actual.position_m[2].abs() < 1e-9);
    plant.advance(40).unwrap();
    let (state, cut) = (plant.sample(), plant.truth());
    assert!(cut.actuators.rotor_speed.iter().all(|omega| *omega < 1.0), "not even the idle speed is left");
    assert_eq!(cut.actuators.tilt_rad.to_bits(), held.actuators.tilt_rad.to_bits(), "the tilt is held");
    assert_eq!((state.command_in_force.rotor_speed, state.applied_sequence), ([0.0; 3], 0));
    assert!(cut.actual.position_m[2] > 0.5, "it falls");
    plant.command(&Actuators { command: trim, ..message(90, 1) }, 0);
    plant.advance(20).unwrap();
    assert!(plant.truth().actuators.rotor_speed.iter().all(|omega| *omega > 1000.0), "a command revives it");
}

#[test]
fn commands_that_are_not_finite_are_ignored() {
    let mut line = line(0.0, 0.0, 0.0, 0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut rotor = message(0, 1);
        rotor.command.rotor_speed[1] = bad;
        let mut tilt = message(0, 2);
        tilt.command.tilt_rad = bad;
        line.receive(&rotor, 0);
        line.receive(&tilt, 0);
    }
    assert_eq!(at(&mut line, MS), 0);
}

#[test]
fn a_flood_of_commands_is_bounded_and_allocates_nothing() {
    let mut line = line(5.0, 0.0, 0.0, 0);
    let room = line.waiting.capacity();
    for sequence in 1..10_000 {
        line.receive(&message(0, sequence), sequence);
    }
    assert_eq!(line.waiting.len(), line.capacity);
    assert_eq!(line.waiting.capacity(), room);
    assert_eq!(at(&mut line, 10 * MS), line.capacity as u64);
}

#[test]
fn commands_are_dropped_with_their_probability_and_the_others_unchanged() {
    let n = 10_000;
    let mut lossy = line(0.0, 0.0, 0.4, 11);
    let lost = (1..=n).filter(|&k| {
        lossy.receive(&message(k, k), 10 * k * MS);
        at(&mut lossy, 10 * k * MS) != k
    });
    let share = lost.count() as f64 / n as f64;
    assert!((share - 0.4).abs() < 5.0 * (0.4 * 0.6 / n as f64).sqrt(), "{share}");
}

#[test]
fn jitter_is_uniform_and_does_not_depend_on_drops() {
    let n = 10_000u64;
    let delays = |drop_probability: f64| -> Vec<Option<u64>> {
        let mut line = line(2.0, 4.0, drop_probability, 5);
        (1..=n)
            .map(|k| {
                let arrival_ns = 10 * MS * k;
                line.receive(&message(k, k), arrival_ns);
                let effect_ns = line.next_switch_ns();
                line.switch(arrival_ns + 10 * MS);
                effect_ns.checked_sub(arrival_ns).filter(|_| line.in_force().sequence == k)
            })
            .collect()
    };
    let (all, some) = (delays(0.0), delays(0.5));
    assert!(all.iter().zip(&some).all(|(a, s)| s.is_none() || s == a));
    assert!(some.iter().filter(|s| s.is_some()).count() > 4000);
    let ms: Vec<f64> = all.iter().map(|d| d.expect("none is lost") as f64 / MS as f64).collect();
    assert!(ms.iter().all(|&d| (2.0..6.0).contains(&d)));
    let mean = ms.iter().sum::<f64>() / n as f64;
    assert!((mean - 4.0).abs() < 5.0 * 4.0 / (12.0 * n as f64).sqrt(), "{mean}");
}

proptest! {
    /// For any arrivals the command in force only becomes newer, and the waiting commands are in order.
    #[test]
    fn the_command_in_force_only_gets_newer(
        arrivals in prop::collection::vec((0u64..40, 0u64..30), 1..60),
        jitter_ms in 0.0..15.0,
        drop_probability in 0.0..1.0,
    ) {
        let mut line = line(1.0, jitter_ms, drop_probability, 2);
        let mut newest = 0;
        for (k, (sequence, lateness_ms)) in arrivals.into_iter().enumerate() {
            let now_ns = 2 * MS * k as u64;
            line.receive(&message(0, sequence), now_ns + lateness_ms * MS);
            let waiting: Vec<_> = line.waiting.iter().map(|c| (c.effect_ns, c.order())).collect();
            prop_assert!(waiting.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1));
            let in_force = at(&mut line, now_ns);
            prop_assert!(in_force >= newest);
            newest = in_force;
        }
    }
}
