//! The supervisor: keeps somebody in every role of a flight against the clock.
//!
//! ```text
//! died  -> role vacant at once -> another process: at once, the next time after 50 ms, then after 100 ms
//! hangs -> killed: see above                           the fourth time in 5 s: given up, the vehicle lands
//! swap  -> candidate started -> on standby -> active -> kept, or sent away: see [`crate::succession::trial`]
//! ```
//!
//! A death is seen through a pidfd, a hang by the progress of the ticks themselves: no heartbeat that could outlive the
//! work. Who is started continues from its predecessor's memory. Nobody can take the plant's place: without it the flight
//! ends. A node that is given up leaves the vehicle to the reactions of the others, which bring it down.

mod candidate;
pub mod hearing;
mod node;
mod progress;
mod strike;

use std::time::{Duration, Instant};

use contract::fault_schedule::{Entry, FaultSchedule};
use contract::scenario::{Fault, Scenario};
use contract::topic::Topic;
use runtime::realtime::ControlPage;

use crate::event::{Event, What};
use crate::log::Record;
use node::Node;
use strike::Strike;

/// How often everybody is looked at, at least.
const LOOK: Duration = Duration::from_millis(5);
/// How soon again when somebody may hang.
const LOOK_AGAIN: Duration = Duration::from_millis(1);

/// What is to be done to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Start this epoch, with the program and settings of this swap, or those of the run.
    Start(Topic, u32, Option<usize>),
    /// SIGKILL.
    Kill(Topic, u32),
    /// SIGSTOP.
    Stop(Topic, u32),
    /// SIGCONT.
    Continue(Topic, u32),
}

/// The supervisor of one run.
pub struct Supervisor {
    strikes: FaultSchedule<Strike>,
    nodes: Vec<Node>,
    /// Which of the swaps have begun.
    begun: Vec<bool>,
    /// The newest sample seen: everything that answers to the ones before has been seen too, or is late.
    seen: u64,
    /// When to look around next.
    due: Instant,
    /// Everything that happened.
    pub events: Vec<Event>,
}

impl Supervisor {
    /// For a run of `scenario` whose first processes have been started.
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            strikes: FaultSchedule::new(scenario, |_, fault| Strike::of(fault)),
            nodes: Topic::ALL.map(|topic| Node::new(topic, scenario.sample_s())).into(),
            begun: vec![],
            seen: 0,
            due: Instant::now(),
            events: vec![],
        }
    }

    /// Whether a node was given up, and which.
    pub fn given_up(&self) -> Option<&'static str> {
        self.nodes.iter().find(|node| node.given_up).map(|node| node.topic.publisher())
    }

    /// Takes one message in: trials are decided by them.
    pub fn observe(&mut self, record: &Record) {
        if let Record::State(state) = record
            && record.is_intact()
        {
            self.seen = self.seen.max(state.stamp.tick);
        }
        self.nodes.iter_mut().filter_map(|node| node.trial.as_mut()).for_each(|trial| trial.observe(record));
    }

    /// Whether the process `epoch` of a node is active, and there is nobody to have it back.
    pub fn is_alone(&self, page: &ControlPage, topic: Topic, epoch: u32) -> bool {
        page.role(topic).active() == epoch && self.nodes[topic as usize].trial.is_none()
    }

    /// Whether a candidate may come for the node that speaks on `topic`; why not.
    pub fn may_swap(&self, page: &ControlPage, topic: Topic) -> Result<(), String> {
        self.nodes[topic as usize].may_swap(page)
    }

    /// Takes fault `number` as it is from now on: see [`FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.strikes.apply_fault(number, fault, Strike::of(fault));
    }

    /// A process has ended that was not asked to. False when the run cannot go on without it.
    pub fn died(&mut self, page: &ControlPage, topic: Topic, epoch: u32) -> bool {
        let tick = plant_tick(page);
        topic != Topic::State && {
            self.nodes[topic as usize].died(page, epoch, tick, &mut self.events);
            true
        }
    }

    /// The process `epoch` of a node works, but not with the others, and `why`: it counts as hung.
    pub fn delivery(&mut self, page: &ControlPage, topic: Topic, epoch: u32, why: &str) -> Order {
        let event = Event::new(plant_tick(page), topic.publisher(), epoch, What::Hung).because(why);
        self.events.push(event);
        if topic != Topic::State {
            self.nodes[topic as usize].vacate(page, epoch); // dying takes milliseconds, for which nobody is to wait
        }
        Order::Kill(topic, epoch)
    }

    /// What is to be done now; swaps may have been added to `scenario` since the last time.
    pub fn orders(&mut self, page: &ControlPage, scenario: &Scenario) -> Vec<Order> {
        let tick = plant_tick(page);
        let now = Instant::now();
        let mut orders = vec![];
        for Entry { ticks, effect, .. } in self.strikes.all_mut() {
            effect.at(page, ticks, tick, &mut orders);
        }
        let absent = now.saturating_duration_since(self.due);
        self.begun.resize(scenario.swap.len(), false);
        for (i, (swap, begun)) in scenario.swap.iter().zip(&mut self.begun).enumerate() {
            let is_due = tick > 0 && tick >= swap.ticks(scenario.sample_s()).from && !*begun;
            // One candidate after the other: against the clock a trial begins when the candidate is ready.
            let has_room = |topic: &Topic| !self.nodes[*topic as usize].has_candidate();
            if let Some(topic) = swap.node.topic().filter(|_| is_due).filter(has_room) {
                *begun = true;
                self.nodes[topic as usize].invite(page, i, tick, now, &mut self.events, &mut orders);
            }
        }
        for node in &mut self.nodes {
            node.restart(page, tick, now, &mut self.events, &mut orders);
            node.welcome(page, scenario, tick, &mut self.events);
            node.progress.excuse(absent);
            node.notice(page, tick, now, &mut self.events, &mut orders);
            node.judge(page, self.seen, &mut self.events, &mut orders);
        }
        self.due = self.next_look(page, now);
        orders
    }

    /// When to ask for orders again.
    pub fn due(&self) -> Instant {
        self.due
    }

    /// The next look around: soon enough for a new start that is due, and for who may hang by then.
    fn next_look(&self, page: &ControlPage, now: Instant) -> Instant {
        let origin = progress::origin(page, now);
        let starts = self.nodes.iter().filter_map(|node| node.restart_at);
        let hangs = self.nodes.iter().filter_map(|node| node.hangs_at(page, origin?));
        starts.chain(hangs).map(|at| at.max(now + LOOK_AGAIN)).fold(now + LOOK, Instant::min)
    }
}

/// Ticks that the plant has sampled, but for the newest.
pub fn plant_tick(page: &ControlPage) -> u64 {
    u64::from(page.role(Topic::State).done(1).get()).saturating_sub(1)
}
