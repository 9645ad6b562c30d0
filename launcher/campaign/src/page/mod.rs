//! `campaign.html`: how often, which controller more, where the border is, and which are the worst.
//!
//! | module | holds |
//! |---|---|
//! | `setup` | what all flights have in common, and their bounds |
//! | `pairs` | the controllers compared draw by draw |
//! | `data` | whose flights they are, whether they passed, how far off they were |
//! | `overview` | the head, the share of each controller, why flights failed or could not be flown |
//! | `bins` | the values of a factor, few enough to stand on an axis |
//! | `factors` | each factor by itself |
//! | `maps` | every two factors, with the border |
//! | `worst` | the flights that went worst, flown again for the page |

mod bins;
mod data;
mod factors;
mod maps;
mod overview;
mod pairs;
mod setup;
mod worst;

use view::draw::{self, STYLE};

use crate::plan::Plan;
use crate::rate::Rate;
use crate::table::Table;
use data::Page;

const OWN_STYLE: &str = include_str!("../../assets/campaign.css");

/// How many of its flights each controller passes; those that could not be flown are not counted.
pub fn rates<'a>(plan: &'a Plan, flights: &'a Table) -> Vec<(&'a str, Rate)> {
    let page = Page::new(plan, flights);
    let of = |i: usize| page.rate(|row| page.controllers[row] == i);
    page.names.iter().enumerate().map(|(i, name)| (*name, of(i))).collect()
}

/// The page of some flights of a plan. `again` with a number behind it is what a user types to fly one again.
pub fn page(plan: &Plan, flights: &Table, again: &str) -> anyhow::Result<String> {
    let all = Page::new(plan, flights);
    let worst = worst::section(&all, again)?;
    let names: Vec<&str> = all.names.clone();
    let body = [
        all.head(),
        all.controllers_section(),
        pairs::section(&names, &all.by_draw()),
        all.causes(),
        all.invalid(),
        factors::section(&all),
        maps::section(&all),
        worst,
        setup::section(plan),
    ];
    let title = format!("Campaign {}", plan.campaign.name());
    Ok(draw::page(&title, &format!("{STYLE}{OWN_STYLE}"), &body.concat()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::{Campaign, outcome, shard};

    /// All flights of a campaign.
    fn flown(text: &str) -> (Plan, Table) {
        let plan = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let mut table = Table::new(&shard::columns(&plan));
        for number in 0..plan.flights() {
            let flight = plan.flight(number);
            let outcome = outcome::fly(&flight, || true, |_| {}).unwrap();
            table.push([plan.cells(&flight), outcome.cells].concat());
        }
        (plan, table)
    }

    #[test]
    fn the_page_has_rates_border_and_the_worst_flights_with_their_commands() {
        let (plan, table) = flown(
            "samples = 3\n[settings]\nrun.duration_s = 1.0\n[vary]\nmpc.np = [4, 20]\nmpc.nu = [3, 5]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\nplant.airframe.mass_kg = { uniform = [1.0, 1.3] }\n",
        );
        assert_eq!(table.rows(), 24);
        assert_eq!(
            rates(&plan, &table),
            [("scenario", Rate::of(9, 18))],
            "6 that could not be flown are counted as neither"
        );
        let html = page(&plan, &table, "launcher campaign x.toml --only").unwrap();
        for part in [
            "50.0 <small>%</small>",
            "26.0 to 74.0 %",
            "plant.airframe.mass_kg",
            "class=\"border\"",
            "<code>launcher campaign x.toml --only ",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("class=\"worst\"").count(), 9, "those that failed");
    }

    #[test]
    fn the_page_says_why_flights_failed_or_could_not_be_flown() {
        let (plan, table) = flown(
            "[settings]\nrun.duration_s = 1.0\n[vary]\nmpc.np = [4, 20]\nmpc.nu = [3, 5]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\n",
        );
        let html = page(&plan, &table, "").unwrap();
        for part in [
            "<th scope=\"col\">position error</th>",
            "<td data-label=\"position error\">3</td>",
            "`mpc.nu` = 5 is longer than `mpc.np` = 4",
            "<td data-label=\"flights\">2</td><td data-label=\"the first\">1</td>",
            "position error by a limit that is not the same in all flights",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
    }

    #[test]
    fn several_controllers_are_compared_draw_by_draw_and_never_pooled() {
        let (plan, table) = flown(
            "seeds = 5\n[settings]\nrun.duration_s = 1.0\n[controller.lax]\nbounds.max_position_error_m = 1.0\n\
             [controller.strict]\nbounds.max_position_error_m = 1e-9\n",
        );
        let page_of = Page::new(&plan, &table);
        assert_eq!(page_of.by_draw(), vec![vec![Some(true), Some(false)]; 5]);
        assert_eq!(page_of.rows(), 10);
        let html = page(&plan, &table, "").unwrap();
        assert!(
            html.contains("<td data-label=\"only A passes\">5</td><td data-label=\"only B passes\">0</td>"),
            "{html}"
        );
        assert!(html.contains(">0.0625</td>") && !html.contains("<dt>passed</dt>"), "{html}");
        assert_eq!(html.matches("The same draw passed under lax.").count(), 5, "each draw once");
    }

    #[test]
    fn a_page_of_no_flights_is_a_page() {
        let plan = Plan::new(Campaign::read("", "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let html = page(&plan, &Table::new(&shard::columns(&plan)), "").unwrap();
        assert!(html.contains("0 of 1 flights are there"), "{html}");
    }
}
