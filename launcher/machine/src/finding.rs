//! Result of one check.

use serde::Serialize;

/// Weight of a finding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// A flight has what it needs.
    Ok,
    /// A flight gets what it asks for, but its timing may be worse.
    Warn,
    /// A flight does not get what its scenario asks for.
    Bad,
    /// The file that has the answer cannot be read, or does not exist.
    Unknown,
}

/// Result of one check.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// Name of the check; empty until [`Self::of`] sets it.
    pub check: &'static str,
    /// Weight of this finding.
    pub level: Severity,
    /// State of the machine that the check found.
    pub found: String,
    /// Consequence for a flight; empty if there is none.
    pub means: String,
    /// Command or setting that improves the state; `None` if none is needed, or none on this machine helps.
    pub remedy: Option<String>,
}

impl Finding {
    /// Returns a finding without a name and a remedy.
    pub fn new(level: Severity, found: impl Into<String>, means: impl Into<String>) -> Self {
        Self { check: "", level, found: found.into(), means: means.into(), remedy: None }
    }

    /// Returns the finding with the name of its check.
    #[must_use]
    pub fn of(self, check: &'static str) -> Self {
        Self { check, ..self }
    }

    /// Returns the finding with a `remedy`: the command or setting that improves the state.
    #[must_use]
    pub fn remedy(self, remedy: impl Into<String>) -> Self {
        Self { remedy: Some(remedy.into()), ..self }
    }

    /// Returns the finding in lines for a terminal: what was found, what it means, and what to do.
    pub fn lines(&self) -> Vec<String> {
        let remedy = self.remedy.as_ref().map(|remedy| format!("do: {remedy}"));
        let rest = [Some(self.means.clone()), remedy].into_iter().flatten().filter(|line| !line.is_empty());
        [self.found.clone()].into_iter().chain(rest).collect()
    }

    /// Returns the finding in one line, as the text of an error.
    pub fn line(&self) -> String {
        let parts = [Some(&self.found), Some(&self.means), self.remedy.as_ref()];
        let parts = parts.into_iter().flatten().filter(|part| !part.is_empty()).cloned();
        parts.collect::<Vec<_>>().join("; ")
    }
}
