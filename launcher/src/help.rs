//! Examples and exit codes of every command, for `--help`, the manual pages and the page of commands.

use std::ffi::OsString;

use clap::builder::StyledStr;
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Command, CommandFactory, Parser};
use contract::exit;
use flight::provenance::{Git, ProgramIdentity};
use settings::moved;
use settings::moved::{MOVED, NameKind};

/// Commands in the list of `--help`, grouped by purpose. Commands for packagers and other programs are left out.
pub const GROUPS: [(&str, &[&str]); 5] = [
    ("Fly", &["fly", "check", "scenarios", "swap", "inject", "clear", "stop"]),
    ("Look", &["status", "web", "mavlink", "runs", "report", "replay", "explain", "compare", "export"]),
    ("Many flights", &["campaign", "tune"]),
    ("Own controllers", &["new"]),
    ("This machine", &["doctor", "measure"]),
];

/// Meaning of each exit code, for every command that does not give the code another meaning.
pub const EXITS: [(u8, &str); 6] = [
    (exit::FLOWN, "done"),
    (exit::OUT_OF_BOUNDS, "flown, but diverged, outside the flight's bounds, or without a swap that was asked for"),
    (exit::USAGE, "usage or scenario error, or a lack of system resources, with the reason"),
    (
        exit::PROCESS_LOST,
        "a process or the log was lost, messages were missed, or results could not be written or printed",
    ),
    (exit::BUDGET_BROKEN, "a deadline with the policy `stop` was missed"),
    (exit::INTERRUPTED, "interrupted"),
];

/// Help on one command.
pub struct Help {
    /// Words of the command after `trefoil`.
    pub command: &'static str,
    /// Examples, as typed after `trefoil`.
    pub examples: &'static [&'static str],
    /// Exit codes besides 0 and 2, or with another meaning than in [`EXITS`]; an empty text stands for the meaning
    /// there.
    pub exits: &'static [(u8, &'static str)],
}

