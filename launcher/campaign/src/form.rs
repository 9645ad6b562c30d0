//! `campaign.toml`: the scenario, the values that vary, the number of draws, and the controllers to compare.
//!
//! ```toml
//! name = "mass-and-wind"             # default: the name of the file
//! scenario = "survey.toml"           # path relative to this file; default: the launcher's scenario
//! seed = 1                           # seed of all draws
//! seeds = 50                         # each flight is flown with the seeds 1 to 50; or a list of seeds
//! samples = 200                      # number of draws of the distributions
//! sampling = "latin-hypercube"       # or "random", "sobol"
//!
//! [settings]                         # of all flights, on top of the scenario
//! run.duration_s = 20.0
//! bounds.max_position_error_m = 0.5  # limit for a passed flight
//!
//! [vary]
//! run.command_delay_ms = [0.0, 10.0, 20.0]                     # each value, with each value of the other lists
//! plant.airframe.mass_kg = { uniform = [1.0, 1.3] }            # drawn
//! initial.attitude_deg.0 = { normal = { mean = 0.0, deviation = 10.0 } }   # one element of an array
//!
//! [case.step]                        # each flight is flown in each case: a scenario of its own, and settings
//! scenario = "step.toml"
//!
//! [controller.lqr]                   # each flight is flown under each controller
//! attitude.law = "lqr"
//!
//! [compare]                          # metrics in which the controllers are compared: see `compare`
//! [[promise]]                        # what must hold of the results: see `promise`
//! figure = "flights of lqr lost"
//! controllers = ["lqr"]
//! passed = "all"
//!
//! [limit]                            # search of the value up to which a flight passes: see `limit`
//! [random_faults]
//! count = [0, 2]
//! at_s = [2.0, 15.0]
//! for_s = [0.1, 2.0]
//! ```

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use folder::shipped::{Shipped, ShippedKind, advice, kind_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::file::{MAX_TEXT_BYTES, read_text};
use settings::{any_table, suggest};
use toml::Table;

use crate::compare::Compare;
use crate::limit::Limit;
use crate::named::Named;
use crate::own_controller::OwnController;
use crate::promise::Promise;
use crate::random_faults::RandomFaults;
use crate::sampling::Sampling;
use crate::tune::Tune;
use crate::variation::Vary;

/// Largest value of `samples`.
pub const MAX_SAMPLES: u64 = 1_000_000;
/// Name of the only controller if the file names none.
pub const ONLY: &str = "scenario";

/// Contents of `campaign.toml`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct File {
    /// Name of the campaign, and of the folder of its results; absent = the name of the file.
    pub name: Option<String>,
    /// Path of the scenario, relative to this file; absent = the defaults.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scenario: Option<PathBuf>,
    /// Seed of all draws.
    #[serde(default = "one")]
    pub seed: u32,
    /// Seeds of each flight, `run.seed`: a number for 1 to that number, or a list.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seeds: Option<Seeds>,
    /// Number of draws of the distributions, 1 to 1000000.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1, max = MAX_SAMPLES))]
    pub samples: Option<u64>,
    /// Placement of the draws; absent = random.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sampling: Option<Sampling>,
    /// Settings of all flights, on top of the scenario.
    #[serde(default, skip_serializing_if = "Table::is_empty")]
    #[schemars(schema_with = "any_table")]
    pub settings: Table,
    /// Settings that vary, by their keys: a list of values, each of which is flown, or a distribution that is drawn.
    #[serde(default, skip_serializing_if = "Vary::is_empty")]
    #[schemars(schema_with = "any_table")]
    pub vary: Vary,
    /// Campaign file whose controllers are flown too.
    #[serde(skip_serializing)]
    pub controllers: Option<PathBuf>,
    /// Settings of each controller, by its name; each flight is flown under each controller.
    #[serde(default, skip_serializing_if = "Named::is_empty")]
    #[schemars(schema_with = "any_table")]
    pub controller: Named,
    /// Scenario and settings of each case, by its name; each flight is flown in each case.
    #[serde(default, skip_serializing_if = "Named::is_empty")]
    #[schemars(schema_with = "any_table")]
    pub case: Named,
    /// Search of the value of a setting up to which each flight of the plan passes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limit: Option<Limit>,
    /// Faults drawn from the catalogue for each draw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub random_faults: Option<RandomFaults>,
    /// Search of gains by `trefoil tune`. It is left out of the campaign's hash, because it changes no flight.
    #[serde(skip_serializing)]
    pub tune: Option<Tune>,
    /// Metrics in which the controllers are compared. They are left out of the campaign's hash, because they change no
    /// flight.
    #[serde(skip_serializing)]
    pub compare: Option<Compare>,
    /// Statements that must hold of the flights. They are left out of the campaign's hash, because they change no
    /// flight.
    #[serde(default, skip_serializing)]
    pub promise: Vec<Promise>,
}

