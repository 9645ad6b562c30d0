//! Sensors of the navigation unit: IMU, satellite receiver, barometer, magnetometer, velocity over the ground.
//!
//! ```text
//! w = Log(R[k-1]' R[k]) / dt,   f = (R[k-1] Exp(w dt / 2))' ((v[k] - v[k-1]) / dt - g)      true means of a sample
//! measured = (1 + scale + misalignment) (w or f) + vibration + bias + noise, rounded
//! position, velocity: of the antenna, at the time that the receiver's clock shows
//! height   = -z - share |wind - v|^2 / (2 g) + rotors' pressure + bias + noise
//! ```
//!
//! The truth of the IMU is the difference of two motions, because an IMU integrates between two samples. The plant
//! integrates up to every sample of the IMU, so that samples have the IMU's rate and not that of the run.

use std::f64::consts::TAU;

use airframe::Trim;
use contract::actuation::Actuation;
use contract::message::Kinematics;
use libm::hypot;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use navigation::alignment::Standstill;
use navigation::{Aiding, Constants, ExpectedNoise, IMUS, Imu, State, Wander, state::turn};
use rand_chacha::ChaCha8Rng;
use settings::{Gyros, Magnetometer, Scenario, SensorSettings};

use crate::faults::memory::{ACCELERATION, FIELD, FLOW, HEIGHT, POSITION, RATES, Readings, SENSORS, VELOCITY};
use crate::memory::Tape;
use crate::random::normal;
use crate::sensor::Sensor;

/// Smallest deviation passed to the estimator, in the units of [`ExpectedNoise`]: the estimator divides by variances,
/// and a sensor without errors would have the variance 0.
const MIN_DEVIATION: f64 = 1e-4;

/// Changes that the filter expects: of the airspeed \[m/s\] and of the thrust, as a share of the weight, and the time
/// over which they happen \[s\]. The airspeed changes the wind's pressure, and the thrust the error of a misaligned
/// accelerometer.
const AIRSPEED_MPS: f64 = 5.0;
const THRUST_SHARE: f64 = 0.1;
const LEG_S: f64 = 10.0;
/// Time over which the barometer's bias walks \[s\].
const FLIGHT_S: f64 = 600.0;

/// Accelerometers and gyros.
#[derive(Debug, Clone)]
struct InertialSensors {
    accelerometer: Sensor,
    gyros: Sensor,
    /// Scale and misalignment of accelerometers and of gyros.
    shapes: [Matrix3<f64>; 2],
}

/// Sensors of a navigation unit.
#[derive(Debug, Clone)]
pub struct Instruments {
    imus: Vec<InertialSensors>,
    position: Sensor,
    velocity: Sensor,
    /// Barometer, magnetometer and sensor of the velocity over the ground; `None` if absent.
    barometer: Option<Sensor>,
    magnetometer: Option<Sensor>,
    flow: Option<Sensor>,
    /// Vibration at trim \[m/s2\].
    vibration: f64,
    /// Vibration at the speed of each rotor: amplitude at trim, body \[m/s2\], and phase \[rad\].
    lines: [(Vector3<f64>, f64); 3],
    /// Mean rotor speed at trim; one rotor speed unit counts as 1 rad/s.
    trim_speed: f64,
    /// Place of the antenna, body \[m\], and error of the receiver's clock \[s\].
    antenna_m: Vector3<f64>,
    clock_s: f64,
    /// Share of the wind's dynamic pressure at the barometer, and error of its height by the rotors at trim \[m\].
    wind_pressure: f64,
    rotor_pressure_m: f64,
    /// Field of the earth, NED, and of the vehicle, body, as shares of the strength of the earth's field.
    fields: [Vector3<f64>; 2],
    g_mps2: f64,
    period_s: f64,
    /// True attitude and velocity, NED, at the last sample of the IMU.
    before: (UnitQuaternion<f64>, Vector3<f64>),
    /// Last measurements without faults.
    readings: Readings,
}

