//! Targets: promised figures, and whether they were met.

use flight::event::name;
use serde::Serialize;

/// Verdict on a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum TargetVerdict {
    Ok,
    Short,
    /// Not decided by this run; the target's note gives the reason.
    Inconclusive,
}

/// Promised figure and its verdict.
#[derive(Debug, Clone, Serialize)]
pub struct Target {
    pub figure: String,
    /// Measured value; `None` if it could not be measured.
    pub measured: Option<f64>,
    pub unit: String,
    /// Target as text: `<= 5`.
    pub target: String,
    pub verdict: TargetVerdict,
    /// Reason for the verdict if the figures do not show it.
    pub note: String,
}

impl Target {
    /// Makes a target that is met if `measured` is at most `limit`; inconclusive if it is absent or NaN.
    pub fn at_most(figure: impl Into<String>, measured: Option<f64>, limit: f64, unit: &str) -> Self {
        let target = format!("<= {} {unit}", plain(limit)).trim_end().to_owned();
        Self { unit: unit.to_owned(), ..Self::when(figure, measured, target, |value| value <= limit) }
    }

    /// Makes a target that is met if `measured` is at least `limit`; inconclusive if it is absent or NaN.
    pub fn at_least(figure: impl Into<String>, measured: Option<f64>, limit: f64) -> Self {
        Self::when(figure, measured, format!(">= {}", plain(limit)), |value| value >= limit)
    }

    /// Makes a target that is met if `measured` passes the test in the text `target`; inconclusive if absent or NaN.
    pub fn when(
        figure: impl Into<String>,
        measured: Option<f64>,
        target: impl Into<String>,
        passes: impl Fn(f64) -> bool,
    ) -> Self {
        let measured = measured.filter(|value| !value.is_nan());
        let verdict = match measured {
            Some(value) if passes(value) => TargetVerdict::Ok,
            Some(_) => TargetVerdict::Short,
            None => TargetVerdict::Inconclusive,
        };
        Self {
            figure: figure.into(),
            measured,
            unit: String::new(),
            target: target.into(),
            verdict,
            note: String::new(),
        }
    }

    /// Makes a target for a count that must be 0.
    pub fn none(figure: impl Into<String>, count: usize) -> Self {
        Self::at_most(figure, Some(count as f64), 0.0, "")
    }

    #[must_use]
    pub fn noting(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// Turns a short target into an inconclusive one, because the machine may be the reason.
    #[must_use]
    pub fn in_doubt(mut self, why: impl Into<String>) -> Self {
        if self.verdict == TargetVerdict::Short {
            self.verdict = TargetVerdict::Inconclusive;
            self.note = why.into();
        }
        self
    }

    /// Formats the measured value with its unit, or returns `absent`.
    pub fn measured_text(&self, absent: &str) -> String {
        let text = self.measured.map_or(absent.to_owned(), |value| format!("{} {}", plain(value), self.unit));
        text.trim_end().to_owned()
    }

    /// Formats the target in one line: verdict, figure, measured value, target.
    pub fn line(&self) -> String {
        let (verdict, measured) = (name(self.verdict), self.measured_text("-"));
        let note = if self.note.is_empty() { String::new() } else { format!("  ({})", self.note) };
        format!("{verdict:<12}  {:<58} {measured:>14}   {}{note}", self.figure, self.target)
    }
}

/// Formats a number with four significant digits; with an exponent only below 1e-3 and from 1e7 on.
pub fn plain(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e7).contains(&size) => format!("{value:.2e}"),
        size if size >= 1e3 || value.fract() == 0.0 => format!("{value:.0}"),
        size => format!("{value:.*}", (3 - libm::log10(size).floor() as i32).max(0) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_measured_value_makes_a_target_short() {
        let verdict = |measured| Target::at_most("time", measured, 5.0, "us").verdict;
        assert_eq!(verdict(Some(5.0)), TargetVerdict::Ok);
        assert_eq!(verdict(Some(5.1)), TargetVerdict::Short);
        assert_eq!(verdict(Some(f64::INFINITY)), TargetVerdict::Short);
        assert_eq!(verdict(Some(f64::NAN)), TargetVerdict::Inconclusive);
        assert_eq!(verdict(None), TargetVerdict::Inconclusive);
    }

    #[test]
    fn doubt_makes_a_short_target_inconclusive_and_leaves_a_met_one() {
        let doubted = |measured| Target::at_most("time", Some(measured), 5.0, "us").in_doubt("noise").verdict;
        assert_eq!(doubted(6.0), TargetVerdict::Inconclusive);
        assert_eq!(doubted(4.0), TargetVerdict::Ok);
    }
}
