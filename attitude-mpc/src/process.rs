//! The attitude controller as a process: wakes on REFERENCE, takes the newest STATE, at least the one behind that.

use contract::Topic;
use contract::message::{Controls, Reference, Stamp, State};
use contract::process::{Seat, SeatError};

use crate::AttitudeMpc;

/// Answers every REFERENCE with CONTROLS until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut mpc = AttitudeMpc::new(&seat.scenario);
    let mut states = seat.inlet::<State>()?;
    let mut references = seat.inlet::<Reference>()?;
    let mut controls = seat.outlet::<Controls>()?;
    seat.settle();
    while let Some(reference) = references.wait() {
        let state = states.catch_up(reference.stamp.inputs[Topic::State as usize]);
        let lineage = Stamp::of(&reference).with(state);
        let late = controls.send(mpc.step(state, &reference), lineage);
        mpc.hurry(late);
    }
    Ok(())
}
