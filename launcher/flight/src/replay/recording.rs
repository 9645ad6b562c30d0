//! What is known of a flight from its log: the script, and what each process flew with.

use std::collections::HashMap;

use anyhow::{Context, bail};
use contract::Topic;
use contract::scenario::{Fault, Scenario, candidate};

use super::script::Script;
use crate::event::{Event, What};
use crate::log::Log;

/// A flight as it was, to be flown again.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The settings at its beginning, with the swaps that were ordered in flight.
    pub scenario: Scenario,
    pub script: Script,
    /// Faults given and changed in flight, in order.
    pub(super) given: Vec<(usize, Fault)>,
    /// Messages in the log, by topic, those that are not whole too.
    pub(super) logged: [u64; Topic::COUNT],
    /// Processes of other programs than this one: topic and epoch.
    pub foreign: Vec<(Topic, u64)>,
    /// Settings of candidates.
    pub(super) settings: HashMap<(Topic, u64), Scenario>,
}

impl Recording {
    /// What `log` tells of a flight. `settled` are the settings in the folder of the run, which have the swaps that were ordered
    /// in flight.
    ///
    /// # Errors
    /// A process cannot be flown again: its settings are not there.
    pub fn new(log: &Log, scenario: &Scenario, settled: Option<&Scenario>) -> anyhow::Result<Self> {
        let mut scenario = scenario.clone();
        let mut injected = log.events.iter().filter(|event| event.what == What::Injected);
        if let Some(first) = injected.find_map(|event| event.fault.as_ref()) {
            scenario.fault.truncate(first.0); // where logs were joined the settings have them already
        }
        let given = log.events.iter().filter_map(|event| event.fault.as_deref().copied()).collect();
        scenario.swap = settled.map_or(scenario.swap, |settled| settled.swap.clone());
        let script = Script::of(log);
        let mut settings = HashMap::new();
        let mut foreign = vec![];
        for event in log.events.iter().filter(|event| event.what == What::Started) {
            let Event { node, epoch, origin: Some(swap), .. } = event else { continue };
            let Some(topic) = Topic::ALL.into_iter().find(|topic| topic.publisher() == node) else { continue };
            let whose = (topic, u64::from(*epoch));
            let lacks =
                || format!("the settings of {node} {epoch} are missing: scenario.toml of the run has no swap {swap}");
            let swap = scenario.swap.get(*swap).with_context(lacks)?;
            if swap.exec.is_some() {
                foreign.push(whose);
            } else {
                settings.insert(whose, candidate(&scenario, swap)?);
            }
        }
        if script.process(Topic::State, 1).is_none() {
            bail!("the log has no message of the plant");
        }
        let logged = [log.states.len(), log.references.len(), log.controls.len(), log.actuators.len()];
        let logged = logged.map(|messages| messages as u64);
        Ok(Self { scenario, script, given, logged, foreign, settings })
    }
}
