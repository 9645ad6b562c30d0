//! Attitude controller as a process, woken by REFERENCE.

use contract::message::{Controls, Reference, State};
use runtime::session::{NodeSession, SessionError};

use crate::AttitudeMpc;

/// Answers every sample with CONTROLS until the run is over.
pub fn run(mut session: NodeSession) -> Result<(), SessionError> {
    let mut mpc = AttitudeMpc::try_new(&session.scenario)?;
    if let Some(memory) = session.memory() {
        mpc.restore(&memory); // a snapshot that does not fit is ignored
    }
    let mut states = session.input::<State>()?;
    let mut references = session.input::<Reference>()?;
    let mut controls = session.output::<Controls>()?;
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(&mut references)? {
        cycles.new_faults(|number, fault| mpc.apply_fault(number, fault));
        let (reference, state) = (references.newest(), states.newest());
        let late = controls.send(mpc.step(tick, state, reference), cycles.provenance(tick).with(reference).with(state));
        mpc.hurry(late);
        cycles.done(tick, &mpc.snapshot());
    }
    Ok(())
}
