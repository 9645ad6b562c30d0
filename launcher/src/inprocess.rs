//! The ring turned by one thread: the four steps in order, message by message as the processes would exchange them.
//!
//! Bit-identical to lockstep, because the same cores see the same messages in the same order, through the same guards,
//! links and plan. Nothing here reads a clock: the stamps carry sample numbers and sequence numbers only.

use attitude_mpc::AttitudeMpc;
use contract::guard::Guard;
use contract::link::Link;
use contract::message::{Actuators, Controls, Message, PlantStatus, Reference, Stamp, State};
use contract::outlet::Slowness;
use contract::plan::Plan;
use contract::scenario::Scenario;
use contract::stamp::unheard;
use contract::topic::Topic;
use guidance::Guidance;
use mixer::Mixer;
use plant::Plant;

use crate::log::Record;
use crate::stack::Ended;

/// Flies `scenario` to its end, or until `watch` says stop by returning false; `watch` sees every message.
pub fn fly(scenario: &Scenario, mut watch: impl FnMut(Record) -> bool) -> Ended {
    let plan = Plan::new(scenario);
    let mut plant = Plant::new(scenario);
    let mut nodes = Nodes::new(scenario);
    loop {
        let mut go_on = true;
        let mut state = plant.sample();
        let tick = state.stamp.tick;
        let epochs = Topic::ALL.map(|topic| plan.epoch(topic, tick));
        if epochs[Topic::State as usize] != 1 {
            return Ended::Lost("plant".into());
        }
        state.stamp = Stamp::at(tick, tick * scenario.sample_ns());
        nodes.turn(scenario, epochs, &state, |record| go_on &= watch(record));
        if !go_on || state.status != PlantStatus::Flying as u64 {
            return Ended::Flown;
        }
        if let Some(command) = nodes.heard_by_plant.fresh() {
            plant.command(command, command.stamp.held_ns);
        }
        plant.advance(1);
    }
}

/// The three nodes that answer to the plant, what all four hear, and how they speak.
struct Nodes {
    guidance: Guidance,
    mpc: AttitudeMpc,
    mixer: Mixer,
    heard_by_guidance: Ear<State>,
    heard_by_mpc: (Ear<State>, Ear<Reference>),
    heard_by_mixer: (Ear<State>, Ear<Controls>),
    heard_by_plant: Ear<Actuators>,
    states: Voice<State>,
    references: Voice<Reference>,
    controls: Voice<Controls>,
    actuators: Voice<Actuators>,
}

impl Nodes {
    fn new(scenario: &Scenario) -> Self {
        Self {
            guidance: Guidance::new(scenario),
            mpc: AttitudeMpc::new(scenario),
            mixer: Mixer::new(scenario),
            heard_by_guidance: Ear::default(),
            heard_by_mpc: Default::default(),
            heard_by_mixer: Default::default(),
            heard_by_plant: Ear::default(),
            states: Voice::new(scenario),
            references: Voice::new(scenario),
            controls: Voice::new(scenario),
            actuators: Voice::new(scenario),
        }
    }

    /// Turns the ring once, with `state` as the plant's sample, already numbered with its tick.
    fn turn(&mut self, scenario: &Scenario, epochs: [u32; 4], state: &State, mut watch: impl FnMut(Record)) {
        let [plant, guidance, mpc, mixer] = epochs;
        self.replace(scenario, epochs);
        let (tick, sample) = (state.stamp.tick, state.stamp);
        self.states.speak(scenario, plant, *state, sample, |message| {
            self.heard_by_guidance.hear(message, plant);
            self.heard_by_mpc.0.hear(message, plant);
            self.heard_by_mixer.0.hear(message, plant);
            watch((*message).into());
        });
        if guidance > 0 {
            let state = self.heard_by_guidance.newest();
            let lineage = sample.with(state);
            self.references.speak(scenario, guidance, self.guidance.step(tick, state), lineage, |message| {
                self.heard_by_mpc.1.hear(message, guidance);
                watch((*message).into());
            });
        }
        if mpc > 0 {
            let (state, reference) = (self.heard_by_mpc.0.newest(), self.heard_by_mpc.1.newest());
            let lineage = sample.with(reference).with(state);
            self.controls.speak(scenario, mpc, self.mpc.step(tick, state, reference), lineage, |message| {
                self.heard_by_mixer.1.hear(message, mpc);
                watch((*message).into());
            });
        }
        if mixer > 0 {
            let (state, demand) = (self.heard_by_mixer.0.newest(), self.heard_by_mixer.1.newest());
            let lineage = sample.with(demand).with(state);
            self.actuators.speak(scenario, mixer, self.mixer.step(tick, demand, state), lineage, |message| {
                self.heard_by_plant.hear(message, mixer);
                watch((*message).into());
            });
        }
    }

