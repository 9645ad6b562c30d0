//! Tests of the state machine by examples, by random inputs, and by every sequence of inputs up to a length.

use std::collections::{HashSet, VecDeque};
use std::panic::{AssertUnwindSafe, catch_unwind};

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use super::*;

const MS: u64 = 1_000_000;

fn policy() -> Policy {
    Policy { window_ns: 500 * MS, ..Policy::node(&Supervision::default(), 10 * MS) }
}

fn now(ms: u64) -> Now {
    Now { ns: ms * MS, tick: ms / 10 }
}

/// Returns epoch and kind of the reported events.
fn told(actions: &[Action]) -> Vec<(u32, What)> {
    let event =
        |action: &Action| if let Action::Report(event) = action { Some((event.epoch, event.what)) } else { None };
    actions.iter().filter_map(event).collect()
}

/// Returns the actions except reports.
fn done(actions: Vec<Action>) -> Vec<Action> {
    actions.into_iter().filter(|action| !matches!(action, Action::Report(_))).collect()
}

/// Returns a role whose active process ended at each of these times \[ms\]; the next one was ready and active at once.
fn after_failures(ends_ms: &[u64]) -> Role {
    let mut role = Role::new("mixer", policy());
    for end_ms in ends_ms {
        let active = role.active().expect("a process is active");
        role.on(now(*end_ms), RoleInput::Exited(active));
        let restart_ns = role.due_ns().expect("another is to be started");
        let at = Now { ns: restart_ns, tick: 0 };
        role.on(at, RoleInput::Tick);
        let epoch = role.starting().expect("another was started");
        role.on(at, RoleInput::Ready(epoch));
        role.on(at, RoleInput::Activated(epoch));
    }
    role
}

#[test]
fn an_exit_is_followed_by_another_process() {
    let mut role = Role::new("mixer", policy());
    let actions = role.on(now(100), RoleInput::Exited(1));
    assert_eq!(told(&actions), [(1, What::Died)]);
    assert_eq!(done(actions), [Action::Vacate(1)]);
    assert_eq!(role.due_ns(), Some(100 * MS), "at once");
    let actions = role.on(now(100), RoleInput::Tick);
    assert_eq!(told(&actions), [(2, What::Started)]);
    assert_eq!(done(actions), [Action::Spawn(2, None)]);
    assert_eq!(role.on(now(125), RoleInput::Ready(2)), [Action::Activate(2)]);
    assert_eq!(told(&role.on(now(130), RoleInput::Activated(2))), [(2, What::TookOver)]);
}

#[test]
fn waits_grow_and_the_fourth_failure_in_the_window_is_the_last() {
    for (ends, wait_ms) in [(&[][..], 0), (&[100], 50), (&[100, 200], 100)] {
        let mut role = after_failures(ends);
        role.on(now(400), RoleInput::Exited(role.active().unwrap()));
        assert_eq!(role.due_ns(), Some((400 + wait_ms) * MS), "after {ends:?}");
    }
    let mut role = after_failures(&[100, 200, 300]);
    assert_eq!(told(&role.on(now(500), RoleInput::Exited(4))), [(4, What::Died), (4, What::GivenUp)]);
    assert!(role.given_up() && role.due_ns().is_none());
    let mut role = after_failures(&[100, 200, 300]);
    assert_eq!(told(&role.on(now(600), RoleInput::Exited(4))), [(4, What::Died)], "the first is out of the window");
}

#[test]
fn a_fault_that_kills_keeps_the_program_from_being_started_until_it_is_over() {
    let mut role = Role::new("mixer", policy());
    assert_eq!(role.on(now(100), RoleInput::Kill(400 * MS)), [Action::Signal(1, Signal::Kill)]);
    role.on(now(102), RoleInput::Exited(1));
    assert_eq!(role.due_ns(), Some(400 * MS));
    assert_eq!(role.on(now(399), RoleInput::Tick), []);
    assert_eq!(done(role.on(now(400), RoleInput::Tick)), [Action::Spawn(2, None)]);
}

