//! The command line. Data goes to stdout, talk to stderr.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand, ValueEnum};
use contract::process::{exit, run_as};
use contract::scenario;

use crate::measure::Measure;
use crate::stack::StartError;
use crate::{fly, intruder, manage, print, recorder, report, trace};

#[derive(Parser)]
#[command(name = "launcher", version, about = "Flies a tilt-rotor tricopter through separate real-time processes")]
#[command(after_help = "Exit codes: 0 flown; 1 flown, but outside the scenario's bounds or diverged; \
2 usage or scenario error; 3 a process or the log was lost; 4 a deadline with the policy `stop` was missed; 130 interrupted.")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fly a scenario and write flight.mcap, run.json and report.html
    Fly(fly::FlyArgs),
    /// Check a scenario file and print the merged settings
    Check {
        /// Scenario file (TOML)
        scenario: PathBuf,
        /// Override a setting, value in TOML
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Write report.html again from a run's folder
    Report {
        /// Folder of the run
        run: PathBuf,
    },
    /// Export some ticks of a run for the trace viewer Perfetto
    Trace(trace::TraceArgs),
    /// List the stacks that are flying
    Status {
        /// Print JSON
        #[arg(long)]
        json: bool,
    },
    /// Stop a flying stack, cleanly
    Stop {
        /// Which stack
        #[arg(long, default_value = "default")]
        namespace: String,
    },
    /// Measure what the stack promises, and say which promises are kept
    #[command(subcommand)]
    Measure(Measure),
    /// Run one process of a stack (the launcher starts these itself)
    Node {
        /// plant, guidance, attitude-mpc, mixer or recorder
        name: NodeName,
        /// Which stack to join
        #[arg(long, default_value = "default")]
        namespace: String,
        /// Which incarnation of the node this is
        #[arg(long, default_value_t = 1)]
        epoch: u32,
        /// recorder: where to write the log
        #[arg(long, required_if_eq("name", "recorder"))]
        log: Option<PathBuf>,
    },
    /// Try to get into a stack as somebody who does not belong there (the launcher starts this as a fault)
    #[command(hide = true)]
    Intrude(intruder::IntrudeArgs),
}

#[derive(Clone, Copy, ValueEnum)]
enum NodeName {
    Plant,
    Guidance,
    AttitudeMpc,
    Mixer,
    Recorder,
}

/// Parses the arguments and does what they say.
pub fn main() -> ExitCode {
    let result = match Cli::parse().command {
        Command::Fly(args) => fly::fly(&args),
        Command::Check { scenario, set } => check(&scenario, &set),
        Command::Report { run } => report::rewrite(&run).map(|()| exit::FLOWN),
        Command::Trace(args) => trace::trace(&args).map(|()| exit::FLOWN),
        Command::Status { json } => manage::status(json).map(|()| exit::FLOWN),
        Command::Stop { namespace } => manage::stop(&namespace).map(|()| exit::FLOWN),
        Command::Measure(what) => what.run(),
        Command::Intrude(args) => intruder::intrude(&args),
        Command::Node { name, namespace, epoch, log } => return node(name, &namespace, epoch, log),
    };
    match result {
        Ok(code) => ExitCode::from(code),
        Err(error) => {
            let text = format!("{error:#}");
            // Scenario errors open with the word themselves, in front of the lines they quote.
            eprintln!("error: {}", text.strip_prefix("error: ").unwrap_or(&text));
            ExitCode::from(error.downcast_ref::<StartError>().map_or(exit::USAGE, StartError::exit_code))
        }
    }
}

fn check(scenario: &std::path::Path, set: &[String]) -> anyhow::Result<u8> {
    let merged = scenario::load(Some(scenario), set)?;
    print(&scenario::to_toml(&merged));
    eprintln!("{}: fine", scenario.display());
    Ok(exit::FLOWN)
}

fn node(name: NodeName, namespace: &str, epoch: u32, log: Option<PathBuf>) -> ExitCode {
    match (name, log) {
        (NodeName::Plant, _) => run_as("plant", namespace, epoch, plant::run),
        (NodeName::Guidance, _) => run_as("guidance", namespace, epoch, guidance::run),
        (NodeName::AttitudeMpc, _) => run_as("attitude-mpc", namespace, epoch, attitude_mpc::run),
        (NodeName::Mixer, _) => run_as("mixer", namespace, epoch, mixer::run),
        (NodeName::Recorder, Some(log)) => recorder::main(namespace, &log),
        (NodeName::Recorder, None) => unreachable!("clap requires --log for the recorder"),
    }
}
