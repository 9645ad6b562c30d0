//! `campaign.html`: shares passed, comparison of the controllers, effects of the factors, and the worst flights.
//!
//! | module | holds |
//! |---|---|
//! | `bounds` | the bounds, with the number of flights that have each |
//! | `setup` | program, sampling and campaign file, common to all flights |
//! | `promises` | verdicts on what the campaign file promises |
//! | `pairs` | the controllers compared draw by draw |
//! | [`differences`] | differences of the controllers in metrics |
//! | `data` | controllers, verdicts and position errors of the flights |
//! | `overview` | the head, the share of each controller, causes of failures, reasons of invalid flights |
//! | `bins` | the axis of a factor, with values or parts of its range |
//! | `factors` | each factor by itself |
//! | [`limits`] | the limits of `[limit]`, in place of the shares |
//! | `maps` | each pair of factors, with the border of sure differences |
//! | `worst` | the worst flights, flown again for the page |
//! | [`under_way`] | the page of a campaign that flies |

mod bins;
mod bounds;
mod data;
pub mod differences;
mod factors;
pub mod limits;
mod maps;
mod overview;
mod pairs;
pub mod promises;
mod setup;
pub mod under_way;
mod words;
mod worst;

use view::draw::{self, STYLE};

pub use data::CampaignPage;

const OWN_STYLE: &str = include_str!("../../assets/campaign.css");

/// Renders the page of some flights of a plan. The command `again`, followed by a number, flies one flight again.
pub fn page(all: &CampaignPage, again: &str) -> anyhow::Result<String> {
    let worst = worst::section(all, again)?;
    let body = [
        all.head(),
        promises::section(all),
        results(all),
        all.invalid(),
        factors::section(all),
        maps::section(all),
        worst,
        setup::section(all.plan),
    ];
    let title = format!("Campaign {}", all.plan.campaign.name());
    Ok(draw::page(&title, &format!("{STYLE}{OWN_STYLE}"), &body.concat()))
}

