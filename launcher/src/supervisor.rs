//! The supervisor: keeps somebody in every office.
//!
//! ```text
//! died  -> office vacant at once -> another process: at once, the next time after 50 ms, then after 100 ms
//! hangs -> killed: see above                           the fourth time in 5 s: given up, the vehicle lands
//! ```
//!
//! A death is seen through a pidfd, a hang by the progress of the ticks themselves: no heartbeat that could outlive the
//! work. Who is started continues from its predecessor's memory. Nobody can take the plant's place: without it the flight
//! ends. A node that is given up leaves the vehicle to the reactions of the others, which bring it down.

use std::ops::Range;
use std::time::{Duration, Instant};

use contract::plan::{HANG_TICKS, Plan};
use contract::realtime::Board;
use contract::scenario::{Fault, FaultKind, Mode, Scenario};
use contract::topic::Topic;
use serde::Serialize;

/// Waits before the first, second, third new start within `WINDOW`; after that the node is given up.
const BACK_OFF_MS: [u64; 3] = [0, 50, 100];
const WINDOW: Duration = Duration::from_secs(5);
/// At high rates a few ticks are no longer than the machine may hold a process up for reasons of its own.
const LEAST_HANG: Duration = Duration::from_millis(20);
/// In lockstep time stands still while a process hangs; on the wall clock this is long.
const LOCKSTEP_HANG: Duration = Duration::from_secs(2);
/// The plant has nobody to answer for it: its motors are off after this time, so it is the end of the flight.
const PLANT_HANG: Duration = Duration::from_millis(500);

/// Something that happened to a process.
#[derive(Debug, Clone, Serialize)]
pub struct Event {
    /// The tick of the plant then.
    pub tick: u64,
    /// Which node.
    pub node: &'static str,
    /// Which incarnation.
    pub epoch: u32,
    /// What.
    pub what: What,
}

/// What can happen to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// It died.
    Died,
    /// It made no progress, and was killed.
    Hung,
    /// The scenario had it killed.
    Killed,
    /// It was started.
    Started,
    /// It holds the office.
    TookOver,
    /// It is not started any more.
    GivenUp,
}

/// What is to be done to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Start this epoch.
    Start(Topic, u32),
    /// SIGKILL to all of the node.
    Kill(Topic),
    /// SIGSTOP.
    Stop(Topic),
    /// SIGCONT.
    Continue(Topic),
}

/// The supervisor of one run.
pub struct Supervisor {
    plan: Plan,
    mode: Mode,
    sample_s: f64,
    strikes: Vec<Strike>,
    nodes: Vec<Node>,
    /// Everything that happened.
    pub events: Vec<Event>,
}

/// A fault that is done to a process by signals.
struct Strike {
    topic: Topic,
    kind: FaultKind,
    ticks: Range<u64>,
    struck: bool,
    ended: bool,
}

struct Node {
    topic: Topic,
    /// The newest epoch started.
    epoch: u32,
    /// New starts within the window.
    starts: Vec<Instant>,
    restart_at: Option<Instant>,
    given_up: bool,
    /// Ticks it had done when it last made progress, and when that was.
    progress: (u32, Instant),
    /// The holder when last looked at.
    holder: u32,
}

impl Supervisor {
    /// For a run of `scenario` whose first processes have been started.
    pub fn new(scenario: &Scenario) -> Self {
        let now = Instant::now();
        let node = |topic| Node {
            topic,
            epoch: 1,
            starts: vec![],
            restart_at: None,
            given_up: false,
            progress: (0, now),
            holder: 1,
        };
        let by_signal = |fault: &Fault| {
            let topic = fault.target.process().filter(|_| matches!(fault.kind, FaultKind::Kill | FaultKind::Stop))?;
            Some(Strike {
                topic,
                kind: fault.kind,
                ticks: fault.ticks(scenario.sample_s()),
                struck: false,
                ended: false,
            })
        };
        Self {
            plan: Plan::new(scenario),
            mode: scenario.run.mode,
            sample_s: scenario.sample_s(),
            strikes: scenario.fault.iter().filter_map(by_signal).collect(),
            nodes: Topic::ALL.map(node).into(),
            events: vec![],
        }
    }

