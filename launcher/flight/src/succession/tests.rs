use std::ops::Range;

use contract::message::{Controls, Message, Stamp, State};
use contract::scenario::{Fault, FaultKind, FaultTarget, Swap, SwapNode};
use contract::stamp::delivery;

use super::*;

const CONTROLS: Topic = Topic::Controls;

fn scenario(fault: Vec<Fault>, swap: Vec<Swap>) -> Scenario {
    Scenario { fault, swap, ..Scenario::default() }
}

/// What `succession` does before each tick up to `until`, by tick, when nobody says anything.
fn steps(succession: &mut Succession, until: u64) -> Vec<(u64, Step)> {
    (0..until).flat_map(|tick| succession.begin(tick).into_iter().map(move |step| (tick, step))).collect()
}

fn told(succession: &Succession) -> Vec<(u64, u32, What)> {
    succession.events.iter().map(|event| (event.tick, event.epoch, event.what)).collect()
}

#[test]
fn a_scripted_death_takes_effect_on_its_tick_and_so_does_the_replacement() {
    let kill = Fault::new(FaultTarget::AttitudeMpc, FaultKind::Kill, 0.1, Some(0.03));
    let mut succession = Succession::new(&scenario(vec![kill], vec![]));
    assert_eq!(steps(&mut succession, 12), [(10, Step::End(CONTROLS, 1))]);
    assert_eq!(succession.assignment(CONTROLS), Assignment::default());
    assert_eq!(succession.begin(13), [Step::Begin(CONTROLS, 2, None)]);
    assert_eq!(succession.assignment(CONTROLS), Assignment { active: 2, standby: 0 });
    assert_eq!(told(&succession), [(10, 1, What::Killed), (13, 2, What::Started), (13, 2, What::TookOver)]);
}

#[test]
fn who_hangs_for_a_moment_goes_on() {
    let stop = Fault::new(FaultTarget::Mixer, FaultKind::Stop, 0.1, Some(0.02));
    let mut succession = Succession::new(&scenario(vec![stop], vec![]));
    assert_eq!(steps(&mut succession, 20), []);
    assert_eq!(told(&succession), [(10, 1, What::Hung), (12, 1, What::TookOver)]);
}

#[test]
fn the_fourth_death_in_five_seconds_is_the_last() {
    let mut succession = Succession::new(&Scenario::default());
    for (epoch, tick) in [(1, 100), (2, 200), (3, 300)] {
        succession.lost(CONTROLS, epoch, tick);
        assert_eq!(succession.begin(tick + 9), []);
        assert_eq!(succession.begin(tick + 10), [Step::Begin(CONTROLS, epoch + 1, None)]);
    }
    succession.lost(CONTROLS, 4, 400);
    assert_eq!(succession.begin(5000), []);
    assert_eq!(succession.given_up(), Some("attitude-mpc"));
}

#[test]
fn deaths_far_apart_are_forgiven() {
    let mut succession = Succession::new(&Scenario::default());
    for epoch in 1..10 {
        let tick = u64::from(epoch) * 200;
        succession.lost(CONTROLS, epoch, tick);
        assert_eq!(succession.begin(tick + 10), [Step::Begin(CONTROLS, epoch + 1, None)]);
    }
}

/// A swap of attitude-mpc: standby from tick 10, role from 20, alone from 40.
fn swapping() -> Succession {
    let swap = Swap { standby_s: 0.1, watch_s: 0.2, ..Swap::new(SwapNode::AttitudeMpc, 0.1) };
    Succession::new(&scenario(vec![], vec![swap]))
}

/// What `epoch` demands on `tick`.
fn demand(epoch: u32, tick: u64, lon_nm: f64) -> Record {
    let stamp = Stamp { tick, sequence: tick + 1, epoch: u64::from(epoch), ..Stamp::default() };
    Controls { stamp, demand: [0.0, lon_nm, 0.0, 0.0], ..Controls::default() }.with_checksum().into()
}

/// The plant's word on `tick`.
fn sample(tick: u64) -> State {
    State { stamp: Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() }, ..State::default() }
}

/// These ticks, with all at work who are there; the candidate demands `lon_nm` of the tick. What was to be done.
fn fly(succession: &mut Succession, ticks: Range<u64>, lon_nm: impl Fn(u64) -> f64) -> Vec<(u64, Step)> {
    let mut done = vec![];
    for tick in ticks {
        done.extend(succession.begin(tick).into_iter().map(|step| (tick, step)));
        succession.observe(&sample(tick).with_checksum().into());
        for epoch in succession.assignment(CONTROLS).epochs() {
            succession.observe(&demand(epoch, tick, if epoch == 2 { lon_nm(tick) } else { 0.1 }));
        }
    }
    done
}

#[test]
fn a_good_candidate_is_kept() {
    let mut succession = swapping();
    let done = fly(&mut succession, 0..60, |_| 0.1);
    assert_eq!(done, [(10, Step::Begin(CONTROLS, 2, Some(0))), (40, Step::End(CONTROLS, 1))]);
    let story = [(10, 2, What::Started), (10, 2, What::OnStandby), (20, 2, What::TookOver), (40, 2, What::Kept)];
    assert_eq!(told(&succession), story);
    assert_eq!(succession.assignment(CONTROLS), Assignment { active: 2, standby: 0 });
    assert!(succession.events[3].why.as_ref().is_some_and(|why| why.starts_with("30 answers, at most 0.00 %")));
    succession.lost(CONTROLS, 2, 100);
    assert_eq!(succession.begin(110), [Step::Begin(CONTROLS, 3, Some(0))], "who comes after it is like it");
}

