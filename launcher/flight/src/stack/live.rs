//! Faults given and ended while the stack flies: they are entered into the fault table, where every process hears of them.

use contract::fault_schedule::{MAX_LIVE_FAULTS, MAX_SENSOR_DELAY_MS};
use contract::scenario::{Fault, FaultKind, FaultTarget, Mode, check_fault};
use serde_json::{Value, json};

use super::Stack;
use crate::event::{Event, Sender, What};
use crate::roles::realtime::plant_tick;

impl Stack {
    /// Gives the flight `fault`, which begins `at_s` after the next sample; the fault with its time in the flight.
    pub(super) fn inject(&mut self, mut fault: Fault, sender: Option<Sender>) -> Result<Value, String> {
        self.needs_a_clock()?;
        if matches!(fault.target, FaultTarget::Clock | FaultTarget::Host) || fault.kind.is_intrusion() {
            return Err(
                "faults of clock, host and intruders are not given while it flies: write them into the scenario".into(),
            );
        }
        self.check(&fault)?;
        if fault.kind == FaultKind::Delayed && fault.ms.is_some_and(|ms| ms > MAX_SENSOR_DELAY_MS) {
            return Err(format!(
                "a sensor can be delayed by {MAX_SENSOR_DELAY_MS} ms at most while it flies; write more into the scenario"
            ));
        }
        fault.at_s += self.time_s(self.next_tick());
        fault.at_s = self.time_s(fault.ticks(self.scenario.sample_s()).start);
        self.check(&fault)?; // nor may it begin too late
        let number = self.scenario.fault.len();
        if !self.page.fault_table().enter(number, &fault) {
            return Err(format!(
                "a flight takes {MAX_LIVE_FAULTS} faults, and this one has had them; `launcher stop` it and fly again"
            ));
        }
        self.driver.apply_fault(number, &fault);
        self.scenario.fault.push(fault);
        self.note(&fault, What::Injected, sender);
        Ok(json!([fault]))
    }

    /// Ends the faults of `target`, or all; those that were not over, with the time they have had.
    pub(super) fn clear(&mut self, target: Option<FaultTarget>, sender: Option<Sender>) -> Result<Value, String> {
        self.needs_a_clock()?;
        let end = self.next_tick();
        let sought = |fault: &Fault| target.is_none_or(|target| target == fault.target) && !self.is_over(fault);
        let had = |fault: &Fault| end.saturating_sub(fault.ticks(self.scenario.sample_s()).start);
        let cut = |fault: &Fault| Fault { for_s: Some(self.time_s(had(fault))), ..*fault };
        let faults = self.scenario.fault.iter().enumerate().filter(|(_, fault)| sought(fault));
        let cleared: Vec<(usize, Fault)> = faults.map(|(number, fault)| (number, cut(fault))).collect();
        if !self.page.fault_table().has_room_for(cleared.iter().map(|(number, _)| *number)) {
            return Err(format!(
                "a flight takes {MAX_LIVE_FAULTS} changes to its faults; name a target, or `launcher stop` it and fly again"
            ));
        }
        for (number, fault) in &cleared {
            self.page.fault_table().enter(*number, fault);
            self.driver.apply_fault(*number, fault);
            self.scenario.fault[*number] = *fault;
            self.note(fault, What::Cleared, sender);
        }
        Ok(cleared.iter().map(|(_, fault)| json!(fault)).collect())
    }

    /// The faults that are at work now.
    pub(super) fn at_work(&self) -> impl Iterator<Item = &Fault> {
        let (tick, sample_s) = (plant_tick(&self.page), self.scenario.sample_s());
        self.scenario.fault.iter().filter(move |fault| fault.is_active(tick, sample_s) && !fault.is_momentary())
    }

    fn check(&self, fault: &Fault) -> Result<(), String> {
        check_fault(&self.scenario, fault).map_err(|error| error.to_string())
    }

    fn needs_a_clock(&self) -> Result<(), String> {
        match self.scenario.run.mode {
            Mode::Realtime => Ok(()),
            _ => {
                Err("a flight in lockstep is over in a blink and must repeat: write the fault into its scenario".into())
            }
        }
    }

    /// The first sample before which every process is sure to hear of what is entered now: the one after the next.
    pub(super) fn next_tick(&self) -> u64 {
        plant_tick(&self.page) + 2
    }

    /// When `tick` is \[s\].
    pub(super) fn time_s(&self, tick: u64) -> f64 {
        tick as f64 / f64::from(self.scenario.run.rate_hz)
    }

    /// Whether nothing of `fault` is to come.
    fn is_over(&self, fault: &Fault) -> bool {
        let ticks = fault.ticks(self.scenario.sample_s());
        let last = if fault.is_momentary() { ticks.start.saturating_add(1) } else { ticks.end };
        ticks.is_empty() || last <= self.next_tick()
    }

    fn note(&mut self, fault: &Fault, what: What, by: Option<Sender>) {
        let tick = plant_tick(&self.page);
        self.events.push(Event { by, ..Event::new(tick, fault.target.name(), 0, what) });
    }
}
