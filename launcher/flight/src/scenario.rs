//! The settings of a flight, checked as far as possible before it: `check` refuses the same settings as `fly`.
//!
//! The values in the file are checked by [`settings`]. This module checks that everything derived from them
//! exists: the controllers of the run and of its candidates, and the programs of its swaps.

use std::path::Path;

use attitude_mpc::AttitudeMpc;
use contract::topic::Topic;
use folder::shipped;
use settings::{ProgramKind, Scenario, ScenarioError, Swap, candidate};

use crate::programs;

/// Loads the scenario of `file`, a path or the name of a shipped scenario, with `overrides` on top; an error if it
/// cannot be flown.
pub fn load(file: Option<&Path>, overrides: &[String]) -> Result<Scenario, ScenarioError> {
    let scenario = load_untried(file, overrides)?;
    check(&scenario)?;
    Ok(scenario)
}

/// Loads a scenario as [`load`] does, for a program other than the launcher: tries no library, and builds no controller
/// of the run or of a candidate.
pub fn load_untried(file: Option<&Path>, overrides: &[String]) -> Result<Scenario, ScenarioError> {
    let mut scenario = settings::load_from(file.map(shipped::scenario).transpose()?, overrides)?;
    programs::pin_all(&mut scenario)?;
    let mut swaps = std::mem::take(&mut scenario.swap);
    swaps.iter_mut().try_for_each(|swap| programs::pin_swap(&scenario, swap).map_err(|error| of_swap(swap, &error)))?;
    scenario.swap = swaps;
    Ok(scenario)
}

/// Checks that everything derived from `scenario` exists.
pub fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    AttitudeMpc::try_new(scenario)?;
    programs::check(scenario)?;
    scenario.swap.iter().try_for_each(|swap| check_swap(scenario, swap))?;
    programs::check_together(scenario)
}

fn of_swap(swap: &Swap, error: &ScenarioError) -> ScenarioError {
    let why = error.to_string();
    let why = why.trim_start_matches("error: ");
    ScenarioError::of(format!("`[[swap]]` of {}: {why}", swap.node.publisher()), String::new())
}

/// Checks that everything that a swap in a flight of `scenario` needs exists, and tries the library of the swap.
///
/// # Errors
/// The program cannot be flown, or there is no controller for its settings.
pub fn check_swap(scenario: &Scenario, swap: &Swap) -> Result<(), ScenarioError> {
    let of_swap = |error| of_swap(swap, &error);
    let topic = swap.node;
    let own = candidate(scenario, swap)?;
    programs::check_one(&own, topic).map_err(of_swap)?;
    match own.node.of(topic).kind() {
        ProgramKind::Own if topic == Topic::Controls => match AttitudeMpc::try_new(&own) {
            Ok(_) => Ok(()),
            Err(error) => Err(of_swap(error)),
        },
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use std::fs::{self, Permissions};
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    fn refused(set: &[&str]) -> String {
        let set: Vec<String> = set.iter().map(ToString::to_string).collect();
        load(None, &set).expect_err("refused").to_string()
    }

    #[test]
    fn settings_without_a_controller_are_refused_with_their_keys() {
        let [q, r] = ["attitude.mpc.q=[0, 0, 0, 1e12, 0, 0, 0]", "attitude.mpc.r=[1e-12, 1e-12, 1e-12, 1e-12]"];
        for law in ["mpc", "lqr"] {
            let message = refused(&[q, r, &format!("attitude.law={law}")]);
            assert!(message.contains("`attitude.mpc.r`") && message.contains("`attitude.mpc.q`"), "{law}: {message}");
        }
        let candidate = format!("swap=[{{at_s=1, node='attitude-mpc', set=['{q}', '{r}']}}]");
        let message = refused(&[&candidate]);
        assert!(message.contains("`[[swap]]` of attitude-mpc: `attitude.mpc."), "{message}");
        load(None, &["attitude.mpc={prediction_horizon_s=2, control_horizon_s=0.5}".into()]).unwrap();
    }

    #[test]
    fn a_program_that_is_not_there_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("program");
        let swap = |exec: &str| format!("swap=[{{at_s=1, node='mixer', exec='{exec}'}}]");
        let ours = swap(path.to_str().unwrap());
        assert!(refused(&[&ours]).contains("is not there, or cannot be executed"));
        fs::write(&path, "#!/bin/sh\n").unwrap();
        assert!(refused(&[&ours]).contains("chmod +x"), "it is no program yet");
        fs::set_permissions(&path, Permissions::from_mode(0o755)).unwrap();
        load(None, &[ours]).unwrap();
        load(None, &[swap("sh")]).unwrap();
        assert!(refused(&[&swap("no-such-program-anywhere")]).contains("`no-such-program-anywhere`"));
        assert!(refused(&[&swap("/")]).contains("is not there"), "a folder is no program");
    }
}
