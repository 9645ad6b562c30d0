use super::*;
use crate::fixture::{TestRing, only_after};
use crate::output::Output;
use crate::shared_role::Assignment;
use contract::message::{Actuators, State};
use settings::{Fault, FaultKind, FaultTarget, Mode};

/// Returns loop, input and output of the plant.
fn plant(ring: &TestRing) -> (SampleLoop, Input<Actuators>, Output<State>) {
    let mut session = ring.session(Topic::State, 1);
    let (input, output) = (session.input().unwrap(), session.output().unwrap());
    (session.ready_to_sample().unwrap(), input, output)
}

/// Marks `tick` as done by every other node.
fn answer(ring: &TestRing, tick: u64) {
    for topic in Topic::OF_CONTROLLERS {
        ring.page.role(topic).done(1).set(tick as u32 + 1);
    }
}

/// Lets the launcher keep the assignment up to and including `tick`.
fn rule(ring: &TestRing, tick: u64) {
    ring.page.decided.raise(tick as u32 + 1);
}

/// Makes a ring in real time whose nodes wait for the first sample.
fn ring_by_the_timer() -> TestRing {
    let mut ring = TestRing::flying(Mode::Realtime);
    ring.run.run.rate_hz = 1000;
    for topic in Topic::OF_CONTROLLERS {
        ring.page.role(topic).waiting.set(1);
    }
    ring
}

#[test]
fn a_stall_skips_the_slots_it_covered() {
    let period = 10_000_000;
    assert_eq!(periods_passed(1_000 + period, 1_000, period), 1, "on time");
    assert_eq!(periods_passed(1_000 + period + period / 2, 1_000, period), 1, "late within the slot");
    assert_eq!(periods_passed(1_000 + 3 * period + 5, 1_000, period), 3, "a stall over three slots");
    assert_eq!(periods_passed(1_000 + period - 7, 1_000, period), 1, "woken early");
    assert_eq!(periods_passed(0, 1_000, period), 1, "a clock behind the sample");
}

#[test]
fn by_the_timer_samples_stand_for_instants_one_period_apart() {
    let ring = ring_by_the_timer();
    let (mut cycles, mut commands, _states) = plant(&ring);
    let mut ticks = vec![];
    for _ in 0..5 {
        let tick = cycles.next(&mut commands, |_, _| {}).unwrap().unwrap();
        assert!(now_ns() >= ring.page.origin_ns.get() + tick * 1_000_000, "none is taken before its instant");
        assert_eq!(cycles.provenance(tick), Stamp::at(tick, ring.page.origin_ns.get() + tick * 1_000_000));
        cycles.done(tick);
        ticks.push(tick);
    }
    assert_eq!(ticks[0], 0);
    assert!(ticks.windows(2).all(|pair| pair[0] < pair[1]));
    let mut stamp = Stamp::default();
    cycles.member.timing.report(&mut stamp);
    assert_eq!(stamp.slips, ticks[4] - 4, "what was slept through is counted");
}

#[test]
fn by_the_timer_the_first_sample_waits_until_all_nodes_wait_for_it() {
    let ring = ring_by_the_timer();
    ring.page.role(Topic::Controls).waiting.set(0);
    let (mut cycles, mut commands, _states) = plant(&ring);
    let waits_ns = std::thread::scope(|scope| {
        let mpc = scope.spawn(|| {
            std::thread::sleep(std::time::Duration::from_millis(10));
            let now_ns = now_ns();
            ring.page.role(Topic::Controls).waiting.set(1);
            ring.page.doorbell(Topic::Controls).ring();
            now_ns
        });
        assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(0));
        mpc.join().unwrap()
    });
    assert!(ring.page.origin_ns.get() > waits_ns);
}

#[test]
fn by_the_timer_the_pending_epoch_is_active_from_the_next_tick_on() {
    let ring = ring_by_the_timer();
    let (mut cycles, mut commands, _states) = plant(&ring);
    let mixer = ring.page.role(Topic::Actuators);
    assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(0));
    mixer.offer(2);
    mixer.set_pending(2);
    assert_eq!(mixer.active(), 1);
    let tick = cycles.next(&mut commands, |_, _| {}).unwrap().unwrap();
    assert_eq!((mixer.active(), u64::from(mixer.since(2).get())), (2, tick));
}

