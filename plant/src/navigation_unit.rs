//! Navigation unit: the sensors of an inertial navigation system, and the estimator behind them.
//!
//! ```text
//! motion -- every sample of the IMU --> Instruments (and their faults) -> Navigation -- every tick --> measured
//! ```
//!
//! The sensors are here and not in `navigation`, because they are physics: only their measurements and the expected
//! size of their errors pass to the estimator. The estimator starts near the true motion, with an error drawn from
//! `plant.sensors.alignment`, as after a transfer alignment: a flight begins in the air, where the position
//! is unknown before the first fix arrives. With `standing_s` the estimator aligns itself by the unit's own sensors, as
//! on the ground.

use contract::actuation::Actuation;
use contract::message::{Kinematics, Navigation as Account};
use nalgebra::Vector3;
use navigation::alignment::Standstill;
use navigation::state::{ATTITUDE, Covariance, POSITION, VELOCITY, turn};
use navigation::{Constants, ExpectedNoise, Filter, InitialErrors, Navigation, Source, State};
use rand_chacha::ChaCha8Rng;
use settings::{FilterName, Scenario, SensorsSettings};

use crate::faults::memory::Readings;
use crate::faults::sensors::SensorFaults;
use crate::instruments::{Instruments, draw, state_of};
use crate::memory::Tape;
use crate::random::Stream;

/// Smallest deviation at the start, in SI units: with a deviation of 0 the filter would never correct the state.
const MIN_DEVIATION: f64 = 1e-4;

/// Sources of each number of [`Account`]: a measurement of the receiver has one gate for its horizontal part and one
/// for its vertical part.
const GROUPS: [&[Source]; 5] = [
    &[Source::Position, Source::Depth],
    &[Source::Velocity, Source::Sink],
    &[Source::Height],
    &[Source::Heading],
    &[Source::Flow],
];

/// Sensors and estimator.
#[derive(Debug, Clone)]
pub struct NavigationUnit {
    instruments: Instruments,
    navigation: Navigation,
    random: ChaCha8Rng,
    sample_ns: u64,
    period_ns: u64,
    /// Time of the next sample of the IMU \[ns\].
    due_ns: u64,
}

impl NavigationUnit {
    /// Builds the unit of a vehicle that starts with `motion`; `None` if `scenario` has no EKF.
    pub fn new(scenario: &Scenario, motion: &Kinematics) -> Option<Self> {
        let settings = &scenario.plant.sensors;
        if settings.filter != FilterName::Ekf {
            return None;
        }
        let period_ns = (1e9 / settings.imu.rate_hz).round() as u64;
        let mut random = Stream::Navigation.open(scenario.run.seed);
        let mut instruments = Instruments::new(scenario, motion, period_ns, &mut random);
        let (noise, constants) = (instruments.noise(scenario), Instruments::constants(scenario));
        let standing = (settings.alignment.standing_s * settings.imu.rate_hz).round() as u64;
        let g_mps2 = scenario.airframe.g_mps2;
        let starts = if standing > 0 {
            let time_s = settings.alignment.standing_s;
            let aligned = |standstill: &Standstill| {
                let aligned = standstill.aligned(motion.position_m.into(), time_s, &noise, &constants, g_mps2);
                aligned.expect("the check refuses a unit without a magnetometer that tells the heading")
            };
            instruments.stand(motion, standing, &mut random).iter().map(aligned).collect()
        } else {
            vec![near(motion, settings, &noise, constants, &mut random); settings.imu.count]
        };
        let filters = starts.into_iter().map(|(state, covariance)| Filter::new(state, covariance, noise, g_mps2));

        let latency_ns = settings.receiver.latency_ms * 1e6;
        let delay = (latency_ns as u64).div_ceil(period_ns) as usize;
        Some(Self {
            instruments,
            navigation: Navigation::new(filters, constants, period_ns as f64 / 1e9, delay),
            random,
            sample_ns: scenario.sample_ns(),
            period_ns,
            due_ns: period_ns,
        })
    }

    /// Time of the next sample of the IMU \[ns\].
    pub fn due_ns(&self) -> u64 {
        self.due_ns
    }

    /// Returns the estimator.
    pub fn navigation(&self) -> &Navigation {
        &self.navigation
    }