#[test]
fn a_candidate_that_differs_in_the_shadow_is_rejected() {
    let mut succession = swapping();
    let done = fly(&mut succession, 0..60, |tick| if tick < 15 { 0.1 } else { 100.0 });
    assert_eq!(done, [(10, Step::Begin(CONTROLS, 2, Some(0))), (18, Step::End(CONTROLS, 2))], "three ticks in a row");
    assert_eq!(told(&succession).last(), Some(&(18, 2, What::Rejected)));
    assert_eq!(succession.assignment(CONTROLS), Assignment { active: 1, standby: 0 });
}

#[test]
fn a_candidate_that_differs_in_office_returns_it() {
    let mut succession = swapping();
    fly(&mut succession, 0..60, |tick| if tick < 30 { 0.1 } else { f64::NAN });
    assert_eq!(told(&succession)[3..], [(33, 2, What::Returned), (33, 1, What::TookOver)]);
    assert!(succession.events[3].why.as_ref().is_some_and(|why| why.contains("cannot be used")));
    assert_eq!(succession.assignment(CONTROLS), Assignment { active: 1, standby: 0 });
}

#[test]
fn a_vehicle_that_tilts_under_a_candidate_gets_the_old_one_back() {
    let mut succession = swapping();
    fly(&mut succession, 0..25, |_| 0.1);
    let mut state = sample(25);
    state.actual.attitude_rad = [0.8, 0.0, 0.0];
    succession.begin(25);
    succession.observe(&state.with_checksum().into());
    for epoch in [1, 2] {
        succession.observe(&demand(epoch, 25, 0.1));
    }
    succession.begin(26);
    assert_eq!(told(&succession)[3..], [(26, 2, What::Returned), (26, 1, What::TookOver)]);
}

#[test]
fn what_was_only_meant_is_not_judged() {
    let mut succession = swapping();
    for tick in 0..60 {
        succession.begin(tick);
        succession.observe(&sample(tick).with_checksum().into());
        let Record::Controls(mut meant) = demand(2, tick, 0.1) else { unreachable!("a demand") };
        meant.stamp.delivery = delivery::STANDBY | delivery::FAULT;
        succession.observe(&meant.with_checksum().into());
        succession.observe(&demand(1, tick, 0.1));
    }
    assert_eq!(told(&succession).last(), Some(&(13, 2, What::Rejected)), "all that it said was lost");
}

#[test]
fn a_candidate_that_dies_leaves_the_office_to_the_old_one() {
    for (at, ending) in [(15, What::Rejected), (30, What::Returned)] {
        let mut succession = swapping();
        fly(&mut succession, 0..at, |_| 0.1);
        succession.lost(CONTROLS, 2, at);
        assert_eq!(fly(&mut succession, at + 1..100, |_| 0.1), [], "{at}: nobody is missing");
        assert_eq!(succession.assignment(CONTROLS), Assignment { active: 1, standby: 0 }, "{at}");
        assert!(told(&succession).contains(&(at, 2, ending)), "{at}: {:?}", told(&succession));
    }
}

#[test]
fn a_trial_goes_on_when_the_old_one_dies() {
    for at in [15, 30] {
        let mut good = swapping();
        fly(&mut good, 0..at, |_| 0.1);
        good.lost(CONTROLS, 1, at);
        assert_eq!(fly(&mut good, at + 1..100, |_| 0.1), [], "{at}: nobody is missing, nobody is to go");
        assert_eq!(good.assignment(CONTROLS), Assignment { active: 2, standby: 0 }, "{at}");
        assert_eq!(told(&good).last(), Some(&(40, 2, What::Kept)), "{at}");

        let mut wrong = swapping();
        fly(&mut wrong, 0..at, |_| 0.1);
        wrong.lost(CONTROLS, 1, at);
        let done = fly(&mut wrong, at + 1..100, |_| f64::NAN);
        let gone = at + 4;
        let expected = [(gone, Step::End(CONTROLS, 2)), (gone + 10, Step::Begin(CONTROLS, 3, None))];
        assert_eq!(done, expected, "{at}: one like the old one comes");
        assert!(told(&wrong).contains(&(gone, 2, What::Returned)), "{at}: {:?}", told(&wrong));
    }
}

#[test]
fn what_both_suffer_is_held_against_nobody() {
    let mut succession = swapping();
    for tick in 0..60 {
        succession.begin(tick);
        if tick % 7 > 0 {
            succession.observe(&sample(tick).with_checksum().into()); // the plant slept
        }
        for epoch in succession.assignment(CONTROLS).epochs().filter(|_| tick % 7 > 0 && !(12..18).contains(&tick)) {
            succession.observe(&demand(epoch, tick, 0.1));
        }
    }
    assert_eq!(told(&succession).last(), Some(&(40, 2, What::Kept)));
}

#[test]
fn one_candidate_comes_after_the_other() {
    let swap = |at_s| Swap { standby_s: 0.1, watch_s: 0.2, ..Swap::new(SwapNode::AttitudeMpc, at_s) };
    let mut succession = Succession::new(&scenario(vec![], vec![swap(0.1), swap(0.2), swap(0.7)]));
    fly(&mut succession, 0..50, |_| 0.1);
    assert!(told(&succession).contains(&(20, 2, What::Rejected)), "the second; the first goes on");
    assert_eq!(told(&succession).last(), Some(&(40, 2, What::Kept)));
    succession.lost(CONTROLS, 2, 60);
    assert_eq!(fly(&mut succession, 61..72, |_| 0.1), [(70, Step::Begin(CONTROLS, 3, Some(0)))]);
    assert_eq!(told(&succession).last(), Some(&(70, 3, What::Rejected)), "who replaces another has no time for it");
}

#[test]
fn two_at_once_differ_in_the_last_bit_of_their_epochs() {
    assert_eq!((successor(1, 1), successor(2, 1), successor(2, 2), successor(3, 0)), (2, 4, 3, 4));
}
