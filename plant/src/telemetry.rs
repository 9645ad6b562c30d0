//! Telemetry of the actuators: rotor speeds and tilt as sensed, with noise, some samples old.
//!
//! The noise of a tick depends on the seed and the tick alone.

use std::collections::VecDeque;

use airframe::Trim;
use contract::actuation::Actuation;
use rand_chacha::ChaCha8Rng;
use settings::Scenario;

use crate::memory::Tape;
use crate::random::{Stream, begin_tick, normal};

/// Sensors of rotor speeds and tilt.
#[derive(Debug, Clone)]
pub struct Telemetry {
    /// Standard deviations of the rotor speeds, then of the tilt \[rad\].
    deviations: [f64; 4],
    /// Positions from the age of a measurement until now, oldest first.
    past: VecDeque<Actuation>,
    random: ChaCha8Rng,
}

impl Telemetry {
    /// Builds the sensors of `scenario` for actuators at their `start`.
    pub fn new(scenario: &Scenario, start: &Actuation) -> Self {
        let settings = &scenario.plant.sensors.telemetry;
        let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction).actuation;
        let [one, two, three] = trim.rotor_speed.map(|speed| settings.rotor_speed_noise * speed);
        let age = (settings.latency_ms / 1e3 / scenario.sample_s() - 1e-6).ceil().max(0.0) as usize;
        Self {
            deviations: [one, two, three, settings.tilt_noise_deg.to_radians()],
            past: std::iter::repeat_n(*start, age + 1).collect(),
            random: Stream::Telemetry.open(scenario.run.seed),
        }
    }

    /// Stores the positions at a sample.
    pub fn observe(&mut self, actuators: &Actuation) {
        self.past.pop_front();
        self.past.push_back(*actuators);
    }

    /// Reads the sensors on `tick`.
    pub fn read(&mut self, tick: u64) -> Actuation {
        let mut sensed = self.past[0];
        if self.deviations != [0.0; 4] {
            begin_tick(&mut self.random, tick);
            let values = sensed.rotor_speed.iter_mut().chain([&mut sensed.tilt_rad]);
            for (value, deviation) in values.zip(self.deviations) {
                *value += deviation * normal(&mut self.random);
            }
        }
        sensed
    }

    /// Writes or reads the past positions. The memory of the vehicle has the present positions, so nothing is stored if
    /// measurements have no age.
    pub fn remember(&mut self, tape: &mut Tape, now: &Actuation) {
        let age = self.past.len() - 1;
        for actuators in self.past.iter_mut().take(age) {
            tape.value(actuators);
        }
        self.past[age] = *now;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn telemetry(age_ms: f64, noise: f64) -> Telemetry {
        let mut scenario = Scenario::default();
        let settings = &mut scenario.plant.sensors.telemetry;
        (settings.latency_ms, settings.rotor_speed_noise, settings.tilt_noise_deg) = (age_ms, noise, noise * 100.0);
        Telemetry::new(&scenario, &Actuation::default())
    }

    #[test]
    fn positions_arrive_after_their_age_in_whole_samples() {
        for (age_ms, samples) in [(0.0, 0), (5.0, 1), (10.0, 1), (25.0, 3)] {
            let mut telemetry = telemetry(age_ms, 0.0);
            for tick in 1..20 {
                telemetry.observe(&Actuation { tilt_rad: tick as f64, ..Actuation::default() });
                assert_eq!(telemetry.read(tick).tilt_rad, tick.saturating_sub(samples) as f64, "{age_ms} ms");
            }
        }
    }

    #[test]
    fn the_noise_has_its_deviation_and_depends_on_the_tick_alone() {
        let mut telemetry = telemetry(0.0, 0.01);
        let read: Vec<f64> = (0..4000).map(|tick| telemetry.read(tick).tilt_rad.to_degrees()).collect();
        let deviation = (read.iter().map(|x| x * x).sum::<f64>() / read.len() as f64).sqrt();
        assert!((deviation - 1.0).abs() < 0.05, "{deviation} deg and not 1");
        assert_eq!(telemetry.read(17).tilt_rad.to_degrees(), read[17]);
    }
}
