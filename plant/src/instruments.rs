//! Sensors of the navigation unit: IMU, satellite receiver, barometer, magnetometer, velocity over the ground.
//!
//! ```text
//! w = Log(R[k-1]' R[k]) / dt,   f = (R[k-1] Exp(w dt / 2))' ((v[k] - v[k-1]) / dt - g)      true means of a sample
//! measured = (1 + scale + misalignment) (w or f) + vibration + bias + noise, rounded
//! ```
//!
//! The truth of the IMU is the difference of two motions, as an IMU integrates between two samples; it needs of a
//! vehicle no more than its motion. The plant integrates up to every sample of the IMU, so that samples have the IMU's
//! rate and not that of the run.

use airframe::{Actuation, Trim};
use contract::Scenario;
use contract::message::Kinematics;
use contract::scenario::{Magnetometer, Sensor as Settings};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use navigation::alignment::Standstill;
use navigation::{Aiding, Imu, Noise, State, state::turn};
use rand_chacha::ChaCha8Rng;

use crate::faults::memory::{Readings, SENSORS};
use crate::memory::Tape;
use crate::random::normal;
use crate::sensor::Sensor;

/// Smallest deviation that the estimator is told, in the units of [`Noise`]: a sensor without errors has no variance to
/// divide by.
const MIN_DEVIATION: f64 = 1e-4;

/// Time after which the filter trusts its heading no further than the vehicle's own field allows \[s\].
const FIELD_S: f64 = 10.0;

/// Sensors of a navigation unit.
#[derive(Debug, Clone)]
pub struct Instruments {
    accelerometer: Sensor,
    gyros: Sensor,
    position: Sensor,
    velocity: Sensor,
    /// `None` if absent, like the two after it.
    barometer: Option<Sensor>,
    magnetometer: Option<Sensor>,
    flow: Option<Sensor>,
    /// Scale and misalignment of accelerometers and of gyros.
    shapes: [Matrix3<f64>; 2],
    /// Vibration per rotor speed unit \[m/s2\].
    vibration: f64,
    /// Field of the earth, NED, and of the vehicle, body, in shares of the strength of the first.
    fields: [Vector3<f64>; 2],
    g_mps2: f64,
    period_s: f64,
    /// Errors of position, NED, and height while the vehicle stood: its frame begins there \[m\].
    offset_m: (Vector3<f64>, f64),
    /// True attitude and velocity, NED, at the last sample of the IMU.
    before: (UnitQuaternion<f64>, Vector3<f64>),
    /// Last measurements without faults; of the attitude stands the magnetic field.
    readings: Readings,
}

