//! The command line. Results go to stdout, notes and errors to stderr.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::builder::PossibleValuesParser;
use clap::{Parser, Subcommand};
use contract::exit;
use contract::topic::{NODES, Topic};

use runtime::console;
use runtime::process::run_as;
use runtime::realtime::{reset_signals, tell_of_crashes};

use flight::hover::Hover;
use flight::stack::{StartError, check_memory};
use flight::{guarded, nodes, recorder, scenario, strays};
use folder::shipped::ShippedKind;
use measure::Measure;
use runtime::console::{eprint_line, print};
use view::report;

use crate::run_folder::{PartOfRun, with_hint};
use crate::target::TargetArgs;
use crate::{
    campaign, command, compare, doctor, export, fly, help, manage, manual, mavlink, mission, new, replay, runs,
    scenarios, swap, tune, vehicle, web,
};

#[derive(Parser)]
#[command(name = "trefoil", version, about = "Flies a tilt-rotor tricopter through separate real-time processes")]
#[command(after_help = "`trefoil COMMAND --help` has examples and exit codes.")]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Fly a scenario and write flight.mcap, run.json and report.html
    Fly(fly::FlyArgs),
    /// Write a controller of your own: code, build file, scenario, test
    New(new::NewArgs),
    /// Check a scenario file; print the merged settings, the hover and the margins of its control loops
    Check {
        /// Scenario file (TOML), or the name of a shipped scenario
        scenario: PathBuf,
        /// Override a setting, value in TOML
        #[arg(long = "set", value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
    /// Check if this machine gives a flight in real time what it asks for, and what to do where it does not
    Doctor(doctor::DoctorArgs),
    /// Write the report of a recorded run again, or the figures of a part of it with every sample drawn
    Report(PartOfRun),
    /// Fly a recorded flight again in process, from its folder alone, and compare the bits
    Replay(replay::ReplayArgs),
    /// Compute what each late, lost or missing message of a recorded flight cost, by replaying it undisturbed
    Explain(replay::ExplainArgs),
    /// Lay recorded flights side by side: settings that differ, metrics, timing, courses
    Compare(compare::CompareArgs),
    /// List the flying stacks, and the state of their nodes
    Status(manage::StatusArgs),
    /// Show a flying stack to a ground station, by MAVLink over UDP
    Mavlink(mavlink::MavlinkArgs),
    /// Replace a process of a flying stack; the new one is tried on standby first, and removed if it fails
    Swap(swap::SwapArgs),
    /// Inject a fault into a stack that flies in real time
    Inject(command::InjectArgs),
    /// End faults in a stack that flies in real time
    Clear(command::ClearArgs),
    /// Stop a flying stack, cleanly
    Stop(TargetArgs),
    /// Show a flying stack in the browser, live, with buttons for inject, clear, swap and stop
    Web(web::WebArgs),
    /// Fly a campaign: many flights that differ in what a file varies
    Campaign(campaign::CampaignArgs),
    /// Tune the controllers of a campaign, each with the same budget, on draws that the campaign does not use
    Tune(tune::TuneArgs),
    /// Export a run, or the plant, for other tools
    Export(export::ExportArgs),
    /// Measure figures of the stack, each against its target
    #[command(subcommand)]
    Measure(Measure),
    /// List the scenarios and campaigns that are part of the program, or print one
    Scenarios(scenarios::ScenariosArgs),
    /// List the flights in a folder: when, scenario, mode, outcome, error, state hash
    Runs(runs::RunsArgs),
    /// Print the JSON Schema of a file, by which editors complete and check it
    #[command(hide = true)]
    Schema(manual::SchemaArgs),
    /// Print the completions of a shell, to be loaded by it
    #[command(hide = true)]
    Completions(manual::CompletionsArgs),
    /// Write manual pages, one for each command
    #[command(hide = true)]
    Man(manual::ManArgs),
    /// Run one process of a stack (the launcher starts these itself)
    #[command(hide = true)]
    Node {
        /// plant, guidance, attitude-mpc, mixer or recorder
        #[arg(value_parser = PossibleValuesParser::new(NODES.into_iter().chain([RECORDER])))]
        name: String,
        /// Namespace of the stack to join
        #[arg(long, default_value = "default")]
        namespace: String,
        /// Epoch of the process: its number among the processes of the node
        #[arg(long, default_value_t = 1)]
        epoch: u32,
        /// Settings of this process, a merged scenario file; without it: the run's
        #[arg(long)]
        settings: Option<PathBuf>,
        /// recorder: file of the log
        #[arg(long, required_if_eq("name", "recorder"))]
        log: Option<PathBuf>,
    },
    /// Try libraries, or fly with them, for the launcher that starts this
    #[command(hide = true)]
    FlyGuarded,
    /// Serve the page of one flight, for the launcher that starts this
    #[command(hide = true)]
    ServePage,
}

/// Name of the recorder, as an argument beside the names of the nodes.
const RECORDER: &str = "recorder";

/// Parses the arguments and runs the command. A panic prints its reason; the exit code is then that of a lost process.
pub fn main() -> ExitCode {
    std::panic::catch_unwind(run).unwrap_or(ExitCode::from(exit::PROCESS_LOST))
}

