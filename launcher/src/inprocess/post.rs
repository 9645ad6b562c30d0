//! Those who work for one node when one thread runs them all: one in office, and now and then one in its shadow.

use contract::message::{Message, Stamp};
use contract::scenario::{Fault, FaultKind, Scenario, newcomer};
use contract::snapshot::Snapshot;

use super::node::{Node, sum};
use super::speech::{Heard, Voice};
use crate::succession::Succession;

/// All that work for one node.
pub struct Post<N: Node> {
    workers: Vec<Worker<N>>,
    /// What the last one remembered who left the office vacant.
    memory: Option<Snapshot>,
    /// What those who have left had refused, by cause.
    refused: [u32; 5],
}

/// What a process of the node would be.
struct Worker<N: Node> {
    epoch: u32,
    scenario: Scenario,
    /// The tick on which it leaves by itself.
    exit: Option<u64>,
    core: N,
    ears: N::Ears,
    voice: Voice<N::Says>,
}

impl<N: Node> Post<N> {
    /// With the first process of a run.
    pub fn new(scenario: &Scenario) -> Self {
        let first = Worker::new(scenario.clone(), 1, N::ears(&Heard::default(), [1; 4]));
        Self { workers: vec![first], memory: None, refused: [0; 5] }
    }

    /// The ears of all.
    pub fn ears(&mut self) -> impl Iterator<Item = &mut N::Ears> {
        self.workers.iter_mut().map(|worker| &mut worker.ears)
    }

    /// Messages refused so far, by cause.
    pub fn refused(&self) -> [u32; 5] {
        self.workers.iter().map(|worker| N::refused(&worker.ears)).fold(self.refused, sum)
    }

    /// Another begins: the run's settings or those of the swap `origin`, the memory of who is or was in office, and the
    /// `last` word of each topic.
    pub fn begin(&mut self, run: &Scenario, epoch: u32, origin: Option<usize>, last: &Heard, holders: [u32; 4]) {
        let own = origin.and_then(|i| newcomer(run, &run.swap[i]).ok()); // what is wrong with it was said before
        let mut worker: Worker<N> = Worker::new(own.unwrap_or_else(|| run.clone()), epoch, N::ears(last, holders));
        worker.exit = worker.leaves_at(run);
        let holder = self.workers.iter().find(|worker| worker.epoch == holders[N::Says::TOPIC as usize]);
        if let Some(memory) = holder.map(|holder| holder.core.memory()).or(self.memory) {
            worker.core.inherit(&memory);
        }
        self.workers.push(worker);
    }

    /// One leaves.
    pub fn end(&mut self, epoch: u32) {
        if let Some(i) = self.workers.iter().position(|worker| worker.epoch == epoch) {
            let worker = self.workers.remove(i);
            self.memory = Some(worker.core.memory());
            self.refused = sum(self.refused, N::refused(&worker.ears));
        }
    }

    /// All who work answer to a sample; `each` gets their messages, with the epoch in office.
    pub fn answer(
        &mut self,
        sample: Stamp,
        succession: &mut Succession,
        mut each: impl FnMut(&N::Says, u32, &mut Succession),
    ) {
        let leaving: Vec<u32> =
            self.workers.iter().filter(|worker| worker.exit == Some(sample.tick)).map(|worker| worker.epoch).collect();
        for epoch in leaving {
            self.end(epoch);
            succession.lost(N::Says::TOPIC, epoch, sample.tick);
        }
        let staff = succession.staff(N::Says::TOPIC);
        for Worker { epoch, core, ears, voice, .. } in &mut self.workers {
            if staff.employs(*epoch) {
                let (answer, lineage) = core.answer(ears, sample);
                let in_office = staff.holder == *epoch;
                voice.speak(in_office, answer, lineage, |message| each(message, staff.holder, succession));
            }
        }
    }
}

impl<N: Node> Worker<N> {
    fn new(scenario: Scenario, epoch: u32, ears: N::Ears) -> Self {
        Self { epoch, exit: None, core: N::new(&scenario), ears, voice: Voice::new(&scenario, epoch), scenario }
    }

    /// The tick on which a fault of its own settings makes it leave; those of the run are the succession's matter.
    fn leaves_at(&self, run: &Scenario) -> Option<u64> {
        if self.scenario.fault == run.fault {
            return None;
        }
        let of_itself =
            |fault: &&Fault| fault.kind == FaultKind::Exit && fault.target.process() == Some(N::Says::TOPIC);
        let exits = self.scenario.fault.iter().filter(of_itself);
        exits.map(|fault| fault.ticks(self.scenario.sample_s()).start).min()
    }
}
