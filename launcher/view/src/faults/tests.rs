use super::*;
use contract::message::{Actuators, Message, State};
use contract::stamp::delivery;

/// A solver fault at 0.1 s, after CONTROLS of these statuses, one per tick from 0 on.
fn flown(for_s: Option<f64>, statuses: &[SolveStatus]) -> Faults {
    let fault = Fault::new(FaultTarget::Mpc, FaultKind::IterationCap, 0.1, for_s);
    let mut faults = Faults::new(&[fault], 100);
    for (tick, status) in statuses.iter().enumerate() {
        faults.observe(&at(tick as u64, State::default()).into());
        faults.observe(&at(tick as u64, Controls { status: *status as u64, ..Controls::default() }).into());
    }
    faults
}

fn at<M: Message>(tick: u64, mut message: M) -> M {
    message.stamp_mut().tick = tick;
    message
}

/// Statuses in runs: so many ticks of each.
fn runs(runs: &[(usize, SolveStatus)]) -> Vec<SolveStatus> {
    runs.iter().flat_map(|(count, status)| std::iter::repeat_n(*status, *count)).collect()
}

#[test]
fn a_fault_is_followed_from_its_first_tick_to_the_recovery() {
    use SolveStatus::{Explicit, Fallback, LimitReached, Solved};
    // Struck on ticks 10 to 12, seen from 11, healthy again on 15.
    let statuses = runs(&[(10, Explicit), (1, Solved), (2, LimitReached), (2, Fallback), (20, Explicit)]);
    let faults = flown(Some(0.03), &statuses);
    let expected = json!([{
        "target": "mpc", "kind": "iteration-cap", "at_s": 0.1, "for_s": 0.03,
        "injected_at_s": 0.1, "ended_at_s": 0.13, "detected_after_s": 0.01, "recovered_after_s": 0.02,
    }]);
    assert_eq!(faults.to_json(), expected);
    let line = "mpc iteration-cap from 0.10 s for 0.03 s: detected after 0.01 s, recovered after 0.02 s";
    assert_eq!(faults.describe(), [line]);
}

#[test]
fn harm_before_the_fault_is_not_its_doing() {
    use SolveStatus::{BadInput, Explicit, Fallback};
    let faults = flown(Some(0.02), &runs(&[(5, BadInput), (5, Explicit), (2, Fallback), (5, Explicit)]));
    let json = &faults.to_json()[0];
    assert_eq!([&json["detected_after_s"], &json["recovered_after_s"]], [0.0, 0.0]);
}

#[test]
fn a_good_tick_within_the_fault_is_no_recovery() {
    use SolveStatus::{Explicit, Fallback, Solved};
    let faults = flown(Some(0.03), &runs(&[(10, Explicit), (1, Fallback), (1, Solved), (2, Fallback), (1, Solved)]));
    assert_eq!(faults.to_json()[0]["recovered_after_s"], 0.01);
}

#[test]
fn what_is_detected_after_the_end_recovers_after_the_detection() {
    use SolveStatus::{Explicit, Fallback};
    let faults = flown(Some(0.01), &runs(&[(13, Explicit), (1, Fallback), (3, Explicit)]));
    let json = &faults.to_json()[0];
    assert_eq!([&json["detected_after_s"], &json["recovered_after_s"]], [0.03, 0.03]);
}

#[test]
fn what_never_happened_is_null() {
    use SolveStatus::{Explicit, Fallback};
    let keys = ["injected_at_s", "detected_after_s", "recovered_after_s"];
    let of = |faults: &Faults| keys.map(|key| faults.to_json()[0][key].as_f64());
    let early_end = flown(Some(0.01), &runs(&[(10, Explicit)]));
    assert_eq!(of(&early_end), [None; 3]);
    assert_eq!(early_end.describe(), ["mpc iteration-cap at 0.1 s: never struck"]);
    let endless = flown(None, &runs(&[(10, Explicit), (20, Fallback), (20, Explicit)]));
    assert_eq!(of(&endless), [Some(0.1), Some(0.0), None]);
    let line = "mpc iteration-cap from 0.10 s to the end: detected after 0.00 s, not recovered";
    assert_eq!(endless.describe(), [line]);
    let harmless = flown(Some(0.05), &runs(&[(30, Explicit)]));
    assert_eq!(of(&harmless), [Some(0.1), None, None]);
    assert_eq!(harmless.describe(), ["mpc iteration-cap from 0.10 s for 0.05 s: no message shows harm"]);
    let empty = flown(Some(0.0), &runs(&[(30, Fallback)]));
    assert_eq!(of(&empty), [None; 3]);
}

#[test]
fn missed_ticks_count_as_the_next_one_seen() {
    let fault = Fault::new(FaultTarget::Mpc, FaultKind::Nan, 0.1, Some(0.05));
    let mut faults = Faults::new(&[fault], 100);
    for (tick, status) in [(9, SolveStatus::Explicit), (12, SolveStatus::Fallback), (20, SolveStatus::Solved)] {
        faults.observe(&at(tick, Controls { status: status as u64, ..Controls::default() }).into());
    }
    let json = &faults.to_json()[0];
    assert_eq!([&json["injected_at_s"], &json["detected_after_s"], &json["recovered_after_s"]], [0.1, 0.02, 0.05]);
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
        let status = if (10..20).contains(&tick) { SolveStatus::Fallback } else { SolveStatus::Explicit } as u64;
        faults.observe(&at(tick, Controls { status, ..Controls::default() }).into());
    }
    let line = "mpc nan from 0.10 s for 0.1 s: detected after 0.00 s, recovered after 0.00 s";
    assert_eq!(faults.describe()[1], line);
}

