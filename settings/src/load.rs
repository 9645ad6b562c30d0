//! Loading: profile and presets < file < `--set key=value`. Tables are merged key by key, arrays are replaced.

use std::path::Path;

use airframe::Parameters;
use toml::{Table, Value};

use crate::check::found::{Found, Violation};
use crate::check::{self, idle};
use crate::shape;
use crate::table::control::Attitude;
use crate::table::fault::Fault;
use crate::table::profile;
use crate::table::program::{drop_replaced_programs, find_programs};
use crate::table::run::{Profile, Scenario};
use crate::table::sensors::SensorsSettings;
use crate::table::swap::Swap;
use crate::text::report::{MAX_PROBLEMS, Problem, ScenarioError, SettingsText};

/// Loads the scenario of `file` with `overrides` on top (`key=value`, the value in TOML or a bare word), on the
/// defaults of the profile that both choose. Without a file the overrides are laid on the defaults alone.
pub fn load(file: Option<&Path>, overrides: &[String]) -> Result<Scenario, ScenarioError> {
    load_from(file.map(SettingsText::read).transpose()?, overrides)
}

/// Loads like [`load`], from the text of a file that was read before.
pub fn load_from(file: Option<SettingsText>, overrides: &[String]) -> Result<Scenario, ScenarioError> {
    resolve(&sources(file, overrides))
}

/// Collects the sources to merge, lowest first: the text of `file`, then the `overrides`.
pub(super) fn sources(file: Option<SettingsText>, overrides: &[String]) -> Vec<SettingsText> {
    file.into_iter().chain(overrides.iter().map(|text| set(text))).collect()
}

/// Loads like [`load`] the scenario `text`; `origin` names the text in errors.
pub fn load_text(text: &str, origin: &str, overrides: &[String]) -> Result<Scenario, ScenarioError> {
    load_from(Some(SettingsText { path: Some(origin.into()), text: text.into() }), overrides)
}

/// Reads the scenario that [`to_toml`] wrote as `text`, and checks it again; `origin` names the text in errors.
pub fn from_merged(text: &str, origin: &str) -> Result<Scenario, ScenarioError> {
    load_text(text, origin, &[])
}

/// Prints all settings as [`to_toml`] does, but settings that still follow from the vehicle or the rate as comments: a
/// scenario made from this text keeps following vehicle and rate.
pub fn to_toml_that_follows(scenario: &Scenario) -> String {
    let flat = |attitude: &Attitude| {
        let Attitude { mpc, .. } = attitude;
        let [mut all, mpc] = [Table::try_from(attitude), Table::try_from(mpc)].map(|table| table.expect(HAS_FORM));
        all.extend(mpc);
        all
    };
    let (own, derived) = (flat(&scenario.attitude), flat(&defaults_of(scenario).attitude));
    let mut following = vec![("vehicle", "r")];
    if scenario.profile == Profile::Robust {
        let keys = ["prediction_horizon_s", "control_horizon_s", "disturbance_gain"];
        following.extend(keys.map(|key| ("rate", key)));
    }
    let follows = following.into_iter().filter(|(_, key)| own[*key] == derived[*key]);
    follows.fold(to_toml(scenario), |text, (of, key)| {
        let line = format!("{key} = {}", own[key]);
        text.replacen(&format!("\n{line}\n"), &format!("\n# of the {of}: {line}\n"), 1)
    })
}

/// Returns the default weights `attitude.mpc.r` for the vehicle of `scenario`, if the weights in use seem to be for
/// another vehicle: one weight is more than ten times larger or smaller than its default, and the vehicle is no preset.
pub fn weights_that_fit(scenario: &Scenario) -> Option<[f64; 4]> {
    let fitting = defaults_of(scenario).attitude.mpc.r;
    let is_other = |(own, fitting): (&f64, &f64)| own / fitting > OTHER_VEHICLE || fitting / own > OTHER_VEHICLE;
    let is_preset = scenario.airframe == Parameters::from(scenario.airframe.preset);
    (!is_preset && scenario.attitude.mpc.r.iter().zip(&fitting).any(is_other)).then_some(fitting)
}

/// Prints all settings as a scenario file, exact to the last bit.
pub fn to_toml(scenario: &Scenario) -> String {
    toml::to_string(scenario).expect("every setting has a form in TOML")
}

/// Merges the settings of a candidate: the settings of `run` with its own on top, its program among them. If the
/// candidate has faults of its own, they replace the run's. Otherwise it has the run's faults, which are not checked
/// against its settings.
pub fn candidate(run: &Scenario, swap: &Swap) -> Result<Scenario, ScenarioError> {
    let base = Scenario { swap: vec![], fault: vec![], ..run.clone() };
    let base = SettingsText { path: Some("the run's settings".into()), text: to_toml(&base) };
    let exec =
        swap.exec.as_ref().map(|exec| format!("node.{}.exec={}", swap.node.publisher(), Value::from(exec.as_str())));
    let own = exec.iter().chain(&swap.set).map(|text| set(text));
    let sources: Vec<SettingsText> = std::iter::once(base).chain(own).collect();
    let own = resolve(&sources)?;
    let fault = if own.fault.is_empty() { run.fault.clone() } else { own.fault };
    Ok(Scenario { fault, ..own })
}

/// Reads the settings of a [`candidate`] that [`to_toml`] wrote as `text`; `origin` names the text in errors.
pub fn candidate_from(text: &str, origin: &str) -> Result<Scenario, ScenarioError> {
    let given = given(&[SettingsText { path: Some(origin.into()), text: text.into() }])?;
    Ok(with_defaults(given).and_then(Table::try_into).expect(READ))
}

