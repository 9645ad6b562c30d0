use std::collections::BTreeSet;
use std::path::Path;

use contract::message::Controls;
use contract::topic::Topic;
use flight::event::What;
use flight::guarded;
use flight::log::{Log, Record};
use proptest::collection::vec;
use proptest::prelude::Strategy;
use proptest::sample::select;
use proptest::test_runner::{Config, TestRunner};
use settings::{Fault, FaultKind, FaultTarget, Law, Scenario, Swap};

use super::again::ReplayRun;
use super::*;

/// Flies some seconds in process, and returns the settings and the log.
fn flown(seconds: f64, faults: &[Fault], swaps: &[Swap]) -> (Scenario, Log) {
    let mut scenario = Scenario { fault: faults.to_vec(), swap: swaps.to_vec(), ..Scenario::default() };
    scenario.run.mode = settings::Mode::Inprocess;
    scenario.run.duration_s = seconds;
    scenario.supervision.hang_ms = 1e3; // a process that stops is not replaced
    let mut log = Log::default();
    let watch = |record: &Record| {
        log.push(record);
        true
    };
    let flown = guarded::fly(&scenario, true, watch, |_| {}).unwrap();
    log.events = flown.events;
    (scenario, log)
}

fn recording((scenario, log): &(Scenario, Log)) -> (Recording, Script) {
    let logged = [log.states.len() + log.truths.len(), log.references.len(), log.controls.len(), log.actuators.len()];
    let recording =
        Recording::new(Path::new(""), &log.events, logged.map(|count| count as u64), u64::MAX, scenario, None);
    (recording.unwrap(), Script::of(log.tick_by_tick()))
}

fn replay(flight: &(Scenario, Log), plan: &ReplayPlan) -> Replayed {
    let (recording, script) = recording(flight);
    replay_script(&recording, script, plan, |_| {}).unwrap()
}

/// Replays message by message, and looks ahead by 400 messages only.
fn read_on((scenario, log): &(Scenario, Log), plan: &ReplayPlan) -> Replayed {
    let (recording, _) = recording(&(scenario.clone(), log.clone()));
    let mut flight = ReplayRun::new(&recording, plan, Script::looking_ahead(400), |_| {});
    log.tick_by_tick().for_each(|record| flight.take(&record).unwrap());
    flight.fly_on().unwrap()
}

fn replayed(flight: &(Scenario, Log)) -> Replayed {
    replay(flight, &ReplayPlan::default())
}

fn fault(target: FaultTarget, kind: FaultKind, at_s: f64) -> Fault {
    Fault::new(target, kind, at_s, Some(0.1))
}

/// Returns faults of every topic and process, and of sensors.
fn all_faults() -> Vec<Fault> {
    use FaultKind::*;
    use FaultTarget as Target;
    let topics = [Target::State, Target::Reference, Target::Controls, Target::Actuators];
    let of_topics = topics.iter().flat_map(|topic| {
        let kinds = [Drop, Burst, Delay, Duplicate, Reorder, Corrupt, Garbage, Stale, Rate];
        kinds.map(|kind| (*topic, kind))
    });
    let of_processes = [
        (Target::Mixer, Kill),
        (Target::Guidance, Stop),
        (Target::AttitudeMpc, Slow),
        (Target::AttitudeMpc, Exit),
        (Target::Rates, Noise),
        (Target::Attitude, Delayed),
        (Target::Rotor2, Slow),
        (Target::Mpc, Nan),
    ];
    let all = of_topics.chain(of_processes);
    all.enumerate().map(|(i, (target, kind))| fault(target, kind, 3.0 + 0.3 * i as f64)).collect()
}

#[test]
fn a_flight_with_every_kind_of_trouble_repeats_bit_for_bit() {
    let faults = all_faults();
    let swap = Swap { set: vec!["attitude.law='lqr'".into()], ..Swap::new(Topic::Controls, 0.5) };
    let end_s = 3.0 + 0.3 * (faults.len() + 3) as f64;
    let flight = flown(end_s, &faults, &[swap]);
    assert!(flight.1.events.iter().any(|event| event.what == What::Kept), "the swap was carried out");
    let replayed = replayed(&flight);
    assert_eq!((&replayed.first, &replayed.stopped), (&None, &None));
    let log = &flight.1;
    assert_eq!(replayed.computed(), log.tick_by_tick().count() as u64);
    assert!(replayed.compared() > replayed.computed() - 50, "all but those with flipped bits");
    let read_on = read_on(&flight, &ReplayPlan::default());
    assert_eq!((&read_on.messages, &read_on.first, read_on.stopped), (&replayed.messages, &None, None));
}

