//! Driver of the roles without a clock: the delays that a clock would show are simulated.
//!
//! ```text
//! a process ends    seen `DETECT_NS` later         a process is started    ready `supervision.start_ms` later
//! ```
//!
//! Lockstep and in process share this driver. Between two ticks it decides which processes end, which are started, and
//! which work on the second tick. An event between two samples takes effect with the second sample. A candidate is
//! ready at once: no answer is missing while it starts.

use contract::topic::Topic;
use runtime::shared_role::Assignment;
use settings::Scenario;

use super::Order;
use super::process_faults::FaultInputs;
use super::role::{Action, Now, RoleInput, Signal};
use super::supervised::Supervised;
use crate::event::Event;
use crate::record::Record;

/// Delay from the end of a process until it is seen \[ns\]: the median that `trefoil measure faults` finds in real
/// time.
const DETECT_NS: u64 = 2_000_000;

/// Roles of all nodes, and the time of the flight.
pub struct Simulated {
    scenario: Scenario,
    pub nodes: [Supervised; Topic::COUNT],
    faults: FaultInputs,
    /// Inputs to come, each with the time at which it is seen \[ns\].
    ahead: Vec<(u64, Topic, RoleInput)>,
    /// Active and standby processes of the present tick.
    assignments: [Assignment; Topic::COUNT],
    /// Stopped process of each node, with the first tick that it has not answered.
    stopped: [Option<(u32, u64)>; Topic::COUNT],
    /// Processes to start and to kill before the tick that begins.
    orders: Vec<Order>,
    /// Tick that begins.
    boundary: u64,
    /// First tick on which anything may change.
    next: u64,
    /// Events so far.
    pub events: Vec<Event>,
}

