//! The plant behind its ports, and the loop of its process. The process, the ring in one thread and a replay sample it
//! in the same order.
//!
//! ```text
//! command  passes each command that arrives after the newest sample to `plant.command`
//! sample   integrates to the next sample, applies the faults that were given since, and measures STATE
//! send     sends STATE, which the nodes wait for, then TRUTH
//! memory   returns the plant's memory after this sample, from which a replay can begin
//! ```

use std::any::Any;

#[cfg(target_os = "linux")]
use contract::message::Content;
use contract::message::{Actuators, Stamp, State};
use contract::snapshot::PLANT_WORDS;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::member::Member;
use runtime::output::{Output, TruthOutput};
use runtime::ports::Ports;
#[cfg(target_os = "linux")]
use runtime::session::NodeSession;
use settings::Scenario;

use crate::Plant;
use crate::vehicle::Vehicle;

/// Flies a `vehicle` from the start of the session's scenario until the run is over or the vehicle has diverged.
///
/// Every sample is published and valid until the next release; a command that arrives in between acts from the instant
/// of its arrival, with the delay of the scenario.
///
/// # Errors
/// A port cannot be opened, the code of the vehicle fails, a fault ends the process, or the process has missed a
/// deadline with the policy `stop`.
#[cfg(target_os = "linux")]
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

/// Plant with its ports.
pub struct Sampler {
    /// The plant; the owner of the ports passes commands and memories to it directly.
    pub plant: Plant<dyn Vehicle>,
    /// Input of the commands; silent in a replay, which takes commands and their instants from the log.
    pub commands: Input<Actuators>,
    member: Member,
    states: Output<State>,
    truths: TruthOutput,
    words: Vec<u64>,
}

impl Sampler {
    /// Opens the ports of `member`, with the plant of `scenario` and this `vehicle` at its start.
    ///
    /// # Errors
    /// Fails if a port cannot be opened.
    pub fn open(
        ports: &mut Ports,
        member: &Member,
        scenario: &Scenario,
        vehicle: Box<dyn Vehicle>,
    ) -> Result<Self, SessionError> {
        Ok(Self {
            plant: Plant::with(scenario, vehicle),
            member: member.clone(),
            states: Output::open(ports, member, scenario)?,
            truths: TruthOutput::open(ports, member)?,
            commands: Input::open(ports, member)?,
            words: vec![0; PLANT_WORDS],
        })
    }

    /// Flies to sample `tick`, and measures STATE there. A `known` STATE of a replay is returned instead, and the plant
    /// stays where it is.
    ///
    /// # Errors
    /// Fails if the code of the vehicle fails.
    pub fn sample(&mut self, tick: u64, known: Option<&dyn Any>) -> Result<State, SessionError> {
        let known = self.states.known(known);
        if known.is_none() {
            self.plant.advance(tick - self.plant.tick)?;
        }
        self.member.faults.new_faults(|number, fault| self.plant.apply_fault(number, fault));
        Ok(known.unwrap_or_else(|| self.plant.sample()))
    }

    /// Sends the `state` that was measured, calls `sent`, and then sends TRUTH, for which no node shall wait.
    pub fn send(&mut self, state: State, provenance: Stamp, sent: impl FnOnce()) {
        self.states.send(state, provenance);
        sent();
        self.truths.send(self.plant.truth(), &self.states);
    }

    /// Returns the memory after the newest sample; `None` if the plant has no memory to continue from.
    pub fn memory(&mut self) -> Option<&[u64]> {
        let length = self.plant.memory(&mut self.words)?;
        Some(&self.words[..length])
    }
}
