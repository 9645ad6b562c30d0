//! Verdicts on targets as a table of a page.

use flight::event::name;
use outcome::target::{Target, TargetVerdict};

use crate::draw::{DASH, escape, table};

/// Makes the table of the verdicts.
pub fn targets(all: &[Target]) -> String {
    let row = |target: &Target| {
        let colour = match target.verdict {
            TargetVerdict::Ok => "good",
            TargetVerdict::Short => "bad",
            TargetVerdict::Inconclusive => "warn",
        };
        vec![
            format!("<strong style=\"color:var(--{colour})\">{}</strong>", name(target.verdict)),
            escape(&target.figure),
            escape(&target.measured_text(DASH)),
            escape(&target.target),
            escape(&target.note),
        ]
    };
    table(&["verdict", "figure", "measured", "target", "note"], all.iter().map(row))
}
