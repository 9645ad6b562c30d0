//! What is measured: the true motion plus white Gaussian noise.

use contract::Scenario;
use contract::message::Kinematics;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::random::Stream;

/// The sensors and their random stream.
#[derive(Debug, Clone)]
pub struct Sensors {
    /// Standard deviations, in the units of [`Kinematics`].
    position_m: f64,
    velocity_mps: f64,
    attitude_rad: f64,
    rates_radps: f64,
    random: ChaCha8Rng,
}

impl Sensors {
    /// The sensors of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let noise = &scenario.plant.noise;
        Self {
            position_m: noise.position_m,
            velocity_mps: noise.velocity_mps,
            attitude_rad: noise.attitude_deg.to_radians(),
            rates_radps: noise.rates_dps.to_radians(),
            random: Stream::Noise.open(scenario.run.seed),
        }
    }

    /// One measurement of `actual`.
    ///
    /// With any noise on it draws all twelve numbers, so that one quantity's noise does not depend on another's.
    pub fn measure(&mut self, actual: &Kinematics) -> Kinematics {
        let mut measured = *actual;
        if self.position_m + self.velocity_mps + self.attitude_rad + self.rates_radps > 0.0 {
            self.blur(&mut measured.position_m, self.position_m);
            self.blur(&mut measured.velocity_mps, self.velocity_mps);
            self.blur(&mut measured.attitude_rad, self.attitude_rad);
            self.blur(&mut measured.rates_radps, self.rates_radps);
        }
        measured
    }

    fn blur(&mut self, values: &mut [f64; 3], deviation: f64) {
        for value in values {
            let normal: f64 = self.random.sample(StandardNormal);
            *value += deviation * normal;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MOTION: Kinematics = Kinematics {
        position_m: [1.0, -2.0, 3.0],
        velocity_mps: [0.5, 0.0, -0.5],
        attitude_rad: [0.1, 0.2, -3.0],
        rates_radps: [0.0, 4.0, 0.0],
    };

    fn sensors(seed: u64, position_m: f64, velocity_mps: f64, attitude_deg: f64, rates_dps: f64) -> Sensors {
        let mut scenario = Scenario::default();
        scenario.run.seed = seed;
        scenario.plant.noise = contract::scenario::Noise { position_m, velocity_mps, attitude_deg, rates_dps };
        Sensors::new(&scenario)
    }

    #[test]
    fn without_noise_the_truth_is_measured() {
        assert_eq!(sensors(1, 0.0, 0.0, 0.0, 0.0).measure(&MOTION), MOTION);
    }

    #[test]
    fn noise_repeats_with_the_seed_and_changes_with_it() {
        let mut same = [sensors(7, 0.1, 0.1, 0.1, 0.1), sensors(7, 0.1, 0.1, 0.1, 0.1)];
        let mut other = sensors(8, 0.1, 0.1, 0.1, 0.1);
        for _ in 0..10 {
            let first = same[0].measure(&MOTION);
            assert_eq!(first, same[1].measure(&MOTION));
            assert_ne!(first, other.measure(&MOTION));
        }
    }

    #[test]
    fn one_quantity_does_not_disturb_another() {
        let (mut alone, mut together) = (sensors(3, 0.0, 0.2, 0.0, 0.0), sensors(3, 0.1, 0.2, 0.3, 0.4));
        for _ in 0..10 {
            let [a, b] = [&mut alone, &mut together].map(|s| s.measure(&MOTION).velocity_mps.map(f64::to_bits));
            assert_eq!(a, b);
        }
    }

    #[test]
    fn noise_has_the_mean_deviation_and_independence_it_was_asked_for() {
        let n = 20_000;
        let mut sensors = sensors(42, 0.03, 0.05, 0.5, 2.0);
        let deviations = [0.03, 0.05, 0.5f64.to_radians(), 2f64.to_radians()];
        let rest = Kinematics::default();
        let draws: Vec<[f64; 12]> = (0..n)
            .map(|_| {
                let m = sensors.measure(&rest);
                let groups = [m.position_m, m.velocity_mps, m.attitude_rad, m.rates_radps];
                std::array::from_fn(|i| groups[i / 3][i % 3] / deviations[i / 3])
            })
            .collect();
        let mean = |f: &dyn Fn(&[f64; 12]) -> f64| draws.iter().map(f).sum::<f64>() / f64::from(n);
        let five_sigma = 5.0 / f64::from(n).sqrt();
        for i in 0..12 {
            assert!(mean(&|d| d[i]).abs() < five_sigma);
            assert!((mean(&|d| d[i] * d[i]) - 1.0).abs() < 2f64.sqrt() * five_sigma);
            for j in 0..i {
                assert!(mean(&|d| d[i] * d[j]).abs() < five_sigma);
            }
        }
    }
}
