//! Flights of shipped campaigns.

use std::path::Path;

use anyhow::bail;
use campaign::page::{Page, promises};
use campaign::row::Standing;
use campaign::table::Table;
use campaign::{Campaign, Plan, local};
use flight::shipped::ROOT;
use outcome::target::Target;

/// Flights of a shipped campaign.
pub struct Flown {
    pub plan: Plan,
    pub flights: Table,
}

/// Flies the campaign `campaigns/NAME.toml` in process on all cores.
///
/// # Errors
/// There is no such campaign, or a flight of it cannot be flown.
pub fn fly(name: &str) -> anyhow::Result<Flown> {
    let plan = Plan::new(Campaign::load(&Path::new(ROOT).join(format!("campaigns/{name}.toml")))?)?;
    let flown = Flown { flights: local::fly_all(&plan), plan };
    match (0..flown.flights.rows()).find(|row| flown.text(*row, "verdict") == Standing::Invalid.name()) {
        Some(row) => bail!("flight {row} cannot be flown: {}", flown.text(row, "outcome")),
        None => Ok(flown),
    }
}

impl Flown {
    /// Returns the verdicts on the campaign's promises.
    pub fn targets(&self) -> Vec<Target> {
        promises::targets(&Page::new(&self.plan, &self.flights))
    }

    /// Returns a number of a row; NaN if it has none.
    pub fn number(&self, row: usize, column: &str) -> f64 {
        self.flights.column(column).and_then(|column| column.number(row)).unwrap_or(f64::NAN)
    }

    /// Returns a text of a row.
    pub fn text(&self, row: usize, column: &str) -> &str {
        self.flights.column(column).map_or("", |column| column.text(row))
    }
}

#[cfg(test)]
mod tests {
    use flight::shipped::{Kind, Shipped};
    use outcome::target::Verdict;

    use super::*;

    #[test]
    fn every_shipped_campaign_can_be_flown() {
        for shipped in Shipped::all(Kind::Campaign) {
            Plan::new(Campaign::load(Path::new(&shipped.origin())).unwrap()).unwrap().check().unwrap();
        }
    }

    #[test]
    fn the_vehicle_lands_without_a_controller_and_falls_without_a_mixer_or_a_rotor() {
        let flown = fly("brought-down").unwrap();
        for row in 0..flown.flights.rows() {
            let sink_mps = flown.number(row, "touchdown_sink_mps");
            let case = flown.text(row, "case");
            let must_land = ["guidance kill", "attitude-mpc kill"].contains(&case);
            assert_eq!(flown.text(row, "cause"), if must_land { "" } else { "crashed" }, "{case}");
            assert!(if must_land { sink_mps < 1.0 } else { sink_mps > 10.0 }, "{sink_mps}");
        }
        assert!(flown.targets().iter().all(|target| target.verdict == Verdict::Ok));
    }
}