/// A process that dies on the tick of its take-over has answered no sample: the next process continues from its
/// predecessor.
#[test]
fn a_flight_with_any_schedule_of_kills_repeats_bit_for_bit() {
    let nodes = [FaultTarget::Guidance, FaultTarget::AttitudeMpc, FaultTarget::Mixer];
    let centiseconds = |from: u64, to: u64| (from..to).prop_map(|time| time as f64 / 100.0);
    let kill = (select(nodes.to_vec()), centiseconds(20, 120), centiseconds(1, 50));
    let schedules = vec(kill, 1..8);
    let found = vec![
        (FaultTarget::Guidance, 0.56, 0.3),
        (FaultTarget::Guidance, 0.66, 0.1), // the new process dies as it takes over
    ];
    let fly = |schedule: Vec<(FaultTarget, f64, f64)>| {
        let kills = schedule.iter().map(|(node, at_s, for_s)| Fault::new(*node, FaultKind::Kill, *at_s, Some(*for_s)));
        let flight = flown(1.6, &kills.collect::<Vec<_>>(), &[]);
        for replayed in [replayed(&flight), read_on(&flight, &ReplayPlan::default())] {
            assert_eq!((&replayed.first, &replayed.stopped), (&None, &None), "{schedule:?}");
        }
    };
    fly(found);
    let default = Config { failure_persistence: None, ..Config::default() };
    let few = if std::env::var_os("PROPTEST_CASES").is_some() { default } else { Config { cases: 24, ..default } };
    let tried = TestRunner::new(few).run(&schedules, |schedule| {
        fly(schedule);
        Ok(())
    });
    tried.unwrap();
}

#[test]
fn a_flipped_bit_is_found_where_it_stands() {
    let mut flight = flown(1.0, &[], &[]);
    let controls = &mut flight.1.controls[57];
    controls.demand[2] = f64::from_bits(controls.demand[2].to_bits() ^ 1);
    *controls = contract::message::Message::with_checksum(*controls);
    let first = replayed(&flight).first.unwrap();
    let Controls { demand, .. } = flight.1.controls[57];
    assert_eq!((first.tick, first.topic, first.differs.field.as_str()), (57, Topic::Controls, "demand[2]"));
    assert_eq!(first.differs.values[0], format!("{:?}", demand[2]));
    let later = ReplayPlan { from: 58, ..ReplayPlan::default() };
    assert_eq!(replay(&flight, &later).first, None, "from there on it is the same");
}

/// The changed constant matters only in the climb: the flight begins level, and differs once the end of the preview is
/// limited.
#[test]
fn a_wrong_constant_is_found_at_the_first_tick_that_it_matters() {
    let flight = flown(6.0, &[], &[]);
    let mut other = flight.0.clone();
    other.guidance.climb_limit_mps = 0.4;
    let plan = ReplayPlan { settings: Some((Topic::Reference, Box::new(other))), ..ReplayPlan::default() };
    let first = replay(&flight, &plan).first.unwrap();
    let down = |tick: usize| flight.1.references[tick].velocity_mps[2];
    assert_eq!((first.topic, first.differs.field.as_str()), (Topic::Reference, "preview[7].w_mps"));
    let ahead = (flight.0.guidance.preview_s / flight.0.sample_s()).round() as usize;
    let down_mps = down(first.tick as usize + ahead);
    assert!(first.tick > 0 && down_mps < -0.3, "at tick {}: {down_mps}", first.tick);
}

#[test]
fn one_node_replayed_alone_repeats_its_messages() {
    let flight = flown(2.0, &[fault(FaultTarget::State, FaultKind::Drop, 1.0)], &[]);
    for only in Topic::ALL {
        let replayed = replay(&flight, &ReplayPlan { only: Some(only), ..ReplayPlan::default() });
        assert!(replayed.first.is_none() && replayed.stopped.is_none());
        let of_tick = if only == Topic::State { 2 } else { 1 };
        let once = replayed.computed() / of_tick;
        assert!((201..=220).contains(&once), "{} messages of {only:?}", replayed.computed());
    }
    let mut lqr = flight.0.clone();
    lqr.attitude.law = Law::Lqr;
    let plan = ReplayPlan {
        only: Some(Topic::Controls),
        settings: Some((Topic::Controls, Box::new(lqr))),
        until: Some(50),
        ..ReplayPlan::default()
    };
    let replayed = replay(&flight, &plan);
    assert_eq!((replayed.computed(), replayed.different > 0), (51, true));
}

#[test]
fn a_log_that_lacks_a_message_replays_up_to_there_and_says_so() {
    let mut flight = flown(2.0, &[], &[]);
    flight.1.references.remove(100);
    let replayed = replayed(&flight);
    assert_eq!((replayed.first, replayed.last_tick), (None, 100));
    let why = replayed.stopped.unwrap();
    assert!(why.contains("the log lacks messages 101 to 101 of guidance 1"), "{why}");
    let read_on = read_on(&flight, &ReplayPlan::default());
    assert_eq!((read_on.last_tick, read_on.stopped), (100, Some(why)), "though the log goes on");
}

