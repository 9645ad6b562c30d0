//! `scenarios`: lists the scenarios and campaigns that are part of the program, or prints one.

use std::path::{Path, PathBuf};

use anyhow::bail;
use folder::shipped::{Shipped, ShippedKind, advice};
use runtime::console::{eprint_line, print};

/// Arguments of `scenarios`.
#[derive(clap::Args)]
#[command(
    after_help = "Every command that takes a scenario or campaign file takes these names too. If there is a file of that \
name, the file wins; a folder of that name does not."
)]
pub struct ScenariosArgs {
    /// Scenario or campaign to print
    name: Option<PathBuf>,
}

/// Prints the list, or the scenario or campaign that is named.
pub fn scenarios(args: &ScenariosArgs) -> anyhow::Result<()> {
    let Some(name) = &args.name else {
        print(&format!("{}\n{}", list("Scenarios", ShippedKind::Scenario), list("Campaigns", ShippedKind::Campaign)));
        return Ok(());
    };
    // Only shipped files are printed, so a user's file of the same name does not matter.
    let named =
        |kind| Shipped::all(kind).find(|shipped| [shipped.name(), shipped.path].map(Path::new).contains(&&**name));
    let Some(shipped) = named(ShippedKind::Scenario).or_else(|| named(ShippedKind::Campaign)) else {
        let nearest = |kind| advice(kind, name).filter(|advice| advice.starts_with("did you mean"));
        let meant = nearest(ShippedKind::Scenario).or_else(|| nearest(ShippedKind::Campaign));
        let meant = meant.map_or(String::new(), |advice| format!("{advice}? "));
        bail!("there is no scenario or campaign `{}`; {meant}`trefoil scenarios` lists them", name.display());
    };
    print(shipped.text());
    Ok(())
}

/// Lists the names of a kind, each with the first sentence of its comment.
fn list(title: &str, kind: ShippedKind) -> String {
    let width = Shipped::all(kind).map(|shipped| shipped.name().len()).max().unwrap_or(0);
    let line = |shipped: Shipped| format!("  {:width$}  {}\n", shipped.name(), first_sentence(&shipped.comment()));
    Shipped::all(kind).map(line).fold(format!("{title}:\n"), |text, line| text + &line)
}

fn first_sentence(text: &str) -> &str {
    text.split_once(". ").map_or(text, |(first, _)| first).trim_end_matches('.')
}

/// Notes on stderr that the shipped file is taken for `path`, if a file of the user may have been meant.
pub fn tell(kind: ShippedKind, path: &Path) {
    if let Some(shipped) = Shipped::find(kind, path).filter(|shipped| shipped.may_be_mistaken(path)) {
        eprint_line(&format!("note: no file `{}`; {} is part of the launcher", path.display(), shipped.path));
    }
}