#[test]
fn a_process_hangs_after_the_limit_if_samples_wait_for_it() {
    let mut role = Role::new("mixer", policy());
    let progress = |done, samples| RoleInput::Progress { done, samples, excused_ns: 0 };
    role.on(now(42), progress(5, 5));
    assert_eq!(role.hangs_at_ns(10 * MS, 0), Some(70 * MS));
    assert_eq!(role.on(now(69), progress(5, 7)), [], "two samples are not enough");
    assert_eq!(role.clone().on(now(61), progress(5, 8)), [], "nor is less than 20 ms");
    let actions = role.on(now(71), progress(5, 8));
    assert_eq!(told(&actions), [(1, What::Hung)]);
    assert_eq!(done(actions), [Action::Signal(1, Signal::Kill), Action::Vacate(1)]);
    assert_eq!(role.on(now(72), RoleInput::Exited(1)), [Action::Vacate(1)], "its end is no news");
    assert_eq!(done(role.on(now(72), RoleInput::Tick)), [Action::Spawn(2, None)]);
}

#[test]
fn time_in_which_the_driver_did_not_run_counts_against_no_process() {
    let mut role = Role::new("mixer", policy());
    let progress = |samples, excused_ns| RoleInput::Progress { done: 5, samples, excused_ns };
    role.on(now(42), progress(5, 0));
    assert_eq!(role.on(now(96), progress(10, 50 * MS)), []);
    assert_eq!(told(&role.on(now(112), progress(12, 0))), [(1, What::Hung)]);
}

#[test]
fn a_process_that_is_not_ready_in_time_is_replaced() {
    let mut role = Role::new("mixer", policy());
    role.on(now(100), RoleInput::Exited(1));
    role.on(now(100), RoleInput::Tick);
    let actions = role.on(now(1101), RoleInput::Tick);
    assert_eq!(told(&actions), [(2, What::Hung)]);
    assert_eq!(
        done(role.on(now(1101), RoleInput::Tick)),
        [Action::Spawn(3, None)],
        "the first failure is out of the window"
    );
}

/// Returns a role with a candidate on standby, epoch 2, that came with swap 7.
fn contest() -> Role {
    let mut role = Role::new("mixer", policy());
    assert_eq!(done(role.on(now(100), RoleInput::SwapRequested(7))), [Action::Spawn(2, Some(7))]);
    let actions = role.on(now(125), RoleInput::Ready(2));
    assert_eq!(told(&actions), [(2, What::OnStandby)]);
    assert_eq!(done(actions), [Action::Standby(2)]);
    assert_eq!(role.swap_on_trial(), Some(7));
    role
}

/// Returns the role of `contest` after the hand-over.
fn handed_over() -> Role {
    let mut role = contest();
    assert_eq!(role.on(now(200), RoleInput::Ruled(Ruling::HandOver, String::new())), [Action::Activate(2)]);
    role.on(now(200), RoleInput::Activated(2));
    assert_eq!((role.active(), role.contest().map(|c| c.handed_over)), (Some(2), Some(true)));
    role
}

#[test]
fn a_kept_candidate_is_restarted_with_its_own_program() {
    let mut role = handed_over();
    let actions = role.on(now(300), RoleInput::Ruled(Ruling::Keep, "well".into()));
    assert_eq!(told(&actions), [(2, What::Kept)]);
    assert_eq!(done(actions), [Action::Signal(1, Signal::Kill), Action::Vacate(1)]);
    assert_eq!(role.on(now(301), RoleInput::Exited(1)), [Action::Vacate(1)]);
    role.on(now(400), RoleInput::Exited(2));
    assert_eq!(done(role.on(now(400), RoleInput::Tick)), [Action::Spawn(3, Some(7))]);
}

#[test]
fn a_candidate_that_is_rejected_leaves_the_active_process_alone() {
    let mut role = contest();
    let actions = role.on(now(150), RoleInput::Ruled(Ruling::Reject, "late".into()));
    assert_eq!(told(&actions), [(2, What::Rejected)]);
    assert_eq!(done(actions), [Action::Signal(2, Signal::Kill), Action::Vacate(2)]);
    assert!(role.is_alone(1));
    assert_eq!(role.on(now(151), RoleInput::Exited(2)), [Action::Vacate(2)]);
}

#[test]
fn messages_of_a_returned_candidate_are_delivered_until_the_old_one_is_active() {
    let mut role = handed_over();
    let actions = role.on(now(250), RoleInput::Ruled(Ruling::Return, "tilt".into()));
    assert_eq!(told(&actions), [(2, What::Returned)]);
    assert_eq!(done(actions), [Action::Signal(2, Signal::Kill), Action::Activate(1)]);
    role.on(now(260), RoleInput::Activated(1));
    assert!(role.is_alone(1));
}

