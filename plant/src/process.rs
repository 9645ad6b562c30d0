//! Plant as a process, which begins every tick.

use contract::message::{Actuators, Content, State};
use contract::snapshot::PLANT_WORDS;
use runtime::session::{NodeSession, SessionError};

use crate::Plant;
use crate::tricopter::Tricopter;
use crate::vehicle::Vehicle;

/// Flies the tricopter until the run is over or the vehicle has diverged.
pub fn run(session: NodeSession) -> Result<(), SessionError> {
    let vehicle = Tricopter::new(&session.scenario);
    run_with(session, Box::new(vehicle))
}

/// Flies a `vehicle`, at the start of the session's scenario, until the run is over or the vehicle has diverged.
///
/// Every sample is published and valid until the next release; a command that arrives in between acts from the instant
/// of its arrival, with the delay of the scenario.
pub fn run_with<V: Vehicle + ?Sized>(mut session: NodeSession, vehicle: Box<V>) -> Result<(), SessionError> {
    let mut plant = Plant::with(&session.scenario, vehicle);
    let mut states = session.output::<State>()?;
    let truths = session.truth_output()?;
    let mut commands = session.input::<Actuators>()?;
    let scenario = session.scenario.clone();
    let mut cycles = session.ready_to_sample()?;
    let mut before = 0;
    let mut memory = vec![0; PLANT_WORDS];
    while let Some(tick) = cycles.next(&mut commands, |command, arrival_ns| plant.command(command, arrival_ns))? {
        plant.advance(tick - before)?;
        before = tick;
        cycles.new_faults(|number, fault| plant.apply_fault(number, fault));
        let state = plant.sample();
        if state.is_last() {
            cycles.ends_with(tick);
        }
        states.send(state, cycles.provenance(tick));
        cycles.done(tick);
        truths.send(plant.truth(), &states);
        if scenario.is_remembered(tick)
            && let Some(length) = plant.memory(&mut memory)
        {
            cycles.remember(tick, &memory[..length]);
        }
    }
    Ok(())
}
