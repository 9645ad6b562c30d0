use super::*;
use contract::guard::{Guard, Refusal};
use contract::message::{ActuationMsg, Actuators, Controls, Reference, Stamp};
use settings::FaultTarget;

/// Sends CONTROLS of ticks 0 to 39 under one fault from tick 10 to 29, and returns the arrivals with their ticks.
fn arrivals(kind: FaultKind, size: impl Fn(&mut Fault)) -> Vec<(u64, Controls)> {
    let mut fault = Fault::new(FaultTarget::Controls, kind, 0.1, Some(0.2));
    size(&mut fault);
    let faults = vec![Fault::new(FaultTarget::State, FaultKind::Drop, 0.0, None), fault];
    let scenario = Scenario { fault: faults, ..Scenario::default() };
    let mut link = Link::new(&scenario);
    let schedule = schedule(&scenario);
    let mut all = vec![];
    for tick in 0..40 {
        let mut marked = 0;
        link.pass(tick, &demand(tick), &schedule, |message| match message.stamp.delivery {
            delivery::DELIVERED => all.push((tick, *message)),
            _ => marked += u64::from(message.is_intact()), // a corrupted message may be marked by chance
        });
        assert!(marked <= 1, "what was meant is shown once");
    }
    all
}

fn schedule(scenario: &Scenario) -> FaultSchedule<Fault> {
    FaultSchedule::new(scenario, |_, fault| Some(*fault))
}

fn demand(tick: u64) -> Controls {
    let stamp = Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() };
    Controls { stamp, demand: [0.1; 4], ..Controls::default() }.with_checksum()
}

/// Returns for each arrival its tick and the number of its sample.
fn numbers(all: &[(u64, Controls)]) -> Vec<(u64, u64)> {
    all.iter().map(|(tick, message)| (*tick, message.stamp.sequence - 1)).collect()
}

/// Returns the results of a guard for the messages that arrive on ticks 10 to 29.
fn judged(all: &[(u64, Controls)]) -> Vec<Result<(), Refusal>> {
    let mut guard = Guard::default();
    let judge = |(tick, message): &(u64, Controls)| (*tick, guard.take(message, 1, *tick + 1));
    all.iter().map(judge).filter(|(tick, _)| (10..30).contains(tick)).map(|(_, verdict)| verdict).collect()
}

fn on_time() -> Vec<(u64, u64)> {
    (0..40).map(|tick| (tick, tick)).collect()
}

#[test]
fn without_a_fault_everything_arrives_as_it_was_sent() {
    let all = arrivals(FaultKind::Drop, |fault| fault.for_s = Some(0.0));
    assert_eq!(numbers(&all), on_time());
    assert!(all.iter().all(|(tick, message)| *message == demand(*tick)));
}

#[test]
fn lost_messages_do_not_arrive() {
    let lost = |all: &[(u64, Controls)]| {
        let arrived = numbers(all);
        (0..40).filter(|tick| !arrived.contains(&(*tick, *tick))).collect::<Vec<u64>>()
    };
    let dropped = lost(&arrivals(FaultKind::Drop, |_| {}));
    assert!((3..=17).contains(&dropped.len()) && dropped.iter().all(|tick| (10..30).contains(tick)), "{dropped:?}");
    assert_eq!(dropped, lost(&arrivals(FaultKind::Drop, |_| {})), "the same every time");
    assert_eq!(lost(&arrivals(FaultKind::Drop, |fault| fault.probability = Some(1.0))), (10..30).collect::<Vec<_>>());
    assert_eq!(lost(&arrivals(FaultKind::Burst, |fault| fault.count = Some(4))), [10, 11, 12, 13]);
    let kept =
        |all: &[(u64, Controls)]| numbers(all).into_iter().filter(|(t, _)| (10..30).contains(t)).collect::<Vec<_>>();
    let slow = kept(&arrivals(FaultKind::Rate, |fault| fault.count = Some(8)));
    assert_eq!(slow, [(10, 10), (18, 18), (26, 26)]);
}

