//! A node's session with a run: join, open the ports, get ready, loop.
//!
//! ```text
//! NodeSession::join --> open, memory --> ready             --> CycleLoop     a node that answers
//!                                        ready_to_sample   --> SampleLoop    the plant
//! ```
//!
//! [`ready`](NodeSession::ready) consumes the session, so that no port is opened and no place is taken in the loop.

use std::path::Path;

use contract::snapshot::Snapshot;
use contract::topic::Topic;
use settings::file::MAX_TEXT_BYTES;
use settings::{Mode, Scenario, file};

use crate::cycle_loop::CycleLoop;
use crate::error::PortFailure;
pub use crate::error::SessionError;
use crate::member::Member;
use crate::ports::Ports;
use crate::realtime::{self, ThisProcess, tell_of_copies};
use crate::release::Release;
use crate::sample_loop::SampleLoop;
use crate::shared_role::Origin;

/// Process of a node that has joined a run and is not ready yet.
pub struct NodeSession {
    /// Settings of this process.
    pub scenario: Scenario,
    ports: Ports,
    member: Member,
}

impl NodeSession {
    /// Joins the run of `namespace` as process `epoch`, from 1, of the node `name`. `own` is a file of merged settings
    /// that replace the run's.
    ///
    /// # Errors
    /// There is no such run or node, or the settings cannot be read.
    pub fn join(namespace: &str, name: &str, epoch: u32, own: Option<&Path>) -> Result<Self, SessionError> {
        let topic = Topic::of_node(name);
        let topic = topic.ok_or_else(|| SessionError::UnknownNode(name.into()))?;
        let (ports, run) = Ports::join(namespace)?;
        let page = ports.page.clone();
        tell_of_copies(move || page.role(topic).port_failures[PortFailure::Copy as usize].count());
        let scenario = own.map_or(Ok(run.clone()), |path| {
            let what = path.display().to_string();
            let text = file::read_text(path, MAX_TEXT_BYTES);
            let text = text.map_err(|why| SessionError::Io { what: what.clone(), why })?;
            Ok::<_, SessionError>(settings::candidate_from(&text, &what)?)
        })?;
        Ok(Self::new(ports, topic, epoch, scenario, &run))
    }

    pub(crate) fn new(ports: Ports, topic: Topic, epoch: u32, scenario: Scenario, run: &Scenario) -> Self {
        let acts = run.run.mode == Mode::Realtime || scenario.fault != run.fault; // else the launcher carries out exits
        let member = Member::new(ports.page.clone(), topic, epoch, &scenario, acts);
        let member = Member { process: Some(ThisProcess::now()), ..member };
        Self { scenario, ports, member }
    }

    /// Opens a node with all its ports by `open`. The output claims the place that the role has offered to the epoch.
    pub fn open<N>(
        &mut self,
        open: impl FnOnce(&mut Ports, &Member, &Scenario) -> Result<N, SessionError>,
    ) -> Result<N, SessionError> {
        open(&mut self.ports, &self.member, &self.scenario)
    }

    /// Offers the snapshot of the previous active process to `restore`, if this process is not the first and there is a
    /// snapshot. If `restore` returns that it fits, all stamps of this process name the origin of the snapshot.
    pub fn take_over_memory(&self, restore: impl FnOnce(&Snapshot) -> bool) {
        let memory = &self.member.page.role(self.member.topic).memory;
        let written = (self.member.epoch > 1).then(|| memory.read_whole()).flatten();
        let written = written.filter(|(origin, _)| *origin != Origin::default());
        if let Some((origin, words)) = written
            && words.as_slice().try_into().is_ok_and(restore)
        {
            self.member.continues.set(origin);
        }
    }

    /// Enters the real-time class, says that this process is ready, and returns the loop of a node that answers. Call
    /// it when everything is allocated.
    ///
    /// # Errors
    /// The messages of a node that this one needs do not arrive.
    pub fn ready(mut self) -> Result<CycleLoop, SessionError> {
        let release = self.become_ready()?;
        let upstream = self.member.topic.upstream() as usize;
        Ok(CycleLoop::new(self.member, release, self.scenario.deadline_of(upstream).deadline_ns))
    }

    /// Gets ready as [`Self::ready`] does, and returns the loop of the plant, which begins with the first sample.
    pub fn ready_to_sample(mut self) -> Result<SampleLoop, SessionError> {
        let release = self.become_ready()?;
        Ok(SampleLoop::new(self.member, release))
    }

