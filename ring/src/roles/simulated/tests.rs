use std::ops::Range;

use contract::message::{Controls, Message, Stamp, State};
use contract::stamp::delivery;
use settings::{Fault, FaultKind, FaultTarget, Mode, Run, Swap};

use contract::message::Truth;

use super::*;
use crate::event::What;
use crate::roles::supervised::given_up;

const CONTROLS: Topic = Topic::Controls;

fn scenario(fault: Vec<Fault>, swap: Vec<Swap>) -> Scenario {
    let run = Run { mode: Mode::Lockstep, ..Scenario::default().run };
    Scenario { run, fault, swap, ..Scenario::default() }
}

/// Returns the orders before each tick below `until`, with their ticks, when no message is sent.
fn steps(roles: &mut Simulated, until: u64) -> Vec<(u64, Order)> {
    steps_between(roles, 0..until)
}

fn steps_between(roles: &mut Simulated, ticks: Range<u64>) -> Vec<(u64, Order)> {
    ticks.flat_map(|tick| roles.begin(tick).into_iter().map(move |step| (tick, step))).collect()
}

fn told(roles: &Simulated) -> Vec<(u64, u32, What)> {
    roles.events.iter().map(|event| (event.tick, event.epoch, event.what)).collect()
}

fn begin(epoch: u32, origin: Option<usize>) -> Order {
    (CONTROLS, Action::Spawn(epoch, origin))
}

fn end(epoch: u32) -> Order {
    (CONTROLS, Action::Signal(epoch, Signal::Kill))
}

impl Simulated {
    /// Ends process `epoch` of attitude-mpc before it answers to `tick`.
    fn lost(&mut self, epoch: u32, tick: u64) {
        self.exited(CONTROLS, epoch, tick, RoleInput::Exited(epoch));
    }
}

#[test]
fn a_kill_takes_effect_on_its_tick_and_its_replacement_after_the_delays_of_the_settings() {
    let kill = |for_s| Fault::new(FaultTarget::AttitudeMpc, FaultKind::Kill, 0.1, for_s);
    for (for_s, tick) in [(None, 13), (Some(0.03), 16), (Some(0.3), 43)] {
        let mut roles = Simulated::new(&scenario(vec![kill(for_s)], vec![]));
        // The kill is seen after 2 ms. The next process is started then, or when the fault is over, and is ready 25 ms
        // later.
        let started = if for_s == Some(0.3) {
            40
        } else if for_s.is_some() {
            13
        } else {
            11
        };
        let expected = [(10, end(1)), (started, begin(2, None))];
        assert_eq!(steps(&mut roles, tick), expected, "for {for_s:?}");
        assert_eq!(roles.assignment(CONTROLS), Assignment::default());
        roles.begin(tick);
        assert_eq!(roles.assignment(CONTROLS), Assignment { active: 2, standby: 0 });
        let [died, started, took_over] = &told(&roles)[..] else { panic!("{:?}", told(&roles)) };
        assert_eq!((*died, started.2, *took_over), ((10, 1, What::Died), What::Started, (tick, 2, What::TookOver)));
    }
}

#[test]
fn a_process_that_stops_for_a_moment_goes_on() {
    let stop = Fault::new(FaultTarget::AttitudeMpc, FaultKind::Stop, 0.1, Some(0.02));
    let mut roles = Simulated::new(&scenario(vec![stop], vec![]));
    assert_eq!(steps(&mut roles, 12), []);
    assert_eq!(roles.assignment(CONTROLS).active, 0);
    assert_eq!(steps_between(&mut roles, 12..100), []);
    assert_eq!(roles.assignment(CONTROLS).active, 1);
    assert_eq!(told(&roles), []);
}

#[test]
fn a_process_that_hangs_is_replaced() {
    let stop = Fault::new(FaultTarget::AttitudeMpc, FaultKind::Hog, 0.1, None);
    let mut roles = Simulated::new(&scenario(vec![stop], vec![]));
    // The third sample without an answer, 12, is seen at 122 ms; the next process is ready at 147 ms.
    assert_eq!(steps(&mut roles, 15), [(13, end(1)), (13, begin(2, None))]);
    roles.begin(15);
    assert_eq!(roles.assignment(CONTROLS).active, 2);
    assert_eq!(told(&roles), [(12, 1, What::Hung), (12, 2, What::Started), (15, 2, What::TookOver)]);
}

