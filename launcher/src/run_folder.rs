//! The run that a command reads, and a part of it; hints for a path that is no run.

use std::fs::read_dir;
use std::path::{Path, PathBuf};

use anyhow::{anyhow, bail};
use flight::duration::seconds;
use folder::files;
use outcome::recorded::TimeSpan;
use settings::file::MAX_LOG_BYTES;

/// Arguments that name a run, and a part of it.
#[derive(clap::Args)]
pub struct PartOfRun {
    /// Folder of the run, or its flight.mcap
    pub run: PathBuf,
    /// Begin of the part of the flight
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    from: Option<f64>,
    /// End of the part of the flight
    #[arg(long, value_name = "TIME", value_parser = seconds)]
    to: Option<f64>,
}

impl PartOfRun {
    /// Returns the part of the flight between `--from` and `--to`; an error if it is empty.
    pub fn part(&self) -> anyhow::Result<TimeSpan> {
        let part =
            TimeSpan { from_s: self.from.unwrap_or(TimeSpan::ALL.from_s), to_s: self.to.unwrap_or(TimeSpan::ALL.to_s) };
        if part.from_s >= part.to_s {
            bail!("--from {} is not before --to {}", part.from_s, part.to_s);
        }
        Ok(part)
    }
}

/// File name of the log in the folder of a run.
const LOG: &str = "flight.mcap";

/// Adds a hint to an error: why one of `runs` is no run, and the newest run nearby. Adds nothing if all may be runs.
pub fn with_hint(error: anyhow::Error, runs: &[impl AsRef<Path>]) -> anyhow::Error {
    let mut runs = runs.iter().map(AsRef::as_ref);
    let Some((run, what)) = runs.find_map(|run| Some((run, misfit(run)?))) else { return error };
    let likely = newest(run).map_or(String::new(), |run| format!("; the newest here is {}", run.display()));
    anyhow!(
        "{error:#}\nhelp: {} {what}. A run is a folder with {LOG} in it, as `trefoil fly` makes it: runs/NAME-TIME{likely}",
        run.display()
    )
}

/// Returns the reason why `run` is no run; `None` if it may be a run.
fn misfit(run: &Path) -> Option<&'static str> {
    let has = |name: &str| run.join(name).symlink_metadata().is_ok();
    match () {
        () if run.symlink_metadata().is_err() => Some("is not there"),
        () if run.is_dir() && has(LOG) => None,
        () if has("layout.toml") => Some(
            "is the folder of a campaign, whose flights have no logs; `trefoil campaign FILE --only N` flies flight N again and writes its log",
        ),
        () if has("run.json") => Some("is a run without a log, flown with --no-log"),
        () if run.is_dir() => Some("is a folder without a log"),
        () if run.extension().is_some_and(|extension| extension == "toml") => {
            Some("is a file of settings, which `trefoil fly` flies")
        }
        () if !is_log(run) => Some("is no log of a flight"),
        () => None,
    }
}

/// Returns whether a file begins as a log does; true if the file cannot be opened.
fn is_log(path: &Path) -> bool {
    use std::io::Read;
    let Ok((mut file, _)) = files::open(path, MAX_LOG_BYTES) else { return true };
    let mut head = [0; 8];
    file.read_exact(&mut head).is_ok() && head == *b"\x89MCAP0\r\n"
}

/// Finds the run with the newest log in `place`, `place/runs` and `./runs`; `None` if these folders have no run.
fn newest(place: &Path) -> Option<PathBuf> {
    let folders = [place.to_owned(), place.join("runs"), PathBuf::from("runs")];
    let runs =
        folders.iter().flat_map(|folder| read_dir(folder).into_iter().flatten().flatten()).map(|entry| entry.path());
    let when = |run: PathBuf| Some((run.join(LOG).symlink_metadata().ok()?.modified().ok()?, run));
    runs.filter_map(when).max().map(|(_, run)| run)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn an_error_about_a_path_that_is_no_run_says_why_and_names_the_newest_run() {
        let top = tempfile::tempdir().unwrap();
        let at = |name: &str| top.path().join(name);
        let said = |name: &str| with_hint(anyhow!("cannot read it"), &[at(name)]).to_string();
        for folder in ["runs/a-1", "none", "campaign", "unlogged"] {
            fs::create_dir_all(at(folder)).unwrap();
        }
        for (file, text) in [
            ("runs/a-1/flight.mcap", &b"\x89MCAP0\r\n"[..]),
            ("campaign/layout.toml", b""),
            ("unlogged/run.json", b""),
            ("survey.toml", b""),
            ("note.txt", b"x"),
        ] {
            fs::write(at(file), text).unwrap();
        }
        assert!(said("").contains("the newest here is ") && said("").contains("runs/a-1"), "{}", said(""));
        for (name, expected) in [
            ("nowhere", "is not there"),
            ("none", "is a folder without a log"),
            ("campaign", "--only N"),
            ("unlogged", "--no-log"),
            ("survey.toml", "`trefoil fly` flies"),
            ("note.txt", "is no log of a flight"),
        ] {
            assert!(
                said(name).starts_with("cannot read it\nhelp: ") && said(name).contains(expected),
                "{}",
                said(name)
            );
        }
        assert_eq!(said("runs/a-1"), "cannot read it");
        assert_eq!(said("runs/a-1/flight.mcap"), "cannot read it");
    }
}
