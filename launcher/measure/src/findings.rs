//! Results of a measurement and the verdicts on its targets, as a file and as text.
//!
//! A measurement ends with one line per target: verdict, figure, measured value, target. The exit code is 0 only if no
//! target is short. The file of the results has one object `{provenance, quick, results, targets}`; `--json` prints the
//! same object instead of text.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use contract::exit;
use flight::provenance::host;
use folder::files::write_whole;
use outcome::target::{Target, TargetVerdict};
use runtime::console::print;
use serde::Serialize;
use serde_json::{Value, json};

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
            target.verdict = TargetVerdict::Inconclusive;
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
        let short = self.targets.iter().any(|target| target.verdict == TargetVerdict::Short);
        Ok(if short { exit::OUT_OF_BOUNDS } else { exit::FLOWN })
    }
}

/// Creates a folder and checks that files can be written to it; `option` is the argument that names the folder.
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

#[cfg(test)]
mod tests {
    use super::*;

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