#[test]
fn the_fourth_death_in_five_seconds_is_the_last() {
    let mut roles = Simulated::new(&Scenario::default());
    for (epoch, tick) in [(1, 100), (2, 200), (3, 300)] {
        roles.lost(epoch, tick);
        let begun = steps_between(&mut roles, tick + 1..tick + 50);
        assert!(matches!(begun[..], [(_, (CONTROLS, Action::Spawn(next, None)))] if next == epoch + 1), "{begun:?}");
    }
    roles.lost(4, 400);
    assert_eq!(steps_between(&mut roles, 401..5000), []);
    assert_eq!(given_up(&roles.nodes), Some("attitude-mpc"));
}

#[test]
fn nothing_changes_between_decisions() {
    let stop = Fault::new(FaultTarget::Mixer, FaultKind::Stop, 1.0, Some(0.5));
    let mut roles = Simulated::new(&scenario(vec![stop], vec![Swap::new(Topic::Reference, 2.0)]));
    roles.begin(0);
    assert_eq!(roles.next_decision(), 100);
    roles.begin(100);
    assert_eq!(roles.next_decision(), 101, "a process is stopped");
    steps_between(&mut roles, 101..160);
    assert_eq!(roles.next_decision(), 200);
}

/// Returns roles with a swap of attitude-mpc: standby from tick 10, active from 20, kept at 40.
fn swapping() -> Simulated {
    let swap = Swap { standby_s: 0.1, watch_s: 0.2, ..Swap::new(Topic::Controls, 0.1) };
    Simulated::new(&scenario(vec![], vec![swap]))
}

/// Returns the CONTROLS of `epoch` on `tick`.
fn demand(epoch: u32, tick: u64, lon_nm: f64) -> Record {
    let stamp = Stamp { tick, sequence: tick + 1, epoch: u64::from(epoch), ..Stamp::default() };
    Controls { stamp, demand: [0.0, lon_nm, 0.0, 0.0], ..Controls::default() }.with_checksum().into()
}

/// Returns the STATE of `tick`.
fn sample(tick: u64) -> State {
    State { stamp: Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() }, ..State::default() }
}

/// Flies `ticks` with answers of all working processes; epoch 2 demands `lon_nm(tick)`. Returns the orders.
fn fly(roles: &mut Simulated, ticks: Range<u64>, lon_nm: impl Fn(u64) -> f64) -> Vec<(u64, Order)> {
    let mut done = vec![];
    for tick in ticks {
        done.extend(roles.begin(tick).into_iter().map(|step| (tick, step)));
        roles.observe(&sample(tick).with_checksum().into());
        for epoch in roles.assignment(CONTROLS).epochs() {
            roles.observe(&demand(epoch, tick, if epoch == 2 { lon_nm(tick) } else { 0.1 }));
        }
    }
    done
}

#[test]
fn a_good_candidate_is_kept() {
    let mut roles = swapping();
    let done = fly(&mut roles, 0..60, |_| 0.1);
    assert_eq!(done, [(10, begin(2, Some(0))), (40, end(1))]);
    let story = [(10, 2, What::Started), (10, 2, What::OnStandby), (20, 2, What::TookOver), (40, 2, What::Kept)];
    assert_eq!(told(&roles), story);
    assert_eq!(roles.assignment(CONTROLS), Assignment { active: 2, standby: 0 });
    assert!(roles.events[3].why.as_ref().is_some_and(|why| why.starts_with("30 answers, at most 0.00 %")));
    roles.lost(2, 100);
    assert_eq!(roles.begin(110), [begin(3, Some(0))], "who comes after it is like it");
}

#[test]
fn a_candidate_that_differs_on_standby_is_rejected() {
    let mut roles = swapping();
    let done = fly(&mut roles, 0..60, |tick| if tick < 15 { 0.1 } else { 100.0 });
    assert_eq!(done, [(10, begin(2, Some(0))), (18, end(2))], "three ticks in a row");
    assert_eq!(told(&roles).last(), Some(&(18, 2, What::Rejected)));
    assert_eq!(roles.assignment(CONTROLS), Assignment { active: 1, standby: 0 });
}

#[test]
fn an_active_candidate_with_unusable_answers_is_returned() {
    let mut roles = swapping();
    fly(&mut roles, 0..60, |tick| if tick < 30 { 0.1 } else { f64::NAN });
    assert_eq!(told(&roles)[3..], [(33, 2, What::Returned), (33, 1, What::TookOver)]);
    assert!(roles.events[3].why.as_ref().is_some_and(|why| why.contains("cannot be used")));
    assert_eq!(roles.assignment(CONTROLS), Assignment { active: 1, standby: 0 });
}