impl Instruments {
    /// Builds the sensors of `scenario` on a vehicle with this `motion`, for samples `period_ns` apart. Draws the
    /// errors that stay constant.
    pub fn new(scenario: &Scenario, motion: &Kinematics, period_ns: u64, random: &mut ChaCha8Rng) -> Self {
        let (settings, white) = (&scenario.plant.sensors, &scenario.plant.noise);
        let degree = 1_f64.to_radians();
        let sensor = |settings: &SensorSettings, noise: f64, unit: f64| Sensor::new(settings, noise, unit, period_ns);
        let plain = |rate_hz: f64, density: f64, bias: f64, walk: f64| {
            let [noise_density, bias, bias_walk] = [density, bias, walk].map(|error| [error; 3]);
            sensor(&SensorSettings { noise_density, bias, bias_walk, rate_hz, ..SensorSettings::default() }, 0.0, 1.0)
        };
        let Gyros { noise_density, bias, bias_walk, quantum } = settings.rates;
        let gyros = SensorSettings { noise_density, bias, bias_walk, quantum, ..SensorSettings::default() };
        let optional = |rate_hz: f64, density, walk| (rate_hz > 0.0).then(|| plain(rate_hz, density, 0.0, walk));
        let (imu, barometer, flow) = (&settings.imu, &settings.barometer, &settings.flow);
        let receiver = &settings.receiver;
        let Magnetometer { rate_hz, noise_density, disturbance, declination_error_deg, inclination_deg } =
            settings.magnetometer;

        let mut shape = || {
            let scale = Matrix3::from_diagonal(&draw(imu.scale, random));
            Matrix3::identity() + scale + draw(imu.misalignment_deg * degree, random).cross_matrix()
        };
        let mut imu = || InertialSensors {
            accelerometer: plain(
                0.0,
                imu.acceleration_noise_density,
                imu.acceleration_bias_mps2,
                imu.acceleration_bias_walk,
            ),
            gyros: sensor(&gyros, white.rates_dps, degree),
            shapes: [shape(), shape()],
        };
        let imus = (0..settings.imu.count).map(|_| imu()).collect();
        let dip = turn(Vector3::y() * (-inclination_deg * degree));
        let declination = turn(Vector3::z() * (draw(declination_error_deg, random).z * degree));
        let field = draw(disturbance, random);
        let lines = std::array::from_fn(|_| {
            let direction = draw(1.0, random).try_normalize(0.0).unwrap_or_default();
            (direction * settings.imu.vibration_line_mps2, 0.0)
        });
        let antenna_m = draw(receiver.antenna_m, random);
        let rest = draw(1.0, random);
        let truth = state_of(motion);
        Self {
            imus,
            position: sensor(&settings.position, white.position_m, 1.0),
            velocity: sensor(&SensorSettings::from(&settings.velocity), white.velocity_mps, 1.0),
            barometer: optional(barometer.rate_hz, barometer.noise_density, barometer.bias_walk),
            magnetometer: optional(rate_hz, noise_density, 0.0),
            flow: optional(flow.rate_hz, flow.noise_density, 0.0),
            vibration: settings.imu.vibration_mps2,
            lines,
            trim_speed: trim_speed(scenario),
            antenna_m,
            clock_s: rest.x * receiver.clock_ms / 1e3,
            wind_pressure: rest.y * barometer.wind_pressure,
            rotor_pressure_m: rest.z * barometer.rotor_pressure_m,
            fields: [declination * (dip * Vector3::x()), field],
            g_mps2: scenario.airframe.g_mps2,
            period_s: period_ns as f64 / 1e9,
            before: (truth.attitude, truth.velocity_mps),
            readings: [[0.0; 3]; SENSORS],
        }
    }

    /// Errors that an estimator of this `scenario` expects: the deviations of the settings, at trim, not the drawn
    /// values.
    pub fn noise(&self, scenario: &Scenario) -> ExpectedNoise {
        let settings = &scenario.plant.sensors;
        let (imu, barometer, receiver) = (&settings.imu, &settings.barometer, &settings.receiver);
        let least = |deviation: f64| deviation.max(MIN_DEVIATION);
        let along = |sensor: &Sensor| Vector3::from(sensor.deviation());
        let of = |sensor: &Option<Sensor>| least(sensor.as_ref().map_or(0.0, |sensor| sensor.deviation()[0]));
        let line = imu.vibration_line_mps2 * mean_of_sine(0.0, trim_speed(scenario) * self.period_s).abs();
        let vibration = hypot(imu.vibration_mps2, line / 2_f64.sqrt());
        let turned = imu.misalignment_deg.to_radians() * THRUST_SHARE * self.g_mps2;
        let SensorSettings { bias, bias_walk, bias_s, .. } = settings.position;
        let time_s = if bias_s > 0.0 { bias_s } else { f64::INFINITY };
        let wind_m = barometer.wind_pressure * AIRSPEED_MPS * AIRSPEED_MPS / (2.0 * self.g_mps2);
        ExpectedNoise {
            specific_force_mps2: least(hypot(along(&self.imus[0].accelerometer).max(), vibration)),
            rates_radps: least(along(&self.imus[0].gyros).max()),
            acceleration_bias_walk: least(hypot(imu.acceleration_bias_walk, turned * (2.0 / LEG_S).sqrt())),
            rates_bias_walk: Vector3::from(settings.rates.bias_walk).max().to_radians(),
            position_m: along(&self.position).map(least),
            velocity_mps: along(&self.velocity).map(least),
            height_m: of(&self.barometer),
            wind_pressure: barometer.wind_pressure,
            field: of(&self.magnetometer),
            inclination_rad: settings.magnetometer.inclination_deg.to_radians(),
            flow_mps: of(&self.flow),
            antenna_m: receiver.antenna_m,
            clock_s: receiver.clock_ms / 1e3,
            drift: std::array::from_fn(|axis| {
                // One decaying process, of the size of both errors together, stands for the constant place of the
                // antenna and for the drift, which decays.
                let start = hypot(bias[axis], receiver.antenna_m);
                let share = if bias_s > 0.0 && bias[axis] > 0.0 { start / bias[axis] } else { 1.0 };
                Wander { start, walk: bias_walk[axis] * share, time_s }
            }),
            barometer: {
                let start = hypot(wind_m, barometer.rotor_pressure_m);
                let walk = hypot(barometer.bias_walk, wind_m * (2.0 / LEG_S).sqrt());
                // With this time constant the stationary deviation equals the one at the end of a flight of `FLIGHT_S`.
                let last = hypot(start, barometer.bias_walk * FLIGHT_S.sqrt());
                Wander {
                    start,
                    walk,
                    time_s: if walk > 0.0 { 2.0 * (last / walk) * (last / walk) } else { f64::INFINITY },
                }
            },
            hard_iron: Wander::stationary(settings.magnetometer.disturbance, f64::INFINITY),
        }
    }

