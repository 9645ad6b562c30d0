//! Navigation unit: the sensors of an inertial navigation system, and the estimator behind them.
//!
//! ```text
//! motion -- every sample of the IMU --> Instruments (and their faults) -> Navigation -- every tick --> measured
//! ```
//!
//! The sensors are here and not in `navigation`, because they are physics: only their measurements, and how large their
//! errors are said to be, pass to the estimator. It does not know scale, misalignment, vibration at other rotor speeds,
//! and the drift of receiver and barometer; the unit adds what these make of position and attitude to the deviations
//! that it publishes. It starts near the true motion, with an error drawn from
//! `plant.sensors.alignment`, as after an alignment on another vehicle: a flight begins in the air, where nothing tells
//! the position before the first fix arrives. With `standing_s` it aligns itself by its own sensors, as on the ground.

use airframe::Actuation;
use contract::Scenario;
use contract::message::{Kinematics, Navigation as Account};
use contract::scenario::{Filter as Choice, Magnetometer, Sensors};
use nalgebra::Vector3;
use navigation::state::{Covariance, turn};
use navigation::{Filter, Navigation, Source, State, initial_covariance};
use rand_chacha::ChaCha8Rng;

use crate::faults::memory::Readings;
use crate::faults::sensors::SensorFaults;
use crate::instruments::{Instruments, draw, state_of};
use crate::memory::Tape;
use crate::random::Stream;

/// Smallest deviation at the start, in SI units: without one the filter would never learn.
const MIN_DEVIATION: f64 = 1e-4;

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
    unseen: Unseen,
}

/// Errors that no sensor tells the estimator, so that its covariance shrinks below them: constants of the instruments,
/// and the drift of receiver and barometer.
#[derive(Debug, Clone, Copy)]
struct Unseen {
    /// Variance of the position, NED, at the start \[m2\] and per second \[m2/s\].
    position: [(f64, f64); 3],
    /// Standard deviation of the attitude, as turns about the body axes \[rad\].
    attitude_rad: [f64; 3],
}

impl Unseen {
    fn new(settings: &Sensors) -> Self {
        let Magnetometer { disturbance, declination_error_deg, inclination_deg, .. } = settings.magnetometer;
        let position = std::array::from_fn(|axis| {
            let walk = settings.position.bias_walk[axis];
            let walk = if axis == 2 { walk.max(settings.barometer.bias_walk) } else { walk };
            (settings.position.bias[axis] * settings.position.bias[axis], walk * walk)
        });
        let tilt = settings.imu.misalignment_deg.to_radians();
        let field = disturbance / libm::cos(inclination_deg.to_radians());
        let heading = libm::hypot(declination_error_deg.to_radians(), field);
        Self { position, attitude_rad: [tilt, tilt, libm::hypot(tilt, heading)] }
    }
}

