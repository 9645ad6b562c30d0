//! `tune`: gains for the controllers of a campaign, by the procedure of its `[tune]`.

use std::path::PathBuf;
use std::sync::atomic::Ordering;

use anyhow::Context;
use campaign::{Campaign, search};
use clap::Args;
use contract::exit;
use flight::interrupts::catch_interrupts;
use folder::shipped::ShippedKind;
use runtime::console::{eprint_line, print};

use crate::progress::ProgressLine;
use crate::scenarios;

/// Arguments of `tune`.
#[derive(Args)]
#[command(
    after_help = "Prints the tuned settings of each controller, to be put into the file. docs/campaigns.md has the form \
of [tune], campaigns/protocol.toml an example."
)]
pub struct TuneArgs {
    /// Campaign file (TOML) with [tune], or the name of a shipped campaign
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Tune this controller only (repeatable)
    #[arg(long, value_name = "NAME")]
    controller: Vec<String>,
}

/// Returns the lines that a campaign needs to be tuned, for its first controller.
fn lines(campaign: &Campaign) -> String {
    let name = campaign.controllers.first().map_or("NAME", |(name, _)| name.as_str());
    format!(
        ". Add these lines, with the settings that shall be scaled in groups; docs/campaigns.md explains them:\n\n\
         [tune]\n\
         seed = 101        # of the training draws\n\
         samples = 10      # draws that each try flies\n\
         flights = 1000    # budget of each controller\n\
         scale.{name} = [[\"attitude.mpc.r.0\"], [\"attitude.mpc.r.1\", \"attitude.mpc.r.2\"]]"
    )
}

/// Searches and prints the gains; returns the exit code.
pub fn tune(args: &TuneArgs) -> anyhow::Result<u8> {
    scenarios::tell(ShippedKind::Campaign, &args.file);
    let campaign = Campaign::load(&args.file)?;
    let file = args.file.display();
    let tune = campaign.tune().with_context(|| format!("{file} has no [tune]{}", lines(&campaign)))?;
    let interrupts = catch_interrupts()?;
    let progress = ProgressLine::start();
    let show = |name: &str, flights: u64, cost: f64| {
        progress.show(|| format!("{name}: {flights} flights   least cost {cost:.4}"));
    };
    let found = search::search(tune, &campaign, &args.controller, || interrupts.load(Ordering::Relaxed) == 0, show);
    progress.finish();
    let Some(found) = found.with_context(|| file.to_string())? else {
        eprint_line("interrupted; nothing was written");
        return Ok(exit::INTERRUPTED);
    };
    let texts: Vec<String> = found.iter().map(search::Tuned::to_toml).collect();
    print(&texts.join("\n"));
    Ok(exit::FLOWN)
}
