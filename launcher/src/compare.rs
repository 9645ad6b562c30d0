//! `compare`: recorded flights side by side.

use std::path::PathBuf;

use anyhow::Context;
use contract::exit;
use folder::files::{named_file, write_whole};
use runtime::console::print;
use view::comparison::Comparison;

/// Arguments of `compare`.
#[derive(clap::Args)]
#[command(after_help = "The flights may differ in length, rate and mode, and their logs may be torn.")]
pub struct CompareArgs {
    /// Folders of two or more runs, or their flight.mcap
    #[arg(required = true, num_args = 2.., value_name = "RUN")]
    pub runs: Vec<PathBuf>,
    /// File for the page [default: compare.html beside the folder of the first run]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
}

/// Prints what differs between the runs, and writes the page.
pub fn compare(args: &CompareArgs) -> anyhow::Result<u8> {
    let page = args.out.as_deref().map_or_else(|| beside_first(args), |out| named_file(out, "html"))?;
    let comparison = Comparison::read(&args.runs)?;
    print(&comparison.text());
    write_whole(&page, comparison.page().as_bytes()).context("give another file with --out")?;
    print(&format!("\nwritten to {}\n", page.display()));
    Ok(exit::FLOWN)
}

fn beside_first(args: &CompareArgs) -> anyhow::Result<PathBuf> {
    let first = args.runs[0].canonicalize().with_context(|| format!("cannot find {}", args.runs[0].display()))?;
    let folder = if first.is_dir() { first } else { first.with_file_name("") };
    Ok(folder.parent().unwrap_or(&folder).join("compare.html"))
}
