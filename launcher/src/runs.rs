//! `runs`: lists the flights in a folder.

use std::fs::read_dir;
use std::path::{Path, PathBuf};

use anyhow::Context;
use flight::event::name;
use outcome::run_record::RunRecord;
use runtime::console::print;
use view::table::{Table, cell};

/// Number of digits of a state hash that are shown.
const HASH_DIGITS: usize = 12;
/// Number of letters of an outcome that are shown.
const OUTCOME_LETTERS: usize = 48;

/// Arguments of `runs`.
#[derive(clap::Args)]
pub struct RunsArgs {
    /// Folder with the folders of runs
    #[arg(default_value = "runs")]
    dir: PathBuf,
}

/// Prints the flights in the folder, the oldest first.
pub fn runs(args: &RunsArgs) -> anyhow::Result<()> {
    let shown = args.dir.display();
    let entries = read_dir(&args.dir)
        .with_context(|| format!("cannot list {shown}; name the folder that has the folders of your runs"))?;
    let mut rows: Vec<Vec<String>> = entries.flatten().filter_map(|entry| row(&entry.path())).collect();
    rows.sort_by(|a, b| a[1].cmp(&b[1]));
    if rows.is_empty() {
        print(&format!("no flights in {shown}\n"));
        return Ok(());
    }
    let headings = ["folder", "when", "scenario", "mode", "code", "outcome", "largest error [m]", "state hash"];
    print(&Table::new(&format!("Flights in {shown}: {}", rows.len()), &headings, rows).text());
    Ok(())
}

/// Returns the row of a run; `None` if the folder is no run.
fn row(folder: &Path) -> Option<Vec<String>> {
    if !folder.is_dir() {
        return None;
    }
    let file = folder.file_name()?.to_string_lossy().into_owned();
    let incomplete = |outcome: &str| Some([&file, "-", "-", "-", "-", outcome, "-", "-"].map(str::to_owned).into());
    let run = match RunRecord::read(&folder.join("run.json")) {
        Ok(Some(run)) => run,
        Ok(None) if folder.join("flight.mcap").is_file() => return incomplete("incomplete: there is no run.json"),
        Ok(None) => return None,
        Err(error) => return incomplete(&shortened(&format!("{error:#}"))),
    };
    let date = run.provenance.as_ref().map_or("-".into(), |provenance| provenance.host.date.clone());
    let hash = run.state_hash.as_deref().map_or("-", |hash| hash.get(..HASH_DIGITS).unwrap_or(hash));
    let error_m = Some(run.metrics.max_position_error_m).filter(|error| error.is_finite());
    Some(vec![
        file,
        date,
        run.name,
        name(run.mode),
        run.exit_code.to_string(),
        shortened(&run.ended),
        cell(error_m, 3),
        hash.to_owned(),
    ])
}

/// Returns the first line of a text, cut after [`OUTCOME_LETTERS`].
fn shortened(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    match line.char_indices().nth(OUTCOME_LETTERS) {
        Some((end, _)) => format!("{}...", &line[..end]),
        None => line.to_owned(),
    }
}
