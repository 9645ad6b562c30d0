use super::*;
use crate::fixture::{TestRing, only_after};
use crate::input::Input;
use crate::output::Output;
use crate::realtime::ControlPage;
use crate::shared_role::Assignment;
use contract::message::{Reference, State};
use contract::snapshot::SNAPSHOT_WORDS;
use settings::{FaultKind, FaultTarget, Late, Mode};

const MEMORY: Snapshot = [7; SNAPSHOT_WORDS];

/// Returns loop and input of guidance as process `epoch`.
fn guidance(ring: &TestRing, epoch: u32) -> (CycleLoop, Input<State>) {
    let mut session = ring.session(Topic::Reference, epoch);
    let input = session.input().unwrap();
    (session.ready().unwrap(), input)
}

/// Takes sample `tick` as the plant does.
fn sample(page: &ControlPage, tick: u64) {
    page.role(Topic::State).done(1).set(tick as u32 + 1);
    page.doorbell(Topic::State).ring();
}

#[test]
fn by_the_barrier_a_node_answers_once_to_each_sample() {
    let ring = TestRing::flying(Mode::Lockstep);
    let (mut cycles, mut states) = guidance(&ring, 1);
    sample(&ring.page, 0);
    assert_eq!(cycles.next(&mut states).unwrap(), Some(0));
    cycles.done(0, &MEMORY);
    assert_eq!(ring.page.role(Topic::Reference).done(1).get(), 1);
    assert_eq!(ring.page.role(Topic::Reference).memory.read(), Some((Origin { epoch: 1, done: 1 }, MEMORY.to_vec())));
    let next = only_after(|| sample(&ring.page, 1), || cycles.next(&mut states));
    assert_eq!(next.unwrap(), Some(1));
}

#[test]
fn by_the_barrier_a_node_waits_for_the_one_before_it_unless_its_role_is_vacant() {
    let ring = TestRing::flying(Mode::Lockstep);
    let mut session = ring.session(Topic::Controls, 1);
    let mut references = session.input::<Reference>().unwrap();
    let mut cycles = session.ready().unwrap();
    sample(&ring.page, 0);
    let guidance = ring.page.role(Topic::Reference);
    let guidance_is_done = || {
        guidance.done(1).set(1);
        ring.page.doorbell(Topic::Reference).ring();
    };
    assert_eq!(only_after(guidance_is_done, || cycles.next(&mut references)).unwrap(), Some(0));
    sample(&ring.page, 1);
    guidance.dismiss(1);
    assert_eq!(cycles.next(&mut references).unwrap(), Some(1));
}

#[test]
fn by_the_barrier_a_process_begins_with_the_tick_of_its_assignment() {
    let ring = TestRing::flying(Mode::Lockstep);
    let role = ring.page.role(Topic::Reference);
    role.offer(2);
    let (mut cycles, mut states) = guidance(&ring, 2);
    sample(&ring.page, 8);
    role.assign(9, |assignment| Assignment { standby: 2, ..assignment });
    sample(&ring.page, 9);
    assert_eq!(cycles.next(&mut states).unwrap(), Some(9));
    cycles.done(9, &MEMORY);
    assert_eq!((role.done(2).get(), role.memory.read()), (10, None), "a standby leaves the memory to the active one");
}

#[test]
fn a_process_ends_when_another_has_taken_over_or_the_run_is_over() {
    let ring = TestRing::flying(Mode::Lockstep);
    let role = ring.page.role(Topic::Reference);
    role.offer(2);
    let ((mut old, mut one), (mut new, mut other)) = (guidance(&ring, 1), guidance(&ring, 2));
    role.assign(0, |_| Assignment { active: 2, standby: 0 });
    assert_eq!(old.next(&mut one).unwrap(), None);
    let leave = || ring.page.set_phase(phase::LEAVE);
    assert_eq!(only_after(leave, || new.next(&mut other)).unwrap(), None);
}

#[test]
fn a_fault_of_its_own_ends_a_process_instead_of_its_answer() {
    let mut ring = TestRing::flying(Mode::Realtime);
    ring.run.run.rate_hz = 1000;
    ring.run.fault = vec![Fault::new(FaultTarget::Guidance, FaultKind::Exit, 0.005, None)];
    let (mut cycles, mut states) = guidance(&ring, 1);
    ring.page.origin_ns.set(now_ns());
    let end = (0..100).map(|_| cycles.next(&mut states)).find(|tick| !matches!(tick, Ok(Some(0..5))));
    assert!(matches!(end, Some(Err(SessionError::FaultExit { tick: 5.. }))));
}

/// Makes a ring in real time for [`slow_guidance`]; sample 0 was taken `since_ns` ago.
fn slow_ring(since_ns: u64) -> TestRing {
    let mut ring = TestRing::flying(Mode::Realtime);
    ring.run.node.plant.deadline_ms = Some(2_000.0);
    ring.page.origin_ns.set(now_ns() - since_ns);
    ring
}

/// Returns loop and input of guidance, with ten seconds between two samples, which no scenario allows.
fn slow_guidance(ring: &TestRing) -> (CycleLoop, Input<State>) {
    let (mut cycles, states) = guidance(ring, 1);
    cycles.release = Release::Timer { period_ns: TEN_S_NS };
    (cycles, states)
}

const TEN_S_NS: u64 = 10_000_000_000;

