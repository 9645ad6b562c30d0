//! The mixer as a process: wakes on CONTROLS.

use contract::message::{Actuators, Controls, Stamp};
use contract::process::{Seat, SeatError};

use crate::Mixer;

/// Answers every CONTROLS with ACTUATORS until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut mixer = Mixer::new(&seat.scenario);
    let mut controls = seat.inlet::<Controls>()?;
    let mut actuators = seat.outlet::<Actuators>()?;
    seat.settle();
    while let Some(demand) = controls.wait() {
        actuators.send(mixer.step(&demand), Stamp::of(&demand));
    }
    Ok(())
}