#[test]
fn a_dead_candidate_returns_the_role_and_a_trial_goes_on_when_the_old_one_dies() {
    let mut role = handed_over();
    let actions = role.on(now(250), RoleInput::Exited(2));
    assert_eq!(told(&actions), [(2, What::Died), (2, What::Returned)]);
    assert_eq!(done(actions), [Action::Vacate(2), Action::Activate(1)]);
    let mut role = contest();
    let actions = role.on(now(150), RoleInput::Exited(1));
    assert_eq!(done(actions), [Action::Vacate(1), Action::Activate(2)], "the candidate is better than none");
    assert_eq!(role.contest().map(|contest| contest.old), Some(None));
}

#[test]
fn a_candidate_that_is_not_ready_when_the_active_process_dies_is_not_waited_for() {
    let mut role = Role::new("mixer", policy());
    role.on(now(100), RoleInput::SwapRequested(0));
    let actions = role.on(now(110), RoleInput::Exited(1));
    assert_eq!(told(&actions), [(1, What::Died), (2, What::Rejected)]);
    assert_eq!(done(role.on(now(110), RoleInput::Tick)), [Action::Spawn(3, None)]);
}

#[test]
fn policies_are_the_settings_in_nanoseconds() {
    let settings = Supervision { hang_ms: 15.0, start_limit_s: 2.0, ..policy_settings() };
    let node = Policy::node(&settings, 10 * MS);
    assert_eq!((node.hang_ticks, node.hang_ns, node.window_ns), (3, 20 * MS, 5000 * MS));
    assert_eq!((node.start_limit_ns, node.restart_ns.as_slice()), (2000 * MS, [0, 50 * MS, 100 * MS].as_slice()));
    assert_eq!(Policy::node(&settings, MS).hang_ns, 15 * MS, "the longer of the two limits");
    let plant = Policy::plant(&settings, 10 * MS);
    assert_eq!((plant.restart_ns.as_slice(), plant.hang_ns, plant.hang_ticks), ([].as_slice(), 500 * MS, 0));
    let recorder = Policy::recorder(&settings);
    assert_eq!((recorder.start_limit_ns, recorder.hang_ns, recorder.hang_ticks), (3000 * MS, 5000 * MS, 1));
}

fn policy_settings() -> Supervision {
    Supervision { restart_ms: vec![0.0, 50.0, 100.0], ..Supervision::default() }
}

#[test]
fn only_the_active_process_can_be_found_disconnected() {
    let mut role = contest();
    assert_eq!(role.on(now(130), RoleInput::Disconnected(2, "no port".into())), []);
    let actions = role.on(now(131), RoleInput::Disconnected(1, "no port".into()));
    assert_eq!(told(&actions), [(1, What::Hung)]);
}

#[test]
fn alone_busy_and_due_follow_the_state_of_the_role() {
    let fresh = Role::new("mixer", policy());
    assert!(fresh.is_alone(1) && !fresh.is_alone(2) && !fresh.is_busy() && !fresh.has_candidate());
    assert_eq!((fresh.due_ns(), fresh.hangs_at_ns(10 * MS, 5 * MS)), (None, Some(25 * MS)));
    let mut swapping = fresh.clone();
    swapping.on(now(100), RoleInput::SwapRequested(7));
    assert!(swapping.has_candidate() && swapping.is_busy() && swapping.is_alone(1));
    assert_eq!(swapping.due_ns(), Some(1100 * MS + 1), "when it counts as hung");
    assert!(swapping.may_swap().is_err());
    let trial = contest();
    assert!(!trial.is_alone(1) && trial.has_candidate() && trial.is_busy() && trial.due_ns().is_none());
    let mut restarting = fresh;
    restarting.on(now(100), RoleInput::Exited(1));
    assert!(restarting.is_busy(), "another is about to be started");
    restarting.on(now(100), RoleInput::Tick);
    assert!(!restarting.has_candidate() && restarting.is_busy());
    restarting.on(now(125), RoleInput::Ready(2));
    assert!(restarting.is_busy() && restarting.may_swap().is_err(), "it is ready and not active yet");
}

