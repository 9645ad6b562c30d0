//! The ring turned by one thread: the four steps in order, message by message as the processes would exchange them.
//!
//! | module | holds |
//! |---|---|
//! | `node` | each core with the ports of a process, over queues |
//! | `post` | those that work for one node |
//!
//! Bit-identical to lockstep, because the same cores get the same messages in the same order through the same inputs and
//! outputs, under the same roles. Nothing here reads a clock: the stamps carry sample numbers and sequence numbers
//! only.

mod node;
mod post;

use contract::guard::Refusal;
use contract::message::{PlantStatus, Stamp};
use contract::scenario::{Scenario, candidate};
use contract::topic::Topic;
use plant::Plant;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::observer::Observer;
use runtime::output::Output;

use crate::event::Event;
use crate::log::Record;
use crate::recorder::Observers;
use crate::roles::role;
use crate::roles::simulated::{Simulated, Step};
use crate::stack::{Ended, Refused};
use node::{GuidanceNode, MixerNode, MpcNode, Node};
use post::{Post, Ring};

/// What a flight by one thread leaves behind, beside the messages.
pub struct Flown {
    /// How it ended.
    pub ended: Ended,
    /// What happened to the nodes.
    pub events: Vec<Event>,
    /// Messages refused, by listener and cause.
    pub refused: Refused,
}

/// Flies `scenario` to its end, or until `watch` says stop by returning false; `watch` sees every message.
pub fn fly(scenario: &Scenario, watch: impl FnMut(Record) -> bool) -> Flown {
    try_to_fly(scenario, watch).unwrap_or_else(|error| panic!("a checked scenario flies in process: {error}"))
}

fn try_to_fly(scenario: &Scenario, mut watch: impl FnMut(Record) -> bool) -> Result<Flown, SessionError> {
    let ring = Ring::new().map_err(|why| SessionError::Io { what: "memory of the ring".into(), why })?;
    let mut observer = Observer::in_process(scenario, ring.page.clone(), ring.queues.clone());
    let observers = Observers::join(&mut observer)?;
    let mut roles = Simulated::new(scenario);
    let mut plant = Plant::new(scenario);
    let (member, mut ports) = ring.member(Topic::State, 1, scenario, scenario);
    let mut states = Output::open(&mut ports, &member, scenario)?;
    let mut commands = Input::open(&mut ports, &member)?;
    let mut nodes = Nodes::new(&ring, scenario)?;
    let ended = loop {
        let mut go_on = true;
        let state = plant.sample();
        let tick = state.stamp.tick;
        for step in roles.begin(tick) {
            nodes.obey(scenario, step)?;
        }
        if roles.assignment(Topic::State).active == 0 {
            break Ended::Lost("plant".into());
        }
        for topic in Topic::ALL {
            ring.page.role(topic).assign(tick as u32, |_| roles.assignment(topic));
        }
        let sample = Stamp::at(tick, tick * scenario.sample_ns());
        states.send(state, sample);
        ring.page.role(Topic::State).done(1).set(tick as u32 + 1);
        answer(&mut nodes.guidance, &ring, &mut roles, sample);
        answer(&mut nodes.mpc, &ring, &mut roles, sample);
        answer(&mut nodes.mixer, &ring, &mut roles, sample);
        observers.drain(|record| {
            roles.observe(&record);
            go_on &= watch(record);
        });
        let command = commands.fresh();
        if !go_on || state.status != PlantStatus::Flying as u64 {
            break roles.given_up().map_or(Ended::Flown, |name| Ended::Lost(name.into()));
        }
        if let Some(command) = command {
            plant.command(command, command.stamp.held_ns);
        }
        plant.advance(1);
    };
    let refused = |topic: Topic| Refusal::ALL.map(|refusal| ring.page.role(topic).refused[refusal as usize].get());
    let refused = Topic::ALL.map(|topic| (topic.publisher(), refused(topic))).into();
    Ok(Flown { ended, events: roles.events, refused })
}

/// The nodes that answer to the plant.
struct Nodes {
    guidance: Post<GuidanceNode>,
    mpc: Post<MpcNode>,
    mixer: Post<MixerNode>,
}

impl Nodes {
    fn new(ring: &Ring, scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self {
            guidance: Post::new(ring, scenario)?,
            mpc: Post::new(ring, scenario)?,
            mixer: Post::new(ring, scenario)?,
        })
    }

    /// Does what is to be done before a tick.
    fn obey(&mut self, run: &Scenario, step: Step) -> Result<(), SessionError> {
        match step {
            Step::End(Topic::State, _) | Step::Begin(Topic::State, ..) => {}
            Step::End(Topic::Reference, epoch) => self.guidance.end(epoch),
            Step::End(Topic::Controls, epoch) => self.mpc.end(epoch),
            Step::End(Topic::Actuators, epoch) => self.mixer.end(epoch),
            Step::Begin(topic, epoch, origin) => {
                let own = origin.and_then(|i| candidate(run, &run.swap[i]).ok()); // what is wrong with it was said before
                let own = own.as_ref().unwrap_or(run);
                match topic {
                    Topic::Reference => self.guidance.begin(epoch, own, run)?,
                    Topic::Controls => self.mpc.begin(epoch, own, run)?,
                    _ => self.mixer.begin(epoch, own, run)?,
                }
            }
        }
        Ok(())
    }
}

/// Has all that work for one node answer to a sample, but those that leave instead.
fn answer<N: Node>(post: &mut Post<N>, ring: &Ring, roles: &mut Simulated, sample: Stamp) {
    while let Some(epoch) = post.leaves(sample.tick) {
        post.end(epoch);
        roles.exited(N::TOPIC, epoch, sample.tick, role::Input::Exited(epoch));
        ring.page.role(N::TOPIC).assign(sample.tick as u32, |_| roles.assignment(N::TOPIC));
    }
    post.answer(sample);
}
