//! Section of the page with the costs of a flight's disturbed ticks, or with the reason why they are not there.

use outcome::happenings::Happenings;
use replay::explain::Costs;

use crate::draw::escape;
use crate::explain::ShownCosts;

/// Makes the section of the page, with `happened` in its plots; empty if no tick was disturbed.
pub fn section(costs: &Costs, happened: &Happenings) -> String {
    let told = match costs {
        Costs::None => return String::new(),
        Costs::Known(explained) => ShownCosts { explained, happened }.section(),
        Costs::TooMany(ticks) => format!(
            "<p>{ticks} ticks were disturbed: <code>trefoil explain RUN</code> says what each of them cost, and writes \
             explain.html into the run’s folder.</p>"
        ),
        Costs::TooLong => "<p>The flight is long: <code>trefoil explain RUN</code> finds the costs.</p>".into(),
        Costs::Unknown(why) => {
            let why = escape(&format!("{why:#}"));
            format!("<p>Not known, because the flight cannot be flown again: {why}.</p>")
        }
    };
    format!("<section id=\"costs\"><h2>What disturbed ticks cost</h2>{told}</section>")
}
