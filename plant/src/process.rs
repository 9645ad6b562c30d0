//! Plant as a process, which begins every tick.

use contract::message::Content;
use runtime::error::SessionError;
use runtime::session::NodeSession;

use crate::sampler::Sampler;
use crate::vehicle::Vehicle;

/// Flies a `vehicle` from the start of the session's scenario until the run is over or the vehicle has diverged.
///
/// Every sample is published and valid until the next release; a command that arrives in between acts from the instant
/// of its arrival, with the delay of the scenario.
pub fn run(mut session: NodeSession, vehicle: Box<dyn Vehicle>) -> Result<(), SessionError> {
    let mut sampler = session.open(|ports, member, scenario| Sampler::open(ports, member, scenario, vehicle))?;
    let scenario = session.scenario.clone();
    let mut cycles = session.ready_to_sample()?;
    while let Some(tick) =
        cycles.next(&mut sampler.commands, |command, arrival_ns| sampler.plant.command(command, arrival_ns))?
    {
        let state = sampler.sample(tick, None)?;
        if state.is_last() {
            cycles.ends_with(tick);
        }
        sampler.send(state, cycles.provenance(tick), || cycles.done(tick));
        if scenario.is_remembered(tick)
            && let Some(memory) = sampler.memory()
        {
            cycles.remember(tick, memory);
        }
    }
    Ok(())
}
