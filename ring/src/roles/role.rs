//! State machine that decides which process runs a node. It has no clock, process, shared memory or I/O.
//!
//! ```text
//!              Spawn            Ready                Activated
//!  vacant ------------> starting ------> pending -----------------> active --+-- Exited, hung, cut off -> vacant
//!     ^                    |                                          ^      |
//!     +--- restart delay --+-- Exited, start limit                    |      +-- SwapRequested: a candidate starts
//!     |                                                               |
//!     +-- too many failures within the window: given up               +-- standby -- HandOver --> active, old: standby
//!                                                                         (trial)      Keep, Reject, Return end it
//! ```
//!
//! Every mode uses this machine. A driver carries [`RoleInput`]s in and [`Action`]s out: `realtime` derives the inputs
//! from the ends of processes and from their progress on the control page, `simulated` from the delays in
//! `[supervision]`. Times are nanoseconds on the clock of the driver: in real time since the driver was made, otherwise
//! since sample 0.

use settings::Supervision;

use super::trial::Ruling;
use crate::event::{Event, What};
use crate::limits::{PLANT_HANG_NS, RECORDER_HANG_NS, RECORDER_START_NS};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Now {
    /// Time on the clock of the driver \[ns\].
    pub ns: u64,
    /// Tick of the newest sample.
    pub tick: u64,
}

/// Observation or request to which a role reacts.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RoleInput {
    /// The process of this epoch is ready to work.
    Ready(u32),
    /// The process of this epoch is active now.
    Activated(u32),
    Exited(u32),
    NotStarted(u32, String),
    /// The active process has answered to `done` of `samples` samples; `excused_ns` are not counted when a hang is
    /// judged.
    Progress {
        /// Ticks done, counted from the first of the run.
        done: u64,
        /// Number of samples to answer, counted from the first of the run.
        samples: u64,
        /// Time in which the driver itself did not run \[ns\].
        excused_ns: u64,
    },
    /// The active process works but is cut off from the others, with the reason.
    Disconnected(u32, String),
    /// Ruling of the trial of the candidate, with the reason.
    Ruled(Ruling, String),
    /// Swap number `n` of the scenario is due.
    SwapRequested(usize),
    /// A fault kills the active process; no other is started before the given time \[ns\].
    Kill(u64),
    /// A fault makes the active process end by itself; no other is started before the given time \[ns\].
    Hold(u64),
    /// A fault stops the active process.
    Stop,
    /// The fault that stopped this process is over.
    Continue(u32),
    Tick,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Action {
    /// Starts this epoch, with the program and settings of this swap, or of the run if `None`.
    Spawn(u32, Option<usize>),
    Signal(u32, Signal),
    /// Makes this epoch active when the next tick begins; a standby changes places with the active process.
    Activate(u32),
    /// Puts this epoch on standby: it answers beside the active process, and its messages are not delivered.
    Standby(u32),
    /// Removes this epoch from the role; its process answers no more samples.
    Vacate(u32),
    Report(Event),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Signal {
    Kill,
    Stop,
    Continue,
}

/// Samples in a row without an answer after which an active node counts as hung, if `supervision.hang_ms` has passed
/// too.
const HANG_TICKS: u64 = 3;
/// Window in which failures are counted together \[ns\].
const WINDOW_NS: u64 = 5_000_000_000;

/// Limits in which roles differ, most of them from `[supervision]`.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Policy {
    /// Delays before the first, second, ... restart within the window \[ns\]; one more failure gives the role up.
    pub restart_ns: Vec<u64>,
    /// Length of the window in which failures are counted \[ns\].
    pub window_ns: u64,
    /// Time after its start at which a process that is not ready counts as hung \[ns\].
    pub start_limit_ns: u64,
    /// Time without progress after which the active process counts as hung \[ns\], if `hang_ticks` samples passed too.
    pub hang_ns: u64,
    /// Samples without an answer after which the active process counts as hung, if `hang_ns` has passed too.
    pub hang_ticks: u64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Worker {
    epoch: u32,
    /// Swap whose program and settings the process has; `None` for those of the run.
    origin: Option<usize>,
}

/// Process that was started and is not ready yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Starting {
    worker: Worker,
    since_ns: u64,
    /// `true` if a swap started the process, `false` if the process replaces one that failed.
    candidate: bool,
}

