//! The ring in one thread. Each tick is flown in parts, so that the caller can also be one of the nodes.
//!
//! ```text
//! begin    the plant takes a sample and sends STATE and TRUTH
//! answer   guidance, attitude-mpc and mixer answer, in this order, in one call or more
//! end      observers get the messages, and the plant the command
//! ```

use contract::message::{Content, Stamp, State};
use contract::topic::Topic;
use plant::Plant;
use plant::sampler::Sampler;
use plant::vehicle::Vehicle;
use runtime::error::SessionError;
use runtime::node::{Asked, Open};
use runtime::shared_role::Origin;
use serde::{Deserialize, Serialize};
use settings::{Scenario, candidate};

use crate::ended::{Ended, Refused, refused_by_listener};
use crate::event::Event;
use crate::memory::Memory;
use crate::observers::Observers;
use crate::record::Record;
use crate::roles::Order;
use crate::roles::role::{self, Action, RoleInput};
use crate::roles::simulated::Simulated;
use crate::roles::supervised::given_up;
use crate::workers::{Ring, Workers};

/// Result of a flight in one thread, except its messages.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SteppedResult {
    pub ended: Ended,
    pub events: Vec<Event>,
    pub refused: Refused,
    /// Reasons for which cores of users failed, in order.
    pub failures: Vec<String>,
}

/// Ring in one thread.
pub struct Stepped {
    scenario: Scenario,
    ring: Ring,
    observers: Observers,
    roles: Simulated,
    sampler: Sampler,
    /// Nodes that answer, in the order of [`Topic::OF_CONTROLLERS`].
    nodes: Vec<Workers>,
    /// Newest sample, and the provenance of the chains that begin with it.
    sample: (State, Stamp),
    /// Tick of the next sample.
    next: u64,
    /// End of the flight; `None` while it lasts.
    ended: Option<Ended>,
    failures: Vec<String>,
}

impl Stepped {
    /// Builds the ring for a flight of `scenario` by `vehicle`, with the nodes that the functions `open` open, in the
    /// order of [`Topic::OF_CONTROLLERS`].
    ///
    /// # Errors
    /// A value derived from `scenario`, such as the gain of the controller, does not exist.
    pub fn new(
        scenario: &Scenario,
        vehicle: Box<dyn Vehicle>,
        with_checksums: bool,
        open: [Open; Topic::OF_CONTROLLERS.len()],
    ) -> Result<Self, SessionError> {
        let ring = Ring::new(with_checksums)?;
        let observers = Observers::open(&mut ring.ports(), scenario)?;
        let (member, mut ports) = ring.member(Topic::State, 1, scenario, scenario);
        let sampler = Sampler::open(&mut ports, &member, scenario, vehicle)?;
        let node = |(topic, open)| Workers::new(&ring, topic, scenario, open);
        Ok(Self {
            nodes: Topic::OF_CONTROLLERS.into_iter().zip(open).map(node).collect::<Result<_, _>>()?,
            scenario: scenario.clone(),
            observers,
            roles: Simulated::new(scenario),
            sampler,
            ring,
            sample: (State::default(), Stamp::default()),
            next: 0,
            ended: None,
            failures: vec![],
        })
    }

    /// Returns the newest sample.
    pub fn sample(&self) -> &State {
        &self.sample.0
    }

    /// Returns the plant.
    pub fn plant(&self) -> &Plant<dyn Vehicle> {
        &self.sampler.plant
    }

    /// Flies to the end, or until `watch`, which gets every message, returns false; `remember` gets the memory of every
    /// node, every ten seconds.
    ///
    /// # Errors
    /// A new process of a node cannot be built.
    pub fn fly(
        mut self,
        mut watch: impl FnMut(&Record) -> bool,
        mut remember: impl FnMut(&Memory),
    ) -> Result<SteppedResult, SessionError> {
        while self.begin()? {
            self.answer(&Topic::OF_CONTROLLERS);
            self.memories().iter().for_each(&mut remember);
            self.end(&mut watch);
        }
        Ok(self.over())
    }

    /// Takes the next sample and sends it. Returns `false` if the flight is over, or ends because the plant is lost.
    ///
    /// # Errors
    /// A new process of a node cannot be built.
    pub fn begin(&mut self) -> Result<bool, SessionError> {
        if self.ended.is_some() {
            return Ok(false);
        }
        let tick = self.next;
        let lost = || Some(Ended::Lost(Topic::State.publisher().into()));
        let state = match self.sampler.sample(tick, None) {
            Ok(state) => state,
            Err(error) => {
                self.failures.push(format!("plant 1, tick {tick}: {error}"));
                self.ended = lost();
                return Ok(false);
            }
        };
        for order in self.roles.begin(tick) {
            self.obey(order)?;
        }
        if self.roles.assignment(Topic::State).active == 0 {
            self.ended = lost();
            return Ok(false);
        }
        self.next += 1;
        for topic in Topic::ALL {
            self.ring.page.role(topic).assign(tick as u32, |_| self.roles.assignment(topic));
        }
        self.sample = (state, Stamp::at(tick, tick * self.scenario.sample_ns()));
        let done = self.ring.page.role(Topic::State).done(1);
        self.sampler.send(state, self.sample.1, || done.set(tick as u32 + 1));
        Ok(true)
    }

