//! `schema`, `completions` and `man`: the program describes its files and its command line to other programs.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use clap_complete::Shell;
use contract::exit;
use runtime::console::print;

/// Arguments of `schema`.
#[derive(Args)]
pub struct SchemaArgs {
    /// File that the schema is for
    pub of: Described,
}

/// File with a schema.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Described {
    /// Scenario file (TOML)
    Scenario,
    /// Campaign file (TOML)
    Campaign,
    /// run.json in the folder of a run
    Run,
}

impl Described {
    /// Returns the JSON Schema of the file, as text.
    pub fn schema(self) -> String {
        let schema = match self {
            Self::Scenario => settings::schema(),
            Self::Campaign => campaign::schema::schema(),
            Self::Run => outcome::run_record::schema(),
        };
        format!("{schema:#}\n")
    }
}

/// Prints the schema; returns the exit code.
pub fn schema(args: &SchemaArgs) -> u8 {
    print(&args.of.schema());
    exit::FLOWN
}

/// Arguments of `completions`.
#[derive(Args)]
pub struct CompletionsArgs {
    /// Shell that completes
    shell: Shell,
}

/// Prints the completions of the command line `command`; returns the exit code.
pub fn completions(args: &CompletionsArgs, mut command: clap::Command) -> u8 {
    let mut text = vec![];
    clap_complete::generate(args.shell, &mut command, "trefoil", &mut text);
    print(&String::from_utf8_lossy(&text));
    exit::FLOWN
}

/// Arguments of `man`.
#[derive(Args)]
pub struct ManArgs {
    /// Folder to write the pages into, one for each command; it is created if it is missing
    dir: PathBuf,
}

/// Writes the manual pages of the command line `command`.
pub fn man(args: &ManArgs, command: clap::Command) -> anyhow::Result<()> {
    let shown = args.dir.display();
    let write = || {
        std::fs::create_dir_all(&args.dir)?;
        clap_mangen::generate_to(command, &args.dir)
    };
    write().with_context(|| format!("cannot write the pages into {shown}"))?;
    print(&format!("written to {shown}\n"));
    Ok(())
}
