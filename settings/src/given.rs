//! Settings without the defaults: the common base of the flights of a campaign, each with settings of its own on top.

use std::path::Path;

use toml::{Table, Value};

use crate::load::{candidate, defaults_of, given, lay, sources, with_defaults, without_place};
use crate::shape;
use crate::table::program::NodeSettings;
use crate::table::run::Scenario;
use crate::text::report::{Problem, ScenarioError, SettingsText};
use crate::{check, moved};

/// Given settings of a scenario. [`scenario`](Self::scenario) adds the defaults of profile and presets below them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given(Table);

impl Given {
    /// Loads the settings of `file`, with `overrides` (`key=value`) on top.
    pub fn load(file: Option<&Path>, overrides: &[String]) -> Result<Self, ScenarioError> {
        Self::load_from(file.map(SettingsText::read).transpose()?, overrides)
    }

    /// Loads like [`load`](Self::load), from the text of a file that was read before.
    pub fn load_from(file: Option<SettingsText>, overrides: &[String]) -> Result<Self, ScenarioError> {
        given(&sources(file, overrides)).map(Self)
    }

    /// Adds the settings of a table on top.
    ///
    /// # Errors
    /// Fails for a key that no scenario has, or a value that its key cannot have; `origin` names the table.
    pub fn with(&self, settings: &Table, origin: &str) -> Result<Self, ScenarioError> {
        check_shape(&settings.to_string(), origin)?;
        let mut given = self.0.clone();
        lay(&mut given, settings.clone());
        Ok(Self(given))
    }

    /// Calls `change` with the settings and the name of each node that has a table in these settings.
    ///
    /// # Errors
    /// Returns the first error of `change`.
    pub fn with_programs(
        mut self,
        change: impl Fn(&mut NodeSettings, &str) -> Result<(), ScenarioError>,
    ) -> Result<Self, ScenarioError> {
        let nodes = self.0.get_mut("node").and_then(Value::as_table_mut);
        for (name, table) in nodes.into_iter().flatten() {
            let mut program: NodeSettings = table.clone().try_into().expect("it was read as settings");
            change(&mut program, name)?;
            *table = Value::try_from(program).expect("it came from TOML");
        }
        Ok(self)
    }

    /// Returns the settings as a table, without the defaults.
    pub fn table(&self) -> &Table {
        &self.0
    }

    /// Makes the scenario with `settings` on top, and checks it. Keys are dotted; a number in a key is the index of an
    /// array element, from 0 (`initial.attitude_deg.0`, `fault.1.value`).
    ///
    /// # Errors
    /// Fails for a key that no scenario has, a value that its key cannot have, or settings that contradict each
    /// other.
    pub fn scenario(&self, settings: &[(String, Value)]) -> Result<Scenario, ScenarioError> {
        let (elements, whole): (Vec<_>, Vec<_>) = settings.iter().partition(|(key, _)| is_element(key));
        let mut given = self.0.clone();
        lay(&mut given, put_all(Table::new(), &whole)?);
        let wrong_type = |error: toml::de::Error| {
            let is_old = |key: &str| moved::find(moved::NameKind::Key, key).is_some();
            let shapes = settings.iter().filter(|(key, _)| !is_element(key) || is_old(key));
            let shape = shapes.map(|(key, value)| check_shape(&format!("{key} = {value}"), "")).find_map(Result::err);
            shape.unwrap_or_else(|| ScenarioError::of(error.message().to_owned(), String::new()))
        };
        let merged = put_all(with_defaults(given.clone()).map_err(wrong_type)?, &elements)?;
        let scenario: Scenario = merged.clone().try_into().map_err(wrong_type)?;
        without_place(check::violations(&scenario, &given, merged, &defaults_of(&scenario), candidate))?;
        Ok(scenario)
    }
}

/// Returns whether a key contains the index of an array element.
fn is_element(key: &str) -> bool {
    key.split('.').any(|name| name.parse::<usize>().is_ok())
}

/// Sets each dotted key of `settings` in `table` to its value.
fn put_all(table: Table, settings: &[&(String, Value)]) -> Result<Table, ScenarioError> {
    let mut all = Value::Table(table);
    for (key, value) in settings {
        put(&mut all, key, value).map_err(|why| {
            let help =
                "count the elements of an array from 0 on; give the whole array first where the settings have none";
            ScenarioError::of(format!("`{key}`: {why}"), help.into())
        })?;
    }
    Ok(all.try_into().expect("it was made of a table"))
}