/// Returns the sections on the controllers: their limits, or their shares of passed flights.
fn results(all: &CampaignPage) -> String {
    if all.plan.campaign.limit().is_some() {
        return limits::section(all);
    }
    [all.controllers_section(), pairs::section(all), differences::section(all), all.causes()].concat()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::plan::Plan;
    use crate::rate::Rate;
    use crate::table::FlightTable;
    use crate::{Campaign, local, shard};

    /// Flies all flights of a campaign.
    fn flown(text: &str) -> (Plan, FlightTable) {
        let plan = Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let table = local::fly_all(&plan);
        (plan, table)
    }

    #[test]
    fn the_page_has_rates_border_and_the_worst_flights_with_their_commands() {
        let (plan, table) = flown(
            "samples = 3\n[settings]\nrun.duration_s = 1.0\n[vary]\nattitude.mpc.prediction_horizon_s = [0.04, 0.2]\n\
             attitude.mpc.control_horizon_s = [0.03, 0.05]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\nplant.airframe.mass_kg = { uniform = [1.0, 1.3] }\n",
        );
        assert_eq!(table.rows(), 24);
        assert_eq!(
            CampaignPage::new(&plan, &table).rates(),
            [("scenario", Rate::over(vec![(3, 6); 3]))],
            "6 that could not be flown are counted as neither"
        );
        let html = page(&CampaignPage::new(&plan, &table), "trefoil campaign x.toml --only").unwrap();
        for part in [
            "50.0 <small>%</small>",
            "14.6 to 85.4 %",
            "The 8 flights that a controller has of each of the 3 draws are one observation.",
            "3 draws are too few to say much.",
            "plant.airframe.mass_kg",
            "class=\"border\"",
            "<code>trefoil campaign x.toml --only ",
        ] {
            assert!(html.contains(part), "{part}");
        }
        assert_eq!(html.matches("class=\"worst\"").count(), 9, "those that failed");
    }

    #[test]
    fn the_page_says_why_flights_failed_or_could_not_be_flown() {
        let (plan, table) = flown(
            "[settings]\nrun.duration_s = 1.0\n[vary]\nattitude.mpc.prediction_horizon_s = [0.04, 0.2]\n\
             attitude.mpc.control_horizon_s = [0.03, 0.05]\n\
             bounds.max_position_error_m = [1e-9, 1.0]\n",
        );
        let html = page(&CampaignPage::new(&plan, &table), "").unwrap();
        for part in [
            "<th scope=\"col\">position error</th>",
            "<td data-label=\"position error\">3</td>",
            "`attitude.mpc.control_horizon_s` = 0.05 is longer than `attitude.mpc.prediction_horizon_s` = 0.04",
            "<td data-label=\"flights\">2</td><td data-label=\"the first\">4</td>",
            "m in 3 flights, 1 m in 3 flights; mixer",
            "Nothing is drawn: shares count what was listed, without interval or test.",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
    }

    #[test]
    fn several_controllers_are_compared_draw_by_draw_and_never_pooled() {
        let (plan, table) = flown(
            "seeds = 5\n[settings]\nrun.duration_s = 1.0\nplant.noise.position_m = 0.01\n[controller.lax]\nbounds.max_position_error_m = 1.0\n\
             [controller.strict]\nbounds.max_position_error_m = 1e-9\n",
        );
        let page_of = CampaignPage::new(&plan, &table);
        let verdicts = |rows: Vec<Option<usize>>| rows.into_iter().map(|row| page_of.passed[row?]).collect::<Vec<_>>();
        let cases: Vec<_> = page_of.by_case(|_| true).into_values().map(verdicts).collect();
        assert_eq!(cases, vec![vec![Some(true), Some(false)]; 5]);
        assert_eq!(page_of.rows(), 10);
        let html = page(&CampaignPage::new(&plan, &table), "").unwrap();
        assert!(
            html.contains("<td data-label=\"only A passes\">5</td><td data-label=\"only B passes\">0</td>"),
            "{html}"
        );
        assert!(
            html.contains("<td data-label=\"A less B\">+100.0 %</td>")
                && html.contains(">0.0625</td>")
                && !html.contains("<dt>passed</dt>"),
            "{html}"
        );
        assert_eq!(html.matches("The same case passed under lax.").count(), 5, "each case once");
    }

    #[test]
    fn copies_are_named_and_do_not_count_as_evidence() {
        let (plan, table) = flown(
            "samples = 4\n[settings]\nrun.duration_s = 0.5\n[vary]\nattitude.mpc.prediction_horizon_s = [0.2, 0.3]\n\
             plant.airframe.mass_kg = { uniform = [1.0, 1.1] }\n[controller.a]\nattitude.law = 'pid'\n\
             [controller.b]\nattitude.law = 'pid'\nattitude.mpc.control_horizon_s = 0.04\n[controller.mpc]\n\
             attitude.law = 'mpc'\n",
        );
        let html = page(&CampaignPage::new(&plan, &table), "").unwrap();
        for part in [
            "Of 24 flights 12 differ; the others are copies bit for bit.",
            "a and b flew every flight alike: they are one law.",
            "`attitude.mpc.prediction_horizon_s` had no effect under a and b:",
            ">a = b</td>",
        ] {
            assert!(html.contains(part), "{part}: {html}");
        }
        assert!(!html.contains("p, Holm"), "two laws are one comparison");
        let (plan, table) = flown(
            "samples = 40\n[settings]\nrun.duration_s = 0.2\nattitude.law = 'pid'\n[vary]\n\
             attitude.mpc.prediction_horizon_s = { uniform = [0.1, 0.5] }\n\
             [controller.lax]\nbounds.max_position_error_m = 1.0\n[controller.strict]\nbounds.max_position_error_m = 1e-9\n",
        );
        let html = page(&CampaignPage::new(&plan, &table), "").unwrap();
        assert!(html.contains("All 40 draws flew the same flights bit for bit: they are one observation"), "{html}");
        assert!(!html.contains("McNemar") && !html.contains("Clopper"), "{html}");
    }

    #[test]
    fn a_bound_is_named_with_the_flights_that_have_it() {
        let seconds = "[settings]\nrun.duration_s = 0.1\nbounds.max_altitude_error_m = 1.0\n";
        let (plan, table) = flown(&format!(
            "{seconds}[vary]\nplant.airframe.mass_kg = {{ range = {{ from = 1.0, to = 1.1, steps = 64 }} }}\n\
             bounds.max_position_error_m = [0.05, 0.5]\n"
        ));
        let html = page(&CampaignPage::new(&plan, &table), "").unwrap();
        assert_eq!(table.rows(), 128);
        assert!(html.contains("position error at most 0.05 m in 64 flights, 0.5 m in 64 flights"), "{html}");
        assert!(html.contains("altitude error at most 1 m;"), "{html}");
    }

    #[test]
    fn a_campaign_without_flights_has_a_page() {
        let plan = Plan::new(Campaign::read("", "x.toml", "x", Path::new("")).unwrap()).unwrap();
        let empty = FlightTable::new(&shard::columns_of(&plan));
        let html = page(&CampaignPage::new(&plan, &empty), "").unwrap();
        assert!(html.contains("0 of 1 flights are there"), "{html}");
    }
}