#[test]
fn a_vehicle_that_tilts_under_a_candidate_gets_the_old_one_back() {
    let mut roles = swapping();
    fly(&mut roles, 0..25, |_| 0.1);
    let mut truth = Truth { tick: 25, ..Truth::default() };
    truth.actual.attitude_rad = [0.8, 0.0, 0.0];
    roles.begin(25);
    roles.observe(&truth.with_checksum().into());
    roles.observe(&sample(25).with_checksum().into());
    for epoch in [1, 2] {
        roles.observe(&demand(epoch, 25, 0.1));
    }
    roles.begin(26);
    assert_eq!(told(&roles)[3..], [(26, 2, What::Returned), (26, 1, What::TookOver)]);
}

#[test]
fn lost_answers_of_a_candidate_count_as_missing() {
    let mut roles = swapping();
    for tick in 0..60 {
        roles.begin(tick);
        roles.observe(&sample(tick).with_checksum().into());
        let Record::Controls(mut meant) = demand(2, tick, 0.1) else { unreachable!("a demand") };
        meant.stamp.delivery = delivery::STANDBY | delivery::FAULT;
        roles.observe(&meant.with_checksum().into());
        roles.observe(&demand(1, tick, 0.1));
    }
    assert_eq!(told(&roles).last(), Some(&(13, 2, What::Rejected)), "all that it said was lost");
}

#[test]
fn a_candidate_that_dies_leaves_the_role_to_the_old_one() {
    for (at, ending) in [(15, What::Rejected), (30, What::Returned)] {
        let mut roles = swapping();
        fly(&mut roles, 0..at, |_| 0.1);
        roles.lost(2, at);
        assert_eq!(fly(&mut roles, at + 1..100, |_| 0.1), [], "{at}: nobody is missing");
        assert_eq!(roles.assignment(CONTROLS), Assignment { active: 1, standby: 0 }, "{at}");
        assert!(told(&roles).contains(&(at, 2, ending)), "{at}: {:?}", told(&roles));
    }
}

#[test]
fn a_trial_goes_on_when_the_old_one_dies() {
    for at in [15, 30] {
        let mut good = swapping();
        fly(&mut good, 0..at, |_| 0.1);
        good.lost(1, at);
        assert_eq!(fly(&mut good, at + 1..100, |_| 0.1), [], "{at}: nobody is missing, nobody is to go");
        assert_eq!(good.assignment(CONTROLS), Assignment { active: 2, standby: 0 }, "{at}");
        assert_eq!(told(&good).last(), Some(&(40, 2, What::Kept)), "{at}");

        let mut wrong = swapping();
        fly(&mut wrong, 0..at, |_| 0.1);
        wrong.lost(1, at);
        let done = fly(&mut wrong, at + 1..100, |_| f64::NAN);
        let gone = at + 4;
        let expected = [(gone, end(2)), (gone, begin(3, None))];
        assert_eq!(done, expected, "{at}: one like the old one comes");
        assert!(told(&wrong).contains(&(gone, 2, What::Returned)), "{at}: {:?}", told(&wrong));
    }
}

#[test]
fn a_tick_that_both_processes_miss_does_not_count_against_the_candidate() {
    let mut roles = swapping();
    for tick in 0..60 {
        roles.begin(tick);
        if tick % 7 > 0 {
            roles.observe(&sample(tick).with_checksum().into()); // the plant sleeps on every seventh tick
        }
        for epoch in roles.assignment(CONTROLS).epochs().filter(|_| tick % 7 > 0 && !(12..18).contains(&tick)) {
            roles.observe(&demand(epoch, tick, 0.1));
        }
    }
    assert_eq!(told(&roles).last(), Some(&(40, 2, What::Kept)));
}

#[test]
fn a_swap_during_a_trial_is_rejected_and_one_after_it_begins() {
    let swap = |at_s| Swap { standby_s: 0.1, watch_s: 0.2, ..Swap::new(Topic::Controls, at_s) };
    let mut roles = Simulated::new(&scenario(vec![], vec![swap(0.1), swap(0.2), swap(0.7)]));
    fly(&mut roles, 0..50, |_| 0.1);
    assert!(told(&roles).contains(&(20, 2, What::Rejected)), "the second; the first goes on");
    assert_eq!(told(&roles).last(), Some(&(40, 2, What::Kept)));
    roles.lost(2, 60);
    let begun = [(61, begin(3, Some(0))), (70, begin(4, Some(2)))];
    assert_eq!(fly(&mut roles, 61..72, |_| 0.1), begun);
}