    /// Constant errors that an estimator of this `scenario` expects. Under gravity, misalignment and scale of an
    /// accelerometer act as a bias.
    pub fn constants(scenario: &Scenario) -> Constants {
        let settings = &scenario.plant.sensors;
        let (imu, magnetometer) = (&settings.imu, &settings.magnetometer);
        let (g_mps2, bias) = (scenario.airframe.g_mps2, imu.acceleration_bias_mps2);
        let turned = hypot(bias, imu.misalignment_deg.to_radians() * g_mps2);
        Constants {
            acceleration_bias_mps2: Vector3::new(turned, turned, hypot(bias, imu.scale * g_mps2))
                .map(|deviation| deviation.max(MIN_DEVIATION)),
            rates_bias_radps: Vector3::from(settings.rates.bias).map(|bias| bias.to_radians().max(MIN_DEVIATION)),
            declination_rad: magnetometer.declination_error_deg.to_radians(),
        }
    }

    /// Measures `motion` at the end of a sample of the IMU at `now_ns`; `inject` changes the measurements.
    pub fn measure(
        &mut self,
        now_ns: u64,
        motion: &Kinematics,
        actuators: &Actuation,
        wind_mps: &[f64; 3],
        inject: impl FnOnce(&mut Readings),
        random: &mut ChaCha8Rng,
    ) -> ([Imu; IMUS], Aiding) {
        let truth = state_of(motion);
        let (attitude, velocity) = std::mem::replace(&mut self.before, (truth.attitude, truth.velocity_mps));
        let turned = (attitude.inverse() * truth.attitude).scaled_axis();
        let gravity = Vector3::new(0.0, 0.0, self.g_mps2);
        let acceleration = (truth.velocity_mps - velocity) / self.period_s;
        let force = (attitude * turn(turned * 0.5)).inverse_transform_vector(&(acceleration - gravity));
        let shakes = self.vibration * mean_speed(actuators) / self.trim_speed;
        let lines = self.vibrate(actuators);
        let rates_radps = turned / self.period_s;
        let antenna_m = truth.position_m + truth.attitude * self.antenna_m + truth.velocity_mps * self.clock_s;
        let antenna_mps =
            truth.velocity_mps + truth.attitude * rates_radps.cross(&self.antenna_m) + acceleration * self.clock_s;
        let height_m =
            -truth.position_m.z + self.pressure_m(&(Vector3::from(*wind_mps) - truth.velocity_mps), actuators);
        let back = truth.attitude.inverse();
        let field = back * self.fields[0] + self.fields[1];
        let body = back * truth.velocity_mps;

        let mut measured = [None; SENSORS];
        for (i, InertialSensors { accelerometer, gyros, shapes }) in self.imus.iter_mut().enumerate() {
            let shaken = shapes[0] * force + draw(shakes, random) + lines;
            let turning = shapes[1] * rates_radps;
            measured[ACCELERATION[i]] = accelerometer.measure(now_ns, shaken.into(), true, random);
            measured[RATES[i]] = gyros.measure(now_ns, turning.into(), true, random);
        }
        let mut measure = |sensor: &mut Sensor, truth: Vector3<f64>| sensor.measure(now_ns, truth.into(), true, random);
        let position = measure(&mut self.position, antenna_m);
        let velocity = measure(&mut self.velocity, antenna_mps);
        let height = self.barometer.as_mut().and_then(|sensor| measure(sensor, Vector3::repeat(height_m)));
        let field = self.magnetometer.as_mut().and_then(|sensor| measure(sensor, field));
        let flow = self.flow.as_mut().and_then(|sensor| measure(sensor, body));

        for (i, new) in [(POSITION, position), (VELOCITY, velocity), (FIELD, field), (HEIGHT, height), (FLOW, flow)] {
            measured[i] = new;
        }
        self.readings.iter_mut().zip(&measured).for_each(|(last, new)| *last = new.unwrap_or(*last));
        let mut readings = self.readings;
        inject(&mut readings);
        let new = |i: usize| measured[i].map(|_| Vector3::from(readings[i]));
        let imus = std::array::from_fn(|imu| Imu {
            specific_force_mps2: readings[ACCELERATION[imu]].into(),
            rates_radps: readings[RATES[imu]].into(),
        });
        let aiding = Aiding {
            position_m: new(POSITION),
            velocity_mps: new(VELOCITY),
            height_m: new(HEIGHT).map(|height| height.x),
            field: new(FIELD),
            flow_mps: new(FLOW).map(|flow| flow.xy()),
        };
        (imus, aiding)
    }

