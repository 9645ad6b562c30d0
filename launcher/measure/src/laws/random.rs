//! Flights at random, and how many of them are survived.
//!
//! Every flight is a hover with 10 ms of delay. What it begins with and meets is drawn, each number uniformly and by itself:
//!
//! | drawn | from |
//! |---|---|
//! | roll at the start, from trim | -120 to 120 deg |
//! | pitch at the start | -85 to 85 deg |
//! | heading at the start | -90 to 90 deg |
//! | body rates at the start | -6 to 6 rad/s |
//! | mass of the vehicle over that of the model | 0.9 to 1.2 |
//! | payload, from 2 to 8 s | 0 to 0.2 kg |
//! | largest thrust over weight, the payload carried | 1.15 to 1.8 |
//! | gust from 4 s on for 2 s: speed; direction | 0 to 15 m/s; all round |
//!
//! The ranges are so wide that every law loses some.
//!
//! A flight is a function of seed and number, so that the first hundred of two hundred are the hundred.

use std::f64::consts::TAU;

use airframe::Trim;
use contract::Scenario;
use contract::scenario::{Fault, FaultKind, FaultTarget, ScenarioError, load};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;
use statrs::distribution::{Beta, ContinuousCDF};

/// One less this is the confidence of an interval.
const ALPHA: f64 = 0.05;

/// The first `count` flights of `seed`.
pub fn flights(seed: u64, count: u64) -> Result<Vec<Scenario>, ScenarioError> {
    let settings = [
        "mission.trajectory=hover",
        "run.mode=inprocess",
        "run.duration_s=15.0",
        "run.command_delay_ms=10.0",
        "plant.drag_linear_nspm=[0.2, 0.2, 0.1]",
        "plant.drag_quadratic_ns2pm2=0.02",
    ];
    let hover = load(None, &settings.map(str::to_owned))?;
    Ok((0..count).map(|number| flight(&hover, seed, number)).collect())
}

fn flight(hover: &Scenario, seed: u64, number: u64) -> Scenario {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    let mut within = |low: f64, high: f64| rng.random_range(low..=high);
    let mut flown = hover.clone();
    flown.name = format!("random-{number}");
    flown.run.seed = number;
    flown.initial.attitude_deg = [within(-120.0, 120.0), within(-85.0, 85.0), within(-90.0, 90.0)];
    flown.initial.rates_radps = std::array::from_fn(|_| within(-6.0, 6.0));
    let mass_kg = hover.airframe.mass_kg * within(0.9, 1.2);
    let payload_kg = within(0.0, 0.2);
    flown.plant.airframe.mass_kg = Some(mass_kg);
    flown.plant.rotor_speed_max_ratio = speed_ratio(hover, within(1.15, 1.8), mass_kg + payload_kg);
    let (gust_mps, towards_rad) = (within(0.0, 15.0), within(0.0, TAU));
    let vector = [gust_mps * libm::cos(towards_rad), gust_mps * libm::sin(towards_rad), 0.0];
    flown.fault = vec![
        Fault { value: Some(payload_kg), ..Fault::new(FaultTarget::Payload, FaultKind::Mass, 2.0, Some(6.0)) },
        Fault { vector: Some(vector), ..Fault::new(FaultTarget::Wind, FaultKind::Gust, 4.0, Some(2.0)) },
    ];
    flown
}

/// Highest speed over trim speed with which the sum of the thrusts is `thrust_to_weight` times the weight of `mass_kg`.
fn speed_ratio(scenario: &Scenario, thrust_to_weight: f64, mass_kg: f64) -> f64 {
    let vehicle = &scenario.airframe;
    let trim = Trim::solve(vehicle, scenario.mixer.tilt_reaction);
    let at_trim_n: f64 = trim.actuation.rotor_speed.iter().map(|omega| vehicle.kf * omega * omega).sum();
    (thrust_to_weight * mass_kg * vehicle.g_mps2 / at_trim_n).sqrt()
}

/// How many flights were survived, and what that says of the share of all such flights that would be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Rate {
    pub survived: usize,
    pub flights: usize,
    /// Ends of the exact 95 % interval of the share (Clopper and Pearson, Biometrika 26, 1934).
    pub low: f64,
    pub high: f64,
}

impl Rate {
    pub fn of(survived: &[bool]) -> Self {
        let (flights, survived) = (survived.len(), survived.iter().filter(|survived| **survived).count());
        let lost = flights - survived;
        // The ends are quantiles of the Beta distribution, but where one of its two numbers would be 0.
        let quantile =
            |a: usize, b: usize, share| Beta::new(a as f64, b as f64).map_or(f64::NAN, |beta| beta.inverse_cdf(share));
        let low = if survived == 0 { 0.0 } else { quantile(survived, lost + 1, ALPHA / 2.0) };
        let high = if lost == 0 { 1.0 } else { quantile(survived + 1, lost, 1.0 - ALPHA / 2.0) };
        Self { survived, flights, low, high }
    }

    pub fn share(&self) -> f64 {
        self.survived as f64 / self.flights as f64
    }
}

#[cfg(test)]
mod tests {
    use contract::scenario::{from_merged, to_toml};

    use super::*;

    /// Against values of R's `binom.test` and the tables of the method.
    #[test]
    fn val_the_interval_is_that_of_clopper_and_pearson() {
        let ends = |survived: usize, flights: usize| {
            let outcomes: Vec<bool> = (0..flights).map(|i| i < survived).collect();
            let Rate { low, high, .. } = Rate::of(&outcomes);
            [low, high]
        };
        // All of n: (alpha / 2)^(1 / n).
        for (ends, expected) in [
            (ends(10, 10), [0.025_f64.powf(0.1), 1.0]),
            (ends(0, 100), [0.0, 1.0 - 0.025_f64.powf(0.01)]),
            (ends(5, 10), [0.187_086, 0.812_914]),
            (ends(81, 263), [0.252_707_2, 0.367_632_4]),
        ] {
            assert!(
                (ends[0] - expected[0]).abs() < 1e-4 && (ends[1] - expected[1]).abs() < 1e-4,
                "{ends:?} {expected:?}"
            );
        }
    }

    #[test]
    fn the_flights_are_scenarios_each_its_own_and_the_same_again() {
        let drawn = flights(1, 20).unwrap();
        for flight in &drawn {
            assert_eq!(&from_merged(&to_toml(flight), "a random flight").unwrap(), flight);
            let loaded_kg = flight.plant.airframe.mass_kg.unwrap() + flight.fault[0].value.unwrap();
            let [o1, o2, o3] = flight.limits().rotor_speed_max;
            let thrust_n = flight.airframe.kf * (o1 * o1 + o2 * o2 + o3 * o3);
            let ratio = thrust_n / (loaded_kg * flight.airframe.g_mps2);
            assert!((1.15 - 1e-9..=1.8 + 1e-9).contains(&ratio), "{ratio}");
        }
        assert_eq!(drawn[..5], flights(1, 5).unwrap());
        assert!(drawn.windows(2).all(|two| two[0].initial != two[1].initial));
        assert_ne!(drawn[0].initial, flights(2, 1).unwrap()[0].initial);
    }
}