#[test]
fn a_ruling_that_does_not_fit_the_trial_changes_nothing() {
    let ruled = |role: &Role, ruling| role.clone().on(now(210), RoleInput::Ruled(ruling, String::new()));
    for ruling in [Ruling::Keep, Ruling::Return] {
        assert_eq!(ruled(&contest(), ruling), []);
    }
    for ruling in [Ruling::HandOver, Ruling::Reject] {
        assert_eq!(ruled(&handed_over(), ruling), []);
    }
}

#[test]
fn a_recorder_that_dies_is_followed_by_another() {
    let mut role = Role::new("recorder", Policy::recorder(&policy_settings()));
    role.on(now(100), RoleInput::Exited(1));
    assert_eq!(done(role.on(now(100), RoleInput::Tick)), [Action::Spawn(2, None)]);
}

#[test]
fn the_exit_of_a_rejected_candidate_is_no_failure() {
    let mut role = contest();
    role.on(now(150), RoleInput::Ruled(Ruling::Reject, String::new()));
    role.on(now(160), RoleInput::Exited(1));
    role.on(now(160), RoleInput::Exited(2));
    assert_eq!(done(role.on(now(160), RoleInput::Tick)), [Action::Spawn(3, None)]);
    role.on(now(170), RoleInput::Exited(3));
    assert_eq!(role.due_ns(), Some(220 * MS), "the second failure of the window");
}

#[test]
fn a_process_hangs_by_unanswered_samples_and_not_by_a_lack_of_samples() {
    let mut role = Role::new("mixer", policy());
    let progress = |done, samples| RoleInput::Progress { done, samples, excused_ns: 0 };
    role.on(now(10), progress(5, 5));
    role.on(now(500), progress(5, 5));
    assert_eq!(role.on(now(515), progress(5, 9)), [], "nothing waited for it until 500 ms");
    assert_eq!(told(&role.on(now(520), progress(5, 9))), [(1, What::Hung)]);
}

/// Role in a world that obeys its actions, with the processes that live and those that are active, standby or pending.
#[derive(Clone, PartialEq, Eq, Hash)]
struct World {
    role: Role,
    ms: u64,
    living: Vec<u32>,
    active: Option<u32>,
    standby: Option<u32>,
    pending: Option<u32>,
    /// Epochs that were rejected or returned.
    refused: Vec<u32>,
    spawned: u32,
}

/// Event of the world that the search may choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Happening {
    Exit(usize),
    Ready,
    Boundary,
    Swap,
    Rule(Ruling),
    Silence,
    Fault,
    Pass(u64),
}

const HAPPENINGS: [Happening; 13] = [
    Happening::Exit(0),
    Happening::Exit(1),
    Happening::Exit(2),
    Happening::Ready,
    Happening::Boundary,
    Happening::Swap,
    Happening::Rule(Ruling::HandOver),
    Happening::Rule(Ruling::Keep),
    Happening::Rule(Ruling::Reject),
    Happening::Rule(Ruling::Return),
    Happening::Silence,
    Happening::Fault,
    Happening::Pass(60),
];

impl World {
    fn new() -> Self {
        let role = Role::new("mixer", policy());
        let (living, active) = (vec![1], Some(1));
        Self { role, ms: 0, living, active, standby: None, pending: None, refused: vec![], spawned: 1 }
    }

    /// Applies `happening` if it is possible; panics if the role breaks a promise.
    fn happen(&mut self, happening: Happening) {
        let input = match happening {
            Happening::Exit(i) => {
                if i >= self.living.len() {
                    return;
                }
                let epoch = self.living.remove(i);
                RoleInput::Exited(epoch)
            }
            Happening::Ready => match self.role.starting().filter(|epoch| self.living.contains(epoch)) {
                Some(epoch) => RoleInput::Ready(epoch),
                None => return,
            },
            Happening::Boundary => match self.pending.take() {
                Some(epoch) => {
                    self.standby = self.active.filter(|_| self.standby == Some(epoch)).or(self.standby);
                    self.standby.take_if(|standby| *standby == epoch);
                    self.active = Some(epoch);
                    RoleInput::Activated(epoch)
                }
                None => return,
            },
            Happening::Swap => RoleInput::SwapRequested(0),
            Happening::Rule(ruling) => RoleInput::Ruled(ruling, String::new()),
            Happening::Silence => RoleInput::Disconnected(self.active.unwrap_or(0), String::new()),
            Happening::Fault => RoleInput::Kill((self.ms + 100) * MS),
            Happening::Pass(ms) => {
                self.ms += ms;
                RoleInput::Tick
            }
        };
        self.on(input);
        self.on(RoleInput::Tick);
        self.check();
    }