/// Candidate on trial beside the process that it is to replace.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Contest {
    pub candidate: u32,
    /// Process before the candidate; `None` once it has ended.
    pub old: Option<u32>,
    /// `true` if the candidate is active.
    pub handed_over: bool,
}

/// Ticks done by the active process, and the time since which their number has not grown while a sample waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
struct Progress {
    done: u64,
    since_ns: u64,
}

/// Role of a node or of the recorder, with the processes that have run it, run it or are about to.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Role {
    name: &'static str,
    policy: Policy,
    newest: u32,
    active: Option<Worker>,
    standby: Option<Worker>,
    starting: Option<Starting>,
    /// Process that is ready, and active from the next tick on.
    pending: Option<Worker>,
    contest: Option<Contest>,
    restart_at_ns: Option<u64>,
    held_until_ns: u64,
    failures_ns: Vec<u64>,
    /// Processes that this role has killed and whose exits it has not seen yet.
    expected_exits: Vec<u32>,
    /// Swap whose program and settings a restart uses: the swap of the newest candidate that was kept, if any.
    origin: Option<usize>,
    progress: Progress,
    given_up: bool,
}

impl Policy {
    /// Returns the policy of a node whose samples are `sample_ns` apart.
    pub fn node(settings: &Supervision, sample_ns: u64) -> Self {
        let ns = |ms: f64| (ms * 1e6) as u64;
        Self {
            restart_ns: settings.restart_ms.iter().copied().map(ns).collect(),
            window_ns: WINDOW_NS,
            start_limit_ns: (settings.start_limit_s * 1e9) as u64,
            // One period less than `HANG_TICKS` samples take, because progress is seen late too.
            hang_ns: ns(settings.hang_ms).max(sample_ns * (HANG_TICKS - 1)),
            hang_ticks: HANG_TICKS,
        }
    }

    /// Returns the policy of the plant, which is never restarted: no other process can continue the vehicle.
    pub fn plant(settings: &Supervision, sample_ns: u64) -> Self {
        let node = Self::node(settings, sample_ns);
        Self { restart_ns: vec![], hang_ns: node.hang_ns.max(PLANT_HANG_NS), hang_ticks: 0, ..node }
    }

    /// Returns the policy of the recorder, with longer limits, because a disk may be slow.
    pub fn recorder(settings: &Supervision) -> Self {
        let node = Self::node(settings, 0);
        let start_limit_ns = node.start_limit_ns.max(RECORDER_START_NS);
        Self { start_limit_ns, hang_ns: RECORDER_HANG_NS, hang_ticks: 1, ..node }
    }
}

impl Role {
    /// Creates a role called `name` whose first process, epoch 1, is active.
    pub fn new(name: &'static str, policy: Policy) -> Self {
        Self {
            name,
            policy,
            newest: 1,
            active: Some(Worker { epoch: 1, origin: None }),
            standby: None,
            starting: None,
            pending: None,
            contest: None,
            restart_at_ns: None,
            held_until_ns: 0,
            failures_ns: vec![],
            expected_exits: vec![],
            origin: None,
            progress: Progress::default(),
            given_up: false,
        }
    }

    /// Handles `input` and returns the actions, in order.
    pub fn on(&mut self, now: Now, input: RoleInput) -> Vec<Action> {
        let mut actions = vec![];
        let out = &mut actions;
        match input {
            RoleInput::Ready(epoch) => self.ready(now, epoch, out),
            RoleInput::Activated(epoch) => self.activated(now, epoch, out),
            RoleInput::Exited(epoch) => self.exited(now, epoch, What::Died, None, out),
            RoleInput::NotStarted(epoch, why) => self.exited(now, epoch, What::NotStarted, Some(&why), out),
            RoleInput::Progress { done, samples, excused_ns } => self.progressed(now, done, samples, excused_ns, out),
            RoleInput::Disconnected(epoch, why) if self.active.is_some_and(|active| active.epoch == epoch) => {
                self.hung(now, epoch, Some(&why), out);
            }
            RoleInput::Disconnected(..) => {}
            RoleInput::Ruled(ruling, why) => self.ruled(now, ruling, &why, out),
            RoleInput::SwapRequested(swap) => self.swap_requested(now, swap, out),
            RoleInput::Kill(until_ns) => {
                self.held_until_ns = self.held_until_ns.max(until_ns);
                out.extend(self.active.map(|active| Action::Signal(active.epoch, Signal::Kill)));
            }
            RoleInput::Hold(until_ns) => self.held_until_ns = self.held_until_ns.max(until_ns),
            RoleInput::Stop => out.extend(self.active.map(|active| Action::Signal(active.epoch, Signal::Stop))),
            RoleInput::Continue(epoch) => out.push(Action::Signal(epoch, Signal::Continue)),
            RoleInput::Tick => self.tick(now, out),
        }
        actions
    }

