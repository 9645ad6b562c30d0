use super::*;
use contract::message::{Actuators, Message, Reference, State};
use contract::stamp::delivery;

/// Time of the injection, delay of the detection and delay of the recovery \[s\], as in [`FaultRecord`].
type Told = [Option<f64>; 3];

fn told(faults: &Faults) -> Told {
    let record = &faults.records(&[])[0];
    [record.injected_at_s, record.detected_after_s, record.recovered_after_s]
}

fn described(faults: &Faults, events: &[Event]) -> Vec<String> {
    faults.records(events).iter().map(FaultRecord::describe).collect()
}

/// Follows a fault that begins at 0.1 s through these messages at 100 Hz.
fn seen(target: FaultTarget, kind: FaultKind, for_s: Option<f64>, records: impl IntoIterator<Item = Record>) -> Faults {
    let mut faults = Faults::new(&[Fault::new(target, kind, 0.1, for_s)], 100);
    records.into_iter().for_each(|record| faults.observe(&record));
    faults
}

fn at<M: Message>(tick: u64, mut message: M) -> M {
    message.stamp_mut().tick = tick;
    message
}

fn solve(tick: u64, status: SolveStatus) -> Record {
    at(tick, Controls { status: status as u64, ..Controls::default() }).into()
}

/// Follows a solver fault through CONTROLS from tick 0 on; `runs` are numbers of ticks and the status of these.
fn solver(for_s: Option<f64>, runs: &[(usize, SolveStatus)]) -> Faults {
    let statuses = runs.iter().flat_map(|(count, status)| std::iter::repeat_n(*status, *count));
    let records = (0..).zip(statuses).flat_map(|(tick, s)| [at(tick, State::default()).into(), solve(tick, s)]);
    seen(FaultTarget::Mpc, FaultKind::IterationCap, for_s, records)
}

/// Case: name, duration of the fault \[s\], statuses, expected times and expected words.
type Case<'a> = (&'a str, Option<f64>, &'a [(usize, SolveStatus)], Told, &'a str);

#[test]
fn a_fault_is_followed_from_its_first_tick_to_the_recovery() {
    use SolveStatus::{BadInput, Explicit, Fallback, LimitReached, Solved};
    let line = |rest: &str| format!("mpc iteration-cap {rest}");
    let at_once = Some(0.1);
    #[rustfmt::skip]
    let cases: [Case; 9] = [
        ("struck on ticks 10 to 12, seen from 11, healthy again on 15", Some(0.03),
            &[(10, Explicit), (1, Solved), (2, LimitReached), (2, Fallback), (20, Explicit)],
            [at_once, Some(0.01), Some(0.02)], "from 0.10 s for 0.03 s: detected after 0.01 s, recovered after 0.02 s"),
        ("harm before the fault is not its doing", Some(0.02),
            &[(5, BadInput), (5, Explicit), (2, Fallback), (5, Explicit)],
            [at_once, Some(0.0), Some(0.0)], "from 0.10 s for 0.02 s: detected after 0.00 s, recovered after 0.00 s"),
        ("a good tick within the fault is no recovery", Some(0.03),
            &[(10, Explicit), (1, Fallback), (1, Solved), (2, Fallback), (1, Solved)],
            [at_once, Some(0.0), Some(0.01)], "from 0.10 s for 0.03 s: detected after 0.00 s, recovered after 0.01 s"),
        ("what is detected after the end recovers after the detection", Some(0.01),
            &[(13, Explicit), (1, Fallback), (3, Explicit)],
            [at_once, Some(0.03), Some(0.03)], "from 0.10 s for 0.01 s: detected after 0.03 s, recovered after 0.03 s"),
        ("the flight ended first", Some(0.01), &[(10, Explicit)], [None; 3], "at 0.1 s: never struck"),
        ("without end", None, &[(10, Explicit), (20, Fallback), (20, Explicit)],
            [at_once, Some(0.0), None], "from 0.10 s to the end: detected after 0.00 s, not recovered"),
        ("harmless", Some(0.05), &[(30, Explicit)],
            [at_once, None, None], "from 0.10 s for 0.05 s: not detected"),
        ("harm long after its end", Some(0.05), &[(80, Explicit), (5, Fallback)],
            [at_once, None, None], "from 0.10 s for 0.05 s: not detected"),
        ("empty", Some(0.0), &[(30, Fallback)], [None; 3], "at 0.1 s: never struck"),
    ];
    for (what, for_s, runs, expected, words) in cases {
        let faults = solver(for_s, runs);
        assert_eq!((told(&faults), described(&faults, &[])), (expected, vec![line(words)]), "{what}");
    }
    let plain = &solver(Some(0.03), &[(30, Explicit)]).records(&[])[0];
    assert_eq!((plain.target, plain.kind), (FaultTarget::Mpc, FaultKind::IterationCap));
    assert_eq!((plain.at_s, plain.for_s, plain.ended_at_s), (0.1, Some(0.03), Some(0.13)));
}