    /// Lets the processes of the nodes on `topics` answer to the sample, except those that a fault ends instead.
    pub fn answer(&mut self, topics: &[Topic]) {
        let sample = self.sample.1;
        for topic in topics {
            self.leave(*topic);
            for (epoch, error) in self.workers(*topic).answer(sample) {
                self.exited(*topic, epoch);
                self.failures.push(format!("{} {epoch}, tick {}: {error}", topic.publisher(), sample.tick));
            }
        }
    }

    /// Returns the node on `topic` if its caller computes its answers, with the provenance of the sample to answer;
    /// `None` otherwise, or if no process of the node works. Processes that a fault ends instead of an answer end now.
    pub fn asked(&mut self, topic: Topic) -> Option<(&mut dyn Asked, Stamp)> {
        self.leave(topic);
        let sample = self.sample.1;
        Some((self.workers(topic).asked()?, sample))
    }

    /// Returns the memories of all nodes after the sample; an empty list if memories are not stored after this sample,
    /// or if the vehicle has no memory to continue from.
    pub fn memories(&mut self) -> Vec<Memory> {
        let tick = self.sample.1.tick;
        if !self.scenario.is_remembered(tick) {
            return vec![];
        }
        let Some(words) = self.sampler.memory() else { return vec![] };
        let vehicle = Memory::new(tick, Topic::State, Origin { epoch: 1, done: tick + 1 }, words);
        let of_node = |workers: &Workers| {
            let (origin, memory) = workers.memory()?;
            Some(Memory::new(tick, workers.topic, origin, &memory))
        };
        std::iter::once(vehicle).chain(self.nodes.iter().filter_map(of_node)).collect()
    }

    /// Passes the messages of the tick to `watch`, and the command to the plant. The flight is over if this sample was
    /// the last, or if `watch` returns `false`.
    pub fn end(&mut self, mut watch: impl FnMut(&Record) -> bool) {
        let mut go_on = true;
        self.observers.drain(|record| {
            self.roles.observe(record);
            go_on &= watch(record);
        });
        let Sampler { plant, commands, .. } = &mut self.sampler;
        let command = commands.fresh();
        if !go_on || self.sample.0.is_last() {
            let ended = given_up(&self.roles.nodes).map_or(Ended::Flown, |name| Ended::Lost(name.into()));
            self.ended = Some(ended);
        } else if let Some(command) = command {
            plant.command(command, command.stamp.held_ns);
        }
    }

    /// Returns the result; a flight that is not over counts as interrupted.
    pub fn over(self) -> SteppedResult {
        let refused = refused_by_listener(&self.ring.page);
        let ended = self.ended.unwrap_or(Ended::Interrupted);
        SteppedResult { ended, events: self.roles.events, refused, failures: self.failures }
    }

    fn workers(&mut self, topic: Topic) -> &mut Workers {
        &mut self.nodes[topic as usize - 1]
    }

    /// Carries out an order before a tick. The plant has no other process: without it the flight ends.
    fn obey(&mut self, (topic, action): Order) -> Result<(), SessionError> {
        let run = &self.scenario;
        let Some(workers) = self.nodes.iter_mut().find(|workers| workers.topic == topic) else { return Ok(()) };
        match action {
            Action::Spawn(epoch, origin) => {
                let own = origin.and_then(|i| candidate(run, &run.swap[i]).ok()); // errors were reported at the check
                workers.begin(epoch, own.as_ref().unwrap_or(run), run)?;
            }
            Action::Signal(epoch, role::Signal::Kill) => workers.end(epoch),
            _ => {} // the simulated roles have carried out this action
        }
        Ok(())
    }

    /// Ends the processes of the node on `topic` that a fault of their own settings ends before they answer.
    fn leave(&mut self, topic: Topic) {
        let tick = self.sample.1.tick;
        while let Some(epoch) = self.workers(topic).leaves(tick) {
            self.exited(topic, epoch);
        }
    }

    /// Ends process `epoch` of the node on `topic`, and tells the role.
    fn exited(&mut self, topic: Topic, epoch: u32) {
        let tick = self.sample.1.tick;
        self.workers(topic).end(epoch);
        self.roles.exited(topic, epoch, tick, RoleInput::Exited(epoch));
        self.ring.page.role(topic).assign(tick as u32, |_| self.roles.assignment(topic));
    }
}