/// A fault from 0.1 s to 0.15 s after these messages.
fn seen(target: FaultTarget, kind: FaultKind, records: &[Record]) -> Vec<Option<f64>> {
    let mut faults = Faults::new(&[Fault::new(target, kind, 0.1, Some(0.05))], 100);
    for record in records {
        faults.observe(record);
    }
    let keys = ["injected_at_s", "detected_after_s", "recovered_after_s"];
    keys.map(|key| faults.to_json()[0][key].as_f64()).into()
}

/// ACTUATORS of 30 ticks; those of `flagged` bear `flags`.
fn commands(flagged: std::ops::Range<u64>, flags: u64) -> Vec<Record> {
    let of =
        |tick| at(tick, Actuators { flags: if flagged.contains(&tick) { flags } else { 0 }, ..Actuators::default() });
    (0..30).map(|tick| of(tick).into()).collect()
}

/// CONTROLS of 30 ticks; those of `lost` bear the mark of a fault.
fn demands(lost: std::ops::Range<u64>) -> Vec<Record> {
    let of = |tick| {
        let mut demand = at(tick, Controls::default());
        demand.stamp.delivery = if lost.contains(&tick) { delivery::FAULT } else { delivery::DELIVERED };
        demand.into()
    };
    (0..30).map(of).collect()
}

#[test]
fn a_process_is_missed_by_its_silence() {
    let kill = |away: std::ops::Range<u64>| {
        let there: Vec<Record> = (0..30)
            .filter(|tick| !away.contains(tick))
            .filter_map(|tick| demands(0..0).get(tick as usize).copied())
            .collect();
        seen(FaultTarget::AttitudeMpc, FaultKind::Kill, &[there, commands(0..0, 0)].concat())
    };
    assert_eq!(kill(11..20), [Some(0.1), Some(0.01), Some(0.09)]);
    assert_eq!(kill(11..40), [Some(0.1), Some(0.01), None], "no process came back");
    assert_eq!(kill(0..0), [Some(0.1), None, None]);
    assert_eq!(kill(3..6), [Some(0.1), None, None], "before the fault");
}

#[test]
fn a_lost_message_is_seen_by_what_the_next_station_does_in_either_order() {
    let (lost, held) = (demands(11..13), commands(12..16, mixer_flags::HELD));
    let expected = [Some(0.11), Some(0.01), Some(0.03)];
    assert_eq!(seen(FaultTarget::Controls, FaultKind::Drop, &[lost.clone(), held.clone()].concat()), expected);
    assert_eq!(seen(FaultTarget::Controls, FaultKind::Drop, &[held, lost.clone()].concat()), expected);
    let limits = commands(12..16, mixer_flags::ROTOR_SATURATED);
    let unseen = seen(FaultTarget::Controls, FaultKind::Drop, &[lost, limits].concat());
    assert_eq!(unseen, [Some(0.11), None, None], "a limit is no reaction");
}

#[test]
fn a_lost_command_is_seen_by_the_plant_that_has_no_new_one() {
    let obeying =
        |tick: u64| at(tick, State { applied_sequence: tick.min(11).max(tick / 16 * tick), ..State::default() });
    let states = (0..30).map(|tick| obeying(tick).into());
    let lost = demands(11..14).into_iter().map(|demand| {
        let mut command = at(demand.stamp().tick, Actuators::default());
        command.stamp.delivery = demand.stamp().delivery;
        command.into()
    });
    let records: Vec<Record> = states.chain(lost).collect();
    assert_eq!(seen(FaultTarget::Actuators, FaultKind::Burst, &records), [Some(0.11), Some(0.01), Some(0.02)]);
}

#[test]
fn sensors_and_rotors_are_struck_by_the_clock() {
    let blind = commands(13..17, mixer_flags::TRIM_ONLY);
    assert_eq!(seen(FaultTarget::Rates, FaultKind::Off, &blind), [Some(0.1), Some(0.03), Some(0.02)]);
    assert_eq!(seen(FaultTarget::Rotor2, FaultKind::Off, &blind), [Some(0.1), None, None]);
    let over = commands(16..30, mixer_flags::TERMINATED | mixer_flags::CUT);
    assert_eq!(seen(FaultTarget::Rotor2, FaultKind::Off, &over), [Some(0.1), Some(0.06), None]);
    assert_eq!(seen(FaultTarget::Wind, FaultKind::Gust, &over), [Some(0.1), None, None], "no message shows wind");
}

#[test]
fn lost_references_show_in_controls() {
    let fault = Fault::new(FaultTarget::Reference, FaultKind::Drop, 0.1, Some(0.02));
    let mut faults = Faults::new(&[fault], 100);
    for tick in 0..20 {
        let lost = (10..12).contains(&tick);
        let mut reference = at(tick, contract::message::Reference::default());
        reference.stamp.delivery = if lost { delivery::FAULT } else { delivery::DELIVERED };
        let status = if lost { SolveStatus::NoReference } else { SolveStatus::Explicit } as u64;
        faults.observe(&reference.into());
        faults.observe(&at(tick, Controls { status, ..Controls::default() }).into());
        faults.observe(&at(tick, Actuators::default()).into());
    }
    let json = &faults.to_json()[0];
    assert_eq!([&json["detected_after_s"], &json["recovered_after_s"]], [0.0, 0.0]);
}