#[test]
fn harm_on_missed_ticks_counts_from_the_next_tick_seen() {
    let records =
        [(9, SolveStatus::Explicit), (12, SolveStatus::Fallback), (20, SolveStatus::Solved)].map(|(t, s)| solve(t, s));
    let faults = seen(FaultTarget::Mpc, FaultKind::Nan, Some(0.05), records);
    assert_eq!(told(&faults), [Some(0.1), Some(0.02), Some(0.05)]);
}

#[test]
fn a_fault_that_comes_or_ends_while_flying_is_followed_too() {
    let scripted = Fault::new(FaultTarget::Wind, FaultKind::Step, 0.0, None);
    let given = Fault::new(FaultTarget::Mpc, FaultKind::Nan, 0.1, Some(0.5));
    let mut faults = Faults::new(&[scripted], 100);
    for tick in 0..30 {
        match tick {
            8 => faults.follow(&[scripted, given]),
            18 => faults.follow(&[scripted, Fault { for_s: Some(0.1), ..given }]),
            _ => {}
        }
        let harmed = (10..20).contains(&tick);
        faults.observe(&solve(tick, if harmed { SolveStatus::Fallback } else { SolveStatus::Explicit }));
    }
    let line = "mpc nan from 0.10 s for 0.1 s: detected after 0.00 s, recovered after 0.00 s";
    assert_eq!(described(&faults, &[])[1], line);
}

/// Times of a fault from 0.1 s to 0.15 s in these messages.
fn short(target: FaultTarget, kind: FaultKind, records: &[Record]) -> Told {
    told(&seen(target, kind, Some(0.05), records.iter().copied()))
}

/// ACTUATORS of 30 ticks; those of `flagged` bear `flags`.
fn commands(flagged: std::ops::Range<u64>, flags: u64) -> Vec<Record> {
    let flags = |tick| if flagged.contains(&tick) { flags } else { 0 };
    (0..30).map(|tick| at(tick, Actuators { flags: flags(tick), ..Actuators::default() }).into()).collect()
}

/// Messages of 30 ticks; those of `lost` bear the mark of a fault.
fn marked<M: Message + Into<Record>>(lost: std::ops::Range<u64>) -> Vec<Record> {
    let of = |tick| {
        let mut message = at(tick, M::default());
        message.stamp_mut().delivery = if lost.contains(&tick) { delivery::FAULT } else { delivery::DELIVERED };
        message.into()
    };
    (0..30).map(of).collect()
}

#[test]
fn a_silent_process_is_detected() {
    let kill = |away: std::ops::Range<u64>| {
        let mut there = marked::<Controls>(0..0);
        there.retain(|record| !away.contains(&record.tick()));
        short(FaultTarget::AttitudeMpc, FaultKind::Kill, &[there, commands(0..0, 0)].concat())
    };
    assert_eq!(kill(11..20), [Some(0.1), Some(0.01), Some(0.09)]);
    assert_eq!(kill(11..40), [Some(0.1), Some(0.01), None], "no process came back");
    assert_eq!(kill(0..0), [Some(0.1), None, None]);
    assert_eq!(kill(3..6), [Some(0.1), None, None], "before the fault");
}

