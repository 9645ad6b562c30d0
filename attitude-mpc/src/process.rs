//! The attitude controller as a process: its turn comes with REFERENCE.

use contract::message::{Controls, Reference, State};
use runtime::process::{Seat, SeatError};

use crate::AttitudeMpc;

/// Answers every sample with CONTROLS until the run is over.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut mpc = AttitudeMpc::try_new(&seat.scenario)?;
    if let Some(memory) = seat.memory() {
        mpc.restore(&memory); // one that does not fit is as good as none
    }
    let mut states = seat.inlet::<State>()?;
    let mut references = seat.inlet::<Reference>()?;
    let mut controls = seat.outlet::<Controls>()?;
    let mut news = seat.news();
    let mut turns = seat.settle()?;
    while let Some(tick) = turns.next(&mut references) {
        news.tell(|number, fault| mpc.suffer(number, fault));
        let (reference, state) = (references.newest(), states.newest());
        let late = controls.send(mpc.step(tick, state, reference), turns.lineage(tick).with(reference).with(state));
        mpc.hurry(late);
        turns.done(tick, &mpc.snapshot());
    }
    Ok(())
}
