//! Page of a campaign under way: the parts of `campaign.html` that can be made of the present flights without flying
//! any again.

use rayon::ThreadPoolBuilder;
use view::draw::{self, STYLE, escape};

use super::data::CampaignPage;
use super::{OWN_STYLE, factors, limits, maps, pairs, setup, worst};
use crate::plan::Plan;
use crate::table::FlightTable;

/// Warning about the figures of an unfinished campaign.
const PARTIAL: &str = "The flights that are there are no random sample of the campaign: short ones end first. Intervals \
                       and sure differences hold for one look, at the end, and not for the first look at which they appear.";

/// Renders the page of the `flights` that are there, in one thread of the caller's priority; `words` tell the progress.
/// The command `again`, followed by a number, flies one flight again.
pub fn page(plan: &Plan, flights: &FlightTable, words: &str, again: &str) -> String {
    let render = || render(&CampaignPage::new(plan, flights), words, again);
    // The threads of the campaign would take up the work only after the last flight.
    match ThreadPoolBuilder::new().num_threads(1).build() {
        Ok(own) => own.install(render),
        Err(_) => render(),
    }
}

fn render(all: &CampaignPage, words: &str, again: &str) -> String {
    let (there, planned) = (all.rows(), all.plan.flights());
    let body = [
        all.title(),
        progress(there, planned, words),
        all.tiles(),
        all.counts(),
        all.causes(),
        all.invalid(),
        worst::listed(all, again),
        maps::section(all),
        factors::section(all),
        limits::section(all),
        pairs::section(all),
        setup::section(all.plan),
    ];
    let title = format!("Campaign {}, {there} of {planned} {}", all.plan.campaign.name(), all.plan.campaign.units());
    draw::page(&title, &format!("{STYLE}{OWN_STYLE}"), &body.concat())
}

fn progress(there: usize, all: u64, words: &str) -> String {
    format!(
        "<section id=\"progress\"><p role=\"status\">{}</p>\
         <progress aria-label=\"flights that are there\" max=\"{all}\" value=\"{there}\"></progress>\
         <p class=\"warn\">{PARTIAL}</p></section>",
        escape(words)
    )
}
