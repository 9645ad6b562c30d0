//! The ring turned by one thread: the four steps in order, message by message as the processes would exchange them.
//!
//! | module | holds |
//! |---|---|
//! | `node` | what the three cores that answer to the plant have in common |
//! | `post` | those who work for one node, heard and delivery |
//! | `speech` | how they hear and speak |
//!
//! Bit-identical to lockstep, because the same cores see the same messages in the same order, through the same guards,
//! links and roles. Nothing here reads a clock: the stamps carry sample numbers and sequence numbers only.

mod node;
mod post;
mod speech;

use attitude_mpc::AttitudeMpc;
use contract::message::{Actuators, Controls, PlantStatus, Reference, Stamp, State};
use contract::scenario::Scenario;
use contract::topic::Topic;
use guidance::Guidance;
use mixer::Mixer;
use plant::Plant;

use crate::event::Event;
use crate::log::Record;
use crate::roles::simulated::{Simulated, Step};
use crate::stack::{Ended, Refused};
use post::Post;
use speech::{Ear, Heard, Voice};

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
pub fn fly(scenario: &Scenario, mut watch: impl FnMut(Record) -> bool) -> Flown {
    let mut roles = Simulated::new(scenario);
    let mut plant = Plant::new(scenario);
    let mut commands = Ear::default();
    let mut ring = Ring::new(scenario);
    let ended = loop {
        let mut go_on = true;
        let mut state = plant.sample();
        let tick = state.stamp.tick;
        for step in roles.begin(tick) {
            ring.obey(scenario, step, &roles);
        }
        if roles.assignment(Topic::State).active == 0 {
            break Ended::Lost("plant".into());
        }
        state.stamp = Stamp::at(tick, tick * scenario.sample_ns());
        let mut each = |record: Record, roles: &mut Simulated| {
            roles.observe(&record);
            go_on &= watch(record);
        };
        ring.turn(&mut roles, &state, &mut commands, &mut each);
        let command = commands.fresh(tick + 1);
        if !go_on || state.status != PlantStatus::Flying as u64 {
            break roles.given_up().map_or(Ended::Flown, |name| Ended::Lost(name.into()));
        }
        if let Some(command) = command {
            plant.command(command, command.stamp.held_ns);
        }
        plant.advance(1);
    };
    let refused = [commands.refused, ring.guidance.refused(), ring.mpc.refused(), ring.mixer.refused()];
    Flown { ended, events: roles.events, refused: Topic::ALL.map(Topic::publisher).into_iter().zip(refused).collect() }
}

/// The plant's voice, and the nodes that answer to it.
struct Ring {
    states: Voice<State>,
    guidance: Post<Guidance>,
    mpc: Post<AttitudeMpc>,
    mixer: Post<Mixer>,
    last: Heard,
}

impl Ring {
    fn new(scenario: &Scenario) -> Self {
        let last = Heard::default();
        Self {
            states: Voice::new(scenario, 1),
            guidance: Post::new(scenario),
            mpc: Post::new(scenario),
            mixer: Post::new(scenario),
            last,
        }
    }

    /// Does what is to be done before a tick.
    fn obey(&mut self, scenario: &Scenario, step: Step, roles: &Simulated) {
        let active = |topic| roles.assignment(topic).active;
        match step {
            Step::End(Topic::State, _) | Step::Begin(Topic::State, ..) => {}
            Step::End(Topic::Reference, epoch) => self.guidance.end(epoch),
            Step::End(Topic::Controls, epoch) => self.mpc.end(epoch),
            Step::End(Topic::Actuators, epoch) => self.mixer.end(epoch),
            Step::Begin(Topic::Reference, epoch, origin) => {
                self.guidance.begin(scenario, epoch, origin, &self.last, active(Topic::Reference));
            }
            Step::Begin(Topic::Controls, epoch, origin) => {
                self.mpc.begin(scenario, epoch, origin, &self.last, active(Topic::Controls));
            }
            Step::Begin(Topic::Actuators, epoch, origin) => {
                self.mixer.begin(scenario, epoch, origin, &self.last, active(Topic::Actuators));
            }
        }
    }

    /// CycleLoop the ring once, with `state` as the plant's sample, already numbered with its tick. What reaches the plant
    /// is heard by `commands`.
    fn turn(
        &mut self,
        roles: &mut Simulated,
        state: &State,
        commands: &mut Ear<Actuators>,
        each: &mut impl FnMut(Record, &mut Simulated),
    ) {
        let Self { states, guidance, mpc, mixer, last } = self;
        let sample = state.stamp;
        states.speak(true, *state, sample, |message: &State| {
            guidance.ears().for_each(|ear| ear.hear(message, 1));
            mpc.ears().for_each(|(ear, _)| ear.hear(message, 1));
            mixer.ears().for_each(|(ear, _)| ear.hear(message, 1));
            last.state = *message;
            each((*message).into(), roles);
        });
        guidance.answer(sample, roles, |message: &Reference, active, roles| {
            mpc.ears().for_each(|(_, ear)| ear.hear(message, active));
            last.keep_reference(message);
            each((*message).into(), roles);
        });
        mpc.answer(sample, roles, |message: &Controls, active, roles| {
            mixer.ears().for_each(|(_, ear)| ear.hear(message, active));
            last.keep_controls(message);
            each((*message).into(), roles);
        });
        mixer.answer(sample, roles, |message: &Actuators, active, roles| {
            commands.hear(message, active);
            each((*message).into(), roles);
        });
    }
}