    /// Vibration in the specific force at the speeds of the rotors: the mean over a sample, body \[m/s2\].
    fn vibrate(&mut self, actuators: &Actuation) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for ((amplitude, phase), speed) in self.lines.iter_mut().zip(actuators.rotor_speed) {
            let turned = speed * self.period_s;
            let share = speed / self.trim_speed;
            sum += *amplitude * (share * share * mean_of_sine(*phase, turned));
            *phase = (*phase + turned) % TAU;
        }
        sum
    }

    /// Error of the barometer's height by the pressure of the air's flow past the vehicle and of the rotors \[m\].
    fn pressure_m(&self, airflow_mps: &Vector3<f64>, actuators: &Actuation) -> f64 {
        let share = mean_speed(actuators) / self.trim_speed;
        self.rotor_pressure_m * share * share - self.wind_pressure * airflow_mps.norm_squared() / (2.0 * self.g_mps2)
    }

    /// Measures a vehicle that stands still with `motion` for `samples` of the IMUs, without wind; then restarts the
    /// sensors' time for the flight. Returns the measurements of each IMU, with those of the other sensors.
    pub fn stand(&mut self, motion: &Kinematics, samples: u64, random: &mut ChaCha8Rng) -> Vec<Standstill> {
        let (period_ns, still) = ((self.period_s * 1e9).round() as u64, Actuation::default());
        let mut standstills = vec![Standstill::default(); self.imus.len()];
        for sample in 1..=samples {
            let (imus, aiding) = self.measure(sample * period_ns, motion, &still, &[0.0; 3], |_| {}, random);
            standstills.iter_mut().zip(&imus).for_each(|(standstill, imu)| standstill.add(imu, &aiding));
        }
        self.sensors().for_each(Sensor::rewind);
        standstills
    }

    fn sensors(&mut self) -> impl Iterator<Item = &mut Sensor> {
        let Self { imus, position, velocity, barometer, magnetometer, flow, .. } = self;
        let inertial = imus.iter_mut().flat_map(|imu| [&mut imu.accelerometer, &mut imu.gyros]);
        inertial.chain([position, velocity]).chain([barometer, magnetometer, flow].into_iter().flatten())
    }

    /// Writes or reads the memory.
    pub fn remember(&mut self, tape: &mut Tape) {
        self.sensors().for_each(|sensor| sensor.remember(tape));
        tape.value(&mut self.before.0);
        tape.value(&mut self.before.1);
        tape.value(&mut self.readings);
        self.lines.iter_mut().for_each(|(_, phase)| tape.value(phase));
    }
}

/// Mean of a sine over an angle from `phase` on.
fn mean_of_sine(phase: f64, angle: f64) -> f64 {
    if angle > 0.0 { (libm::cos(phase) - libm::cos(phase + angle)) / angle } else { libm::sin(phase) }
}

/// Mean rotor speed at trim \[rotor speed unit\].
fn trim_speed(scenario: &Scenario) -> f64 {
    mean_speed(&Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction).actuation)
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

/// Draws three normal numbers of the standard deviation `deviation`.
pub fn draw(deviation: f64, random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| deviation * normal(random))
}

fn mean_speed(actuators: &Actuation) -> f64 {
    actuators.rotor_speed.iter().sum::<f64>() / 3.0
}
