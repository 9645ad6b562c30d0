//! `export fmu`: packs the plant for other tools.

use std::io::{Cursor, Write};
use std::path::PathBuf;

use anyhow::{Context, anyhow};
use flight::files::write_whole;
use flight::settings;
use runtime::console::print;
use trefoil_fmu::description::{MODEL, SCENARIO_FILE, check, model_description};
use zip::write::{SimpleFileOptions, ZipWriter};

/// Format of an export.
#[derive(clap::Subcommand)]
pub enum Export {
    /// Write plant and actuators as an FMU for co-simulation, FMI 3.0
    Fmu(FmuArgs),
}

/// Arguments of `export fmu`.
#[derive(clap::Args)]
pub struct FmuArgs {
    /// Scenario file (TOML) whose vehicle it is; without one, the defaults
    scenario: Option<PathBuf>,
    /// Override a setting, value in TOML
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// File to write
    #[arg(long, value_name = "FILE", default_value = "trefoil.fmu")]
    out: PathBuf,
}

/// Writes the FMU, and says where.
pub fn export(what: &Export) -> anyhow::Result<()> {
    let Export::Fmu(args) = what;
    let scenario = settings::load(args.scenario.as_deref(), &args.set)?;
    check(&scenario).map_err(|why| anyhow!(why))?;
    let library = std::fs::read(library()?).context("cannot read the library of the FMU")?;
    let mut archive = ZipWriter::new(Cursor::new(vec![]));
    let options = SimpleFileOptions::default();
    let platform = format!("{}-{}", std::env::consts::ARCH, std::env::consts::OS);
    for (name, bytes) in [
        ("modelDescription.xml".to_owned(), model_description(&scenario).as_bytes()),
        (format!("resources/{SCENARIO_FILE}"), contract::scenario::to_toml(&scenario).as_bytes()),
        (format!("binaries/{platform}/{MODEL}.so"), &library),
    ] {
        archive.start_file(name, options)?;
        archive.write_all(bytes)?;
    }
    write_whole(&args.out, archive.finish()?.get_ref())?;
    print(&format!("written to {}\n", args.out.display()));
    Ok(())
}

/// Finds the library of the FMU, which cargo builds with the launcher: in its folder, or in `deps` there.
fn library() -> anyhow::Result<PathBuf> {
    let launcher = std::env::current_exe().context("cannot find the folder of the launcher")?;
    let folder = launcher.parent().context("the launcher lies in no folder")?;
    let places = [folder.to_owned(), folder.join("deps")].map(|folder| folder.join("libtrefoil_fmu.so"));
    let found = places.into_iter().find(|place| place.is_file());
    found.with_context(|| format!("libtrefoil_fmu.so is not in {}: copy it there with the launcher", folder.display()))
}
