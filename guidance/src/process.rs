//! Guidance as a process: its turn comes with STATE.

use contract::message::{Reference, State};
use runtime::session::{NodeSession, SessionError};

use crate::Guidance;

/// Answers every sample with a REFERENCE until the run is over.
pub fn run(session: &NodeSession) -> Result<(), SessionError> {
    let mut guidance = Guidance::new(&session.scenario);
    if let Some(memory) = session.memory() {
        guidance.restore(&memory); // one that does not fit is as good as none
    }
    let mut states = session.input::<State>()?;
    let mut references = session.output::<Reference>()?;
    let mut cycle_loop = session.settle()?;
    while let Some(tick) = cycle_loop.next(&mut states) {
        let state = states.newest();
        references.send(guidance.step(tick, state), cycle_loop.provenance(tick).with(state));
        cycle_loop.done(tick, &guidance.snapshot());
    }
    Ok(())
}