fn run() -> ExitCode {
    reset_signals();
    tell_of_crashes();
    if let Err(error) = check_memory() {
        console::eprint_line(&format!("error: {error}"));
        return console::finish(exit::USAGE).into();
    }
    // A process that was started from /proc/self/exe has the name `exe`. The call fails only for a name that is too
    // long.
    let _ = rustix::thread::set_name(c"trefoil");
    let cli = match help::parse::<Cli>() {
        Ok(cli) => cli,
        Err(usage) => return tell(&usage),
    };
    let result = match cli.command {
        Command::Fly(args) => {
            args.scenario.iter().for_each(|path| scenarios::tell(ShippedKind::Scenario, path));
            fly::fly(&args)
        }
        Command::New(args) => new::new(&args),
        Command::Check { scenario, set } => check(&scenario, &set),
        Command::Doctor(args) => doctor::doctor(&args),
        Command::Report(of) => report(&of).map_err(|error| with_hint(error, &[&of.run])),
        Command::Replay(args) => replay::replay(&args).map_err(|error| with_hint(error, &[&args.of.run])),
        Command::Explain(args) => replay::explain(&args).map_err(|error| with_hint(error, &[&args.of.run])),
        Command::Compare(args) => compare::compare(&args).map_err(|error| with_hint(error, &args.runs)),
        Command::Status(args) => manage::status(&args).map(|()| exit::FLOWN),
        Command::Mavlink(args) => mavlink::mavlink(&args),
        Command::Swap(args) => swap::swap(&args),
        Command::Inject(args) => command::inject(&args).map(|()| exit::FLOWN),
        Command::Clear(args) => command::clear(&args).map(|()| exit::FLOWN),
        Command::Stop(args) => manage::stop(&args).map(|()| exit::FLOWN),
        Command::Web(args) => web::web(&args),
        Command::Campaign(args) => campaign::campaign(&args),
        Command::Tune(args) => tune::tune(&args),
        Command::Export(args) => export::export(&args).map(|()| exit::FLOWN),
        Command::Measure(what) => what.run(),
        Command::Scenarios(args) => scenarios::scenarios(&args).map(|()| exit::FLOWN),
        Command::Runs(args) => runs::runs(&args).map(|()| exit::FLOWN),
        Command::Schema(args) => Ok(manual::schema(&args)),
        Command::Completions(args) => Ok(manual::completions(&args, help::command::<Cli>())),
        Command::Man(args) => manual::man(&args, help::command::<Cli>()).map(|()| exit::FLOWN),
        Command::FlyGuarded => guarded::serve().map_err(Into::into),
        Command::ServePage => web::serve_page(),
        Command::Node { name, namespace, epoch, settings, log } => {
            return node(&name, &namespace, epoch, settings.as_deref(), log);
        }
    };
    strays::kill_all_of_this_launcher();
    let code = match result {
        Ok(code) => code,
        Err(error) => {
            let text = with_causes(&error);
            // Scenario errors begin with `error:` themselves, before the lines that they quote.
            console::eprint_line(&format!("error: {}", text.strip_prefix("error: ").unwrap_or(&text)));
            error.downcast_ref::<StartError>().map_or(exit::USAGE, StartError::exit_code)
        }
    };
    guarded::exit_code(console::finish(code)).into()
}

/// Prints the text of `--help` and the like, or the error in the arguments.
fn tell(usage: &clap::Error) -> ExitCode {
    if usage.use_stderr() {
        // The text may contain names of files, so it is printed like every message, and without colours.
        eprint_line(usage.render().to_string().trim_end());
        return console::finish(exit::USAGE).into();
    }
    match usage.print() {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => ExitCode::from(exit::PROCESS_LOST),
        _ => ExitCode::from(exit::FLOWN),
    }
}

/// Returns the error with its causes, each of them once: the text of some errors includes that of their cause.
fn with_causes(error: &anyhow::Error) -> String {
    error.chain().map(ToString::to_string).fold(String::new(), |text, cause| match text.as_str() {
        "" => cause,
        text if text.contains(&cause) => text.to_owned(),
        text => format!("{text}: {cause}"),
    })
}

fn report(of: &PartOfRun) -> anyhow::Result<u8> {
    let (page, missing) = report::write(&of.run, of.part()?, ::replay::explain::costs)?;
    if let Some(missing) = missing {
        eprint_line(&format!("note: {missing}"));
    }
    print(&format!("written to {}\n", page.display()));
    Ok(exit::FLOWN)
}

fn check(scenario: &std::path::Path, set: &[String]) -> anyhow::Result<u8> {
    scenarios::tell(ShippedKind::Scenario, scenario);
    let merged = scenario::load(Some(scenario), set)?;
    print(&settings::to_toml_that_follows(&merged));
    let hover = Hover::of(&merged);
    print(&vehicle::describe_hover(&hover));
    if let Some(parts) = mission::describe(&merged) {
        eprint_line(parts.trim_end());
    }
    mission::warn(&merged);
    vehicle::warn_of_weights(&merged);
    eprint_line(&format!("{}: {}", scenario.display(), vehicle::verdict(&hover)));
    Ok(exit::FLOWN)
}

fn node(name: &str, namespace: &str, epoch: u32, own: Option<&Path>, log: Option<PathBuf>) -> ExitCode {
    match log {
        Some(log) if name == RECORDER => recorder::main(namespace, epoch, &log),
        _ if name == Topic::State.publisher() => run_as(name, namespace, epoch, own, |session| {
            let vehicle = nodes::vehicle(&session.scenario)?;
            plant::sampler::run(session, vehicle)
        }),
        _ => run_as(name, namespace, epoch, own, |session| runtime::node::run(session, nodes::open)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use anyhow::Context;
    use runtime::domain::DomainError;

    #[test]
    fn each_cause_of_an_error_is_printed_once() {
        let io = || std::io::Error::other("no space");
        let error: anyhow::Result<()> = Err(DomainError::Io { path: "/dev/shm/x".into(), source: io() }.into());
        let error = error.context("cannot fly").expect_err("an error");
        assert_eq!(with_causes(&error).matches("no space").count(), 1, "{}", with_causes(&error));
        assert_eq!(with_causes(&io().into()), "no space");
    }
}