#[test]
fn late_messages_arrive_whole_ticks_later() {
    let all = numbers(&arrivals(FaultKind::Delay, |fault| fault.ms = Some(11.0)));
    let expected: Vec<(u64, u64)> = (0..40).filter(|t| ![10, 11].contains(t)).map(|t| (t, t)).collect();
    let expected = expected.into_iter().flat_map(|(t, n)| match t {
        12..30 => vec![(t, n - 2)],
        30 | 31 => vec![(t, n - 2), (t, n)],
        _ => vec![(t, n)],
    });
    assert_eq!(all, expected.collect::<Vec<_>>());
}

#[test]
fn messages_can_arrive_twice_or_in_the_wrong_order() {
    let twice = numbers(&arrivals(FaultKind::Duplicate, |_| {}));
    assert_eq!(twice.len(), 60);
    assert!(judged(&arrivals(FaultKind::Duplicate, |_| {})).contains(&Err(Refusal::Order)));
    let turned = numbers(&arrivals(FaultKind::Reorder, |fault| fault.probability = Some(1.0)));
    assert_eq!(turned.len(), 40);
    assert_eq!(turned[10..14], [(11, 11), (11, 10), (13, 13), (13, 12)]);
    assert!(judged(&arrivals(FaultKind::Reorder, |_| {})).contains(&Err(Refusal::Order)));
}

#[test]
fn bad_contents_are_refused_for_the_right_reason() {
    let all_but = |kind, allowed: &[Result<(), Refusal>]| {
        let verdicts = judged(&arrivals(kind, |_| {}));
        // A few corrupt messages do not count as delivered, because bits of their `delivery` were flipped.
        assert!(verdicts.len() == 20 || kind == FaultKind::Corrupt && verdicts.len() > 15);
        assert!(verdicts.iter().all(|verdict| allowed.contains(verdict)), "{kind:?}: {verdicts:?}");
    };
    all_but(FaultKind::Garbage, &[Err(Refusal::Range)]);
    // The accepted messages name the sample of ten ticks ago, so that their receiver treats them as old.
    all_but(FaultKind::Stale, &[Err(Refusal::Age), Ok(())]);
    assert!(arrivals(FaultKind::Stale, |_| {}).iter().all(|(t, m)| !(10..30).contains(t) || m.stamp.tick + 10 == *t));
    all_but(FaultKind::Corrupt, &Refusal::ALL.map(Err));
}

#[test]
fn messages_of_a_standby_stay_marked_under_any_fault() {
    for kind in [FaultKind::Drop, FaultKind::Garbage, FaultKind::Delay, FaultKind::Reorder] {
        let fault = Fault { probability: Some(1.0), ..Fault::new(FaultTarget::Controls, kind, 0.0, None) };
        let scenario = Scenario { fault: vec![fault], ..Scenario::default() };
        let mut link = Link::new(&scenario);
        let mut marks = vec![];
        for tick in 0..10 {
            let mut message = demand(tick);
            message.stamp.delivery = delivery::STANDBY;
            link.pass(tick, &message.with_checksum(), &schedule(&scenario), |message| {
                marks.push(message.stamp.delivery);
            });
        }
        let struck = delivery::STANDBY | delivery::FAULT;
        assert!(marks.iter().all(|mark| [delivery::STANDBY, struck].contains(mark)), "{kind:?}: {marks:?}");
        assert!(marks.contains(&struck), "{kind:?}");
    }
}

