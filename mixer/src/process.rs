//! Mixer as a process, woken by CONTROLS.

use contract::message::{Actuators, Controls, State};
use runtime::session::{NodeSession, SessionError};

use crate::Mixer;

/// Answers every sample with ACTUATORS until the run is over.
pub fn run(mut session: NodeSession) -> Result<(), SessionError> {
    let mut mixer = Mixer::new(&session.scenario);
    if let Some(memory) = session.memory() {
        mixer.restore(&memory); // a snapshot that does not fit is ignored
    }
    let mut states = session.input::<State>()?;
    let mut demands = session.input::<Controls>()?;
    let mut actuators = session.output::<Actuators>()?;
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(&mut demands)? {
        let (demand, state) = (demands.newest(), states.newest());
        actuators.send(mixer.step(tick, demand, state), cycles.provenance(tick).with(demand).with(state));
        cycles.done(tick, &mixer.snapshot());
    }
    Ok(())
}
