//! The ring turned by one thread: the four steps in order, message by message as the processes would exchange them.
//!
//! Bit-identical to lockstep, because the same cores see the same messages in the same order. Nothing here reads a
//! clock: the stamps carry sample numbers and sequence numbers only.

use attitude_mpc::AttitudeMpc;
use contract::Scenario;
use contract::message::{Message, PlantStatus, Stamp};
use guidance::Guidance;
use mixer::Mixer;
use plant::Plant;

use crate::log::Record;

/// Flies `scenario` to its end, or until `watch` says stop by returning false; `watch` sees every message.
pub fn fly(scenario: &Scenario, mut watch: impl FnMut(Record) -> bool) {
    let mut plant = Plant::new(scenario);
    let mut guidance = Guidance::new(scenario);
    let mut mpc = AttitudeMpc::new(scenario);
    let mut mixer = Mixer::new(scenario);
    let mut sequence = 0;
    loop {
        sequence += 1;
        let mut state = plant.sample();
        let tick = state.stamp.tick;
        let sample = Stamp { tick, sample_ns: tick * scenario.sample_ns(), ..Stamp::default() };
        stamp(&mut state, sample, sequence);
        let mut reference = guidance.step(&state);
        stamp(&mut reference, Stamp::of(&state), sequence);
        let mut controls = mpc.step(&state, &reference);
        stamp(&mut controls, Stamp::of(&reference).with(&state), sequence);
        let mut actuators = mixer.step(&controls);
        stamp(&mut actuators, Stamp::of(&controls), sequence);

        let mut go_on = true;
        for record in [state.into(), reference.into(), controls.into(), actuators.into()] {
            go_on &= watch(record);
        }
        if !go_on || state.status != PlantStatus::Flying as u64 {
            return;
        }
        plant.command(&actuators, 0);
        plant.advance(1);
    }
}

fn stamp<M: Message>(message: &mut M, lineage: Stamp, sequence: u64) {
    *message.stamp_mut() = Stamp { epoch: 1, ..lineage.published(M::TOPIC, sequence, 0) };
}