#[test]
fn reordered_messages_are_not_lost() {
    let fault = Fault::new(FaultTarget::Controls, FaultKind::Reorder, 0.0, None);
    let scenario = Scenario { fault: vec![Fault { probability: Some(1.0), ..fault }], ..Scenario::default() };
    let mut link = Link::new(&scenario);
    let mut arrived = vec![];
    for tick in 0..6 {
        let heard = |message: &Controls| message.stamp.delivery == delivery::DELIVERED;
        link.pass(tick, &demand(tick), &schedule(&scenario), |message| {
            arrived.extend(heard(message).then_some(message.stamp.tick));
        });
    }
    assert_eq!(arrived, [1, 0, 3, 2, 5, 4]);
}

#[test]
fn a_fault_given_in_flight_has_the_effect_of_one_in_the_scenario() {
    let fault = Fault::new(FaultTarget::Controls, FaultKind::Drop, 0.1, Some(0.2));
    let arrived = |given: bool| -> Vec<(u64, u64)> {
        let scenario = Scenario { fault: if given { vec![] } else { vec![fault] }, ..Scenario::default() };
        let mut link = Link::new(&scenario);
        let mut schedule = schedule(&scenario);
        let mut all = vec![];
        for tick in 0..40 {
            if given && tick == 9 {
                schedule.apply_fault(0, &fault, Some(fault));
            }
            if tick == 24 {
                schedule.apply_fault(0, &Fault { for_s: Some(0.15), ..fault }, None);
            }
            link.pass(tick, &demand(tick), &schedule, |message| all.push((tick, message.stamp.delivery)));
        }
        all
    };
    assert_eq!(arrived(true), arrived(false));
    assert!(arrived(true).iter().all(|(tick, mark)| *mark == delivery::DELIVERED || (10..25).contains(tick)));
}

/// Passes a message through a link with a fault of kind `wrong`, and returns the result.
fn struck<M: Message>(message: M, how: Option<Wrong>, value: Option<f64>) -> M {
    let target = [FaultTarget::State, FaultTarget::Reference, FaultTarget::Controls, FaultTarget::Actuators];
    let fault = Fault { value, how, ..Fault::new(target[M::TOPIC as usize], FaultKind::Wrong, 0.0, None) };
    let scenario = Scenario { fault: vec![fault], ..Scenario::default() };
    let mut link = Link::new(&scenario);
    let mut heard = None;
    link.pass(0, &message.with_checksum(), &schedule(&scenario), |message| {
        if message.stamp().delivery == delivery::DELIVERED {
            heard = Some(*message);
        }
    });
    let heard = heard.expect("it arrives");
    assert!(heard.is_intact(), "the checksum does not show it");
    heard
}

#[test]
fn a_wrong_message_demands_something_else_and_nothing_more_is_changed() {
    let controls = Controls { demand: [-9.0, 0.1, 0.2, 0.0], disturbance: [1.0; 4], ..Controls::default() };
    let expected = |demand| Controls { demand, ..controls }.with_checksum();
    assert_eq!(struck(controls, None, None), expected([9.0, -0.1, -0.2, -0.0]), "the sign, unless told otherwise");
    assert_eq!(struck(controls, Some(Wrong::Scale), Some(2.0)), expected([-18.0, 0.2, 0.4, 0.0]));
    assert_eq!(struck(controls, Some(Wrong::Bias), Some(1.0)), expected([-8.0, 1.1, 1.2, 1.0]));

    let reference = Reference { position_m: [1.0; 3], w_mps: 0.5, attitude_rad: [0.1; 3], ..Reference::default() };
    let expected = Reference { w_mps: -0.5, attitude_rad: [-0.1; 3], rates_radps: [-0.0; 3], ..reference };
    assert_eq!(struck(reference, None, None), expected.with_checksum());

    let command = |rotor_speed, tilt_rad| ActuationMsg { rotor_speed, tilt_rad };
    let actuators = Actuators { command: command([5.0; 3], 0.1), flags: 3, ..Actuators::default() };
    let expected = Actuators { command: command([-5.0; 3], -0.1), ..actuators };
    assert_eq!(struck(actuators, Some(Wrong::Sign), None), expected.with_checksum());
}