#[test]
fn by_the_timer_a_node_answers_when_its_input_comes() {
    let ring = slow_ring(0);
    let mut plant = ring.session(Topic::State, 1);
    let mut states: Output<State> = plant.output().unwrap();
    let (mut cycles, mut input) = slow_guidance(&ring);
    states.send(State::default(), Stamp::at(0, ring.page.origin_ns.get()));
    assert_eq!(cycles.next(&mut input).unwrap(), Some(0));
    let mut stamp = Stamp::default();
    cycles.member.timing.report(&mut stamp);
    assert_eq!(stamp.release_ns, input.newest().stamp.publish_ns[0], "it was due when the input was sent");
    assert_eq!(cycles.provenance(0), Stamp::at(0, ring.page.origin_ns.get()));
}

#[test]
fn by_the_timer_a_node_answers_without_its_input_when_that_is_late() {
    let ring = slow_ring(3_000_000_000);
    let (mut cycles, mut input) = slow_guidance(&ring);
    assert_eq!(cycles.next(&mut input).unwrap(), Some(0), "due after 2 s, and 3 s have passed");
    assert_eq!(cycles.sleep(TEN_S_NS, &mut input), Wake::LookAround, "sample 1 is to come");
}

#[test]
fn by_the_timer_a_node_wakes_for_the_first_sample_even_if_its_input_never_comes() {
    let mut ring = TestRing::flying(Mode::Realtime);
    ring.run.node.plant.deadline_ms = Some(5_000.0);
    let (mut cycles, mut input) = {
        let mut session = ring.session(Topic::Controls, 1);
        let input = session.input::<Reference>().unwrap();
        (session.ready().unwrap(), input)
    };
    cycles.release = Release::Timer { period_ns: TEN_S_NS };
    let mut is_woken_by_the_sample = || {
        ring.page.origin_ns.set(0);
        let began_ns = now_ns();
        let first_sample = || {
            ring.page.origin_ns.set(now_ns());
            sample(&ring.page, 0);
        };
        assert_eq!(only_after(first_sample, || cycles.sleep(TEN_S_NS, &mut input)), Wake::LookAround);
        now_ns() - began_ns < LOOK_AROUND_NS
    };
    assert!((0..5).any(|_| is_woken_by_the_sample()), "every time the clock has woken it");
}

#[test]
fn by_the_timer_a_process_begins_with_the_tick_of_its_assignment() {
    let ring = slow_ring(2 * TEN_S_NS + 1_000_000_000);
    let role = ring.page.role(Topic::Reference);
    role.offer(2);
    let mut session = ring.session(Topic::Reference, 2);
    let mut input = session.input::<State>().unwrap();
    let mut cycles = session.ready().unwrap();
    cycles.release = Release::Timer { period_ns: TEN_S_NS };
    role.set_pending(2);
    role.activate_pending(2);
    assert_eq!(cycles.sleep(TEN_S_NS, &mut input), Wake::LookAround, "sample 1 is not its own, and 2 is late in 1 s");
    ring.page.origin_ns.set(now_ns() - 2 * TEN_S_NS - 2_000_000_001);
    assert_eq!(cycles.next(&mut input).unwrap(), Some(2));
    let mut stamp = Stamp::default();
    cycles.member.timing.report(&mut stamp);
    assert_eq!(stamp.slips, 0, "samples of the process before it");
}

#[test]
fn by_the_timer_slots_that_were_slept_through_are_skipped_and_counted() {
    let ring = slow_ring(3_000_000_000);
    let (mut cycles, mut input) = slow_guidance(&ring);
    assert_eq!(cycles.next(&mut input).unwrap(), Some(0));
    ring.page.origin_ns.set(now_ns() - 4 * TEN_S_NS - 3_000_000_000);
    assert_eq!(cycles.next(&mut input).unwrap(), Some(4));
    let mut stamp = Stamp::default();
    cycles.member.timing.report(&mut stamp);
    assert_eq!(stamp.slips, 3);
}

#[test]
fn by_the_timer_a_node_warms_up_once_before_a_sample() {
    let ring = slow_ring(3_000_000_000);
    let (mut cycles, mut input) = slow_guidance(&ring);
    assert_eq!(cycles.next(&mut input).unwrap(), Some(0));
    ring.page.origin_ns.set(now_ns() - TEN_S_NS + 50_000_000);
    assert_eq!(cycles.sleep(TEN_S_NS, &mut input), Wake::WarmUp);
    assert_eq!(cycles.sleep(TEN_S_NS, &mut input), Wake::LookAround);
}

#[test]
fn by_the_timer_no_node_answers_to_a_sample_after_the_last() {
    let ring = slow_ring(TEN_S_NS + 3_000_000_000);
    let (mut cycles, mut input) = slow_guidance(&ring);
    cycles.next = 1;
    ring.page.total_samples.set(1);
    assert_eq!(cycles.sleep(TEN_S_NS, &mut input), Wake::LookAround, "sample 1 would be late");
    ring.page.total_samples.set(2);
    assert!(matches!(cycles.sleep(TEN_S_NS, &mut input), Wake::Late(1, _)));
}

#[test]
fn a_missed_deadline_with_the_policy_stop_ends_the_loop() {
    let mut ring = TestRing::flying(Mode::Realtime);
    ring.run.deadline.late = Late::Stop;
    let (mut cycles, mut input) = guidance(&ring, 1);
    let late = cycles.member.timing.ready(3, 0, 50_000_000);
    assert_eq!(late, Some(Late::Stop));
    assert!(matches!(cycles.next(&mut input), Err(SessionError::Late { tick: 3, .. })));
}