    /// Puts another process in the place of each that is gone: a new core with the old one's memory, and new ears, which
    /// have heard no more than the last word of each topic.
    fn replace(&mut self, scenario: &Scenario, [plant, guidance, mpc, mixer]: [u32; 4]) {
        if guidance > self.references.epoch {
            let memory = self.guidance.snapshot();
            self.guidance = Guidance::new(scenario);
            self.guidance.restore(&memory);
            self.heard_by_guidance = self.states.ear(plant);
        }
        if mpc > self.controls.epoch {
            let memory = self.mpc.snapshot();
            self.mpc = AttitudeMpc::new(scenario);
            self.mpc.restore(&memory);
            self.heard_by_mpc = (self.states.ear(plant), self.references.ear(guidance));
        }
        if mixer > self.actuators.epoch {
            let memory = self.mixer.snapshot();
            self.mixer = Mixer::new(scenario);
            self.mixer.restore(&memory);
            self.heard_by_mixer = (self.states.ear(plant), self.controls.ear(mpc));
        }
    }
}

/// Where a node hears one topic: what an inlet is to a process.
#[derive(Default)]
struct Ear<M: Message> {
    guard: Guard<M>,
    fresh: bool,
}

impl<M: Message> Ear<M> {
    fn hear(&mut self, message: &M, holder: u32) {
        if message.stamp().unheard == unheard::HEARD {
            self.fresh |= self.guard.take(message, holder).is_ok();
        }
    }

    fn newest(&self) -> &M {
        self.guard.newest()
    }

    /// The newest message, if it came since the last call.
    fn fresh(&mut self) -> Option<&M> {
        std::mem::take(&mut self.fresh).then(|| self.guard.newest())
    }
}

/// Where a node speaks on one topic: what an outlet is to a process.
struct Voice<M> {
    link: Link<M>,
    slow: Slowness,
    epoch: u32,
    sequence: u64,
    /// The last word that anybody could hear.
    last: Option<M>,
}

impl<M: Message> Voice<M> {
    fn new(scenario: &Scenario) -> Self {
        Self { link: Link::new(scenario), slow: Slowness::new(scenario, M::TOPIC), epoch: 1, sequence: 0, last: None }
    }

    fn speak(&mut self, scenario: &Scenario, epoch: u32, mut message: M, mut lineage: Stamp, mut to: impl FnMut(&M)) {
        if epoch > self.epoch {
            *self = Self { epoch, last: self.last, ..Self::new(scenario) };
        }
        self.sequence += 1;
        lineage.held_ns += self.slow.held_up_ns(lineage.tick);
        *message.stamp_mut() = Stamp { epoch: u64::from(epoch), ..lineage.published(M::TOPIC, self.sequence, 0) };
        let last = &mut self.last;
        self.link.pass(lineage.tick, &message.sealed(), |message| {
            *last = Some(*message);
            to(message);
        });
    }

    /// What a process hears first that joins now.
    fn ear(&self, holder: u32) -> Ear<M> {
        let mut ear = Ear::default();
        self.last.iter().for_each(|message| ear.hear(message, holder));
        ear
    }
}
