//! Those that work for one node when one thread runs them all: one active, and now and then one on standby.

use std::sync::Arc;

use contract::message::Stamp;
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;
use contract::topic::Topic;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::ports::{Ports, Transport};
use runtime::queue::Queues;
use runtime::realtime::ControlPage;

use super::node::Node;

/// What a ring in process shares: the control page and the queues.
#[derive(Clone)]
pub struct Ring {
    /// Roles and counts.
    pub page: Arc<ControlPage>,
    /// What carries the messages.
    pub queues: Queues,
}

impl Ring {
    /// With empty roles.
    pub fn new() -> std::io::Result<Self> {
        Ok(Self { page: Arc::new(ControlPage::private()?), queues: Queues::default() })
    }

    /// A process of the node that answers on `topic`, with its place in the role and its ports. It acts out the exits of
    /// its own settings if they are not those of the `run`.
    pub fn member(&self, topic: Topic, epoch: u32, own: &Scenario, run: &Scenario) -> (Member, Ports) {
        self.page.role(topic).offer(epoch);
        let member = Member::in_process(self.page.clone(), topic, epoch, own, own.fault != run.fault);
        (member, Ports::new(self.page.clone(), Transport::Queues(self.queues.clone())))
    }
}

/// All that work for one node.
pub struct Post<N> {
    ring: Ring,
    workers: Vec<Worker<N>>,
    /// What the last one remembered that left the role vacant.
    memory: Option<Snapshot>,
}

/// What a process of the node would be.
struct Worker<N> {
    member: Member,
    node: N,
}

impl<N: Node> Post<N> {
    /// With the first process of a run.
    pub fn new(ring: &Ring, run: &Scenario) -> Result<Self, SessionError> {
        let mut post = Self { ring: ring.clone(), workers: vec![], memory: None };
        post.begin(1, run, run)?;
        Ok(post)
    }

    /// The process `epoch` begins, with settings of its `own` or those of the `run`, and with the memory of the one that is
    /// or was active.
    pub fn begin(&mut self, epoch: u32, own: &Scenario, run: &Scenario) -> Result<(), SessionError> {
        let (member, mut ports) = self.ring.member(N::TOPIC, epoch, own, run);
        let mut node = N::join(&mut ports, &member, own)?;
        let active = self.ring.page.role(N::TOPIC).active();
        let active = self.workers.iter().find(|worker| worker.member.epoch == active);
        if let Some(memory) = active.map(|active| active.node.memory()).or(self.memory) {
            node.restore(&memory);
        }
        self.workers.push(Worker { member, node });
        Ok(())
    }

    /// The process `epoch` ends.
    pub fn end(&mut self, epoch: u32) {
        if let Some(i) = self.workers.iter().position(|worker| worker.member.epoch == epoch) {
            self.memory = Some(self.workers.remove(i).node.memory());
        }
    }

    /// A process that a fault of its own settings ends instead of its answer to `tick`.
    pub fn leaves(&self, tick: u64) -> Option<u32> {
        let leaves = |worker: &&Worker<N>| worker.member.faults.leaves(tick, tick);
        self.workers.iter().find(leaves).map(|worker| worker.member.epoch)
    }

    /// All that work answer to a sample; `sample` is the provenance of a new chain.
    pub fn answer(&mut self, sample: Stamp) {
        let assignment = self.ring.page.role(N::TOPIC).assignment();
        let working = self.workers.iter_mut().filter(|worker| assignment.includes(worker.member.epoch));
        working.for_each(|worker| worker.node.answer(sample));
    }
}
