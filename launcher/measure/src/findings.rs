//! Targets, their verdicts, and the results of a measurement as a file and as text.
//!
//! Every measurement ends with one line per target: verdict, figure, measured value, target. The exit code is 0 only if
//! no target is short. `--json` and the file of the results are one object `{provenance, quick, results, targets}`.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use contract::exit;
use flight::event::name;
use flight::files::write_whole;
use flight::provenance::host;
use runtime::console::print;
use serde::Serialize;
use serde_json::{Value, json};

/// Verdict on a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
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
    pub unit: &'static str,
    /// Target as text: `<= 5`.
    pub target: String,
    pub verdict: Verdict,
    /// Reason for the verdict if the figures do not show it.
    pub note: String,
}

impl Target {
    /// Makes a target that is met if `measured` is at most `limit`; inconclusive if it is absent or NaN.
    pub fn at_most(figure: impl Into<String>, measured: Option<f64>, limit: f64, unit: &'static str) -> Self {
        let target = format!("<= {} {unit}", plain(limit)).trim_end().to_owned();
        Self { unit, ..Self::when(figure, measured, target, |value| value <= limit) }
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
            Some(value) if passes(value) => Verdict::Ok,
            Some(_) => Verdict::Short,
            None => Verdict::Inconclusive,
        };
        Self { figure: figure.into(), measured, unit: "", target: target.into(), verdict, note: String::new() }
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
        if self.verdict == Verdict::Short {
            self.verdict = Verdict::Inconclusive;
            self.note = why.into();
        }
        self
    }

    /// Formats the measured value with its unit, or returns `absent`.
    pub fn measured_text(&self, absent: &str) -> String {
        let text = self.measured.map_or(absent.to_owned(), |value| format!("{} {}", plain(value), self.unit));
        text.trim_end().to_owned()
    }

    fn line(&self) -> String {
        let (verdict, measured) = (name(self.verdict), self.measured_text("-"));
        let note = if self.note.is_empty() { String::new() } else { format!("  ({})", self.note) };
        format!("{verdict:<12}  {:<58} {measured:>14}   {}{note}", self.figure, self.target)
    }
}

/// Results and targets of one measurement.
pub struct Findings {
    targets: Vec<Target>,
    /// Object `{provenance, quick, results, targets}`.
    json: Value,
    quick: bool,
}

impl Findings {
    /// Combines results and targets. Targets of a `quick` run become inconclusive, because it has too few samples.
    pub fn new(results: impl Serialize, mut targets: Vec<Target>, quick: bool) -> anyhow::Result<Self> {
        for target in targets.iter_mut().filter(|_| quick) {
            target.verdict = Verdict::Inconclusive;
            target.note = "not judged: a quick run".into();
        }
        let results = serde_json::to_value(results)?;
        let json = json!({ "provenance": host(), "quick": quick, "results": results, "targets": targets });
        Ok(Self { targets, json, quick })
    }

    /// Writes the object to `file` in the folder `out`, if given; creates the folder if needed. Then prints `table` and
    /// one line per target, or with `json` the object. Returns the exit code.
    pub fn conclude(&self, out: Option<&Path>, file: &str, json: bool, table: &str) -> anyhow::Result<u8> {
        let text = serde_json::to_string_pretty(&self.json)? + "\n";
        if let Some(out) = out {
            make_folder(out, "--out")?;
            let cannot = || format!("cannot write to the folder {}; choose another with --out", out.display());
            write_whole(&out.join(file), text.as_bytes()).with_context(cannot)?;
        }
        if json {
            print(&text);
        } else {
            let mut text = format!("{table}\n");
            for target in &self.targets {
                writeln!(text, "{}", target.line().trim_end())?;
            }
            if self.quick {
                text += "a quick run shows that everything works; only a full one is judged by the targets\n";
            }
            print(&text);
        }
        let short = self.targets.iter().any(|target| target.verdict == Verdict::Short);
        Ok(if short { exit::OUT_OF_BOUNDS } else { exit::FLOWN })
    }
}

/// Creates a folder and checks that files can be written to it; `option` is the argument that names it.
pub fn make_folder(folder: &Path, option: &str) -> anyhow::Result<()> {
    let probe = folder.join("measure.part");
    let made = fs::create_dir_all(folder).and_then(|()| fs::write(&probe, "")).and_then(|()| fs::remove_file(&probe));
    made.with_context(|| format!("cannot write to the folder {}; choose another with {option}", folder.display()))
}

/// Returns `runs/measure-NAME-TIME`.
pub fn default_folder(name: &str) -> PathBuf {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Path::new("runs").join(format!("measure-{name}-{}", since_epoch.as_millis()))
}

/// Formats a number with four figures; with an exponent only below 1e-3 and from 1e7 on.
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
        assert_eq!(verdict(Some(5.0)), Verdict::Ok);
        assert_eq!(verdict(Some(5.1)), Verdict::Short);
        assert_eq!(verdict(Some(f64::INFINITY)), Verdict::Short);
        assert_eq!(verdict(Some(f64::NAN)), Verdict::Inconclusive);
        assert_eq!(verdict(None), Verdict::Inconclusive);
    }

    #[test]
    fn doubt_makes_a_short_target_inconclusive_and_leaves_a_met_one() {
        let doubted = |measured| Target::at_most("time", Some(measured), 5.0, "us").in_doubt("noise").verdict;
        assert_eq!(doubted(6.0), Verdict::Inconclusive);
        assert_eq!(doubted(4.0), Verdict::Ok);
    }

    #[test]
    fn only_a_short_target_changes_the_exit_code() {
        let code = |measured, quick| {
            let targets = [Target::at_most("time", measured, 5.0, "us"), Target::at_most("blocks", Some(0.0), 0.0, "")];
            Findings::new(json!({}), targets.into(), quick)
                .and_then(|found| found.conclude(None, "", true, ""))
                .expect("prints")
        };
        assert_eq!([code(Some(4.0), false), code(None, false)], [0; 2]);
        assert_eq!(code(Some(6.0), false), 1);
        assert_eq!(code(Some(6.0), true), 0, "a quick run judges nothing");
    }
}
