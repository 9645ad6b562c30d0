//! `export`: a run in the formats of other tools, or, with `--to fmu`, the plant as an FMU.

use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail, ensure};
use flight::duration::{seconds, seconds_or_inf};
use flight::scenario;
use folder::files::{named_file, write_whole};
use folder::shipped::ShippedKind;
use outcome::recorded::TimeSpan;
use runtime::console::{eprint_line, print};
use trefoil_fmu::description::{MODEL, SCENARIO_FILE, check, model_description};
use view::export::{self, perfetto};
use zip::DateTime;
use zip::write::{SimpleFileOptions, ZipWriter};

use crate::run_folder::with_hint;
use crate::scenarios;

/// Arguments of `export`.
#[derive(clap::Args)]
#[command(after_help = "docs/tools.md shows how other tools open the files.")]
pub struct ExportArgs {
    /// Folder of the run, or its flight.mcap; with fmu the scenario file (TOML) or the name of a shipped scenario whose
    /// vehicle is exported [default with fmu: the defaults]
    #[arg(value_name = "RUN")]
    what: Option<PathBuf>,
    /// Format
    #[arg(long, value_enum)]
    to: Format,
    /// Begin of the part of the flight: 500ms, 2s, 1min
    #[arg(long = "from", value_name = "TIME", default_value = "0s", value_parser = seconds)]
    from_s: f64,
    /// Length of the part [default: to the end]
    #[arg(long = "for", value_name = "TIME", default_value = "inf", hide_default_value = true, value_parser = seconds_or_inf)]
    for_s: f64,
    /// With perfetto: a second, or --for, around the worst tick; in lockstep, where no tick is late, at the beginning
    #[arg(long, conflicts_with = "from_s")]
    worst: bool,
    /// With fmu: override a setting, value in TOML
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Folder (csv, parquet) or file to write [default: csv/, parquet/, flight.ulg, foxglove.mcap, trace.json beside
    /// the log; trefoil.fmu]
    #[arg(long, value_name = "PATH")]
    out: Option<PathBuf>,
}

/// Format of an export.
#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    /// A CSV file for each topic, for the events and for the cycles of the nodes
    Csv,
    /// Parquet files of the same tables
    Parquet,
    /// One `ULog` file, for PlotJuggler and the tools of PX4
    Ulog,
    /// The log with the vehicle and its course as scenes, for Foxglove and Rerun
    Foxglove,
    /// A trace for ui.perfetto.dev, of a flight through processes
    Perfetto,
    /// Plant and actuators as an FMU for co-simulation, FMI 3.0
    Fmu,
}

/// Writes the export, and prints its path.
pub fn export(args: &ExportArgs) -> anyhow::Result<()> {
    let is_fmu = args.to == Format::Fmu;
    let part = args.from_s > 0.0 || args.for_s.is_finite() || args.worst;
    ensure!(!(is_fmu && part), "--from, --for and --worst choose a part of a flight; --to fmu packs the plant");
    ensure!(is_fmu || args.set.is_empty(), "--set is for --to fmu: a recorded run has its settings");
    match &args.what {
        scenario if is_fmu => fmu(scenario.as_deref(), args),
        Some(run) => of_run(run, args).map_err(|error| with_hint(error, &[run])),
        None => bail!("give the run: its folder, or its flight.mcap"),
    }
}

fn of_run(run: &Path, args: &ExportArgs) -> anyhow::Result<()> {
    let ExportArgs { to, from_s, for_s, worst, ref out, .. } = *args;
    ensure!(for_s > 0.0, "--for 0 is no part of a flight");
    ensure!(!worst || to == Format::Perfetto, "--worst is for --to perfetto; choose the part with --from and --for");
    let log = if run.is_dir() { run.join("flight.mcap") } else { run.to_owned() };
    ensure!(log.exists(), "there is no {}; give the folder of a run that was flown with a log", log.display());
    let format = match to {
        Format::Csv => export::Format::Csv,
        Format::Parquet => export::Format::Parquet,
        Format::Ulog => export::Format::Ulog,
        Format::Foxglove => export::Format::Foxglove,
        Format::Fmu => unreachable!("it is of no run"),
        Format::Perfetto => return perfetto::write(&log, (!worst).then_some(from_s), for_s, out.as_deref()),
    };
    let written = export::export(&log, format, TimeSpan { from_s, to_s: from_s + for_s }, out.as_deref())?;
    for note in &written.notes {
        eprint_line(&format!("note: {note}"));
    }
    print(&format!("written to {}\n", written.out.display()));
    Ok(())
}

/// Writes the FMU, and prints its path.
fn fmu(scenario: Option<&Path>, args: &ExportArgs) -> anyhow::Result<()> {
    if let Some(path) = scenario {
        scenarios::tell(ShippedKind::Scenario, path);
    }
    let out = args.out.as_deref().map_or_else(|| Ok("trefoil.fmu".into()), |out| named_file(out, "fmu"))?;
    let scenario = scenario::load(scenario, &args.set)?;
    check(&scenario).map_err(|why| anyhow!(why))?;
    let library = std::fs::read(library()?).context("cannot read the library of the FMU")?;
    let mut archive = ZipWriter::new(Cursor::new(vec![]));
    let description = model_description(&scenario, option_env!("TREFOIL_DATE"));
    let options = SimpleFileOptions::default().last_modified_time(DateTime::default()); // never today's date
    let platform = format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS);
    for (name, bytes) in [
        ("modelDescription.xml".to_owned(), description.as_bytes()),
        (format!("resources/{SCENARIO_FILE}"), settings::to_toml(&scenario).as_bytes()),
        (format!("binaries/{platform}/{MODEL}.so"), &library),
    ] {
        archive.start_file(name, options)?;
        archive.write_all(bytes)?;
    }
    write_whole(&out, archive.finish()?.get_ref())?;
    print(&format!("written to {}\n", out.display()));
    Ok(())
}

/// Finds the library of the FMU, which cargo builds with the launcher: in the launcher's folder, in `deps` there, or
/// where a package of the system puts it. The newest library counts: cargo leaves an old one in the launcher's folder
/// when it builds for tests.
fn library() -> anyhow::Result<PathBuf> {
    let launcher = std::env::current_exe().context("cannot find the folder of the launcher")?;
    let folder = launcher.parent().context("the launcher lies in no folder")?;
    let folders = [folder.to_owned(), folder.join("deps"), folder.join("../lib/trefoil")];
    let places = folders.map(|folder| folder.join("libtrefoil_fmu.so"));
    let newest = |place: &PathBuf| place.metadata().and_then(|metadata| metadata.modified()).ok();
    let found = places.into_iter().filter(|place| place.is_file()).max_by_key(newest);
    found.with_context(|| {
        let folder = folder.display();
        format!(
            "libtrefoil_fmu.so is not in {folder}: copy it there from target/release/deps of the clone that built it"
        )
    })
}
