//! Libraries of a flight: their nodes, files and environment variables.

use std::collections::{BTreeMap, BTreeSet};

use contract::Topic;
use settings::{ProgramKind, Scenario, candidate};

/// Returns the nodes that are libraries in a flight of `scenario`, at its beginning or after one of its swaps, each
/// with its settings.
pub fn all(scenario: &Scenario) -> Vec<(Topic, Scenario)> {
    let swapped = scenario.swap.iter().filter_map(|swap| Some((swap.node, candidate(scenario, swap).ok()?)));
    let own = scenario.node.libraries().map(|topic| (topic, scenario.clone()));
    own.chain(swapped.filter(|(topic, own)| own.node.of(*topic).kind() == ProgramKind::Library)).collect()
}

/// Returns the files of the libraries in a flight of `scenario`, each with its hash.
pub fn files(scenario: &Scenario) -> BTreeSet<(String, String)> {
    let all = all(scenario).into_iter();
    all.map(|(topic, own)| own.node.of(topic).clone())
        .map(|program| (program.exec.clone(), program.sha256().into()))
        .collect()
}

/// Merges the environment variables that the scenario gives to its libraries, which share one process in a flight in
/// process.
pub fn env_of(scenario: &Scenario) -> BTreeMap<String, String> {
    let of_library = |topic| scenario.node.of(topic).env.clone();
    scenario.node.libraries().flat_map(of_library).collect()
}