/// Seeds of each flight: 1 to a count, or a list.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected how many seeds, or a list of them")]
pub enum Seeds {
    Count(u32),
    List(Vec<u32>),
}

fn one() -> u32 {
    1
}

impl File {
    /// Adds controllers of the command line. A promise on all controllers then covers only those of the file.
    pub fn add_own(&mut self, own: &[OwnController]) -> anyhow::Result<()> {
        let count = self.controller.0.len().max(1);
        OwnController::add_all(own, &mut self.controller, ONLY)?;
        let of_the_file: Vec<String> = self.controller.0.iter().take(count).map(|(name, _)| name.clone()).collect();
        for promise in self.promise.iter_mut().filter(|promise| promise.controllers.is_empty() && !own.is_empty()) {
            promise.controllers.clone_from(&of_the_file);
        }
        Ok(())
    }

    /// Adds the controllers of the campaign file at `path` before those of this file.
    pub fn add_controllers_of(&mut self, path: &Path) -> anyhow::Result<()> {
        let (path, text) = text_of(path)?;
        let origin = path.display().to_string();
        let mut other: Self = toml::from_str(&text).map_err(|error| not_a_campaign(&origin, &text, &error))?;
        ensure!(!other.controller.is_empty(), "{origin} has no [controller.NAME]");
        other.controller.put_in_order(&text, "controller");
        for (name, _) in &self.controller.0 {
            let is_twice = other.controller.0.iter().any(|(theirs, _)| theirs == name);
            ensure!(!is_twice, "[controller.{name}] stands in {origin} too: give one of them another name");
        }
        self.controller.0.splice(0..0, other.controller.0);
        Ok(())
    }
}

/// Returns path and text of the campaign at `path`, or of the shipped one of that name.
pub fn text_of(path: &Path) -> anyhow::Result<(PathBuf, String)> {
    if let Some(shipped) = Shipped::find(ShippedKind::Campaign, path) {
        return Ok((shipped.origin().into(), shipped.text().into()));
    }
    let text = read_text(path, MAX_TEXT_BYTES).with_context(|| {
        let meant = advice(ShippedKind::Campaign, path).map_or(String::new(), |advice| format!("{advice}? Or "));
        let path = path.display();
        format!(
            "cannot read the campaign {path}; {meant}give the path of a campaign file, or the name of a shipped one: \
                 `trefoil scenarios` lists them"
        )
    })?;
    Ok((path.to_owned(), text))
}

/// Returns the error for a text that is no campaign, with the place.
pub fn not_a_campaign(origin: &str, text: &str, error: &toml::de::Error) -> anyhow::Error {
    if kind_of(text) == Some(ShippedKind::Scenario) {
        return anyhow::anyhow!(
            "{origin} is a scenario, which `trefoil fly {origin}` flies once. A campaign is a file of its own that names the \
             scenario, `scenario = \"PATH\"`, and says what varies: campaigns/ has some, docs/campaigns.md has the form"
        );
    }
    anyhow::anyhow!("{origin}: {}", suggest(error.to_string().trim_end()))
}
