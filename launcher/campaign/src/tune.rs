//! `[tune]`: the settings of the controllers that a [search](crate::search) may scale, its draws and its budget.
//!
//! ```toml
//! [tune]
//! seed = 101                         # of the training draws; give another than the campaign's
//! samples = 60                       # draws that each try flies
//! flights = 9600                     # budget of each controller
//!
//! [tune.scale]                       # settings that are searched: each group is scaled by one factor
//! pid = [["attitude.pid.kp.1", "attitude.pid.kp.2"], ["attitude.pid.kd.0", "attitude.pid.kd.1"]]
//! ```

use std::collections::BTreeMap;

use anyhow::{Context, ensure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Given, to_toml};
use toml::{Table, Value};

/// Settings of `[tune]`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tune {
    /// Seed of the training draws; give another than the campaign's.
    pub seed: u32,
    /// Draws that each try flies, 1 or more.
    #[schemars(range(min = 1))]
    pub samples: u64,
    /// Flights that the search of each controller may fly.
    pub flights: u64,
    /// Groups of keys, by controller.
    pub scale: BTreeMap<String, Vec<Vec<String>>>,
}

impl Tune {
    /// Checks `[tune]` against the controllers of its campaign.
    pub fn check(&self, controllers: &[(String, Given)]) -> anyhow::Result<()> {
        ensure!(self.samples > 0, "`samples` = 0: give how many draws each try flies, 1 or more");
        ensure!(!self.scale.is_empty(), "`scale` is missing: say which settings of which controller are searched");
        for (name, groups) in &self.scale {
            let given = controllers.iter().find(|(controller, _)| controller == name);
            let (_, given) = given.with_context(|| format!("`scale.{name}`: there is no [controller.{name}]"))?;
            ensure!(groups.len() > 1, "`scale.{name}` has {} groups: the search needs at least 2", groups.len());
            starts(given, groups).with_context(|| format!("`scale.{name}`"))?;
            let least = self.samples * population(groups.len()) as u64;
            ensure!(
                self.flights >= least,
                "`flights` = {}: one generation of `scale.{name}` flies {least}",
                self.flights
            );
        }
        Ok(())
    }
}

/// Number of tries of a generation for this number of groups: the default of CMA-ES.
pub fn population(groups: usize) -> usize {
    4 + (3.0 * libm::log(groups as f64)) as usize
}

/// Returns the keys of each group with their values at the start of the search.
pub fn starts(given: &Given, groups: &[Vec<String>]) -> anyhow::Result<Vec<Vec<(String, f64)>>> {
    let merged = merged(given, &[])?;
    let start = |key: &String| {
        let number = at(&merged, key).and_then(|value| value.as_float().or(value.as_integer().map(|n| n as f64)));
        let number = number.with_context(|| format!("`{key}` is no number of a scenario"))?;
        ensure!(number != 0.0, "`{key}` is 0, which no factor changes: give it a value in [controller]");
        Ok((key.clone(), number))
    };
    let group = |keys: &Vec<String>| {
        ensure!(!keys.is_empty(), "a group without a setting");
        keys.iter().map(start).collect()
    };
    groups.iter().map(group).collect()
}

/// Returns the merged settings of a controller with `settings` on top.
pub fn merged(given: &Given, settings: &[(String, Value)]) -> anyhow::Result<Value> {
    Ok(Value::Table(to_toml(&given.scenario(settings)?).parse::<Table>()?))
}

/// Returns the value of a dotted key; a number in the key is the index of an array element, from 0.
pub fn at<'a>(settings: &'a Value, key: &str) -> Option<&'a Value> {
    key.split('.').try_fold(settings, |value, name| match name.parse::<usize>() {
        Ok(i) => value.get(i),
        Err(_) => value.get(name),
    })
}