/// Checks `fault` as a fault of `scenario`, with the messages of [`load`].
pub fn check_fault(scenario: &Scenario, fault: &Fault) -> Result<(), ScenarioError> {
    checked(|found| check::faults::check(scenario, fault, found))
}

/// Checks the sizes of `fault` by the rules that hold in any scenario, with the messages of [`load`].
pub fn check_sizes(fault: &Fault) -> Result<(), ScenarioError> {
    checked(|found| check::faults::check_sizes(fault, found))
}

/// Checks the swaps of `scenario`, with the messages of [`load`].
pub fn check_swaps(scenario: &Scenario) -> Result<(), ScenarioError> {
    checked(|found| check::swaps::check(scenario, candidate, found))
}

/// Makes one error of the rules that `check` finds broken.
fn checked(check: impl FnOnce(&mut Found)) -> Result<(), ScenarioError> {
    let mut found = Found::default();
    check(&mut found);
    without_place(found.0)
}

/// Makes one error of `violations` of settings that were written in no file.
pub(super) fn without_place(violations: Vec<Violation>) -> Result<(), ScenarioError> {
    let problem = |violation: Violation| Problem { title: violation.what, place: None, help: violation.allowed };
    let problems: Vec<Problem> = violations.into_iter().map(problem).collect();
    if problems.is_empty() { Ok(()) } else { Err(ScenarioError::new(&problems)) }
}

/// Merges the sources, later sources on top, and checks the result.
fn resolve(sources: &[SettingsText]) -> Result<Scenario, ScenarioError> {
    let given = given(sources)?;
    let merged = with_defaults(given.clone()).expect(READ);
    let scenario: Scenario = merged.clone().try_into().expect(READ);
    let problems: Vec<Problem> = check::violations(&scenario, &given, merged, &defaults_of(&scenario), candidate)
        .into_iter()
        .take(MAX_PROBLEMS + 1)
        .map(|violation| Problem {
            title: violation.what,
            place: violation.keys.iter().find_map(|key| shape::find(sources, key)),
            help: violation.allowed,
        })
        .collect();
    if problems.is_empty() { Ok(scenario) } else { Err(ScenarioError::new(&problems)) }
}

/// Ratio of two weights of an input above which they count as weights for different vehicles. The bandwidth of the
/// channel goes with the fourth root of the weight, and then differs by a factor of nearly 2.
const OTHER_VEHICLE: f64 = 10.0;

/// Reason why settings can always be written.
const HAS_FORM: &str = "settings have a form in TOML";

/// Reason why merged settings always have the types of a scenario.
const READ: &str = "every source was read as a scenario by itself";

/// Merges the sources, later sources on top, without the defaults.
pub(super) fn given(sources: &[SettingsText]) -> Result<Table, ScenarioError> {
    let mut given = Table::new();
    let mut problems = vec![];
    for source in sources {
        match shape::read(source) {
            Ok(mut settings) => {
                find_programs(&mut settings, source.folder());
                lay(&mut given, settings);
            }
            Err(found) => problems.extend(found),
        }
    }
    if !problems.is_empty() {
        return Err(ScenarioError::new(&problems));
    }
    Ok(given)
}

/// Merges `given` on top of the defaults of the profile, the presets and the vehicle that it chooses.
pub(super) fn with_defaults(given: Table) -> Result<Table, toml::de::Error> {
    let mut chosen: Scenario = given.clone().try_into()?;
    if let Some(Value::Table(own)) = given.get("airframe") {
        let preset = Parameters::from(chosen.airframe.preset);
        let mut vehicle = Table::try_from(preset).expect("parameters have a form in TOML");
        overlay(&mut vehicle, own.clone());
        chosen.airframe = vehicle.try_into()?;
    }
    let mut merged = Table::try_from(defaults_of(&chosen)).expect("profiles have a form in TOML");
    overlay(&mut merged, given);
    Ok(merged)
}

/// Returns the defaults of the profile, the presets, the vehicle, the law and the rate of `chosen`.
pub(super) fn defaults_of(chosen: &Scenario) -> Scenario {
    let mut defaults = profile::for_choice(chosen);
    defaults.plant.sensors = SensorsSettings::from(chosen.plant.sensors.preset);
    defaults
}

/// Merges `above` into `below` like [`overlay`], but first drops settings of `below` that `above` switches off, and
/// settings of programs that `above` replaces.
pub(super) fn lay(below: &mut Table, above: Table) {
    let merge = |mut below, above| {
        overlay(&mut below, above);
        with_defaults(below).ok()?.try_into().ok()
    };
    idle::drop_overridden(below, &above, merge);
    drop_replaced_programs(below, &above);
    overlay(below, above);
}

/// Merges `above` into `below`: `above` wins, and tables are merged key by key.
pub(super) fn overlay(below: &mut Table, above: Table) {
    for (key, value) in above {
        match (below.get_mut(&key), value) {
            (Some(Value::Table(below)), Value::Table(above)) => overlay(below, above),
            (_, value) => {
                below.insert(key, value);
            }
        }
    }
}

/// Reads the argument of one `--set`. A value that begins as a word or a path and is no TOML is a string without
/// quotes.
fn set(argument: &str) -> SettingsText {
    let text = match argument.split_once('=') {
        Some((key, word)) if is_word(word.trim_start()) && argument.parse::<Table>().is_err() => {
            format!("{key}={}", Value::from(word.trim()))
        }
        _ => argument.into(),
    };
    SettingsText { path: None, text }
}

fn is_word(value: &str) -> bool {
    value.starts_with(char::is_alphabetic) || ["/", "./", "../"].iter().any(|path| value.starts_with(path))
}
