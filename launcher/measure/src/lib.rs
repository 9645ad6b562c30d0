//! Figures with targets: what the stack promises of itself, measured here and now.
//!
//! | module | holds |
//! |---|---|
//! | [`mpc`] | `measure mpc`: how long a step of the controller takes, by path and solver |
//! | [`faults`] | `measure faults`: every fault of the catalogue, and what the flight bears |
//! | [`kills`] | `measure kills`: any process killed at any moment, a thousand times |
//! | [`laws`] | `measure laws`: the aggressive scenarios under every inner loop |
//! | [`processes`] | the processes of a stack, seen from outside |
//! | [`sensitivity`] | `measure sensitivity`: tracking error over delay, jitter and misses |
//! | [`timing`] | `measure timing`: how late the stack is, beside the kernel's own wake-up |
//!
//! Every measurement ends with one line per target: figure, measured value, target, and the verdict `ok`, `short` or
//! `inconclusive`, the last where this machine could not tell. The exit code is 0 only when none is short; a quick run judges nothing. `--json` and the file of the results are one
//! object `{provenance, quick, results, targets}`.

pub mod faults;
pub mod kills;
pub mod laws;
pub mod mpc;
pub mod processes;
pub mod sensitivity;
pub mod timing;

use std::fmt::Write;
use std::path::Path;

use anyhow::Context;
use clap::Subcommand;
use runtime::session::exit;
use serde::Serialize;
use serde_json::{Value, json};

use flight::files::write_whole;
use flight::provenance::host;
use runtime::console::print;
use view::summary::Summary;

/// What can be measured.
#[derive(Subcommand)]
pub enum Measure {
    /// Time a step of the controller on recorded problems, by path and solver
    Mpc(mpc::MpcArgs),
    /// Fly through every fault of the catalogue, and strike processes in real time
    Faults(faults::FaultsArgs),
    /// Kill any process of short flights at any moment, again and again
    Kills(kills::KillsArgs),
    /// Fly the aggressive scenarios under every inner loop and compare
    Laws(laws::LawsArgs),
    /// Map the tracking error over delay, jitter and misses, for both profiles
    Sensitivity(sensitivity::SensitivityArgs),
    /// Time the stack against cyclictest, raw rings, load and rates
    Timing(timing::TimingArgs),
    /// One process of a ring that `timing` compares with (it starts these itself)
    #[command(hide = true)]
    Station(timing::station::StationArgs),
}

impl Measure {
    /// Measures; the exit code.
    pub fn run(&self) -> anyhow::Result<u8> {
        match self {
            Self::Mpc(args) => mpc::measure(args),
            Self::Faults(args) => faults::measure(args),
            Self::Kills(args) => kills::measure(args),
            Self::Laws(args) => laws::measure(args),
            Self::Sensitivity(args) => sensitivity::measure(args),
            Self::Timing(args) => timing::measure(args),
            Self::Station(args) => timing::station::run(args),
        }
    }
}

/// Whether a target is met.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// Measured, and within.
    Ok,
    /// Measured, and not within.
    Short,
    /// This run cannot tell; the target's note says why.
    Inconclusive,
}

/// One promise, and what became of it.
#[derive(Debug, Clone, Serialize)]
pub struct Target {
    /// What is measured.
    pub figure: String,
    /// What came out, in `unit`; nothing where it could not be measured.
    pub measured: Option<f64>,
    /// Unit of the measured value, may be empty.
    pub unit: &'static str,
    /// What was promised, as text: `<= 5`.
    pub target: String,
    /// Whether it is kept.
    pub verdict: Verdict,
    /// Why the verdict is what it is, where that is not plain.
    pub note: String,
}

impl Target {
    /// The promise that `measured` is no more than `limit`. No value, or none that is a number, is inconclusive.
    pub fn at_most(figure: impl Into<String>, measured: Option<f64>, limit: f64, unit: &'static str) -> Self {
        let measured = measured.filter(|value| !value.is_nan());
        let verdict = match measured {
            Some(value) if value <= limit => Verdict::Ok,
            Some(_) => Verdict::Short,
            None => Verdict::Inconclusive,
        };
        let target = format!("<= {} {unit}", plain(limit)).trim_end().to_owned();
        Self { figure: figure.into(), measured, unit, target, verdict, note: String::new() }
    }

    /// The same with a remark.
    #[must_use]
    pub fn noting(mut self, note: impl Into<String>) -> Self {
        self.note = note.into();
        self
    }

    /// The same, but what speaks against it may be the machine's doing: short becomes inconclusive.
    #[must_use]
    pub fn in_doubt(mut self, why: impl Into<String>) -> Self {
        if self.verdict == Verdict::Short {
            self.verdict = Verdict::Inconclusive;
            self.note = why.into();
        }
        self
    }

