//! The roles of a flight against the clock: what is seen on the control page goes in, orders to processes come out.
//!
//! The end of a process is seen through a pidfd, a hang by the progress of the ticks themselves: no heartbeat that could outlive
//! the work. The instant at which a process will count as hung is known beforehand, and the launcher sleeps no longer than that.

use std::time::{Duration, Instant};

use contract::scenario::{Fault, Scenario};
use contract::topic::Topic;
use runtime::realtime::{ControlPage, now_ns};
use runtime::shared_role::{Assignment, SharedRole};

use super::process_faults::ProcessFaults;
use super::role::{Action, Input, Now};
use super::supervised::Supervised;
use crate::log::Record;

/// How often everything is looked at, at least.
const LOOK: Duration = Duration::from_millis(5);
/// How soon again when a process may hang.
const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// A sample is looked for so long after it was due: the plant needs a moment to take it \[ns\].
const GRACE_NS: u64 = 500_000;

/// The roles of all nodes of one run.
pub struct Realtime {
    nodes: [Supervised; Topic::COUNT],
    faults: ProcessFaults,
    sample_ns: u64,
    /// Which of the swaps have begun.
    begun: Vec<bool>,
    /// The newest sample observed: all messages of the ticks before it have been observed too, or are late.
    observed: u64,
    started: Instant,
    /// When to look again.
    due: Instant,
}

impl Realtime {
    /// For a run of `scenario` whose first processes are active.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            nodes: Supervised::all(scenario),
            faults: ProcessFaults::new(scenario),
            sample_ns: scenario.sample_ns(),
            begun: vec![],
            observed: 0,
            started: Instant::now(),
            due: Instant::now(),
        }
    }

    /// The roles.
    pub fn nodes(&self) -> &[Supervised] {
        &self.nodes
    }

    /// Takes one message in: trials are decided by them.
    pub fn observe(&mut self, record: &Record) {
        if let Record::State(state) = record
            && record.is_intact()
        {
            self.observed = self.observed.max(state.stamp.tick);
        }
        self.nodes.iter_mut().for_each(|node| node.observe(record));
    }

    /// Takes fault `number` as it is from now on.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault);
    }

    /// Takes `input` in; what is left to be done after the control page was changed.
    pub fn on(&mut self, page: &ControlPage, scenario: &Scenario, topic: Topic, input: Input) -> Vec<(Topic, Action)> {
        let now = self.now(page);
        // The sample under way is answered already, or by the active process.
        let actions = self.nodes[topic as usize].on(scenario, now, now.tick + 2, input);
        let rest = actions.into_iter().filter(|action| !share(page, page.role(topic), topic, now.tick, action));
        rest.map(|action| (topic, action)).collect()
    }

    /// Looks at everything; what is to be done. Swaps may have been added to `scenario` since the last look.
    pub fn look(&mut self, page: &ControlPage, scenario: &Scenario) -> Vec<(Topic, Action)> {
        let at = Instant::now();
        let tick = plant_tick(page);
        let excused_ns = at.saturating_duration_since(self.due).as_nanos() as u64;
        let mut orders = vec![];
        let nodes = &self.nodes;
        for (topic, input) in self.faults.due(tick, |topic| nodes[topic as usize].role.active()) {
            let input = match input {
                Input::Kill(until_ns) => Input::Kill(until_ns + self.lead_in_ns(page)),
                Input::Hold(until_ns) => Input::Hold(until_ns + self.lead_in_ns(page)),
                other => other,
            };
            orders.extend(self.on(page, scenario, topic, input));
        }
        self.begun.resize(scenario.swap.len(), false);
        for (i, swap) in scenario.swap.iter().enumerate() {
            let is_due = tick > 0 && tick >= swap.ticks(scenario.sample_s()).from && !self.begun[i];
            let has_room = |topic: &Topic| !self.nodes[*topic as usize].role.has_candidate();
            if let Some(topic) = swap.node.topic().filter(|_| is_due).filter(has_room) {
                self.begun[i] = true;
                orders.extend(self.on(page, scenario, topic, Input::SwapRequested(i)));
            }
        }
        for topic in Topic::ALL {
            orders.extend(self.on(page, scenario, topic, Input::Tick));
            for input in self.seen(page, topic, tick, excused_ns) {
                orders.extend(self.on(page, scenario, topic, input));
            }
            if let Some(ruled) = self.nodes[topic as usize].ruling(self.observed) {
                orders.extend(self.on(page, scenario, topic, ruled));
            }
        }
        self.due = self.next_look(page, at);
        orders
    }

    /// When to look again.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// What the control page shows of one node.
    fn seen(&self, page: &ControlPage, topic: Topic, tick: u64, excused_ns: u64) -> Vec<Input> {
        let (role, shared) = (&self.nodes[topic as usize].role, page.role(topic));
        let mut seen = vec![];
        seen.extend(role.starting().filter(|epoch| tick > 0 && shared.met.get() == *epoch).map(Input::Ready));
        let active = shared.active();
        if active == 0 {
            return seen;
        }
        if role.active() == Some(active) {
            let samples = match topic {
                Topic::State => u64::MAX, // nobody samples for the plant: time alone tells
                _ if tick == 0 => 0,
                _ => tick + 1,
            };
            seen.push(Input::Progress { done: u64::from(shared.done(active).get()), samples, excused_ns });
        } else {
            seen.push(Input::Activated(active));
        }
        seen
    }

    fn now(&self, page: &ControlPage) -> Now {
        Now { ns: self.started.elapsed().as_nanos() as u64, tick: plant_tick(page) }
    }

    /// From the start of this driver to sample 0 \[ns\].
    fn lead_in_ns(&self, page: &ControlPage) -> u64 {
        let since_sample_0_ns = now_ns().saturating_sub(page.origin_ns());
        (self.started.elapsed().as_nanos() as u64).saturating_sub(since_sample_0_ns)
    }

    /// Soon enough for a start that is due, and for a process that may hang by then.
    fn next_look(&self, page: &ControlPage, at: Instant) -> Instant {
        let origin_ns = (page.origin_ns() > 0).then(|| self.lead_in_ns(page) + GRACE_NS);
        let starts = self.nodes.iter().filter_map(|node| node.role.due_ns());
        let hangs = self.nodes.iter().filter_map(|node| node.role.hangs_at_ns(self.sample_ns, origin_ns?));
        let instants = starts.chain(hangs).map(|ns| self.started + Duration::from_nanos(ns));
        instants.map(|next| next.max(at + LOOK_AGAIN)).fold(at + LOOK, Instant::min)
    }
}

/// Does what `action` means for the control page; false when it means something else.
fn share(page: &ControlPage, shared: &SharedRole, topic: Topic, tick: u64, action: &Action) -> bool {
    match *action {
        Action::Activate(epoch) => shared.set_pending(epoch),
        Action::Standby(epoch) => shared.assign(tick as u32, |work| Assignment { standby: epoch, ..work }),
        Action::Vacate(epoch) => {
            shared.dismiss(epoch);
            page.doorbell(topic).ring();
        }
        Action::Spawn(..) | Action::Signal(..) | Action::Report(_) => return false,
    }
    true
}

/// Ticks that the plant has sampled, but for the newest.
pub fn plant_tick(page: &ControlPage) -> u64 {
    u64::from(page.role(Topic::State).done(1).get()).saturating_sub(1)
}
