//! `schema`, `completions` and `man`: the program describes its files and its command line to other programs.

use std::path::PathBuf;

use anyhow::Context;
use clap::{Args, ValueEnum};
use clap_complete::Shell;
use runtime::console::print;
use serde_json::Value;

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
        to_text(&schema)
    }
}

fn to_text(schema: &Value) -> String {
    format!("{schema:#}\n")
}

/// Prints the schema.
pub fn schema(args: &SchemaArgs) {
    print(&args.of.schema());
}

/// Arguments of `completions`.
#[derive(Args)]
pub struct CompletionsArgs {
    /// Shell that completes
    shell: Shell,
}

/// Prints the completions of the command line `command`.
pub fn completions(args: &CompletionsArgs, mut command: clap::Command) {
    let mut text = vec![];
    clap_complete::generate(args.shell, &mut command, "trefoil", &mut text);
    print(&String::from_utf8_lossy(&text));
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