    /// Whether a node was given up, and which.
    pub fn given_up(&self) -> Option<&'static str> {
        self.nodes.iter().find(|node| node.given_up).map(|node| node.topic.publisher())
    }

    /// A process has ended that was not asked to. False when the run cannot go on without it.
    pub fn died(&mut self, board: &Board, topic: Topic, epoch: u32) -> bool {
        let tick = plant_tick(board);
        if topic == Topic::State {
            return false;
        }
        let office = board.office(topic);
        let node = &mut self.nodes[topic as usize];
        let held = office.holder.get() == epoch;
        if held {
            office.holder.set(0);
        }
        // Nor can it take the office any more, should it have been about to.
        for word in [&office.ready, &office.heir] {
            if word.get() == epoch {
                word.set(0);
            }
        }
        board.bell(topic).ring();
        let event = |what| Event { tick, node: topic.publisher(), epoch, what };
        if epoch < node.epoch {
            return true; // its successor is on the way already
        }
        self.events.push(event(What::Died));
        let now = Instant::now();
        node.starts.retain(|start| now.duration_since(*start) < WINDOW);
        if let Some(wait_ms) = BACK_OFF_MS.get(node.starts.len()) {
            node.starts.push(now);
            node.restart_at = Some(now + Duration::from_millis(*wait_ms));
        } else {
            node.given_up = true;
            self.events.push(event(What::GivenUp));
        }
        true
    }

    /// What is to be done now.
    pub fn orders(&mut self, board: &Board) -> Vec<Order> {
        let tick = plant_tick(board);
        let mut orders = vec![];
        match self.mode {
            Mode::Realtime => self.strike(tick, &mut orders),
            Mode::Lockstep | Mode::Inprocess => self.follow(board, tick, &mut orders),
        }
        let now = Instant::now();
        for i in 0..self.nodes.len() {
            self.look_after(i, board, tick, now, &mut orders);
        }
        orders
    }

    /// Real time: the scenario's kills and stops, when their time has come.
    fn strike(&mut self, tick: u64, orders: &mut Vec<Order>) {
        for Strike { topic, kind, ticks, struck, ended } in &mut self.strikes {
            if tick >= ticks.start && !*struck {
                *struck = true;
                orders.push(if *kind == FaultKind::Kill { Order::Kill(*topic) } else { Order::Stop(*topic) });
            }
            if tick >= ticks.end && !*ended && *kind == FaultKind::Stop {
                *ended = true;
                orders.push(Order::Continue(*topic));
            }
        }
    }

    /// Lockstep: the plan says who is gone; the process is ended for real, and its successor started.
    fn follow(&mut self, board: &Board, tick: u64, orders: &mut Vec<Order>) {
        for node in &mut self.nodes {
            let successor = self.plan.successor(node.topic, tick);
            let vacated = board.office(node.topic).holder.get() == 0 || node.topic == Topic::State;
            if successor > node.epoch && vacated {
                let event = |epoch, what| Event { tick, node: node.topic.publisher(), epoch, what };
                self.events.push(event(node.epoch, What::Killed));
                orders.push(Order::Kill(node.topic));
                if node.topic != Topic::State {
                    node.epoch = successor;
                    node.restart_at = None;
                    self.events.push(event(successor, What::Started));
                    orders.push(Order::Start(node.topic, successor));
                }
            }
        }
    }

    /// Restarts that are due, processes that hang, offices that changed hands.
    fn look_after(&mut self, i: usize, board: &Board, tick: u64, now: Instant, orders: &mut Vec<Order>) {
        let hang = self.hang(i);
        let node = &mut self.nodes[i];
        let office = board.office(node.topic);
        let event = |epoch, what| Event { tick, node: node.topic.publisher(), epoch, what };
        let holder = office.holder.get();
        if node.restart_at.is_some_and(|at| now >= at) {
            node.restart_at = None;
            node.epoch += 1;
            self.events.push(event(node.epoch, What::Started));
            orders.push(Order::Start(node.topic, node.epoch));
        }
        // A successor that is ready and has no one before it is the heir; in lockstep the plan says when.
        let scripted = self.plan.successor(node.topic, tick) >= node.epoch && self.mode != Mode::Realtime;
        if holder == 0 && node.epoch > 1 && office.ready.get() == node.epoch && !scripted && tick > 0 {
            office.heir.set(node.epoch);
        }
        if holder != node.holder && holder != 0 {
            self.events.push(event(holder, What::TookOver));
        }
        let done = office.done(holder).get();
        if holder == 0 || holder != node.holder || done != node.progress.0 {
            node.progress = (done, now);
        }
        node.holder = holder;
        // The sample after the newest it has done is number `done`: that many have come since without an answer.
        let behind = node.topic == Topic::State || tick + 1 >= u64::from(done) + HANG_TICKS;
        if holder != 0 && tick > 0 && behind && now.duration_since(node.progress.1) > hang {
            self.events.push(event(holder, What::Hung));
            node.progress.1 = now;
            orders.push(Order::Kill(node.topic));
        }
    }

    /// How long a node may make no progress.
    fn hang(&self, i: usize) -> Duration {
        match (self.mode, self.nodes[i].topic) {
            (Mode::Realtime, Topic::State) => PLANT_HANG,
            // A little less than the ticks say, because the look around comes late too.
            (Mode::Realtime, _) => Duration::from_secs_f64(self.sample_s * (HANG_TICKS as f64 - 1.0)).max(LEAST_HANG),
            _ => LOCKSTEP_HANG,
        }
    }
}

/// Ticks that the plant has sampled.
pub fn plant_tick(board: &Board) -> u64 {
    u64::from(board.office(Topic::State).done(1).get()).saturating_sub(1)
}
