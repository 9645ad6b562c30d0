//! Section "What was flown": the program, the sampling and the campaign file.

use flight::event::name;
use view::draw::{escape, list};

use crate::plan::Plan;
use crate::shard;

pub fn section(plan: &Plan) -> String {
    let campaign = &plan.campaign;
    let sampling = name(campaign.sampling());
    let samples = campaign.samples().map(|samples| ("samples".to_owned(), format!("{samples}, {sampling}")));
    let facts = [
        ("flights planned".to_owned(), plan.flights().to_string()),
        ("controllers".to_owned(), campaign.controllers.len().to_string()),
        ("seed of what is drawn".to_owned(), campaign.seed().to_string()),
        ("SHA-256 of the campaign".to_owned(), campaign.hash()[..12].to_owned()),
    ];
    format!(
        "<section id=\"setup\"><h2>What was flown</h2><p>Program <code>{}</code>.</p><div class=\"facts-list\">{}</div><details><summary>The campaign with its \
         scenario: all settings that are not defaults, what varies, the controllers</summary><pre>{}</pre></details></section>",
        escape(shard::program()),
        list(facts.into_iter().chain(samples)),
        escape(&campaign.merged())
    )
}
