//! The plant as a process: the only one with a clock.

use contract::message::{Actuators, PlantStatus, State};
use runtime::pace::Turn;
use runtime::process::{Seat, SeatError};

use crate::Plant;

/// Flies the vehicle until the run is over or the vehicle is lost.
///
/// Every sample is published and lives until the next release; the commands that arrive meanwhile act from the moment
/// they arrived.
pub fn run(seat: &Seat) -> Result<(), SeatError> {
    let mut plant = Plant::new(&seat.scenario);
    let mut states = seat.outlet::<State>()?;
    let mut commands = seat.inlet::<Actuators>()?;
    let mut news = seat.news();
    seat.settle()?;
    let Some(mut pace) = seat.pace() else { return Ok(()) };
    loop {
        news.tell(|number, fault| {
            plant.suffer(number, fault);
            pace.suffer(number, fault);
        });
        let state = plant.sample();
        let tick = state.stamp.tick;
        let Some(lineage) = pace.sample(tick) else { return Err(SeatError::Stuck { tick }) };
        states.send(state, lineage);
        pace.sampled(tick);
        match pace.turn(tick, &mut commands, |command, arrival_ns| plant.command(command, arrival_ns)) {
            Turn::Periods(periods) if state.status == PlantStatus::Flying as u64 => {
                plant.advance(periods);
            }
            Turn::Periods(_) | Turn::Over => return Ok(()),
            Turn::Stuck => return Err(SeatError::Stuck { tick }),
            Turn::Seized => return Err(SeatError::Seized { tick: tick + 1 }),
        }
    }
}