impl Simulated {
    /// Creates the driver of a run of `scenario` whose first processes are active.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            scenario: scenario.clone(),
            nodes: Supervised::all(scenario),
            faults: FaultInputs::new(scenario),
            ahead: vec![],
            assignments: [Assignment { active: 1, standby: 0 }; Topic::COUNT],
            stopped: [None; Topic::COUNT],
            orders: vec![],
            boundary: 0,
            next: 0,
            events: vec![],
        }
    }

    /// Returns the active and the standby process of the node that publishes on `topic`, without a stopped process.
    pub fn assignment(&self, topic: Topic) -> Assignment {
        let assignment = self.assignments[topic as usize];
        self.stopped[topic as usize].map_or(assignment, |(epoch, _)| assignment.without(epoch))
    }

    /// Returns the first tick on which [`Self::begin`] may change anything.
    pub fn next_decision(&self) -> u64 {
        self.next
    }

    pub fn observe(&mut self, record: &Record) {
        self.nodes.iter_mut().for_each(|node| node.observe(record));
    }

    /// Decides which processes work on `tick`, after all messages of earlier ticks were observed. Returns the processes
    /// to start ([`Action::Spawn`]) and to kill ([`Action::Signal`]) before `tick`.
    pub fn begin(&mut self, tick: u64) -> Vec<Order> {
        if tick < self.next {
            return vec![];
        }
        self.boundary = tick;
        let now = Now { ns: self.faults.time_ns(tick), tick };
        self.pass(now.ns);
        for topic in Topic::ALL {
            self.notice_stopped(topic, now);
            if let Some(ruled) = self.nodes[topic as usize].ruling(tick) {
                self.on(topic, now, ruled);
            }
        }
        for (i, swap) in self.scenario.swap.clone().iter().enumerate() {
            let begins = swap.ticks(self.scenario.sample_s()).from == tick;
            if begins {
                self.on(swap.node, now, RoleInput::SwapRequested(i));
            }
        }
        let nodes = &self.nodes;
        for (topic, input) in self.faults.due(tick, |topic| nodes[topic as usize].role.active()) {
            self.on(topic, now, input);
        }
        self.pass(now.ns);
        self.next = self.next_after(tick);
        std::mem::take(&mut self.orders)
    }

    /// Removes process `epoch`, which ended before it answered to `tick`; its role sees `input` after `DETECT_NS`.
    pub fn exited(&mut self, topic: Topic, epoch: u32, tick: u64, input: RoleInput) {
        self.remove(topic, epoch);
        let seen_ns = self.faults.time_ns(tick) + DETECT_NS;
        self.ahead.push((seen_ns, topic, input));
        self.next = tick + 1;
    }

    /// Advances the time to `now_ns`: the roles get every input that is seen by then, in order.
    fn pass(&mut self, now_ns: u64) {
        loop {
            let seen =
                self.ahead.iter().enumerate().min_by_key(|(_, (at_ns, ..))| *at_ns).map(|(i, (at_ns, ..))| (*at_ns, i));
            let due = self
                .nodes
                .iter()
                .filter_map(|node| Some((node.role.due_ns()?, node.topic)))
                .min_by_key(|(due_ns, _)| *due_ns);
            match (seen, due) {
                (Some((at_ns, i)), due) if at_ns <= now_ns && due.is_none_or(|(due_ns, _)| at_ns <= due_ns) => {
                    let (_, topic, input) = self.ahead.remove(i);
                    self.on(topic, self.at(at_ns), input);
                }
                (_, Some((due_ns, topic))) if due_ns <= now_ns => self.on(topic, self.at(due_ns), RoleInput::Tick),
                _ => return,
            }
        }
    }

    /// Tells the role of a stopped process that the process has answered to no sample since it stopped.
    fn notice_stopped(&mut self, topic: Topic, now: Now) {
        let Some((epoch, first)) = self.stopped[topic as usize] else { return };
        if self.nodes[topic as usize].role.active() != Some(epoch) || now.tick <= first {
            return;
        }
        // The newest sample is seen `DETECT_NS` after it was taken. So was the last answer, after its own sample.
        let seen_ns = self.faults.time_ns(now.tick - 1) + DETECT_NS;
        let progress = RoleInput::Progress { done: first, samples: now.tick, excused_ns: 0 };
        self.on(topic, self.at(seen_ns), progress);
        self.pass(now.ns);
    }

    fn on(&mut self, topic: Topic, now: Now, input: RoleInput) {
        for action in self.nodes[topic as usize].on(&self.scenario, now, self.boundary, input) {
            self.act(topic, now, action);
        }
    }

    fn act(&mut self, topic: Topic, now: Now, action: Action) {
        let at_ns = |delay_ns| now.ns + delay_ns;
        match action {
            Action::Spawn(epoch, _) => {
                self.orders.push((topic, action));
                let node = &self.nodes[topic as usize].role;
                let waited_for = node.active().is_none();
                let start_ns = if waited_for { (self.scenario.supervision.start_ms * 1e6) as u64 } else { 0 };
                self.ahead.push((at_ns(start_ns), topic, RoleInput::Ready(epoch)));
            }
            Action::Signal(epoch, Signal::Kill) => {
                self.orders.push((topic, action));
                self.remove(topic, epoch);
                let seen_ns = at_ns(DETECT_NS);
                self.ahead.push((seen_ns, topic, RoleInput::Exited(epoch)));
            }
            Action::Signal(epoch, Signal::Stop) => {
                let first = self.boundary;
                self.stopped[topic as usize] = Some((epoch, first));
                // The process has answered to every sample until now.
                let seen_ns = self.faults.time_ns(first.saturating_sub(1)) + DETECT_NS;
                let progress = RoleInput::Progress { done: first, samples: first, excused_ns: 0 };
                self.on(topic, self.at(seen_ns), progress);
            }
            Action::Signal(epoch, Signal::Continue) => {
                self.stopped[topic as usize].take_if(|(stopped, _)| *stopped == epoch);
            }
            Action::Activate(epoch) => {
                let Assignment { active, standby } = self.assignments[topic as usize];
                let standby = if standby == epoch { active } else { standby };
                self.assignments[topic as usize] = Assignment { active: epoch, standby };
                self.on(topic, Now { tick: self.boundary, ..now }, RoleInput::Activated(epoch));
            }
            Action::Standby(epoch) => self.assignments[topic as usize].standby = epoch,
            Action::Vacate(epoch) => self.remove(topic, epoch),
            Action::Report(event) => self.events.push(event),
        }
    }

    /// Removes process `epoch`, which no longer works.
    fn remove(&mut self, topic: Topic, epoch: u32) {
        let assignment = &mut self.assignments[topic as usize];
        *assignment = assignment.without(epoch);
        self.stopped[topic as usize].take_if(|(stopped, _)| *stopped == epoch);
    }

    /// Returns the next tick after `tick` on which anything may change.
    fn next_after(&self, tick: u64) -> u64 {
        let busy = self.nodes.iter().any(|node| node.role.is_busy());
        if busy || !self.ahead.is_empty() || self.stopped.iter().any(Option::is_some) {
            return tick + 1;
        }
        let swaps = self.scenario.swap.iter().map(|swap| swap.ticks(self.scenario.sample_s()).from);
        let after = swaps.filter(|from| *from > tick).chain(self.faults.next_tick(tick + 1));
        after.min().unwrap_or(u64::MAX)
    }

    /// Returns the instant `ns` of the flight, with the newest sample by then.
    fn at(&self, ns: u64) -> Now {
        Now { ns, tick: ns / self.scenario.sample_ns() }
    }
}

#[cfg(test)]
mod tests;
