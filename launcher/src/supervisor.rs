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

mod progress;
mod strike;

use std::time::{Duration, Instant};

use contract::plan::Plan;
use contract::realtime::Board;
use contract::scenario::{Mode, Scenario};
use contract::topic::Topic;
use progress::Progress;
use serde::Serialize;
use strike::Strike;

/// How often everybody is looked at, at least.
const LOOK: Duration = Duration::from_millis(5);
/// How soon again when somebody may hang.
const LOOK_AGAIN: Duration = Duration::from_millis(1);
/// Waits before the first, second, third new start within `WINDOW`; after that the node is given up.
const BACK_OFF_MS: [u64; 3] = [0, 50, 100];
const WINDOW: Duration = Duration::from_secs(5);
/// A process that is not ready by then never will be: it waits for what another has left half made, or was stopped.
const START_LIMIT: Duration = Duration::from_secs(1);

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
    /// When to look around next.
    due: Instant,
    /// Everything that happened.
    pub events: Vec<Event>,
}

struct Node {
    topic: Topic,
    /// The newest epoch started.
    epoch: u32,
    /// New starts within the window.
    starts: Vec<Instant>,
    restart_at: Option<Instant>,
    given_up: bool,
    progress: Progress,
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
            progress: Progress::new(now),
            holder: 1,
        };
        Self {
            plan: Plan::new(scenario),
            mode: scenario.run.mode,
            sample_s: scenario.sample_s(),
            strikes: Strike::all(scenario),
            nodes: Topic::ALL.map(node).into(),
            due: now,
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
        vacate(board, topic, epoch);
        let node = &mut self.nodes[topic as usize];
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
            Mode::Realtime => self.strikes.iter_mut().for_each(|strike| strike.at(tick, &mut orders)),
            Mode::Lockstep | Mode::Inprocess => self.follow(board, tick, &mut orders),
        }
        let now = Instant::now();
        let absent = now.saturating_duration_since(self.due);
        for i in 0..self.nodes.len() {
            self.nodes[i].progress.excuse(absent);
            self.look_after(i, board, tick, now, &mut orders);
        }
        self.due = self.next_look(board, now);
        orders
    }

    /// When to ask for orders again.
    pub fn due(&self) -> Instant {
        self.due
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
        let node = &mut self.nodes[i];
        let limit = progress::limit(self.mode, node.topic, self.sample_s);
        let office = board.office(node.topic);
        let event = |epoch, what| Event { tick, node: node.topic.publisher(), epoch, what };
        let holder = office.holder.get();
        if node.restart_at.is_some_and(|at| now >= at) {
            node.restart_at = None;
            node.epoch += 1;
            node.progress.begin(0, now);
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
        let done = u64::from(office.done(holder).get());
        if holder != node.holder {
            node.progress.begin(done, now);
        }
        node.progress.note(done, now);
        node.holder = holder;
        // Nobody samples for the plant, nor for a newcomer that is not ready yet: time alone tells.
        let newcomer = holder == 0 && node.is_started() && office.ready.get() != node.epoch;
        let (epoch, samples, limit) = match (node.topic, newcomer) {
            (_, true) => (node.epoch, u64::MAX, START_LIMIT),
            (Topic::State, _) => (holder, u64::MAX, limit),
            _ => (holder, tick + 1, limit),
        };
        if epoch != 0 && tick > 0 && node.progress.hangs(samples, limit, now) {
            self.events.push(event(epoch, What::Hung));
            node.progress.begin(done, now);
            orders.push(Order::Kill(node.topic));
            if node.topic != Topic::State {
                vacate(board, node.topic, epoch); // dying takes milliseconds, for which nobody is to wait
            }
        }
    }

    /// The next look around: soon enough for a new start that is due, and for who may hang by then.
    fn next_look(&self, board: &Board, now: Instant) -> Instant {
        let starts = self.nodes.iter().filter_map(|node| node.restart_at);
        let origin = progress::origin(board, now).filter(|_| self.mode == Mode::Realtime);
        let in_office = self.nodes.iter().filter(|node| board.office(node.topic).holder.get() != 0);
        let limit = |topic| progress::limit(self.mode, topic, self.sample_s);
        let hangs =
            in_office.filter_map(|node| Some(node.progress.deadline(origin?, self.sample_s, limit(node.topic))));
        starts.chain(hangs).map(|at| at.max(now + LOOK_AGAIN)).fold(now + LOOK, Instant::min)
    }
}

impl Node {
    /// Whether a successor of the first process is there or on its way up.
    fn is_started(&self) -> bool {
        self.epoch > 1 && self.restart_at.is_none() && !self.given_up
    }
}

/// Leaves the office of `topic` to nobody, if `epoch` holds it or is about to.
fn vacate(board: &Board, topic: Topic, epoch: u32) {
    let office = board.office(topic);
    for word in [&office.holder, &office.ready, &office.heir] {
        if word.get() == epoch {
            word.set(0);
        }
    }
    board.bell(topic).ring();
}

/// Ticks that the plant has sampled.
fn plant_tick(board: &Board) -> u64 {
    u64::from(board.office(Topic::State).done(1).get()).saturating_sub(1)
}