#[test]
fn a_changed_truth_is_a_difference() {
    let mut flight = flown(1.0, &[], &[]);
    flight.1.truths[50].actual.position_m[2] += 1e-9;
    flight.1.truths[50] = flight.1.truths[50].with_checksum();
    for replayed in [replayed(&flight), read_on(&flight, &ReplayPlan::default())] {
        let FirstDifference { tick, topic, differs, .. } = replayed.first.unwrap();
        assert_eq!((replayed.different, tick, topic), (1, 50, Topic::State));
        assert_eq!(differs.field, "truth.actual.position_m[2]");
    }
}

/// The mixer gets no CONTROLS for three ticks. With these ticks undone, the flight equals a flight without the stall.
#[test]
fn a_flight_without_its_only_stall_is_the_flight_that_had_none() {
    let stall = Fault::new(FaultTarget::AttitudeMpc, FaultKind::Stop, 0.5, Some(0.03));
    let (stalled, clean) = (flown(2.0, &[stall], &[]), flown(2.0, &[], &[]));
    let (recording, script) = recording(&stalled);
    let ticks: BTreeSet<u64> = disturbed(&recording, &script).iter().map(|one| one.tick).collect();
    assert_eq!(ticks, BTreeSet::from([50, 51, 52]));
    let mut truths = vec![];
    let replayed = replay_script(&recording, without(&recording, &script, &ticks), &ReplayPlan::default(), |record| {
        if let Record::Truth(truth) = record {
            truths.push((truth.actual, truth.actuators));
        }
    });
    assert_eq!(replayed.unwrap().stopped, None);
    let of = |log: &Log| log.truths.iter().map(|truth| (truth.actual, truth.actuators)).collect::<Vec<_>>();
    assert!(truths == of(&clean.1), "bit for bit");
    assert!(truths != of(&stalled.1), "it made a difference");
}

/// A mixer that slept answers to an old tick with the newest state, skips two ticks, and goes on.
#[test]
fn a_tick_can_be_undone_after_late_answers_to_earlier_ones() {
    let (recording, mut script) = recording(&flown(1.0, &[], &[]));
    let [plant, mixer] = [Topic::State, Topic::Actuators].map(|topic| script.process(topic, 1).unwrap());
    let processes = &mut script.processes;
    for cycle in &mut processes[plant].cycles {
        cycle.arrivals.retain(|(read, _)| !(50..53).contains(&read.key.tick));
    }
    processes[mixer].cycles.retain(|cycle| !(51..53).contains(&cycle.tick));
    let late = processes[mixer].cycles.iter_mut().find(|cycle| cycle.tick == 50).unwrap();
    late.inputs[Topic::State as usize].as_mut().unwrap().key.tick = 53;
    let ticks: Vec<u64> = disturbed(&recording, &script).iter().map(|one| one.tick).collect();
    assert_eq!(ticks, [50, 51, 52]);
    for undone in [&ticks[..1], &ticks[1..2], &ticks[2..], &ticks] {
        let mended = without(&recording, &script, &undone.iter().copied().collect());
        let replayed = replay_script(&recording, mended, &ReplayPlan::default(), |_| {}).unwrap();
        assert_eq!((replayed.stopped, replayed.last_tick), (None, 100), "without {undone:?}");
    }
}

#[test]
fn every_way_to_disturb_a_tick_is_seen_and_can_be_undone() {
    use FaultKind::*;
    use FaultTarget as Target;
    let flights = [
        (Target::State, Drop),
        (Target::Reference, Delay),
        (Target::Controls, Garbage),
        (Target::Actuators, Reorder),
        (Target::Mixer, Kill),
        (Target::Guidance, Hog),
    ];
    for (target, kind) in flights {
        let flight = flown(2.0, &[fault(target, kind, 0.5)], &[]);
        let (recording, script) = recording(&flight);
        let ticks: BTreeSet<u64> = disturbed(&recording, &script).iter().map(|one| one.tick).collect();
        assert!(
            ticks.iter().all(|tick| (50..75).contains(tick)) && !ticks.is_empty(),
            "{target:?} {kind:?}: {ticks:?}"
        );
        let mended = without(&recording, &script, &ticks);
        assert_eq!(
            disturbed(&recording, &mended).iter().filter(|one| !one.what.contains("a fault")).count(),
            0,
            "{target:?} {kind:?}"
        );
        assert_eq!(
            replay_script(&recording, mended, &ReplayPlan::default(), |_| {}).unwrap().stopped,
            None,
            "{target:?} {kind:?}"
        );
    }
}
