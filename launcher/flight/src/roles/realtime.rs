//! Driver of the roles in real time: reads the control page, and orders processes to be started and signalled.
//!
//! The launcher reports the end of a process (`stack/children.rs`: a pidfd wakes it, `waitid` finds the process). This
//! driver sees a hang by the progress of the ticks themselves, because a heartbeat could outlive the work. The instant
//! at which a process will count as hung is known beforehand, and the launcher sleeps no longer than until then.

use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::topic::Topic;
use runtime::realtime::{ControlPage, now_ns};
use runtime::shared_role::Assignment;
use settings::{Fault, Scenario};

use super::driver::Driver;
use crate::limits::{GRACE_NS, LOOK, LOOK_AGAIN};
use crate::log::Record;
use ring::roles::Order;
use ring::roles::process_faults::FaultInputs;
use ring::roles::role::{Action, Now, RoleInput};
use ring::roles::supervised::Supervised;

pub struct RealtimeRoles {
    page: Arc<ControlPage>,
    nodes: [Supervised; Topic::COUNT],
    faults: FaultInputs,
    sample_ns: u64,
    /// `true` for each swap that has begun.
    begun: Vec<bool>,
    /// Tick of the newest sample observed: all messages of earlier ticks have been observed too, or are late.
    observed: u64,
    started: Instant,
    due: Instant,
}

impl RealtimeRoles {
    /// Creates the driver of a run of `scenario` whose first processes are active.
    pub fn new(scenario: &Scenario, page: Arc<ControlPage>) -> Self {
        Self {
            page,
            nodes: Supervised::all(scenario),
            faults: FaultInputs::new(scenario),
            sample_ns: scenario.sample_ns(),
            begun: vec![],
            observed: 0,
            started: Instant::now(),
            due: Instant::now(),
        }
    }

    /// Reads the inputs of the role of one node from the control page.
    fn seen(&self, topic: Topic, tick: u64, excused_ns: u64) -> Vec<RoleInput> {
        let (role, shared) = (&self.nodes[topic as usize].role, self.page.role(topic));
        let mut seen = vec![];
        seen.extend(role.starting().filter(|epoch| tick > 0 && shared.observed.get() == *epoch).map(RoleInput::Ready));
        let active = shared.active();
        if active == 0 {
            return seen;
        }
        if role.active() == Some(active) {
            let samples = match topic {
                Topic::State => u64::MAX, // the plant takes the samples itself: only the time without progress counts
                _ if tick == 0 => 0,
                _ => tick + 1,
            };
            seen.push(RoleInput::Progress { done: u64::from(shared.done(active).get()), samples, excused_ns });
        } else {
            seen.push(RoleInput::Activated(active));
        }
        seen
    }

    fn now(&self) -> Now {
        Now { ns: self.started.elapsed().as_nanos() as u64, tick: self.page.plant_tick() }
    }

    /// Returns the time from the start of this driver to sample 0 \[ns\].
    fn lead_in_ns(&self) -> u64 {
        let since_sample_0_ns = now_ns().saturating_sub(self.page.origin_ns.get());
        (self.started.elapsed().as_nanos() as u64).saturating_sub(since_sample_0_ns)
    }

    /// Returns the instant of the look after `at`: the first instant at which a restart is due or a process may count
    /// as hung, but at least [`LOOK_AGAIN`] and at most [`LOOK`] after `at`.
    fn next_look(&self, at: Instant) -> Instant {
        let origin_ns = (self.page.origin_ns.get() > 0).then(|| self.lead_in_ns() + GRACE_NS);
        let starts = self.nodes.iter().filter_map(|node| node.role.due_ns());
        let hangs = self.nodes.iter().filter_map(|node| node.role.hangs_at_ns(self.sample_ns, origin_ns?));
        let instants = starts.chain(hangs).map(|ns| self.started + Duration::from_nanos(ns));
        instants.map(|next| next.max(at + LOOK_AGAIN)).fold(at + LOOK, Instant::min)
    }
}

impl Driver for RealtimeRoles {
    fn nodes(&self) -> &[Supervised; Topic::COUNT] {
        &self.nodes
    }

    fn observe(&mut self, record: &Record) {
        if let Record::State(state) = record
            && record.is_intact()
        {
            self.observed = self.observed.max(state.stamp.tick);
        }
        self.nodes.iter_mut().for_each(|node| node.observe(record));
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault);
    }

    fn on(&mut self, scenario: &Scenario, topic: Topic, input: RoleInput) -> Vec<Order> {
        let now = self.now();
        // A trial begins with the next sample but one: the candidate may not answer the sample under way.
        let actions = self.nodes[topic as usize].on(scenario, now, now.tick + 2, input);
        let mut orders = vec![];
        for action in actions {
            if !apply_to_page(&self.page, topic, now.tick, &action) {
                orders.push((topic, action));
            }
        }
        orders
    }

    fn look(&mut self, scenario: &Scenario, _question: Option<u64>) -> Vec<Order> {
        let at = Instant::now();
        let tick = self.page.plant_tick();
        let excused_ns = at.saturating_duration_since(self.due).as_nanos() as u64;
        let mut orders = vec![];
        let nodes = &self.nodes;
        for (topic, input) in self.faults.due(tick, |topic| nodes[topic as usize].role.active()) {
            let input = match input {
                RoleInput::Kill(until_ns) => RoleInput::Kill(until_ns + self.lead_in_ns()),
                RoleInput::Hold(until_ns) => RoleInput::Hold(until_ns + self.lead_in_ns()),
                other => other,
            };
            orders.extend(self.on(scenario, topic, input));
        }
        self.begun.resize(scenario.swap.len(), false);
        for (i, swap) in scenario.swap.iter().enumerate() {
            // The tick is 0 before the first sample too.
            let is_due = tick > 0 && tick >= swap.ticks(scenario.sample_s()).from && !self.begun[i];
            let topic = swap.node;
            if is_due && !self.nodes[topic as usize].role.has_candidate() {
                self.begun[i] = true;
                orders.extend(self.on(scenario, topic, RoleInput::SwapRequested(i)));
            }
        }
        for topic in Topic::ALL {
            orders.extend(self.on(scenario, topic, RoleInput::Tick));
            for input in self.seen(topic, tick, excused_ns) {
                orders.extend(self.on(scenario, topic, input));
            }
            if let Some(ruled) = self.nodes[topic as usize].ruling(self.observed) {
                orders.extend(self.on(scenario, topic, ruled));
            }
        }
        self.due = self.next_look(at);
        orders
    }

    fn may_swap(&self, topic: Topic) -> Result<(), String> {
        self.nodes[topic as usize].role.may_swap()
    }

    fn due(&self) -> Instant {
        self.due
    }
}

/// Carries out `action` on the control page; returns `false` if the launcher has to carry it out instead.
fn apply_to_page(page: &ControlPage, topic: Topic, tick: u64, action: &Action) -> bool {
    let shared = page.role(topic);
    match *action {
        Action::Activate(epoch) => shared.set_pending(epoch),
        Action::Standby(epoch) => shared.assign(tick as u32, |work| Assignment { standby: epoch, ..work }),
        Action::Vacate(epoch) => {
            shared.dismiss(epoch);
            page.doorbell(topic).ring(); // before sample 0 the plant waits for every role that is not vacant
        }
        Action::Spawn(..) | Action::Signal(..) | Action::Report(_) => return false,
    }
    true
}