/// Sets the dotted `key` in `place` to `value`, or returns the reason for a failure. Missing tables on the way are
/// made; arrays and their elements must exist.
fn put(place: &mut Value, key: &str, value: &Value) -> Result<(), String> {
    let (first, rest) = key.split_once('.').map_or((key, None), |(first, rest)| (first, Some(rest)));
    let has = place.as_array().map_or(String::new(), |all| format!(" in an array of {} elements", all.len()));
    let inner = match place {
        Value::Table(table) => Some(table.entry(first).or_insert_with(|| Value::Table(Table::new()))),
        Value::Array(all) => first.parse().ok().and_then(|i: usize| all.get_mut(i)),
        _ => None,
    };
    let inner = inner.ok_or_else(|| format!("there is no `{first}`{has}"))?;
    if let Some(rest) = rest {
        return put(inner, rest, value);
    }
    *inner = value.clone();
    Ok(())
}

/// Checks that `text` has the shape of settings; `origin` names their place in errors.
fn check_shape(text: &str, origin: &str) -> Result<(), ScenarioError> {
    let source = SettingsText { path: Some(origin.into()), text: text.into() };
    let Err(problems) = shape::read(&source) else { return Ok(()) };
    let place = if origin.is_empty() { String::new() } else { format!("{origin}: ") };
    let without_place = |problem: &Problem| Problem {
        title: format!("{place}{}", problem.title),
        place: None,
        help: problem.help.clone(),
    };
    Err(ScenarioError::new(&problems.iter().map(without_place).collect::<Vec<_>>()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::load::load;

    fn settings(pairs: &[(&str, &str)]) -> Vec<(String, Value)> {
        let value = |text: &str| format!("x = {text}").parse::<Table>().unwrap().remove("x").unwrap();
        pairs.iter().map(|(key, text)| ((*key).to_owned(), value(text))).collect()
    }

    #[test]
    fn settings_on_top_are_those_of_the_command_line() {
        let base = Given::load(None, &["mission.trajectory=hover".into()]).unwrap();
        let laid = base.scenario(&settings(&[("profile", "\"paper\""), ("plant.airframe.mass_kg", "1.2")])).unwrap();
        let set = ["mission.trajectory=hover", "profile=paper", "plant.airframe.mass_kg=1.2"].map(str::to_owned);
        assert_eq!(laid, load(None, &set).unwrap(), "the defaults are those of the profile");
    }

    #[test]
    fn a_number_in_a_key_counts_the_elements_of_an_array() {
        let fault = "fault=[{ at_s = 1.0, target = \"payload\", kind = \"mass\", value = 0.1 }]";
        let base = Given::load(None, &[fault.into()]).unwrap();
        let laid = base.scenario(&settings(&[("initial.attitude_deg.1", "20.0"), ("fault.0.value", "0.3")])).unwrap();
        assert_eq!(laid.initial.attitude_deg, [0.0, 20.0, 0.0]);
        assert_eq!(laid.fault[0].value, Some(0.3));
        for key in ["initial.attitude_deg.3", "plant.wind_ned_mps.0", "fault.1.value"] {
            let refused = base.scenario(&settings(&[(key, "1.0")])).unwrap_err().to_string();
            assert!(refused.contains("there is no"), "{key}: {refused}");
        }
    }

    #[test]
    fn errors_name_the_key() {
        let base = Given::default();
        for (key, value, expected) in [
            ("attitude.mpc.npp", "3", "unknown key `attitude.mpc.npp`"),
            ("attitude.mpc.max_iterations", "\"many\"", "`attitude.mpc.max_iterations`"),
            ("attitude.mpc.max_iterations", "2.5", "`attitude.mpc.max_iterations`"),
            ("mpc.nu", "2", "`mpc.nu` is `attitude.mpc.control_horizon_s` now"),
            ("plant.airframe.mass_kg", "-1.0", "plant.airframe.mass_kg"),
        ] {
            let refused = base.scenario(&settings(&[(key, value)])).unwrap_err().to_string();
            assert!(refused.contains(expected), "{refused}");
        }
        let wrong: Table = "attitude.mpc.qq = 3".parse().unwrap();
        let refused = base.with(&wrong, "[settings] of x.toml").unwrap_err().to_string();
        assert!(
            refused.contains("[settings] of x.toml: unknown key `attitude.mpc.qq`")
                && refused.contains("`attitude.mpc.q`"),
            "{refused}"
        );
    }
}
