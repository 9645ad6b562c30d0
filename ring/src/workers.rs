//! Stand-ins for the processes of one node, run by one thread: one is active, and during a trial one is on standby.

use std::sync::Arc;

use contract::message::Stamp;
use contract::snapshot::Snapshot;
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::{Asked, Node, Open};
use runtime::ports::{Ports, Transport};
use runtime::queue::Queues;
use runtime::realtime::ControlPage;
use runtime::shared_role::Origin;
use settings::Scenario;

/// Control page and queues that the nodes of a ring in process share.
#[derive(Clone)]
pub struct Ring {
    pub page: Arc<ControlPage>,
    queues: Queues,
    with_checksums: bool,
}

impl Ring {
    pub fn new(with_checksums: bool) -> Result<Self, SessionError> {
        let no_memory = |why| SessionError::Io { what: "memory of the ring".into(), why };
        let page = Arc::new(ControlPage::private().map_err(no_memory)?);
        Ok(Self { page, queues: Queues::default(), with_checksums })
    }

    /// Creates a process of the node that publishes `topic`, with its place in the role and its ports. The process
    /// carries out the exit faults of its `own` settings only if their list of faults differs from that of the `run`.
    pub fn member(&self, topic: Topic, epoch: u32, own: &Scenario, run: &Scenario) -> (Member, Ports) {
        self.page.role(topic).offer(epoch);
        let member = Member::in_process(self.page.clone(), topic, epoch, own, own.fault != run.fault);
        let member = Member { with_checksums: self.with_checksums, ..member };
        (member, self.ports())
    }

    /// Creates ports for a process of the ring, or for an observer.
    pub fn ports(&self) -> Ports {
        Ports::new(self.page.clone(), Transport::Queues(self.queues.clone()))
    }
}

/// Processes of one node.
pub struct Workers {
    pub topic: Topic,
    ring: Ring,
    open: Open,
    all: Vec<Worker>,
    /// Memory of the process that ended last, used while the role is vacant.
    memory: Option<(Origin, Snapshot)>,
}

/// Stand-in for one process of the node.
struct Worker {
    member: Member,
    node: Box<dyn Node>,
    /// Ticks done.
    done: u64,
}

impl Worker {
    /// Returns the memory that another process begins with; the origin is the default if the core keeps no memory. A
    /// process that has not answered yet has the memory of the process before it; `None` if it began without a memory.
    fn memory(&self) -> Option<(Origin, Snapshot)> {
        let memory = self.node.memory();
        let continues = self.member.continues.get();
        match self.done {
            0 => (continues != Origin::default()).then_some((continues, memory)),
            done => Some((Origin::of(self.member.epoch, done, &memory), memory)),
        }
    }
}

impl Workers {
    /// Creates the node with its first process.
    pub fn new(ring: &Ring, topic: Topic, run: &Scenario, open: Open) -> Result<Self, SessionError> {
        let mut workers = Self { topic, ring: ring.clone(), open, all: vec![], memory: None };
        workers.begin(1, run, run)?;
        Ok(workers)
    }

    /// Starts process `epoch` with its `own` settings, which may be those of the `run`, and with the
    /// [memory](Self::memory) of the process before it.
    pub fn begin(&mut self, epoch: u32, own: &Scenario, run: &Scenario) -> Result<(), SessionError> {
        let (member, mut ports) = self.ring.member(self.topic, epoch, own, run);
        let mut node = (self.open)(&mut ports, &member, own)?;
        let before = self.memory().filter(|(origin, _)| *origin != Origin::default());
        if let Some((origin, _)) = before.filter(|(_, memory)| node.restore(memory)) {
            member.continues.set(origin);
        }
        self.all.push(Worker { member, node, done: 0 });
        Ok(())
    }

    /// Returns the memory of the active process, or of the process that ended last.
    pub fn memory(&self) -> Option<(Origin, Snapshot)> {
        let active = self.ring.page.role(self.topic).active();
        let active = self.all.iter().find(|worker| worker.member.epoch == active);
        active.and_then(Worker::memory).or(self.memory)
    }

    pub fn end(&mut self, epoch: u32) {
        if let Some(i) = self.all.iter().position(|worker| worker.member.epoch == epoch) {
            self.memory = self.all.remove(i).memory().or(self.memory);
        }
    }

    /// Returns the process, if any, that a fault of its own settings ends before it answers to `tick`.
    pub fn leaves(&self, tick: u64) -> Option<u32> {
        let leaves = |worker: &&Worker| worker.member.faults.leaves(tick, tick);
        self.all.iter().find(leaves).map(|worker| worker.member.epoch)
    }

    /// Returns the node of the process that works if its caller computes its answers.
    pub fn asked(&mut self) -> Option<&mut dyn Asked> {
        let assignment = self.ring.page.role(self.topic).assignment();
        let working = self.all.iter_mut().find(|worker| assignment.includes(worker.member.epoch))?;
        working.node.asked()
    }

    /// Lets every process that works answer to a sample; `sample` is the provenance of a new chain. Returns the epochs
    /// of the processes whose core failed instead, with the errors.
    pub fn answer(&mut self, sample: Stamp) -> Vec<(u32, SessionError)> {
        let assignment = self.ring.page.role(self.topic).assignment();
        let working = self.all.iter_mut().filter(|worker| assignment.includes(worker.member.epoch));
        let failed = working.filter_map(|worker| {
            if let Err(error) = worker.node.answer(sample, None) {
                return Some((worker.member.epoch, error));
            }
            worker.done = sample.tick + 1;
            None
        });
        failed.collect()
    }
}
