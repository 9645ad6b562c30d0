//! Faults of processes, turned into inputs of the roles when the faults are due.

use contract::topic::Topic;
use settings::fault_schedule::{Entry, FaultSchedule};
use settings::{Fault, FaultKind, Mode, Scenario};

use super::role::RoleInput;

pub struct FaultInputs {
    faults: FaultSchedule<Injected>,
    simulated: bool,
    sample_ns: u64,
}

struct Injected {
    topic: Topic,
    kind: FaultKind,
    /// Time before which no other process is started \[ns\].
    held_until_ns: u64,
    /// Process that the fault was applied to; `None` before the fault begins.
    victim: Option<u32>,
    ended: bool,
}

impl FaultInputs {
    /// Takes the process faults of `scenario`. In real time the process itself carries out `exit` and `hog`: an `exit`
    /// then only delays the next start, and a `hog` gives no input.
    pub fn new(scenario: &Scenario) -> Self {
        let (simulated, sample_ns) = (scenario.run.mode != Mode::Realtime, scenario.sample_ns());
        let faults = FaultSchedule::new(scenario, |_, fault| Injected::of(fault));
        Self { faults, simulated, sample_ns }
    }

    /// Adds or changes fault `number`: see [`FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, Injected::of(fault));
    }

    /// Returns the inputs of faults that begin or end by `tick`, each once; `active` gives a node's active process.
    pub fn due(&mut self, tick: u64, active: impl Fn(Topic) -> Option<u32>) -> Vec<(Topic, RoleInput)> {
        let mut inputs = vec![];
        for Entry { ticks, effect: fault, .. } in self.faults.all_mut() {
            let begins = tick >= ticks.start && !ticks.is_empty() && fault.victim.is_none();
            // A process that ends by itself may be gone by now.
            let ends_itself = !self.simulated && fault.kind == FaultKind::Exit;
            if let Some(epoch) = active(fault.topic).or(ends_itself.then_some(0)).filter(|_| begins) {
                fault.victim = Some(epoch);
                inputs.extend(fault.input(self.simulated).map(|input| (fault.topic, input)));
            }
            let stops = fault.kind == FaultKind::Stop || (self.simulated && fault.kind == FaultKind::Hog);
            if let Some(victim) = fault.victim.filter(|_| stops && tick >= ticks.end && !fault.ended) {
                fault.ended = true;
                inputs.push((fault.topic, RoleInput::Continue(victim)));
            }
        }
        inputs
    }

    /// Returns the first tick from `tick` on at which a fault begins or ends.
    pub fn next_tick(&self, tick: u64) -> Option<u64> {
        let ticks = self.faults.all().iter().flat_map(|Entry { ticks, .. }| [ticks.start, ticks.end]);
        ticks.filter(|at| *at >= tick).min()
    }

    /// Returns the time of `tick` \[ns\].
    pub fn time_ns(&self, tick: u64) -> u64 {
        tick.saturating_mul(self.sample_ns)
    }
}

impl Injected {
    fn of(fault: &Fault) -> Option<Self> {
        use FaultKind::{Exit, Hog, Kill, Stop};
        let topic = fault.target.process().filter(|_| matches!(fault.kind, Kill | Exit | Stop | Hog))?;
        let held_until_ns = fault.for_s.map_or(0, |for_s| ((fault.at_s + for_s) * 1e9) as u64);
        Some(Self { topic, kind: fault.kind, held_until_ns, victim: None, ended: false })
    }

    fn input(&self, simulated: bool) -> Option<RoleInput> {
        match self.kind {
            FaultKind::Kill => Some(RoleInput::Kill(self.held_until_ns)),
            FaultKind::Exit if simulated => Some(RoleInput::Kill(self.held_until_ns)),
            FaultKind::Exit => Some(RoleInput::Hold(self.held_until_ns)),
            FaultKind::Stop => Some(RoleInput::Stop),
            FaultKind::Hog if simulated => Some(RoleInput::Stop),
            _ => None,
        }
    }
}