    /// Measures the vehicle when a sample of the IMU is [due](Self::due_ns).
    pub fn measure(
        &mut self,
        motion: &Kinematics,
        actuators: &Actuation,
        wind_mps: &[f64; 3],
        faults: &mut SensorFaults,
    ) {
        let Self { instruments, navigation, random, sample_ns, period_ns, due_ns, .. } = self;
        let tick = *due_ns / *sample_ns;
        let inject = |readings: &mut Readings| faults.inject_all(tick, readings);
        let (imus, aiding) = instruments.measure(*due_ns, motion, actuators, wind_mps, inject, random);
        navigation.update(&imus, &aiding);
        *due_ns += *period_ns;
    }

    /// Estimates the motion at `now_ns`, at or after the last sample of the IMU, with the estimator's account of its
    /// errors.
    pub fn estimate(&self, now_ns: u64) -> (Kinematics, Account) {
        let ahead_s = self.ahead_s(now_ns);
        (self.motion(ahead_s), self.account(ahead_s))
    }

    /// Covariance of the error of [`estimate`](Self::estimate).
    pub fn covariance(&self, now_ns: u64) -> Covariance {
        self.navigation.covariance(self.ahead_s(now_ns))
    }

    /// Time from the last sample of the IMU to `now_ns` \[s\].
    fn ahead_s(&self, now_ns: u64) -> f64 {
        (now_ns + self.period_ns).saturating_sub(self.due_ns) as f64 / 1e9
    }

    fn account(&self, ahead_s: f64) -> Account {
        let variances = self.navigation.covariance(ahead_s).diagonal();
        let deviations = |from: usize| std::array::from_fn(|i| variances[from + i].max(0.0).sqrt());
        let of = |source: &Source| self.navigation.filter().record(*source);
        Account {
            position_m: deviations(POSITION),
            velocity_mps: deviations(VELOCITY),
            attitude_rad: deviations(ATTITUDE),
            innovations: GROUPS
                .map(|group| group.iter().map(|source| of(source).nis / source.gate()).fold(0.0, f64::max)),
            refused: GROUPS.map(|group| group.iter().map(|source| of(source).refused).sum::<f64>() as u64),
            resets: Source::ALL.iter().map(|source| of(source).resets).sum::<f64>() as u64,
            imu: self.navigation.imu() as u64 + 1,
            imus_sound: self.navigation.sound() as u64,
        }
    }

    fn motion(&self, ahead_s: f64) -> Kinematics {
        let (state, rates) = self.navigation.estimate(ahead_s);
        let (roll, pitch, yaw) = state.attitude.euler_angles();
        Kinematics {
            position_m: state.position_m.into(),
            velocity_mps: state.attitude.inverse_transform_vector(&state.velocity_mps).into(),
            attitude_rad: [roll, pitch, yaw],
            rates_radps: rates.into(),
        }
    }

    /// Writes or reads the memory.
    pub fn remember(&mut self, tape: &mut Tape) {
        self.instruments.remember(tape);
        self.navigation.visit(&mut |words| tape.words(words));
        tape.random(&mut self.random);
        tape.value(&mut self.due_ns);
    }
}

/// Draws a start near the true `motion`, by the deviations of the settings, with its covariance.
fn near(
    motion: &Kinematics,
    settings: &SensorsSettings,
    noise: &ExpectedNoise,
    constants: Constants,
    random: &mut ChaCha8Rng,
) -> (State, Covariance) {
    let (start, truth) = (&settings.alignment, state_of(motion));
    let [tilt, heading] = [start.tilt_deg, start.heading_deg].map(f64::to_radians);
    let off = draw(1.0, random).component_mul(&Vector3::new(tilt, tilt, heading));
    let state = State {
        position_m: truth.position_m + draw(start.position_m, random),
        velocity_mps: truth.velocity_mps + draw(start.velocity_mps, random),
        attitude: turn(off) * truth.attitude,
        ..State::default()
    };
    let [position_m, velocity_mps, tilt_rad, heading_rad] =
        [start.position_m, start.velocity_mps, tilt, heading].map(|deviation| deviation.max(MIN_DEVIATION));
    let start = InitialErrors { position_m, velocity_mps, tilt_rad, heading_rad, constants };
    (state, start.covariance(&state.attitude, noise))
}

#[cfg(test)]
mod tests;