    pub fn name(&self) -> &'static str {
        self.name
    }

    pub fn active(&self) -> Option<u32> {
        self.active.map(|worker| worker.epoch)
    }

    /// Returns the epoch that was started and is not ready yet, if any.
    pub fn starting(&self) -> Option<u32> {
        self.starting.map(|starting| starting.worker.epoch)
    }

    /// Returns the candidate on trial with the process before it, if any.
    pub fn contest(&self) -> Option<Contest> {
        self.contest
    }

    /// Returns the swap that started the candidate on trial, if any.
    pub fn swap_on_trial(&self) -> Option<usize> {
        let candidate = self.contest?.candidate;
        [self.active, self.standby].into_iter().flatten().find(|worker| worker.epoch == candidate)?.origin
    }

    /// Returns whether the role is given up: no process is started any more.
    pub fn given_up(&self) -> bool {
        self.given_up
    }

    pub fn newest(&self) -> u32 {
        self.newest
    }

    /// Returns whether `epoch` is active and no candidate is on trial.
    pub fn is_alone(&self, epoch: u32) -> bool {
        self.active() == Some(epoch) && self.contest.is_none()
    }

    /// Returns whether a candidate is starting or on trial.
    pub fn has_candidate(&self) -> bool {
        self.contest.is_some() || self.starting.is_some_and(|starting| starting.candidate)
    }

    /// Returns whether a process is starting, pending or on trial, or a restart is due.
    pub fn is_busy(&self) -> bool {
        self.starting.is_some() || self.pending.is_some() || self.contest.is_some() || self.restart_at_ns.is_some()
    }

    /// Returns the latest time to send [`RoleInput::Tick`] \[ns\]; `None` if nothing is due.
    pub fn due_ns(&self) -> Option<u64> {
        let restart_ns = self.restart_at_ns.map(|at_ns| at_ns.max(self.held_until_ns));
        let limit_ns = self.starting.map(|starting| starting.since_ns + self.policy.start_limit_ns + 1);
        restart_ns.into_iter().chain(limit_ns).min()
    }

    /// Returns the time at which the active process, if any, counts as hung if it answers to no more samples \[ns\].
    /// Samples are seen from `origin_ns` on, `sample_ns` apart.
    pub fn hangs_at_ns(&self, sample_ns: u64, origin_ns: u64) -> Option<u64> {
        let last = (self.progress.done + self.policy.hang_ticks).saturating_sub(1);
        self.active.map(|_| (origin_ns + last * sample_ns).max(self.progress.since_ns + self.policy.hang_ns))
    }

    /// Returns `Ok` if a swap may begin now, else the reason why not.
    pub fn may_swap(&self) -> Result<(), String> {
        let name = self.name;
        if self.given_up {
            return Err(format!("{name} was given up: too many of its processes have failed"));
        }
        if self.contest.is_some() || self.starting.is_some() || self.pending.is_some() {
            return Err(format!(
                "{name} has a candidate already, or another process of it is starting; wait until that is over"
            ));
        }
        if self.active.is_none() {
            return Err(format!("{name} has no active process to take over from"));
        }
        Ok(())
    }

    fn ready(&mut self, now: Now, epoch: u32, out: &mut Vec<Action>) {
        let Some(Starting { worker, candidate, .. }) = self.starting.take_if(|s| s.worker.epoch == epoch) else {
            return;
        };
        if candidate {
            self.standby = Some(worker);
            self.contest = Some(Contest { candidate: epoch, old: self.active(), handed_over: false });
            out.push(Action::Standby(epoch));
            self.report(now, epoch, What::OnStandby, None, out);
        } else {
            self.pending = Some(worker);
            out.push(Action::Activate(epoch));
        }
    }

    fn activated(&mut self, now: Now, epoch: u32, out: &mut Vec<Action>) {
        if let Some(pending) = self.pending.take_if(|pending| pending.epoch == epoch) {
            self.active = Some(pending);
        } else if self.standby.is_some_and(|standby| standby.epoch == epoch) {
            std::mem::swap(&mut self.active, &mut self.standby);
        } else {
            return;
        }
        if let Some(contest) = &mut self.contest {
            contest.handed_over = contest.candidate == epoch;
        }
        self.progress = Progress { done: 0, since_ns: now.ns };
        // A killed process may now be the standby.
        out.extend(self.expected_exits.iter().map(|epoch| Action::Vacate(*epoch)));
        self.report(now, epoch, What::TookOver, None, out);
    }

    /// Handles the end of process `epoch`: reports `what`, unless this role has killed the process.
    fn exited(&mut self, now: Now, epoch: u32, what: What, why: Option<&str>, out: &mut Vec<Action>) {
        let known = self.expected_exits.len();
        self.expected_exits.retain(|other| *other != epoch);
        if self.expected_exits.len() < known {
            out.push(Action::Vacate(epoch));
        } else if self.knows(epoch) {
            self.report(now, epoch, what, why, out);
            self.lost(now, epoch, why.unwrap_or("it died"), out);
        }
    }

    fn hung(&mut self, now: Now, epoch: u32, why: Option<&str>, out: &mut Vec<Action>) {
        self.report(now, epoch, What::Hung, why, out);
        self.kill(epoch, out);
        self.lost(now, epoch, "it hung", out);
    }

    /// Removes process `epoch`, which no longer works, with its trial if it was the candidate, and fills the role.
    fn lost(&mut self, now: Now, epoch: u32, why: &str, out: &mut Vec<Action>) {
        out.push(Action::Vacate(epoch));
        let is = |worker: &mut Worker| worker.epoch == epoch;
        self.active.take_if(is);
        self.standby.take_if(is);
        self.pending.take_if(is);
        if let Some(starting) = self.starting.take_if(|starting| starting.worker.epoch == epoch)
            && starting.candidate
        {
            let why = if why == "it died" { "it died before it was ready" } else { why };
            self.report(now, epoch, What::Rejected, Some(why), out);
        }
        if let Some(contest) = &mut self.contest {
            if contest.candidate == epoch {
                let what = if contest.handed_over { What::Returned } else { What::Rejected };
                self.contest = None;
                self.report(now, epoch, what, Some(why), out);
            } else if contest.old == Some(epoch) {
                contest.old = None; // the trial goes on without the old process
            }
        }
        self.fill(now, epoch, out);
    }

    /// Fills the role, if it is empty, after `epoch` has gone: with the standby, or else by a restart.
    fn fill(&mut self, now: Now, epoch: u32, out: &mut Vec<Action>) {
        if self.active.is_some() || self.pending.is_some() {
            return;
        }
        if let Some(standby) = self.standby {
            out.push(Action::Activate(standby.epoch));
            return;
        }
        // A candidate that is not ready has not been judged yet, so it is not waited for.
        if let Some(late) = self.starting.take_if(|starting| starting.candidate) {
            let late = late.worker.epoch;
            self.kill(late, out);
            self.report(now, late, What::Rejected, Some("the active process ended before it was ready"), out);
        }
        if self.starting.is_none() && self.restart_at_ns.is_none() && !self.given_up {
            self.count_failure(now, epoch, out);
        }
    }

    fn count_failure(&mut self, now: Now, epoch: u32, out: &mut Vec<Action>) {
        let window_ns = self.policy.window_ns;
        self.failures_ns.retain(|at_ns| now.ns.saturating_sub(*at_ns) < window_ns);
        if let Some(wait_ns) = self.policy.restart_ns.get(self.failures_ns.len()) {
            self.failures_ns.push(now.ns);
            self.restart_at_ns = Some(now.ns + wait_ns);
        } else {
            self.given_up = true;
            if !self.policy.restart_ns.is_empty() {
                self.report(now, epoch, What::GivenUp, None, out);
            }
        }
    }

    fn progressed(&mut self, now: Now, done: u64, samples: u64, excused_ns: u64, out: &mut Vec<Action>) {
        let Some(active) = self.active else { return };
        if done == self.progress.done && samples > done {
            self.progress.since_ns += excused_ns;
        } else {
            self.progress = Progress { done, since_ns: now.ns };
        }
        let unanswered = samples >= done.saturating_add(self.policy.hang_ticks);
        if unanswered && now.ns.saturating_sub(self.progress.since_ns) >= self.policy.hang_ns {
            self.hung(now, active.epoch, None, out);
        }
    }

    fn ruled(&mut self, now: Now, ruling: Ruling, why: &str, out: &mut Vec<Action>) {
        let Some(Contest { candidate, old, handed_over }) = self.contest else { return };
        let what = match ruling {
            Ruling::HandOver if !handed_over => {
                out.push(Action::Activate(candidate));
                return;
            }
            Ruling::Keep if handed_over => What::Kept,
            Ruling::Reject if !handed_over => What::Rejected,
            Ruling::Return if handed_over => What::Returned,
            _ => return, // the ruling is from before candidate and old process changed places
        };
        self.contest = None;
        self.report(now, candidate, what, Some(why), out);
        let leaves = if what == What::Kept { old } else { Some(candidate) };
        if what == What::Kept {
            self.origin = self.active.and_then(|active| active.origin);
        }
        let Some(leaves) = leaves else { return };
        self.kill(leaves, out);
        let returns = what == What::Returned && old.is_some();
        if returns {
            // The messages of the candidate are delivered until the old one is active.
            (self.active, self.pending) = (None, self.standby.take());
            out.extend(old.map(Action::Activate));
        } else {
            out.push(Action::Vacate(leaves));
            self.active.take_if(|worker| worker.epoch == leaves);
            self.standby.take_if(|worker| worker.epoch == leaves);
            self.fill(now, leaves, out);
        }
    }

    fn swap_requested(&mut self, now: Now, swap: usize, out: &mut Vec<Action>) {
        match self.may_swap() {
            Ok(()) => self.spawn(now, Some(swap), out),
            Err(why) => {
                let rejected = Event::new(now.tick, self.name, self.newest, What::Rejected);
                out.push(Action::Report(rejected.because(why).begins(Some(swap))));
            }
        }
    }

    fn tick(&mut self, now: Now, out: &mut Vec<Action>) {
        let held = now.ns < self.held_until_ns;
        if self.restart_at_ns.take_if(|at_ns| now.ns >= *at_ns && !held).is_some() {
            self.spawn(now, None, out);
        }
        let limit_ns = self.policy.start_limit_ns;
        if let Some(late) = self.starting.filter(|starting| now.ns.saturating_sub(starting.since_ns) > limit_ns) {
            self.hung(now, late.worker.epoch, None, out);
        }
    }

    /// Starts another process: the candidate of `swap`, if any; otherwise one with the program of the newest candidate
    /// that was kept, or with the program of the run.
    fn spawn(&mut self, now: Now, swap: Option<usize>, out: &mut Vec<Action>) {
        self.newest += 1;
        let origin = swap.or(self.origin);
        let worker = Worker { epoch: self.newest, origin };
        self.starting = Some(Starting { worker, since_ns: now.ns, candidate: swap.is_some() });
        let started = Event::new(now.tick, self.name, worker.epoch, What::Started);
        out.push(Action::Report(Event { origin, ..started.begins(swap) }));
        out.push(Action::Spawn(worker.epoch, origin));
    }

    fn kill(&mut self, epoch: u32, out: &mut Vec<Action>) {
        self.expected_exits.push(epoch);
        out.push(Action::Signal(epoch, Signal::Kill));
    }

    fn knows(&self, epoch: u32) -> bool {
        let starting = self.starting.map(|starting| starting.worker);
        let workers = [self.active, self.standby, self.pending, starting];
        workers.into_iter().flatten().any(|worker| worker.epoch == epoch)
    }

    fn report(&self, now: Now, epoch: u32, what: What, why: Option<&str>, out: &mut Vec<Action>) {
        let event = Event::new(now.tick, self.name, epoch, what);
        out.push(Action::Report(why.map_or(event.clone(), |why| event.because(why))));
    }
}

#[cfg(test)]
mod tests;
