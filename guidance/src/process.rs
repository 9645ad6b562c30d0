//! Guidance as a process, woken by STATE.

use contract::message::{Reference, State};
use runtime::session::{NodeSession, SessionError};

use crate::Guidance;

/// Answers every sample with a REFERENCE until the run is over.
pub fn run(mut session: NodeSession) -> Result<(), SessionError> {
    let mut guidance = Guidance::new(&session.scenario);
    if let Some(memory) = session.memory() {
        guidance.restore(&memory); // a snapshot that does not fit is ignored
    }
    let mut states = session.input::<State>()?;
    let mut references = session.output::<Reference>()?;
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(&mut states)? {
        let state = states.newest();
        references.send(guidance.step(tick, state), cycles.provenance(tick).with(state));
        cycles.done(tick, &guidance.snapshot());
    }
    Ok(())
}
