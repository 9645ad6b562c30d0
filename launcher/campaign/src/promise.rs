//! Promises: what a campaign file says must hold of its flights.
//!
//! ```toml
//! [[promise]]
//! figure = "{controller}: largest error"       # for people; {controller} and {case} become their names
//! controllers = ["lqr", "pid"]                 # one verdict for each; without it one over all controllers
//! cases = ["step"]                             # one verdict for each; without it one over all cases
//! at = { "run.command_delay_ms" = 4.0 }        # only flights with this listed value, or one of an array of values
//! metric = "max_position_error_m"              # column of the table of flights
//! of = "max"                                   # over the flights: max (default), min, median, mean or sum
//! at_most = 0.7                                # or at_least
//! over_best = true                             # as a multiple of the best controller in the same case
//! because = "the paper claims it"              # reason that the verdict shows
//!
//! [[promise]]
//! figure = "flights lost"
//! passed = "all"                               # or "none", or "share" with at_least = 0.95, judged by its interval
//!
//! [[promise]]
//! figure = "{controller}: delay up to which it flies"
//! metric = "limit"                             # of a campaign with [limit]; `of` is min, max or median
//! of = "min"
//! at_least = 40.0
//! ```
//!
//! If one of the flights failed, the gathered metric is infinite on the side that breaks the promise. Flights that are
//! missing, invalid, or not part of the campaign leave a promise undecided.

use anyhow::{bail, ensure};
use schemars::JsonSchema;
use serde::Deserialize;
use settings::{any_table, moved};
use toml::Table;

use crate::columns;
use crate::limit::{LIMIT, Limit};

/// One `[[promise]]` of a campaign file.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Promise {
    /// Figure, for people; `{controller}` and `{case}` become their names.
    pub figure: String,
    /// Controllers, with one verdict for each; absent = one verdict over all.
    #[serde(default)]
    pub controllers: Vec<String>,
    /// Cases, with one verdict for each; absent = one verdict over all.
    #[serde(default)]
    pub cases: Vec<String>,
    /// Listed values by their dotted keys: only flights with them count.
    #[serde(default)]
    #[schemars(schema_with = "any_table")]
    pub at: Table,
    /// Column of the table of flights.
    pub metric: Option<String>,
    /// Rule by which the metric of several flights becomes one number; absent = max.
    pub of: Option<Gather>,
    /// `true` to take the metric as a multiple of the best controller's.
    #[serde(default)]
    pub over_best: bool,
    /// Part of the flights that must pass.
    pub passed: Option<Passed>,
    /// Largest value that keeps the promise.
    pub at_most: Option<f64>,
    /// Least value that keeps the promise.
    pub at_least: Option<f64>,
    /// Unit of the metric, for people.
    pub unit: Option<String>,
    /// Reason that the verdict shows.
    #[serde(default)]
    pub because: String,
}

/// Rule by which the metric of several flights becomes one number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Gather {
    /// Largest value.
    #[default]
    Max,
    /// Least value.
    Min,
    /// Median; of two in the middle the lower one.
    Median,
    /// Mean.
    Mean,
    /// Sum.
    Sum,
}

/// Part of the flights that must pass.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Passed {
    /// Every flight.
    All,
    /// No flight.
    None,
    /// A share of at least `at_least`.
    Share,
}

impl Promise {
    /// Checks the promise against the names of the campaign's controllers and cases, and the keys of its lists.
    ///
    /// # Errors
    /// A name or a column that the campaign does not have, or settings of the promise that contradict each other.
    pub fn check(
        &self,
        controllers: &[&str],
        cases: &[&str],
        listed: &[&str],
        limit: Option<&Limit>,
    ) -> anyhow::Result<()> {
        let Self { figure, metric, passed, at_most, at_least, .. } = self;
        let known = |what: &str, names: &[String], all: &[&str]| match names.iter().find(|n| !all.contains(&n.as_str()))
        {
            Some(name) => bail!("[[promise]] {figure:?}: there is no {what} {name:?}; there are {}", all.join(", ")),
            None => Ok(()),
        };
        known("controller", &self.controllers, controllers)?;
        known("case", &self.cases, cases)?;
        if let Some(moved) = self.at.keys().find_map(|key| moved::find(moved::NameKind::Key, key)) {
            bail!("[[promise]] {figure:?}: {}", moved.title);
        }
        known("list of values of", &self.at.keys().cloned().collect::<Vec<_>>(), listed)?;
        match metric.as_deref() {
            Some(LIMIT) if limit.is_some() => ensure!(
                matches!(self.of, Some(Gather::Min | Gather::Max | Gather::Median)) && !self.over_best,
                "[[promise]] {figure:?}: give `of` = \"min\", \"max\" or \"median\", without `over_best`: a limit beyond the \
                 range has no value"
            ),
            Some(metric) => columns::require_metric(&format!("[[promise]] {figure:?}"), metric)?,
            None => {}
        }
        let is_limited = at_most.is_some() != at_least.is_some();
        let is_finite = [at_most, at_least].into_iter().flatten().all(|limit| limit.is_finite());
        ensure!(is_finite, "[[promise]] {figure:?}: give a finite limit");
        match (metric, passed) {
            (Some(_), None) => ensure!(is_limited, "[[promise]] {figure:?}: give `at_most` or `at_least`"),
            (None, Some(Passed::Share)) => {
                let is_share = at_least.is_some_and(|share| (0.0..=1.0).contains(&share)) && at_most.is_none();
                ensure!(is_share, "[[promise]] {figure:?}: give the share, `at_least`, from 0 to 1");
                ensure!(
                    !self.controllers.is_empty() || controllers.len() == 1,
                    "[[promise]] {figure:?}: name the `controllers`: a share over several describes none of them"
                );
            }
            (None, Some(_)) => {
                ensure!(at_most.is_none() && at_least.is_none(), "[[promise]] {figure:?}: `passed` needs no limit");
            }
            _ => bail!("[[promise]] {figure:?}: give either `metric` or `passed`"),
        }
        let of_a_metric = [("over_best", self.over_best), ("of", self.of.is_some()), ("unit", self.unit.is_some())];
        for (key, _) in of_a_metric.into_iter().filter(|(_, is_given)| *is_given) {
            ensure!(metric.is_some(), "[[promise]] {figure:?}: `{key}` applies only to a `metric`; remove it");
        }
        Ok(())
    }
}