#[test]
fn a_lost_message_is_detected_by_the_next_node_in_either_order() {
    let drop = |records: [&[Record]; 2]| short(FaultTarget::Controls, FaultKind::Drop, &records.concat());
    let (lost, held) = (marked::<Controls>(11..13), commands(12..16, mixer_flags::HELD));
    let expected = [Some(0.11), Some(0.01), Some(0.03)];
    assert_eq!([drop([&lost, &held]), drop([&held, &lost])], [expected; 2]);
    let limits = commands(12..16, mixer_flags::ROTOR_SATURATED);
    assert_eq!(drop([&lost, &limits]), [Some(0.11), None, None], "a limit is no reaction");
    let references = marked::<Reference>(11..13);
    let unheard = |tick| if (11..13).contains(&tick) { SolveStatus::NoReference } else { SolveStatus::Explicit };
    let solves: Vec<_> = (0..30).map(|tick| solve(tick, unheard(tick))).collect();
    let records = [references, solves, commands(0..0, 0)].concat();
    assert_eq!(short(FaultTarget::Reference, FaultKind::Drop, &records), [Some(0.11), Some(0.0), Some(0.0)]);
}

#[test]
fn a_lost_command_is_detected_by_the_plant_without_a_new_one() {
    let obeying =
        |tick: u64| at(tick, State { applied_sequence: tick.min(11).max(tick / 16 * tick), ..State::default() });
    let states = (0..30).map(|tick| obeying(tick).into()).collect();
    let records = [states, marked::<Actuators>(11..14)].concat();
    assert_eq!(short(FaultTarget::Actuators, FaultKind::Burst, &records), [Some(0.11), Some(0.01), Some(0.02)]);
}

#[test]
fn faults_of_sensors_and_rotors_act_at_their_time() {
    let blind = commands(13..17, mixer_flags::TRIM_ONLY);
    assert_eq!(short(FaultTarget::Rates, FaultKind::Off, &blind), [Some(0.1), Some(0.03), Some(0.02)]);
    assert_eq!(short(FaultTarget::Rotor2, FaultKind::Off, &blind), [Some(0.1), None, None]);
    let over = commands(16..30, mixer_flags::TERMINATED | mixer_flags::CUT);
    assert_eq!(short(FaultTarget::Rotor2, FaultKind::Off, &over), [Some(0.1), Some(0.06), None]);
    assert_eq!(short(FaultTarget::Wind, FaultKind::Gust, &over), [Some(0.1), None, None], "no message shows wind");
}

#[test]
fn a_process_replaced_before_a_message_is_missing_is_detected_by_its_exit() {
    let mut faults = Faults::new(&[Fault::new(FaultTarget::Mixer, FaultKind::Kill, 0.1, None)], 100);
    (0..40).for_each(|tick| faults.observe(&at(tick, Actuators::default()).into()));
    let event = |tick, node: &str, epoch, what| Event::new(tick, node, epoch, what);
    let events = [
        event(3, "mixer", 9, What::Died), // before the fault
        event(9, "mixer", 4, What::Started).begins(Some(0)),
        event(10, "guidance", 1, What::Died),
        event(10, "mixer", 4, What::Died), // a candidate
        event(10, "mixer", 1, What::Died),
        event(11, "mixer", 5, What::TookOver),
    ];
    let line = "mixer kill at 0.10 s: detected after 0.00 s, recovered after 0.01 s";
    assert_eq!(described(&faults, &events), [line]);
    assert_eq!(described(&faults, &events[..4]), ["mixer kill at 0.10 s: not detected"]);
    assert_eq!(described(&faults, &events[..5]), ["mixer kill at 0.10 s: detected after 0.00 s, not recovered"]);
}
