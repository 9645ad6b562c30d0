//! The plant as a process: the only one with a clock.

use contract::message::{Actuators, PlantStatus, State};
use runtime::release::CycleEnd;
use runtime::session::{NodeSession, SessionError};

use crate::Plant;

/// Flies the vehicle until the run is over or the vehicle is lost.
///
/// Every sample is published and lives until the next release; the commands that arrive meanwhile act from the moment
/// they arrived.
pub fn run(session: &NodeSession) -> Result<(), SessionError> {
    let mut plant = Plant::new(&session.scenario);
    let mut states = session.output::<State>()?;
    let mut commands = session.input::<Actuators>()?;
    let mut news = session.news();
    session.settle()?;
    let Some(mut release) = session.release() else { return Ok(()) };
    loop {
        news.tell(|number, fault| {
            plant.apply_fault(number, fault);
            release.apply_fault(number, fault);
        });
        let state = plant.sample();
        let tick = state.stamp.tick;
        let Some(provenance) = release.sample(tick) else { return Err(SessionError::Stuck { tick }) };
        states.send(state, provenance);
        release.sampled(tick);
        match release.turn(tick, &mut commands, |command, arrival_ns| plant.command(command, arrival_ns)) {
            CycleEnd::Periods(periods) if state.status == PlantStatus::Flying as u64 => {
                plant.advance(periods);
            }
            CycleEnd::Periods(_) | CycleEnd::Over => return Ok(()),
            CycleEnd::Stuck => return Err(SessionError::Stuck { tick }),
            CycleEnd::FaultExit => return Err(SessionError::FaultExit { tick: tick + 1 }),
        }
    }
}
