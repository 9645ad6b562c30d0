//! `[compare]`: by how much the controllers of a campaign differ from one of them, in metrics of the same flights.
//!
//! ```toml
//! [compare]
//! with = "pid"                            # controller that is subtracted
//! controllers = ["lqr"]                   # controllers that are compared; default: all others
//! metrics = ["rms_position_error_m"]      # columns of the table of flights
//! ```
//!
//! Only pairs of flights that both pass are compared: a lost flight has no tracking error. The number of pairs left out
//! stands beside each difference, because a controller that loses its worst flights looks better without them.

use anyhow::ensure;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::columns;

/// `[compare]` of a campaign file.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Compare {
    /// Controller that others are compared with.
    pub with: String,
    /// Controllers that are compared with `with`; absent = all others.
    #[serde(default)]
    pub controllers: Option<Vec<String>>,
    /// Columns of the table of flights.
    pub metrics: Vec<String>,
}

impl Compare {
    /// Checks the names against those of the campaign's controllers.
    ///
    /// # Errors
    /// A controller or a column that the campaign does not have, or nothing to compare.
    pub fn check(&self, controllers: &[&str]) -> anyhow::Result<()> {
        let all = controllers.join(", ");
        let others = self.controllers.iter().flatten();
        for name in [&self.with].into_iter().chain(others.clone()) {
            ensure!(
                controllers.contains(&name.as_str()),
                "[compare]: there is no controller {name:?}; there are {all}"
            );
        }
        ensure!(
            others.clone().all(|name| *name != self.with),
            "[compare]: `controllers` has {:?}, with which it compares; leave it out",
            self.with
        );
        let is_empty = self.controllers.as_ref().is_some_and(Vec::is_empty);
        ensure!(!is_empty, "[compare]: `controllers` is empty: name one, or leave it out to compare all");
        ensure!(controllers.len() > 1, "[compare]: there is one controller only; give another [controller.NAME]");
        ensure!(!self.metrics.is_empty(), "[compare]: `metrics` is empty: name a column of the table of flights");
        self.metrics.iter().try_for_each(|metric| columns::require_metric("[compare]", metric))
    }

    /// Returns whether the controller `name` is compared with `self.with`.
    pub fn compares(&self, name: &str) -> bool {
        name != self.with && self.controllers.as_ref().is_none_or(|names| names.iter().any(|own| own == name))
    }
}
