//! Before a campaign is flown, refuses seeds that change no flight, because their flights would be copies of each
//! other.

use anyhow::ensure;

use crate::file::SEED;
use crate::plan::Plan;
use crate::row;

/// Largest number of pairs of flights with different seeds that are flown to find one pair that differs.
const TRIED: u64 = 64;

/// Checks that the listed seeds of a plan change a flight.
///
/// # Errors
/// The two flights of every tried pair are equal, and at least one of them could be flown.
pub fn check(plan: &Plan) -> anyhow::Result<()> {
    let axes = plan.listed_axes();
    let Some((_, axis)) = axes.iter().find(|(key, axis)| *key == SEED && axis.values > 1) else { return Ok(()) };
    let others = plan.flights() / axis.values;
    let mut is_flown = false;
    for i in 0..others.min(TRIED) {
        // Multiples of the golden ratio spread evenly and avoid every regular pattern of the flights.
        let place = if others > TRIED {
            ((u128::from(i.wrapping_mul(0x9E37_79B9_7F4A_7C15)) * u128::from(others)) >> 64) as u64
        } else {
            i
        };
        let first = place / axis.step * axis.step * axis.values + place % axis.step;
        // The limit's setting is in the middle of its range: at an end, for instance zero noise, nothing may be random.
        let at_middle: Vec<_> =
            plan.campaign.limit().map(|limit| limit.setting(limit.steps() / 2)).into_iter().collect();
        let hash = |number: u64| {
            row::fly(&plan.flight_with(number, &at_middle), || true, |_| {}).map(|flown| flown.hash().to_owned())
        };
        let hashes = [hash(first), hash(first + axis.step)];
        if hashes[0] != hashes[1] {
            return Ok(());
        }
        is_flown |= hashes[0].as_ref().is_some_and(|hash| !hash.is_empty());
    }
    ensure!(
        !is_flown,
        "seeds change no flight: nothing in it is random, and a copy is no evidence; remove `seeds`, or give noise \
         (`plant.noise`), turbulence or a fault with a probability"
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::Campaign;

    fn checked(text: &str) -> anyhow::Result<()> {
        let text = format!("{text}\n[settings]\nrun.duration_s = 0.5\n");
        check(&Plan::new(Campaign::read(&text, "x.toml", "x", Path::new("")).unwrap()).unwrap())
    }

    #[test]
    fn seeds_of_a_flight_without_randomness_are_refused() {
        let said = checked("seeds = 60").unwrap_err().to_string();
        assert!(said.contains("seeds change no flight"), "{said}");
        assert!(
            checked(
                "seeds = 3\n[vary]\nattitude.mpc.prediction_horizon_s = [0.2, 0.3]\nplant.airframe.mass_kg = [1.0, 1.1]"
            )
            .is_err()
        );
    }

    #[test]
    fn seeds_that_change_some_flights_are_flown() {
        checked("seeds = 3\n[vary]\nplant.noise.position_m = [0.0, 0.0001, 0.001]").unwrap();
        checked("seeds = 3\n[vary]\nrun.command_jitter_ms = [0.0, 8.0]").unwrap();
        checked("seeds = [7]").unwrap();
        checked("[vary]\nattitude.mpc.prediction_horizon_s = [0.2, 0.3]").unwrap();
    }
}
