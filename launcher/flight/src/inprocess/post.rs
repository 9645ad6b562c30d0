//! Those who work for one node when one thread runs them all: one active, and now and then one beside it on standby.

use contract::message::{Message, Stamp};
use contract::scenario::{Scenario, candidate};
use contract::snapshot::Snapshot;
use runtime::process_fault::ProcessFaults;

use super::node::{Node, sum};
use super::speech::{Counts, Heard, Voice};
use crate::roles::role::Input;
use crate::roles::simulated::Simulated;

/// All that work for one node.
pub struct Post<N: Node> {
    workers: Vec<Worker<N>>,
    /// What the last one remembered who left the role vacant.
    memory: Option<Snapshot>,
    /// What those who have left had refused, by cause.
    refused: Counts,
}

/// What a process of the node would be.
struct Worker<N: Node> {
    epoch: u32,
    /// Those of its own settings; those of the run are the roles's matter.
    process_faults: ProcessFaults,
    core: N,
    ears: N::Ears,
    voice: Voice<N::Says>,
}

impl<N: Node> Post<N> {
    /// With the first process of a run.
    pub fn new(scenario: &Scenario) -> Self {
        let first = Worker::new(scenario, scenario, 1, N::ears(&Heard::default()));
        Self { workers: vec![first], memory: None, refused: Counts::default() }
    }

    /// The ears of all.
    pub fn ears(&mut self) -> impl Iterator<Item = &mut N::Ears> {
        self.workers.iter_mut().map(|worker| &mut worker.ears)
    }

    /// Messages refused so far, by cause.
    pub fn refused(&self) -> Counts {
        self.workers.iter().map(|worker| N::refused(&worker.ears)).fold(self.refused, sum)
    }

    /// Another begins: the run's settings or those of the swap `origin`, the memory of who is or was active, and the
    /// `last` word of each topic.
    pub fn begin(&mut self, run: &Scenario, epoch: u32, origin: Option<usize>, last: &Heard, active: u32) {
        let own = origin.and_then(|i| candidate(run, &run.swap[i]).ok()); // what is wrong with it was said before
        let mut worker: Worker<N> = Worker::new(own.as_ref().unwrap_or(run), run, epoch, N::ears(last));
        let active = self.workers.iter().find(|worker| worker.epoch == active);
        if let Some(memory) = active.map(|active| active.core.memory()).or(self.memory) {
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

    /// All who work answer to a sample; `each` gets their messages, with the epoch active.
    pub fn answer(
        &mut self,
        sample: Stamp,
        roles: &mut Simulated,
        mut each: impl FnMut(&N::Says, u32, &mut Simulated),
    ) {
        let leaves = |worker: &&Worker<N>| worker.process_faults.leaves(sample.tick, sample.tick);
        let leaving: Vec<u32> = self.workers.iter().filter(leaves).map(|worker| worker.epoch).collect();
        for epoch in leaving {
            self.end(epoch);
            roles.exited(N::Says::TOPIC, epoch, sample.tick, Input::Exited(epoch));
        }
        let assignment = roles.assignment(N::Says::TOPIC);
        for Worker { epoch, core, ears, voice, .. } in &mut self.workers {
            if assignment.includes(*epoch) {
                let (answer, provenance) = core.answer(ears, sample);
                let active = assignment.active == *epoch;
                voice.speak(active, answer, provenance, |message| each(message, assignment.active, roles));
            }
        }
    }
}

impl<N: Node> Worker<N> {
    /// With settings of its `own`, which may be those of the `run`.
    fn new(own: &Scenario, run: &Scenario, epoch: u32, ears: N::Ears) -> Self {
        let scripted = own.fault == run.fault;
        let fault = if scripted { vec![] } else { own.fault.clone() };
        let process_faults = ProcessFaults::new(&Scenario { fault, ..own.clone() }, N::Says::TOPIC);
        Self { epoch, process_faults, core: N::new(own), ears, voice: Voice::new(own, epoch) }
    }
}