#[test]
fn the_last_tick_is_finished_and_no_other_begins() {
    let ring = ring_by_the_timer();
    let (mut cycles, mut commands, _states) = plant(&ring);
    assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(0));
    cycles.ends_with(0);
    cycles.done(0);
    assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), None);
    assert!(now_ns() >= ring.page.origin_ns.get() + 1_000_000, "the nodes had their time");
}

#[test]
fn a_run_that_is_called_off_has_no_sample() {
    for mode in [Mode::Realtime, Mode::Lockstep] {
        let ring = TestRing::flying(mode);
        ring.page.set_phase(phase::LEAVE);
        let (mut cycles, mut commands, _states) = plant(&ring);
        assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), None);
    }
}

#[test]
fn a_fault_of_its_own_ends_the_plant() {
    let mut ring = ring_by_the_timer();
    ring.run.fault = vec![Fault::new(FaultTarget::Plant, FaultKind::Exit, 0.003, None)];
    let (mut cycles, mut commands, _states) = plant(&ring);
    let end = (0..100).map(|_| cycles.next(&mut commands, |_, _| {})).find(|tick| !matches!(tick, Ok(Some(0..3))));
    assert!(matches!(end, Some(Err(SessionError::FaultExit { .. }))));
}

#[test]
fn by_the_barrier_a_command_acts_after_the_delay_of_faults() {
    let ring = TestRing::flying(Mode::Lockstep);
    let (mut cycles, mut commands, mut states) = plant(&ring);
    let mut mixer = ring.session(Topic::Actuators, 1);
    let mut actuators = mixer.output::<Actuators>().unwrap();
    rule(&ring, 1);
    assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(0));
    states.send(State::default(), cycles.provenance(0));
    cycles.done(0);
    actuators.send(Actuators::default(), Stamp { held_ns: 77, ..Stamp::at(0, 0) });
    answer(&ring, 0);
    let mut arrivals = vec![];
    let next = cycles.next(&mut commands, |command, arrival_ns| arrivals.push((command.stamp.tick, arrival_ns)));
    assert_eq!((next.unwrap(), arrivals), (Some(1), vec![(0, 77)]));
}

#[test]
fn by_the_barrier_the_launcher_is_asked_from_the_tick_that_it_names_or_when_a_role_is_vacant() {
    let ring = TestRing::flying(Mode::Lockstep);
    let (mut cycles, mut commands, _states) = plant(&ring);
    ring.page.next_decision.set(2);
    let mut asked = vec![];
    for tick in 0..5 {
        rule(&ring, tick); // before the plant asks, so that it need not wait
        if tick == 4 {
            ring.page.next_decision.set(u32::MAX);
            ring.page.role(Topic::Controls).dismiss(1);
        } else if tick == 3 {
            ring.page.next_decision.set(u32::MAX);
        }
        assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(tick));
        asked.push(ring.page.asked.count());
        answer(&ring, tick);
    }
    assert_eq!(asked, [0, 0, 3, 3, 5]);
}

#[test]
fn by_the_barrier_the_next_sample_waits_for_active_standby_and_observers() {
    let ring = TestRing::flying(Mode::Lockstep);
    let (mut cycles, mut commands, _states) = plant(&ring);
    let mixer = ring.page.role(Topic::Actuators);
    mixer.offer(2);
    mixer.assign(0, |assignment| Assignment { standby: 2, ..assignment });
    (0..LEAD_TICKS + 5).for_each(|tick| rule(&ring, tick));
    assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(0));
    answer(&ring, 0);
    let standby_is_done = || {
        mixer.done(2).set(1);
        ring.page.doorbell(Topic::Actuators).ring();
    };
    let next = only_after(standby_is_done, || cycles.next(&mut commands, |_, _| {}));
    assert_eq!(next.unwrap(), Some(1));
    mixer.assign(1, |assignment| assignment.without(2));
    ring.page.recorded.raise(u32::MAX);
    for tick in 1..LEAD_TICKS {
        answer(&ring, tick);
        assert_eq!(cycles.next(&mut commands, |_, _| {}).unwrap(), Some(tick + 1));
    }
    answer(&ring, LEAD_TICKS);
    let launcher_follows = || ring.page.watched.raise(1);
    let next = only_after(launcher_follows, || cycles.next(&mut commands, |_, _| {}));
    assert_eq!(next.unwrap(), Some(LEAD_TICKS + 1));
}