    /// Enters the real-time class, tests the ports (before the run only) and says that this process is ready. A process
    /// in lockstep does not enter the real-time class: it has no deadline, and a ring that never sleeps would starve
    /// its observers. The launcher has chosen the CPU of such a process, unless the scenario names others.
    fn become_ready(&mut self) -> Result<Release, SessionError> {
        let Member { page, topic, epoch, timing, .. } = &self.member;
        let release = Release::of(&self.scenario);
        let scheduling = self.scenario.scheduling_of(*topic as usize);
        match release {
            Release::Timer { .. } => realtime::enter(&scheduling),
            Release::Barrier => realtime::pin(&scheduling.affinity),
        }
        self.ports.probe(|| page.role(*topic).ready.set(*epoch))?;
        timing.warm_up();
        page.role(*topic).waiting.set(*epoch);
        page.doorbell(*topic).ring();
        Ok(release)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::TestRing;
    use crate::ports::Transport;
    use crate::realtime::phase;
    use crate::shared_role::Assignment;
    use contract::message::{Controls, Reference, State};
    use settings::{Fault, FaultKind, FaultTarget};

    #[test]
    fn a_node_that_the_ring_does_not_have_is_an_error() {
        let error = NodeSession::join("nowhere", "launcher", 1, None).err().map(|error| error.to_string());
        assert!(error.is_some_and(|error| error.contains("'launcher' is no node of the ring")));
    }

    #[test]
    fn a_place_goes_to_the_process_that_it_was_offered_to() {
        let ring = TestRing::new(Mode::Lockstep);
        let mut session = ring.session(Topic::Controls, 2);
        assert!(matches!(session.output::<Controls>(), Err(SessionError::Taken { node: "attitude-mpc", epoch: 2 })));
        ring.page.role(Topic::Controls).offer(2);
        assert!(session.output::<Controls>().is_ok());
        assert!(ring.session(Topic::Controls, 2).output::<Controls>().is_err(), "another process has it");
    }

    #[test]
    fn a_process_is_ready_when_all_its_ports_work() {
        let ring = TestRing::new(Mode::Lockstep);
        let mut mpc = ring.session(Topic::Controls, 1);
        for topic in Topic::ALL {
            ring.page.role(topic).offer(1);
            ring.page.role(topic).assign(0, |_| Assignment { active: 1, standby: 0 });
        }
        let (_states, _references) = (mpc.input::<State>().unwrap(), mpc.input::<Reference>().unwrap());
        let _controls = mpc.output::<Controls>().unwrap();
        assert_eq!(mpc.ports.probe_once().unwrap(), Some("plant"), "it has sent nothing");
        let mut plant = ring.session(Topic::State, 1);
        let mut guidance = ring.session(Topic::Reference, 1);
        let _states = plant.output::<State>().unwrap();
        let _references = guidance.output::<Reference>().unwrap();
        assert_eq!(plant.ports.probe_once().unwrap(), None);
        assert_eq!(mpc.ports.probe_once().unwrap(), Some("guidance"));
        assert_eq!(guidance.ports.probe_once().unwrap(), None);
        assert_eq!(mpc.ports.probe_once().unwrap(), Some("attitude-mpc"), "no process receives it");
        let mut mixer = ring.session(Topic::Actuators, 1);
        let _demands = mixer.input::<Controls>().unwrap();
        assert_eq!(mpc.ports.probe_once().unwrap(), None);
        ring.page.set_phase(phase::GO);
        assert!(mpc.ready().is_ok());
        assert_eq!(ring.page.role(Topic::Controls).ready.get(), 1);
    }

    #[test]
    fn the_first_process_begins_with_nothing_and_the_next_with_its_memory() {
        let ring = TestRing::new(Mode::Lockstep);
        let memory = [7; contract::snapshot::SNAPSHOT_WORDS];
        let origin = Origin { epoch: 1, done: 5 };
        ring.page.role(Topic::Controls).memory.write(origin, &memory);
        ring.session(Topic::Controls, 1).take_over_memory(|_| panic!("it is the first"));
        for (fits, continues) in [(true, origin), (false, Origin::default())] {
            let next = ring.session(Topic::Controls, 2);
            next.take_over_memory(|offered| *offered == memory && fits);
            assert_eq!(next.member.continues.get(), continues);
        }
    }

    #[test]
    fn in_lockstep_a_process_acts_out_the_exits_of_its_own_settings_only() {
        let mut ring = TestRing::new(Mode::Lockstep);
        let exit = Fault::new(FaultTarget::Mixer, FaultKind::Exit, 0.1, None);
        ring.run.fault = vec![exit];
        assert!(!ring.session(Topic::Actuators, 1).member.faults.leaves(10, 10), "the launcher does it");
        let run = Scenario { fault: vec![], ..ring.run.clone() };
        let ports = Ports::new(ring.page.clone(), Transport::Queues(ring.queues.clone()));
        let own = NodeSession::new(ports, Topic::Actuators, 1, ring.run.clone(), &run);
        assert!(own.member.faults.leaves(10, 10));
    }
}