impl Instruments {
    /// Builds the sensors of `scenario` on a vehicle with this `motion`, for samples `period_ns` apart. Errors that
    /// stay the same are drawn here.
    pub fn new(scenario: &Scenario, motion: &Kinematics, period_ns: u64, random: &mut ChaCha8Rng) -> Self {
        let (settings, white) = (&scenario.plant.sensors, &scenario.plant.noise);
        let degree = 1_f64.to_radians();
        let sensor = |settings: &Settings, noise: f64, unit: f64| Sensor::new(settings, noise, unit, period_ns);
        let plain = |rate_hz: f64, density: f64, bias: f64, walk: f64| {
            let [noise_density, bias, bias_walk] = [density, bias, walk].map(|error| [error; 3]);
            sensor(&Settings { noise_density, bias, bias_walk, rate_hz, ..Settings::default() }, 0.0, 1.0)
        };
        let optional = |rate_hz: f64, density, walk| (rate_hz > 0.0).then(|| plain(rate_hz, density, 0.0, walk));
        let (imu, barometer, flow) = (&settings.imu, &settings.barometer, &settings.flow);
        let Magnetometer { rate_hz, noise_density, disturbance, declination_error_deg, inclination_deg } =
            settings.magnetometer;

        let mut shape = || {
            let scale = Matrix3::from_diagonal(&draw(imu.scale, random));
            Matrix3::identity() + scale + draw(imu.misalignment_deg * degree, random).cross_matrix()
        };
        let shapes = [shape(), shape()];
        let dip = turn(Vector3::y() * (-inclination_deg * degree));
        let declination = turn(Vector3::z() * (draw(declination_error_deg, random).z * degree));
        let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction).actuation;
        let truth = state_of(motion);
        Self {
            accelerometer: plain(
                0.0,
                imu.acceleration_noise_density,
                imu.acceleration_bias_mps2,
                imu.acceleration_bias_walk,
            ),
            gyros: sensor(&settings.rates, white.rates_dps, degree),
            position: sensor(&settings.position, white.position_m, 1.0),
            velocity: sensor(&settings.velocity, white.velocity_mps, 1.0),
            barometer: optional(barometer.rate_hz, barometer.noise_density, barometer.bias_walk),
            magnetometer: optional(rate_hz, noise_density, 0.0),
            flow: optional(flow.rate_hz, flow.noise_density, 0.0),
            shapes,
            vibration: imu.vibration_mps2 / mean_speed(&trim),
            fields: [declination * (dip * Vector3::x()), draw(disturbance, random)],
            g_mps2: scenario.airframe.g_mps2,
            period_s: period_ns as f64 / 1e9,
            offset_m: (Vector3::zeros(), 0.0),
            before: (truth.attitude, truth.velocity_mps),
            readings: [[0.0; 3]; SENSORS],
        }
    }

    /// Errors that an estimator of this `scenario` expects: those of the data sheets, at trim.
    pub fn noise(&self, scenario: &Scenario) -> Noise {
        let settings = &scenario.plant.sensors;
        let least = |deviation: f64| deviation.max(MIN_DEVIATION);
        let along = |sensor: &Sensor| Vector3::from(sensor.deviation()).map(least);
        let of = |sensor: &Option<Sensor>| least(sensor.as_ref().map_or(0.0, |sensor| sensor.deviation()[0]));
        let imu = |sensor: &Sensor| least(Vector3::from(sensor.deviation()).max());
        Noise {
            specific_force_mps2: libm::hypot(imu(&self.accelerometer), settings.imu.vibration_mps2),
            rates_radps: imu(&self.gyros),
            acceleration_bias_walk: least(settings.imu.acceleration_bias_walk),
            rates_bias_walk: Vector3::from(settings.rates.bias_walk).max().to_radians(),
            position_m: along(&self.position),
            velocity_mps: along(&self.velocity),
            height_m: of(&self.barometer),
            field: libm::hypot(of(&self.magnetometer), constant_field(&settings.magnetometer)),
            flow_mps: of(&self.flow),
        }
    }

    /// Measures `motion` at the end of a sample of the IMU at `now_ns`; `inject` changes what is measured.
    pub fn measure(
        &mut self,
        now_ns: u64,
        motion: &Kinematics,
        actuators: &Actuation,
        inject: impl FnOnce(&mut Readings),
        random: &mut ChaCha8Rng,
    ) -> (Imu, Aiding) {
        let truth = state_of(motion);
        let (attitude, velocity) = std::mem::replace(&mut self.before, (truth.attitude, truth.velocity_mps));
        let turned = (attitude.inverse() * truth.attitude).scaled_axis();
        let gravity = Vector3::new(0.0, 0.0, self.g_mps2);
        let force = (truth.velocity_mps - velocity) / self.period_s - gravity;
        let force = (attitude * turn(turned * 0.5)).inverse_transform_vector(&force);
        let shaken = self.shapes[0] * force + draw(self.vibration * mean_speed(actuators), random);
        let back = truth.attitude.inverse();
        let field = back * self.fields[0] + self.fields[1];
        let body = back * truth.velocity_mps;

        let mut measure = |sensor: &mut Sensor, truth: Vector3<f64>| sensor.measure(now_ns, truth.into(), true, random);
        let specific_force = measure(&mut self.accelerometer, shaken);
        let rates = measure(&mut self.gyros, self.shapes[1] * turned / self.period_s);
        let position = measure(&mut self.position, truth.position_m);
        let velocity = measure(&mut self.velocity, truth.velocity_mps);
        let height = self.barometer.as_mut().and_then(|sensor| measure(sensor, truth.position_m));
        let field = self.magnetometer.as_mut().and_then(|sensor| measure(sensor, field));
        let flow = self.flow.as_mut().and_then(|sensor| measure(sensor, body));

        let position = position.map(|position_m| (Vector3::from(position_m) - self.offset_m.0).into());
        let height = height.map(|[_, _, down_m]| [-down_m - self.offset_m.1; 3]);
        let measured = [position, velocity, field, rates, specific_force, height, flow];
        self.readings.iter_mut().zip(&measured).for_each(|(last, new)| *last = new.unwrap_or(*last));
        let mut readings = self.readings;
        inject(&mut readings);
        let new = |i: usize| measured[i].map(|_| Vector3::from(readings[i]));
        let imu = Imu { specific_force_mps2: readings[4].into(), rates_radps: readings[3].into() };
        let aiding = Aiding {
            position_m: new(0),
            velocity_mps: new(1),
            height_m: new(5).map(|height| height.x),
            field: new(2),
            flow_mps: new(6).map(|flow| flow.xy()),
        };
        (imu, aiding)
    }

    /// Measures a vehicle that has stood with `motion` for `samples` of the IMU; then the time of the flight begins.
    /// Its frame begins there too: position and height are from then on relative to their means.
    pub fn stand(&mut self, motion: &Kinematics, samples: u64, random: &mut ChaCha8Rng) -> Standstill {
        let (period_ns, still) = ((self.period_s * 1e9).round() as u64, Actuation::default());
        let mut standstill = Standstill::default();
        for sample in 1..=samples {
            let (imu, aiding) = self.measure(sample * period_ns, motion, &still, |_| {}, random);
            standstill.add(&imu, &aiding);
        }
        self.sensors().for_each(Sensor::rewind);
        let (truth, (position_m, height_m)) = (Vector3::from(motion.position_m), standstill.place());
        self.offset_m = (position_m - truth, height_m + truth.z);
        standstill
    }

    fn sensors(&mut self) -> impl Iterator<Item = &mut Sensor> {
        let Self { accelerometer, gyros, position, velocity, .. } = self;
        let aiding = [&mut self.barometer, &mut self.magnetometer, &mut self.flow].into_iter().flatten();
        [accelerometer, gyros, position, velocity].into_iter().chain(aiding)
    }

    /// Writes or reads the memory.
    pub fn remember(&mut self, tape: &mut Tape) {
        self.sensors().for_each(|sensor| sensor.remember(tape));
        tape.numbers(self.before.0.as_mut_unchecked().coords.as_mut_slice());
        tape.numbers(self.before.1.as_mut_slice());
        tape.numbers(self.readings.as_flattened_mut());
    }
}

/// Deviation that white noise of the magnetometer must have for a mean over [`FIELD_S`] to err as the vehicle's own
/// field does, which stays: else the filter would learn a heading that is wrong, and the tilt with it.
fn constant_field(settings: &Magnetometer) -> f64 {
    settings.disturbance * (settings.rate_hz * FIELD_S).max(1.0).sqrt()
}

/// State of an estimator without an error.
pub fn state_of(motion: &Kinematics) -> State {
    let [roll, pitch, yaw] = motion.attitude_rad;
    let attitude = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    State {
        position_m: motion.position_m.into(),
        velocity_mps: attitude * Vector3::from(motion.velocity_mps),
        attitude,
        ..State::default()
    }
}

/// Draws three normal numbers.
pub fn draw(deviation: f64, random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| deviation * normal(random))
}

fn mean_speed(actuators: &Actuation) -> f64 {
    actuators.rotor_speed.iter().sum::<f64>() / 3.0
}