impl NavigationUnit {
    /// Builds the unit of a vehicle that starts with `motion`; `None` if `scenario` has no EKF.
    pub fn new(scenario: &Scenario, motion: &Kinematics) -> Option<Self> {
        let settings = &scenario.plant.sensors;
        if settings.filter != Choice::Ekf {
            return None;
        }
        let period_ns = (1e9 / settings.imu.rate_hz).round() as u64;
        let mut random = Stream::Navigation.open(scenario.run.seed);
        let mut instruments = Instruments::new(scenario, motion, period_ns, &mut random);
        let noise = instruments.noise(scenario);
        let standing = (settings.alignment.standing_s * settings.imu.rate_hz).round() as u64;
        let (state, covariance) = if standing > 0 {
            let standstill = instruments.stand(motion, standing, &mut random);
            let bias_mps2 = settings.imu.acceleration_bias_mps2.max(MIN_DEVIATION);
            let aligned = standstill.aligned(&noise, bias_mps2, scenario.airframe.g_mps2);
            let (state, covariance) =
                aligned.expect("the check refuses a unit without a magnetometer that tells the heading");
            (State { position_m: motion.position_m.into(), ..state }, covariance)
        } else {
            near(motion, settings, &mut random)
        };
        let filter = Filter::new(state, covariance, noise, scenario.airframe.g_mps2);

        let latency_ns = settings.position.latency_ms.max(settings.velocity.latency_ms) * 1e6;
        let delay = (latency_ns as u64).div_ceil(period_ns) as usize;
        Some(Self {
            instruments,
            navigation: Navigation::new(filter, period_ns as f64 / 1e9, delay),
            random,
            sample_ns: scenario.sample_ns(),
            period_ns,
            due_ns: period_ns,
            unseen: Unseen::new(settings),
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
    pub fn measure(&mut self, motion: &Kinematics, actuators: &Actuation, faults: &mut SensorFaults) {
        let Self { instruments, navigation, random, sample_ns, period_ns, due_ns, .. } = self;
        let tick = *due_ns / *sample_ns;
        let inject = |readings: &mut Readings| faults.inject_all(tick, readings);
        let (imu, aiding) = instruments.measure(*due_ns, motion, actuators, inject, random);
        navigation.update(&imu, &aiding);
        *due_ns += *period_ns;
    }

    /// Estimates the motion at `now_ns`, at or after the last sample of the IMU, with what the estimator knows of its
    /// errors.
    pub fn estimate(&self, now_ns: u64) -> (Kinematics, Account) {
        let ahead_s = (now_ns + self.period_ns).saturating_sub(self.due_ns) as f64 / 1e9;
        (self.motion(ahead_s), self.account(now_ns, ahead_s))
    }

    fn account(&self, now_ns: u64, ahead_s: f64) -> Account {
        let [position_m, velocity_mps, attitude_rad] = self.navigation.deviations(ahead_s).map(<[f64; 3]>::from);
        let now_s = now_ns as f64 / 1e9;
        let drift_m = self.unseen.position.map(|(start, rate)| (start + rate * now_s).sqrt());
        let with = |seen: [f64; 3], unseen: [f64; 3]| std::array::from_fn(|axis| libm::hypot(seen[axis], unseen[axis]));
        let records = Source::ALL.map(|source| (source, self.navigation.filter().record(source)));
        Account {
            position_m: with(position_m, drift_m),
            velocity_mps,
            attitude_rad: with(attitude_rad, self.unseen.attitude_rad),
            innovations: records.map(|(source, record)| record.nis / source.gate()),
            refused: records.map(|(_, record)| record.refused as u64),
            resets: records.iter().map(|(_, record)| record.resets as u64).sum(),
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
        self.navigation.visit(&mut |number| tape.number(number));
        tape.random(&mut self.random);
        tape.word(&mut self.due_ns);
    }
}

/// Draws a start near the true `motion`, by the deviations of the settings, with its covariance.
fn near(motion: &Kinematics, settings: &Sensors, random: &mut ChaCha8Rng) -> (State, Covariance) {
    let (start, truth) = (&settings.alignment, state_of(motion));
    let [tilt, heading] = [start.tilt_deg, start.heading_deg].map(f64::to_radians);
    let off = draw(1.0, random).component_mul(&Vector3::new(tilt, tilt, heading));
    let state = State {
        position_m: truth.position_m + draw(start.position_m, random),
        velocity_mps: truth.velocity_mps + draw(start.velocity_mps, random),
        attitude: turn(off) * truth.attitude,
        ..State::default()
    };
    let rates_bias = Vector3::from(settings.rates.bias).max().to_radians();
    let deviations =
        [start.position_m, start.velocity_mps, tilt, heading, settings.imu.acceleration_bias_mps2, rates_bias];
    let covariance = initial_covariance(&state.attitude, &deviations.map(|least| least.max(MIN_DEVIATION)));
    (state, covariance)
}

#[cfg(test)]
mod tests;
