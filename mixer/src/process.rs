//! The mixer as a process: its turn comes with CONTROLS.

use contract::message::{Actuators, Controls, State};
use runtime::process::{Seat, SeatError};

use crate::Mixer;

/// Answers every sample with ACTUATORS until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut mixer = Mixer::new(&seat.scenario);
    if let Some(memory) = seat.memory() {
        mixer.restore(&memory); // one that does not fit is as good as none
    }
    let mut states = seat.inlet::<State>()?;
    let mut demands = seat.inlet::<Controls>()?;
    let mut actuators = seat.outlet::<Actuators>()?;
    let mut turns = seat.settle()?;
    while let Some(tick) = turns.next(&mut demands) {
        let (demand, state) = (demands.newest(), states.newest());
        actuators.send(mixer.step(tick, demand, state), turns.lineage(tick).with(demand).with(state));
        turns.done(tick, &mixer.snapshot());
    }
    Ok(())
}
