//! Guidance as a process: wakes on STATE.

use contract::message::{Reference, Stamp, State};
use contract::process::{Seat, SeatError};

use crate::Guidance;

/// Answers every STATE with a REFERENCE until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut guidance = Guidance::new(&seat.scenario);
    let mut states = seat.inlet::<State>()?;
    let mut references = seat.outlet::<Reference>()?;
    seat.settle();
    while let Some(state) = states.wait() {
        references.send(guidance.step(&state), Stamp::of(&state));
    }
    Ok(())
}
