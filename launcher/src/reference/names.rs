//! docs/names.md: names of earlier versions, from their table.

use std::collections::BTreeSet;
use std::path::Path;

use campaign::file::Campaign;
use clap::CommandFactory;
use settings::load_text;
use settings::moved::{MOVED, NameKind, Replacement, find};

use super::is_generated;
use super::page::{head, objects, row};
use crate::cli::Cli;
use crate::help::parse_from;

const PAGE: &str = "# Old and new names

This page is for users of an earlier version: it has every name that is refused now, with the one that takes its place. It
is generated from [`moved.rs`](../settings/src/moved.rs); a test compares.
";

const SECTIONS: [(&str, &str, &[NameKind]); 4] = [
    ("Settings", "A table stands for every key in it without a row of its own.", &[NameKind::Key, NameKind::Value]),
    ("Commands", "Each is a command of `trefoil`, or an option of one.", &[NameKind::Command]),
    ("Columns", "The table of a campaign's flights has them; promises and comparisons name them.", &[NameKind::Column]),
    ("Fields of run.json", "`provenance.schema_version` is the version of the form.", &[NameKind::Field]),
];

#[test]
fn the_page_of_names_is_generated() {
    let mut page = PAGE.to_owned();
    for (title, about, kinds) in SECTIONS {
        page += &format!("\n## {title}\n\n{about}\n\n{}", head(&["old", "new"]));
        for (_, old, now) in MOVED.iter().filter(|(kind, ..)| kinds.contains(kind)) {
            let new = match now {
                Replacement::Name(new) => format!("`{new}`"),
                Replacement::Seconds(new) => format!("`{new}`, in seconds instead of samples"),
                Replacement::Gone(words) => format!("none: {words}"),
            };
            page += &row(&[&format!("`{old}`"), &new]);
        }
    }
    is_generated("docs/names.md", &page);
}

/// Returns settings in TOML that contain `old`: a key, or a key with its value. In `old`, elements of lists have no
/// index.
fn settings(old: &str) -> String {
    let value = if old.contains('=') { old.to_owned() } else { format!("{old} = 1") };
    match value.split_once('.') {
        Some((list @ ("fault" | "swap"), rest)) => format!("{list} = [{{ {rest} }}]"),
        _ => value,
    }
}

/// Returns the message with which the program refuses the `old` name; `None` for a field, which is no input.
fn refusal(kind: NameKind, old: &str) -> Option<String> {
    let words = || ["launcher"].into_iter().chain(old.split(' ')).map(Into::into).collect();
    let campaign = || format!("seeds = [1]\n[[promise]]\nfigure = \"x\"\nmetric = \"{old}\"\nat_most = 1.0\n");
    match kind {
        NameKind::Key | NameKind::Value => load_text(&settings(old), "x", &[]).err().map(|error| error.to_string()),
        NameKind::Command => parse_from::<Cli>(words()).err().map(|error| error.to_string()),
        NameKind::Column => {
            Campaign::read(&campaign(), "x.toml", "x", Path::new("")).err().map(|error| format!("{error:#}"))
        }
        NameKind::Field => None,
    }
}

/// Returns whether the program has the `name` of this `kind`, as its reference pages list it.
fn is_known(kind: NameKind, name: &str) -> bool {
    let keys = |schema: &serde_json::Value| -> BTreeSet<String> {
        let all = objects(schema);
        let fields = all.iter().flat_map(|object| object.fields.iter().map(|field| &field.key));
        fields.chain(all.iter().map(|object| &object.key)).map(|key| key.replace("[]", "")).collect()
    };
    match kind {
        NameKind::Key => keys(&settings::schema()).contains(name),
        NameKind::Value => {
            let said = refusal(kind, name).unwrap_or_default(); // the text may lack another setting
            find(kind, name).is_none() && !said.contains("unknown variant")
        }
        NameKind::Field => keys(&outcome::run_record::schema()).contains(name),
        NameKind::Column => is_known(NameKind::Field, &format!("metrics.{name}")),
        NameKind::Command => {
            let (mut command, mut is_known) = (Cli::command(), true);
            for word in name.split(' ') {
                if let Some(option) = word.strip_prefix("--") {
                    is_known &= command.get_arguments().any(|of| of.get_long() == Some(option));
                } else if let Some(inner) = command.find_subcommand(word).cloned() {
                    command = inner;
                } else {
                    is_known &= command.get_positionals().next().is_some();
                }
            }
            is_known
        }
    }
}

#[test]
fn every_old_name_is_refused_by_its_row_and_every_new_one_is_known() {
    for (kind, old, now) in MOVED {
        let moved = find(*kind, old).unwrap();
        if let Some(said) = refusal(*kind, old) {
            assert!(said.contains(&moved.title), "{old}: {said}");
        }
        assert!(*kind == NameKind::Field || refusal(*kind, old).is_some(), "{old} is accepted");
        assert!(*kind == NameKind::Command || !is_known(*kind, old), "{old} is still there");
        if let Replacement::Name(new) | Replacement::Seconds(new) = now {
            assert!(is_known(*kind, new), "{old}: there is no {new}");
        }
    }
}