const fn help(command: &'static str, examples: &'static [&'static str]) -> Help {
    Help { command, examples, exits: &[] }
}

/// Exit codes of a command that flies.
const FLIES: &[(u8, &str)] = &[
    (exit::FLOWN, "flown, inside its bounds"),
    (exit::OUT_OF_BOUNDS, ""),
    (exit::PROCESS_LOST, ""),
    (exit::BUDGET_BROKEN, ""),
    (exit::INTERRUPTED, ""),
];
/// Exit codes of a command that measures.
const MEASURES: &[(u8, &str)] = &[
    (exit::FLOWN, "no target is missed"),
    (exit::OUT_OF_BOUNDS, "a target is missed"),
    (exit::PROCESS_LOST, "results could not be written or printed"),
    (exit::INTERRUPTED, ""),
];

/// Help on every command that users and other programs run, in the order of the page of commands.
#[rustfmt::skip]
pub const HELP: &[Help] = &[
    Help {
        command: "fly",
        examples: &[
            "fly", "fly wind --mode inprocess", "fly scenarios/faults/swap-law.toml --mode lockstep --out runs/swap",
            "fly --set run.duration_s=20 --set profile=paper",
        ],
        exits: FLIES,
    },
    help("new", &["new my-controller --lang c", "new my-guidance --lang c --node guidance"]),
    help("check", &["check survey", "check mine.toml --set attitude.mpc.prediction_horizon_s=0.3"]),
    Help {
        command: "doctor",
        examples: &["doctor", "doctor scenarios/survey.toml --json"],
        exits: &[(exit::FLOWN, "a flight gets what it asks for"), (exit::OUT_OF_BOUNDS, "it does not")],
    },
    help("report", &["report runs/survey", "report runs/survey --from 10s --to 12s"]),
    Help {
        command: "replay",
        examples: &["replay runs/survey", "replay runs/survey --node mixer", "replay runs/survey --web"],
        exits: &[(exit::FLOWN, "the same bits, or the answers of other settings"), (exit::OUT_OF_BOUNDS, "a difference, nothing compared, or a log that is not all of the flight")],
    },
    Help {
        command: "explain",
        examples: &["explain runs/survey"],
        exits: &[(exit::OUT_OF_BOUNDS, "the log is not all of the flight")],
    },
    help("compare", &["compare runs/a runs/b", "compare runs/a runs/b runs/c --out three.html"]),
    help("status", &["status", "status --watch"]),
    Help {
        command: "swap",
        examples: &["swap attitude-mpc --set attitude.law=lqr", "swap mixer --exec ./my-mixer --standby 2s"],
        exits: &[
            (exit::FLOWN, "the candidate stays"),
            (exit::OUT_OF_BOUNDS, "the candidate was removed, and the old process is active"),
            (exit::PROCESS_LOST, "the flight ended first"),
        ],
    },
    help("inject", &["inject controls drop --for 500ms", "inject wind step --vector 5,0,0 --for 2s"]),
    help("clear", &["clear", "clear controls"]),
    help("web", &["web", "web 0.0.0.0:8080"]),
    help("mavlink", &["mavlink udpout:127.0.0.1:14550"]),
    help("stop", &["stop", "stop --namespace mine"]),
    Help {
        command: "campaign",
        examples: &["campaign fifty-seeds", "campaign fifty-seeds --web", "campaign delay-limit --observed runs/mine", "campaign mine.toml --plan", "campaign mine.toml --only 17"],
        exits: &[
            (exit::OUT_OF_BOUNDS, "flights could not be flown (invalid), or a promise is broken"),
            (exit::PROCESS_LOST, "shards are missing, or results could not be written"),
            (exit::INTERRUPTED, "interrupted: what is complete is kept"),
        ],
    },
    Help {
        command: "campaign shard",
        examples: &["campaign shard mine.toml --index 0 --of 10"],
        exits: &[(exit::PROCESS_LOST, "the shard could not be written"), (exit::INTERRUPTED, "")],
    },
    Help { command: "tune", examples: &["tune protocol", "tune mine.toml --controller pid"], exits: &[(exit::INTERRUPTED, "")] },
    help("export", &["export runs/survey --to parquet", "export runs/survey --to csv --from 10s --for 2s", "export wind --to fmu --out wind.fmu"]),
    Help { command: "measure mpc", examples: &["measure mpc"], exits: MEASURES },
    Help { command: "measure faults", examples: &["measure faults"], exits: MEASURES },
    Help { command: "measure stress", examples: &["measure stress"], exits: MEASURES },
    Help { command: "measure timing", examples: &["measure timing"], exits: MEASURES },
    help("scenarios", &["scenarios", "scenarios faults/swap-law"]),
    help("runs", &["runs", "runs results"]),
    help("schema", &["schema scenario", "schema campaign"]),
    help("completions", &["completions bash"]),
    help("man", &["man man1"]),
    Help {
        command: "node",
        examples: &["node mixer --namespace default"],
        exits: &[(exit::PROCESS_LOST, ""), (exit::BUDGET_BROKEN, "")],
    },
];

impl Help {
    /// Exit codes of the command with their meanings, in order.
    pub fn exit_codes(&self) -> Vec<(u8, &'static str)> {
        let usual = |code| EXITS.iter().find(|(of, _)| *of == code).map_or("", |(_, meaning)| meaning);
        let others = self.exits.iter().map(|(code, own)| (*code, if own.is_empty() { usual(*code) } else { *own }));
        let is_own = |code| self.exits.iter().any(|(of, _)| *of == code);
        let usual_ones =
            [exit::FLOWN, exit::USAGE].into_iter().filter(|code| !is_own(*code)).map(|code| (code, usual(code)));
        let mut all: Vec<_> = usual_ones.chain(others).collect();
        all.sort_by_key(|(code, _)| *code);
        all
    }

    /// Formats examples and exit codes below the command's own text.
    fn below(&self, own: Option<&StyledStr>) -> String {
        let own = own.map_or(String::new(), |own| format!("{own}\n\n"));
        let examples: String =
            self.examples.iter().fold(String::new(), |all, example| all + "  trefoil " + example + "\n");
        let codes: Vec<String> = self.exit_codes().iter().map(|(code, meaning)| format!("{code} {meaning}")).collect();
        format!("{own}Examples:\n{examples}\nExit codes: {}.", codes.join("; "))
    }
}

/// Returns the command line of `C` with version, examples and exit codes.
pub fn command<C: CommandFactory>() -> Command {
    let ProgramIdentity { version, git } = ProgramIdentity::this();
    let version = git.map_or(version.clone(), |Git { commit, changed }| {
        let changed = if changed { ", with changed sources" } else { "" };
        format!("{version} (commit {}{changed})", commit.get(..12).unwrap_or(&commit))
    });
    let command = C::command().version(&*version.leak());
    let command =
        HELP.iter().fold(command, |command, help| add(command, &help.command.split(' ').collect::<Vec<_>>(), help));
    let list = grouped(&command);
    command.help_template(list)
}

/// Makes the form of `--help` with the commands in [`GROUPS`]; clap has only one heading for all commands.
fn grouped(command: &Command) -> String {
    let (heading, literal) = (command.get_styles().get_header(), command.get_styles().get_literal());
    let about = |name: &str| command.find_subcommand(name).and_then(Command::get_about).map(ToString::to_string);
    let lines = GROUPS.iter().map(|(group, names)| {
        let lines =
            names.iter().map(|name| format!("  {literal}{name:<10}{literal:#} {}\n", about(name).unwrap_or_default()));
        format!("{heading}{group}:{heading:#}\n{}\n", lines.collect::<String>())
    });
    format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{}{heading}Options:{heading:#}\n{{options}}{{after-help}}",
        lines.collect::<String>()
    )
}

/// Adds `help` to the command that is reached by the names in `path`.
fn add(command: Command, path: &[&str], help: &Help) -> Command {
    match path {
        [] => {
            let below = help.below(command.get_after_help());
            command.after_help(below)
        }
        [name, rest @ ..] => command.mut_subcommand(name, |inner| add(inner, rest, help)),
    }
}

/// Parses the arguments of this process.
pub fn parse<C: Parser>() -> Result<C, clap::Error> {
    parse_from(std::env::args_os().collect())
}

/// Parses `arguments`, of which the first is the name of the program.
pub fn parse_from<C: Parser>(arguments: Vec<OsString>) -> Result<C, clap::Error> {
    let mut command = command::<C>();
    let words: Vec<String> = arguments.iter().map(|word| word.to_string_lossy().into_owned()).collect();
    let matches = command.try_get_matches_from_mut(arguments);
    let matches = matches.map_err(|error| match old_command(&words) {
        Some(title) if error.use_stderr() => command.error(error.kind(), title),
        _ => with_advice(error, &command, &words),
    })?;
    C::from_arg_matches(&matches).map_err(|error| error.format(&mut command))
}

/// Describes the replacement of a command of an earlier version, or of an option of such a command; `None` if `words`
/// have neither.
fn old_command(words: &[String]) -> Option<String> {
    let is_said = |old: &str| {
        let (mut names, mut options) = (words.iter().skip(1), words.iter());
        old.split(' ').all(|part| {
            let is_option = part.starts_with("--");
            if is_option {
                options.any(|word| word.split('=').next() == Some(part))
            } else {
                names.next().is_some_and(|word| word == part)
            }
        })
    };
    let (kind, old, _) = MOVED.iter().find(|(kind, old, _)| *kind == NameKind::Command && is_said(old))?;
    moved::find(*kind, old).map(|moved| moved.title)
}

/// Adds a tip to the error for a word that no option takes, if the word may be a unit apart from its number or the name
/// of a stack.
fn with_advice(mut error: clap::Error, command: &Command, words: &[String]) -> clap::Error {
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidArg) else { return error };
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    let apart = words.windows(2).find(|pair| pair[1] == *word && is_number(&pair[0])).map(|pair| &pair[0]);
    // A command that takes no positional arguments, but the name of a stack by an option.
    let of_a_stack = words.get(1).and_then(|name| command.find_subcommand(name)).filter(|command| {
        command.get_positionals().next().is_none() && command.get_arguments().any(|of| of.get_id() == "namespace")
    });
    let tip = match (apart, of_a_stack) {
        _ if error.kind() != ErrorKind::UnknownArgument || word.starts_with('-') => return error,
        (Some(number), _) => format!("a time is one word: {number}{word}"),
        (None, Some(command)) => {
            format!("a stack is named with --namespace: `trefoil {} --namespace {word}`", command.get_name())
        }
        (None, None) => return error,
    };
    error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    error
}
