//! The roles of a flight without a clock: what a clock would have shown takes as long as `[supervision]` says.
//!
//! ```text
//! a process ends    seen `detect_ms` later         a process is started    ready `start_ms` later
//! ```
//!
//! Lockstep and in process share this driver: between two ticks it says which processes end and which begin, and who works on
//! the tick. Whatever happens between two samples takes effect with the second one. A candidate is ready at once: no answer is
//! missing while it starts.

use contract::Scenario;
use contract::topic::Topic;
use runtime::shared_role::Assignment;

use super::driver::Order;
use super::process_faults::FaultInputs;
use super::role::{Action, Input, Now, Signal};
use super::supervised::Supervised;
use crate::event::Event;
use crate::log::Record;

/// The roles of all nodes, and the time of the flight.
pub struct Simulated {
    scenario: Scenario,
    pub nodes: [Supervised; Topic::COUNT],
    faults: FaultInputs,
    /// What is to be seen, and when \[ns\].
    ahead: Vec<(u64, Topic, Input)>,
    /// Who works on the present tick.
    assignments: [Assignment; Topic::COUNT],
    /// The process of each node that is stopped, and the first tick that it has not answered.
    stopped: [Option<(u32, u64)>; Topic::COUNT],
    /// Processes to be started and killed before it.
    orders: Vec<Order>,
    /// The tick that begins.
    boundary: u64,
    /// The first tick on which anything may change.
    next: u64,
    /// Everything that happened.
    pub events: Vec<Event>,
}

impl Simulated {
    /// For a run of `scenario`, whose first processes are active.
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

    /// Who works for the node that speaks on `topic`; a process that is stopped does not.
    pub fn assignment(&self, topic: Topic) -> Assignment {
        let assignment = self.assignments[topic as usize];
        self.stopped[topic as usize].map_or(assignment, |(epoch, _)| assignment.without(epoch))
    }

    /// The first tick from which on [`Self::begin`] may change anything.
    pub fn next_decision(&self) -> u64 {
        self.next
    }

    pub fn observe(&mut self, record: &Record) {
        self.nodes.iter_mut().for_each(|node| node.observe(record));
    }

    /// Decides who works on `tick`, when all messages of the ticks before have been observed; which processes
    /// are to be started ([`Action::Spawn`]) and killed ([`Action::Signal`]) before it.
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
            if let Some(topic) = swap.node.topic().filter(|_| begins) {
                self.on(topic, now, Input::SwapRequested(i));
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

    /// The process `epoch` has ended by itself, before it answered to `tick`.
    pub fn exited(&mut self, topic: Topic, epoch: u32, tick: u64, input: Input) {
        self.remove(topic, epoch);
        let seen_ns = self.faults.time_ns(tick) + self.detect_ns();
        self.ahead.push((seen_ns, topic, input));
        self.next = tick + 1;
    }

    /// Lets the time pass until `now_ns`: everything that is seen until then is seen in order.
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
                (_, Some((due_ns, topic))) if due_ns <= now_ns => self.on(topic, self.at(due_ns), Input::Tick),
                _ => return,
            }
        }
    }

    /// What would be seen of a stopped process: that it has answered to no sample since.
    fn notice_stopped(&mut self, topic: Topic, now: Now) {
        let Some((epoch, first)) = self.stopped[topic as usize] else { return };
        if self.nodes[topic as usize].role.active() != Some(epoch) || now.tick <= first {
            return;
        }
        // The newest sample was seen shortly after it was taken, and the last answer as long after its own.
        let seen_ns = self.faults.time_ns(now.tick - 1) + self.detect_ns();
        let progress = Input::Progress { done: first, samples: now.tick, excused_ns: 0 };
        self.on(topic, self.at(seen_ns), progress);
        self.pass(now.ns);
    }

    fn on(&mut self, topic: Topic, now: Now, input: Input) {
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
                self.ahead.push((at_ns(start_ns), topic, Input::Ready(epoch)));
            }
            Action::Signal(epoch, Signal::Kill) => {
                self.orders.push((topic, action));
                self.remove(topic, epoch);
                let seen_ns = at_ns(self.detect_ns());
                self.ahead.push((seen_ns, topic, Input::Exited(epoch)));
            }
            Action::Signal(epoch, Signal::Stop) => {
                let first = self.boundary;
                self.stopped[topic as usize] = Some((epoch, first));
                // Until now it has answered to everything.
                let seen_ns = self.faults.time_ns(first.saturating_sub(1)) + self.detect_ns();
                let progress = Input::Progress { done: first, samples: first, excused_ns: 0 };
                self.on(topic, self.at(seen_ns), progress);
            }
            Action::Signal(epoch, Signal::Continue) => {
                self.stopped[topic as usize].take_if(|(stopped, _)| *stopped == epoch);
            }
            Action::Activate(epoch) => {
                let Assignment { active, standby } = self.assignments[topic as usize];
                let standby = if standby == epoch { active } else { standby };
                self.assignments[topic as usize] = Assignment { active: epoch, standby };
                self.on(topic, Now { tick: self.boundary, ..now }, Input::Activated(epoch));
            }
            Action::Standby(epoch) => self.assignments[topic as usize].standby = epoch,
            Action::Vacate(epoch) => self.remove(topic, epoch),
            Action::Report(event) => self.events.push(event),
        }
    }

    /// The process `epoch` works no longer.
    fn remove(&mut self, topic: Topic, epoch: u32) {
        let assignment = &mut self.assignments[topic as usize];
        *assignment = assignment.without(epoch);
        self.stopped[topic as usize].take_if(|(stopped, _)| *stopped == epoch);
    }

    /// The next tick after `tick` on which anything may change.
    fn next_after(&self, tick: u64) -> u64 {
        let busy = self.nodes.iter().any(|node| node.role.is_busy());
        if busy || !self.ahead.is_empty() || self.stopped.iter().any(Option::is_some) {
            return tick + 1;
        }
        let swaps = self.scenario.swap.iter().map(|swap| swap.ticks(self.scenario.sample_s()).from);
        let after = swaps.filter(|from| *from > tick).chain(self.faults.next_tick(tick + 1));
        after.min().unwrap_or(u64::MAX)
    }

    /// The instant `ns` of the flight, with the newest sample then.
    fn at(&self, ns: u64) -> Now {
        Now { ns, tick: ns / self.scenario.sample_ns() }
    }

    /// From the end of a process to when it is seen \[ns\].
    fn detect_ns(&self) -> u64 {
        (self.scenario.supervision.detect_ms * 1e6) as u64
    }
}

#[cfg(test)]
mod tests;