    /// One line: verdict, figure, measured, target, note.
    fn line(&self) -> String {
        let verdict = match self.verdict {
            Verdict::Ok => "ok",
            Verdict::Short => "short",
            Verdict::Inconclusive => "inconclusive",
        };
        let measured = self.measured.map_or("-".to_owned(), |value| format!("{} {}", plain(value), self.unit));
        let note = if self.note.is_empty() { String::new() } else { format!("  ({})", self.note) };
        format!("{verdict:<12}  {:<58} {:>14}   {}{note}", self.figure, measured.trim_end(), self.target)
    }
}

/// What a measurement has found.
pub struct Findings {
    targets: Vec<Target>,
    /// `{provenance, quick, results, targets}`.
    json: Value,
    quick: bool,
}

impl Findings {
    /// The `results`, judged by the `targets`; a `quick` run has too little to judge by.
    pub fn new(results: impl Serialize, mut targets: Vec<Target>, quick: bool) -> anyhow::Result<Self> {
        for target in targets.iter_mut().filter(|_| quick) {
            target.verdict = Verdict::Inconclusive;
            target.note = "not judged: a quick run".into();
        }
        let results = serde_json::to_value(results)?;
        let json = json!({ "provenance": host(), "quick": quick, "results": results, "targets": targets });
        Ok(Self { targets, json, quick })
    }

    /// Writes all of it to the file `name` in the folder `out`, which is made if need be.
    pub fn save(&self, out: &Path, name: &str) -> anyhow::Result<()> {
        let cannot = || format!("cannot write to the folder {}; choose another with --out", out.display());
        std::fs::create_dir_all(out).with_context(cannot)?;
        let file = serde_json::to_string_pretty(&self.json)? + "\n";
        write_whole(&out.join(name), file.as_bytes()).with_context(cannot)
    }

    /// Prints `table` and one line per target, or all of it as one JSON object; the exit code.
    pub fn conclude(&self, json: bool, table: &str) -> anyhow::Result<u8> {
        if json {
            print(&(serde_json::to_string_pretty(&self.json)? + "\n"));
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

/// Farther off than this in the end, a vehicle is lost, whatever its plant says \[m\].
pub const SURVIVED_M: f64 = 1.0;

/// When the vehicle of a flight that is over was lost \[s\]: when it diverged, or in the end, when it is not back then.
pub fn lost_at_s(summary: &Summary) -> Option<f64> {
    let is_back = summary.metrics().final_position_error_m <= SURVIVED_M; // false for NaN
    (summary.status().diverged() || !is_back).then(|| summary.time_s())
}

/// A number with four figures, without an exponent where it can be read without.
pub(crate) fn plain(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if !(1e-3..1e7).contains(&size) => format!("{value:.2e}"),
        size if size >= 1e3 || value.fract() == 0.0 => format!("{value:.0}"),
        size => format!("{value:.*}", (3 - size.log10().floor() as i32).max(0) as usize),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_is_short_only_when_measured_so() {
        let verdict = |measured| Target::at_most("time", measured, 5.0, "us").verdict;
        assert_eq!(verdict(Some(5.0)), Verdict::Ok);
        assert_eq!(verdict(Some(5.1)), Verdict::Short);
        assert_eq!(verdict(Some(f64::INFINITY)), Verdict::Short);
        assert_eq!(verdict(Some(f64::NAN)), Verdict::Inconclusive);
        assert_eq!(verdict(None), Verdict::Inconclusive);
    }

    #[test]
    fn doubt_excuses_a_short_target_and_leaves_a_met_one() {
        let doubted = |measured| Target::at_most("time", Some(measured), 5.0, "us").in_doubt("noise").verdict;
        assert_eq!(doubted(6.0), Verdict::Inconclusive);
        assert_eq!(doubted(4.0), Verdict::Ok);
    }

    #[test]
    fn only_a_short_target_spoils_the_exit_code() {
        let code = |measured, quick| {
            let targets = [Target::at_most("time", measured, 5.0, "us"), Target::at_most("blocks", Some(0.0), 0.0, "")];
            Findings::new(json!({}), targets.into(), quick).and_then(|found| found.conclude(true, "")).expect("prints")
        };
        assert_eq!([code(Some(4.0), false), code(None, false)], [0; 2]);
        assert_eq!(code(Some(6.0), false), 1);
        assert_eq!(code(Some(6.0), true), 0, "a quick run judges nothing");
    }

    #[test]
    fn numbers_are_printed_to_be_read() {
        for (value, text) in
            [(0.0, "0"), (5.0, "5"), (0.98765, "0.9877"), (12.345, "12.35"), (1234.5, "1234"), (2e-7, "2.00e-7")]
        {
            assert_eq!(plain(value), text);
        }
    }
}
