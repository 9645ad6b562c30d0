//! Guidance as a process: its turn comes with STATE.

use contract::message::{Reference, State};
use runtime::process::{Seat, SeatError};

use crate::Guidance;

/// Answers every sample with a REFERENCE until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut guidance = Guidance::new(&seat.scenario);
    if let Some(memory) = seat.memory() {
        guidance.restore(&memory); // one that does not fit is as good as none
    }
    let mut states = seat.inlet::<State>()?;
    let mut references = seat.outlet::<Reference>()?;
    let mut turns = seat.settle()?;
    while let Some(tick) = turns.next(&mut states) {
        let state = states.newest();
        references.send(guidance.step(tick, state), turns.lineage(tick).with(state));
        turns.done(tick, &guidance.snapshot());
    }
    Ok(())
}
