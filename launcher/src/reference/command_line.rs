//! docs/reference/commands.md, from the command line itself.

use clap::{Arg, Command};

use super::is_generated;
use super::page::{head, row};
use crate::cli::Cli;
use crate::help::{EXITS, GROUPS, HELP, Help, command};

const COMMANDS: &str = "# Commands

This page is for users of the command line and for scripts: every command with its arguments and examples, and its exit
codes. It is generated from the program; a test compares. `trefoil COMMAND --help` says the same. `trefoil man DIR`
writes manual pages, and `trefoil completions SHELL` prints what a shell needs to complete commands and options:

```sh
trefoil completions bash > ~/.local/share/bash-completion/completions/trefoil
```
";

const CODES: &str = "
## Exit codes

Nothing that failed ends with 0. Any command has the code 130 in a shell if Ctrl-C ends it, and at least 3 if its output
cannot be printed.

";

/// Returns a text of clap in one line.
fn line(text: Option<&clap::builder::StyledStr>) -> String {
    text.map_or(String::new(), |text| text.to_string().split_whitespace().collect::<Vec<_>>().join(" "))
}

/// Returns an argument as it is typed.
fn typed(arg: &Arg) -> String {
    let values = arg.get_value_names().into_iter().flatten().map(clap::builder::Str::as_str);
    let values = values.collect::<Vec<_>>().join(" ");
    let takes = arg.get_action().takes_values();
    match (arg.get_long(), arg.is_required_set()) {
        (Some(long), _) if takes => format!("--{long} {values}"),
        (Some(long), _) => format!("--{long}"),
        (None, true) => values,
        (None, false) => format!("[{values}]"),
    }
}

fn meaning(arg: &Arg) -> String {
    let mut text = line(arg.get_help());
    let values = arg.get_possible_values();
    if arg.get_action().takes_values() && !values.is_empty() {
        let of = |value: &clap::builder::PossibleValue| match line(value.get_help()) {
            help if help.is_empty() => format!("`{}`", value.get_name()),
            help => format!("`{}` ({help})", value.get_name()),
        };
        let shown = values.iter().filter(|value| !value.is_hide_set()).map(of);
        text = format!("{text}: {}", shown.collect::<Vec<_>>().join(", "));
    }
    let defaults: Vec<_> = arg.get_default_values().iter().map(|value| value.to_string_lossy()).collect();
    if arg.get_action().takes_values() && defaults.iter().any(|value| !value.is_empty()) {
        text = format!("{text} [default: {}]", defaults.join(" "));
    }
    text
}

fn describe(page: &mut String, of: &Command, help: &Help) {
    *page += &format!("\n## trefoil {}\n\n{}.\n\n", help.command, line(of.get_about()).trim_end_matches('.'));
    let args: Vec<&Arg> = of.get_arguments().filter(|arg| !arg.is_hide_set() && arg.get_id() != "help").collect();
    if !args.is_empty() {
        *page += &head(&["argument", "meaning"]);
        args.iter().for_each(|arg| *page += &row(&[&format!("`{}`", typed(arg)), &meaning(arg)]));
        page.push('\n');
    }
    let own = of.get_after_help().map(ToString::to_string).unwrap_or_default();
    let own = own.split("Examples:\n").next().unwrap_or_default().trim();
    if !own.is_empty() {
        *page += &format!("{own}\n\n");
    }
    let examples = help.examples.iter().map(|example| format!("trefoil {example}\n")).collect::<String>();
    *page += &format!("```sh\n{examples}```\n");
}

#[test]
fn the_page_of_commands_is_generated() {
    let mut whole = command::<Cli>();
    whole.build();
    let mut page = COMMANDS.to_owned();
    for help in HELP {
        let found = help.command.split(' ').try_fold(&whole, |command, name| command.find_subcommand(name));
        describe(&mut page, found.expect("help is on a command"), help);
    }
    page += &format!("{CODES}{}", head(&["code", "meaning"]));
    EXITS.iter().for_each(|(code, meaning)| page += &row(&[&code.to_string(), meaning]));
    page += &format!("\n{}", head(&["command", "codes"]));
    for help in HELP {
        let codes = help.exit_codes().iter().map(|(code, meaning)| format!("**{code}** {meaning}")).collect::<Vec<_>>();
        page += &row(&[&format!("`{}`", help.command), &codes.join("; ")]);
    }
    is_generated("docs/reference/commands.md", &page);
}

/// Returns the words of each command that users see and can run.
fn visible(command: &Command, before: &str) -> Vec<String> {
    let own = |inner: &Command| format!("{before}{}", inner.get_name());
    let seen = command.get_subcommands().filter(|inner| !inner.is_hide_set() && inner.get_name() != "help");
    seen.flat_map(|inner| {
        let inside = visible(inner, &format!("{} ", own(inner)));
        let is_group = inner.is_subcommand_required_set();
        (!is_group).then(|| own(inner)).into_iter().chain(inside).collect::<Vec<_>>()
    })
    .collect()
}

#[test]
fn every_command_has_examples_and_each_example_parses() {
    let whole = command::<Cli>();
    let has_help = |command: &String| HELP.iter().any(|help| help.command == command);
    assert_eq!(visible(&whole, "").iter().find(|command| !has_help(command)), None, "a command without help");
    for Help { command: of, examples, .. } in HELP {
        assert!(!examples.is_empty(), "{of} has no example");
        for example in *examples {
            assert!(example.split(' ').take(of.split(' ').count()).eq(of.split(' ')), "{example} is of {of}");
            let words = std::iter::once("trefoil").chain(example.split(' '));
            whole.clone().try_get_matches_from(words).unwrap_or_else(|error| panic!("{example}: {error}"));
        }
    }
}

#[test]
fn every_visible_command_is_in_the_list_of_help_once() {
    let whole = command::<Cli>();
    let mut listed: Vec<&str> = GROUPS.iter().flat_map(|(_, names)| *names).copied().collect();
    let mut seen: Vec<&str> = whole.get_subcommands().filter(|of| !of.is_hide_set()).map(Command::get_name).collect();
    let text = whole.clone().render_help().to_string();
    assert!(
        text.contains("\nFly:\n  fly        Fly a scenario") && text.contains("\nOptions:\n  -h, --help"),
        "{text}"
    );
    listed.sort_unstable();
    seen.sort_unstable();
    assert_eq!(listed, seen);
}

#[test]
fn the_help_of_a_command_has_its_examples_and_exit_codes() {
    let mut whole = command::<Cli>();
    let fly = whole.find_subcommand_mut("fly").unwrap().render_long_help().to_string();
    for part in
        ["trefoil fly wind --mode inprocess", "Exit codes: 0 flown, inside its bounds; 1 ", "; 130 interrupted."]
    {
        assert!(fly.contains(part), "{part}: {fly}");
    }
}

#[test]
fn the_version_names_the_commit() {
    let version = command::<Cli>().get_version().unwrap().to_owned();
    assert!(version.starts_with(env!("CARGO_PKG_VERSION")), "{version}");
}