    fn on(&mut self, input: RoleInput) {
        let given_up = self.role.given_up();
        for action in self.role.on(now(self.ms), input) {
            match action {
                Action::Spawn(epoch, _) => {
                    assert!(epoch > self.spawned, "epochs only grow");
                    assert!(!given_up, "nothing is spawned after the end");
                    self.spawned = epoch;
                    self.living.push(epoch);
                }
                Action::Signal(epoch, Signal::Kill) => {
                    // The process ends later: the search decides when.
                    assert!(epoch <= self.spawned);
                }
                Action::Signal(..) => {}
                Action::Activate(epoch) => {
                    assert!(!self.refused.contains(&epoch), "a rejected candidate never becomes active again");
                    self.pending = Some(epoch);
                }
                Action::Standby(epoch) => self.standby = Some(epoch),
                Action::Vacate(epoch) => {
                    for place in [&mut self.active, &mut self.standby, &mut self.pending] {
                        place.take_if(|other| *other == epoch);
                    }
                }
                Action::Report(event) => {
                    if matches!(event.what, What::Rejected | What::Returned) && event.swap.is_none() {
                        self.refused.push(event.epoch);
                    }
                }
            }
        }
    }

    fn check(&self) {
        assert!(self.active.is_none() || self.active != self.standby, "one process has one place");
        let someone = self.active.or(self.pending).or(self.standby);
        let coming = self.role.starting().is_some() || self.role.due_ns().is_some();
        assert!(
            someone.is_some() || coming || self.role.given_up(),
            "every exit is followed by a spawn or by giving up"
        );
        if self.active.is_none() && self.standby.is_some() {
            assert!(self.pending.is_some(), "a role with a living candidate is never left empty");
        }
        assert!(!self.role.given_up() || self.role.starting().is_none() || self.active.is_some());
    }
}

/// Tries every sequence of up to `depth` happenings. Returns the number of states seen.
fn search(depth: usize) -> usize {
    let mut seen = HashSet::new();
    let mut open = VecDeque::from([(World::new(), vec![])]);
    while let Some((world, story)) = open.pop_front() {
        for happening in HAPPENINGS.into_iter().filter(|_| story.len() < depth) {
            let (mut next, story) = (world.clone(), [&story[..], &[happening]].concat());
            let holds = catch_unwind(AssertUnwindSafe(|| next.happen(happening))).is_ok();
            assert!(holds, "after {story:?}");
            if seen.insert(next.clone()) {
                open.push_back((next, story));
            }
        }
    }
    seen.len()
}

#[test]
fn no_sequence_of_seven_happenings_breaks_a_promise() {
    let worlds = search(7);
    assert!(worlds > 1000, "{worlds} states");
}

proptest! {
    #[test]
    fn no_long_sequence_breaks_a_promise(story in vec(select(HAPPENINGS.to_vec()), 0..200)) {
        let mut world = World::new();
        for happening in story {
            world.happen(happening);
        }
        // Once nothing more goes wrong, a process is active, or the role was given up.
        for _ in 0..50 {
            for happening in [Happening::Pass(60), Happening::Ready, Happening::Boundary] {
                world.happen(happening);
            }
        }
        prop_assert!(world.active.is_some() || world.role.given_up());
    }

    #[test]
    fn a_trial_ends(rulings in vec(select(vec![Ruling::HandOver, Ruling::Keep, Ruling::Reject, Ruling::Return]), 1..20)) {
        let mut world = World::new();
        for happening in [Happening::Swap, Happening::Ready] {
            world.happen(happening);
        }
        for ruling in rulings {
            world.happen(Happening::Rule(ruling));
            world.happen(Happening::Boundary);
        }
        for ruling in [Ruling::Keep, Ruling::Reject] {
            world.happen(Happening::Rule(ruling));
        }
        prop_assert!(world.role.contest().is_none());
    }
}
