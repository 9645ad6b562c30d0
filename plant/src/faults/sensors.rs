//! Faults of the sensors, which change the measurements but not the true motion.
//!
//! ```text
//! off            NaN: no measurement
//! stuck          the last measurement before the fault
//! garbage        NaN, infinite or random bits, on the share `probability` of the ticks
//! wrong          m + value (bias, on every axis), m value (scale), -m (sign)
//! slow           y = y + (1 - exp(-Ts / tau)) (m - y), with tau = `ms`, from the last measurement before the fault
//! delayed        the measurement `ms` ago, rounded up to whole samples, without any fault
//! intermittent   off, on the share `probability` of the ticks
//! noise          m + value n, n white, normal and independent on every axis
//! ```
//!
//! Behind the EKF the faults act on its sensors: those of position and velocity on the receiver, of rates on the gyros.
//! The measurement m includes the scenario's noise
//! and the effects of earlier faults of the same sensor.

use contract::Scenario;
use contract::fault_schedule::{Entry, FaultSchedule, MAX_SENSOR_DELAY_MS};
use contract::message::Kinematics;
use contract::scenario::{Fault, FaultKind, FaultTarget, Mode, Wrong};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::memory::{Filter, Past, Reading, Readings};
use crate::memory::Tape;
use crate::random::{Stream, begin_tick, normal};

/// Default share of the ticks on which a garbage sensor returns garbage.
const GARBAGE_SHARE: f64 = 1.0;
/// Default share of the ticks on which an intermittent sensor is off.
const OFF_SHARE: f64 = 0.5;
/// Default factor of a sensor that is wrong by scale.
const SCALE: f64 = 1.5;
/// Default time constant of a slow sensor \[ms\].
const SLOW_MS: f64 = 200.0;
/// Default age of the readings of a delayed sensor \[ms\].
const DELAYED_MS: f64 = 100.0;

/// Default bias and standard deviation of noise: far beyond those of a good sensor, within those of a bad one.
struct Sizes {
    bias: f64,
    noise: f64,
}
/// Sizes for the position \[m\].
const POSITION: Sizes = Sizes { bias: 1.0, noise: 0.3 };
/// Sizes for the velocity \[m/s\].
const VELOCITY: Sizes = Sizes { bias: 0.5, noise: 0.2 };
/// Sizes for the attitude \[deg\].
const ATTITUDE: Sizes = Sizes { bias: 5.0, noise: 2.0 };
/// Sizes for the rates \[deg/s\].
const RATES: Sizes = Sizes { bias: 10.0, noise: 10.0 };
/// Sizes for the specific force \[m/s2\].
const ACCELERATION: Sizes = Sizes { bias: 1.0, noise: 1.0 };
/// Sizes for the height \[m\].
const HEIGHT: Sizes = Sizes { bias: 1.0, noise: 0.3 };

/// Sizes for the magnetic field \[share of the earth's\].
const FIELD: Sizes = Sizes { bias: 0.1, noise: 0.05 };

/// Reading without a measurement.
const NONE: Reading = [f64::NAN; 3];

/// Faults of the sensors, with their memory.
#[derive(Debug, Clone)]
pub struct SensorFaults {
    faults: FaultSchedule<SensorFault>,
    past: Past,
    seed: u64,
    sample_s: f64,
}

#[derive(Debug, Clone)]
struct SensorFault {
    /// Index in [`Readings`].
    sensor: usize,
    effect: Effect,
    random: ChaCha8Rng,
}

/// Effect of a fault, in SI units.
#[derive(Debug, Clone)]
enum Effect {
    Off,
    /// Last reading before the fault.
    Stuck(Option<Reading>),
    /// Share of the ticks.
    Garbage(f64),
    Bias(f64),
    Scale(f64),
    Slow(Filter),
    /// Number of ticks.
    Delayed(u64),
    /// Share of the ticks.
    Intermittent(f64),
    /// Standard deviation.
    Noise(f64),
}

impl SensorFaults {
    /// Builds the sensor faults of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let (seed, sample_s) = (scenario.run.seed, scenario.sample_s());
        let faults = FaultSchedule::new(scenario, |number, fault| SensorFault::new(seed, sample_s, number, fault));
        let delays =
            faults.all().iter().map(|fault| if let Effect::Delayed(by) = fault.effect.effect { by } else { 0 });
        let of_live = if scenario.run.mode == Mode::Realtime { ticks(MAX_SENSOR_DELAY_MS, sample_s) } else { 0 };
        Self { past: Past::new(delays.fold(of_live, u64::max)), faults, seed, sample_s }
    }

    /// Updates fault `number` if it is a fault of a sensor.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, SensorFault::new(self.seed, self.sample_s, number, fault));
    }

    /// Returns whether a fault may need measurements of the recent past.
    pub fn needs_past(&self) -> bool {
        self.past.ticks() > 0
    }

    /// Writes or reads the memory at sample `tick` except the recent past, which [`recall`](Self::recall) restores from
    /// the published samples. Refuses if a fault may have changed these.
    pub fn remember(&mut self, tape: &mut Tape, tick: u64) {
        let since = tick.saturating_sub(self.past.ticks());
        for Entry { ticks, effect: fault, .. } in self.faults.all_mut() {
            match &mut fault.effect {
                Effect::Stuck(last) => tape.option(last, |tape, last| tape.numbers(last)),
                Effect::Slow(filter) => filter.remember(tape),
                _ => {}
            }
            if self.past.ticks() > 0 && ticks.start <= tick && since < ticks.end {
                tape.refuse();
            }
        }
    }

    /// Stores the sample that the vehicle published at `tick` as the reading of the sensors.
    pub fn recall(&mut self, tick: u64, returned: &Kinematics) {
        self.past.remember(tick, readings(returned));
    }

    /// Applies the faults at sample `tick` to a `measured` motion.
    pub fn inject(&mut self, tick: u64, measured: &mut Kinematics) {
        let mut readings = readings(measured);
        self.inject_all(tick, &mut readings);
        let [position_m, velocity_mps, attitude_rad, rates_radps, ..] = readings;
        *measured = Kinematics { position_m, velocity_mps, attitude_rad, rates_radps };
    }

    /// Applies the faults at sample `tick` to the `readings` of all sensors.
    pub fn inject_all(&mut self, tick: u64, readings: &mut Readings) {
        self.past.remember(tick, *readings);
        for Entry { ticks, effect: fault, .. } in self.faults.all_mut() {
            let reading = &mut readings[fault.sensor];
            if ticks.contains(&tick) {
                *reading = fault.read(tick, *reading, &self.past);
            } else {
                fault.watch(tick, *reading);
            }
        }
    }
}

impl SensorFault {
    /// Builds the fault; `None` if it is not a fault of a sensor.
    fn new(seed: u64, sample_s: f64, number: usize, fault: &Fault) -> Option<Self> {
        let degree = 1f64.to_radians();
        let (sensor, unit, sizes) = match fault.target {
            FaultTarget::Position => (0, 1.0, POSITION),
            FaultTarget::Velocity => (1, 1.0, VELOCITY),
            FaultTarget::Attitude => (2, degree, ATTITUDE),
            FaultTarget::Field => (2, 1.0, FIELD),
            FaultTarget::Rates => (3, degree, RATES),
            FaultTarget::Acceleration => (4, 1.0, ACCELERATION),
            FaultTarget::Height => (5, 1.0, HEIGHT),
            FaultTarget::Flow => (6, 1.0, VELOCITY),
            _ => return None,
        };
        let effect = match (fault.kind, fault.wrong()) {
            (FaultKind::Off, _) => Effect::Off,
            (FaultKind::Stuck, _) => Effect::Stuck(None),
            (FaultKind::Garbage, _) => Effect::Garbage(fault.probability.unwrap_or(GARBAGE_SHARE)),
            (FaultKind::Wrong, Wrong::Bias) => Effect::Bias(fault.value.unwrap_or(sizes.bias) * unit),
            (FaultKind::Wrong, Wrong::Scale) => Effect::Scale(fault.value.unwrap_or(SCALE)),
            (FaultKind::Wrong, Wrong::Sign) => Effect::Scale(-1.0),
            (FaultKind::Slow, _) => Effect::Slow(Filter::new(fault.ms.unwrap_or(SLOW_MS) / 1e3, sample_s)),
            (FaultKind::Delayed, _) => Effect::Delayed(ticks(fault.ms.unwrap_or(DELAYED_MS), sample_s)),
            (FaultKind::Intermittent, _) => Effect::Intermittent(fault.probability.unwrap_or(OFF_SHARE)),
            (FaultKind::Noise, _) => Effect::Noise(fault.value.unwrap_or(sizes.noise) * unit),
            _ => return None,
        };
        Some(Self { sensor, effect, random: Stream::Fault(number).open(seed) })
    }

    /// Stores a reading while the fault is not active.
    fn watch(&mut self, tick: u64, measured: Reading) {
        match &mut self.effect {
            Effect::Stuck(last) => *last = Some(measured),
            Effect::Slow(filter) => filter.settle(tick, measured),
            _ => {}
        }
    }

    /// Computes the reading of the sensor while the fault is active.
    fn read(&mut self, tick: u64, measured: Reading, past: &Past) -> Reading {
        begin_tick(&mut self.random, tick);
        let random = &mut self.random;
        match &mut self.effect {
            Effect::Off => NONE,
            Effect::Stuck(last) => *last.get_or_insert(measured),
            Effect::Garbage(share) if random.random::<f64>() < *share => measured.map(|_| garbage(random)),
            Effect::Intermittent(share) if random.random::<f64>() < *share => NONE,
            Effect::Garbage(_) | Effect::Intermittent(_) => measured,
            Effect::Bias(by) => measured.map(|value| value + *by),
            Effect::Scale(factor) => measured.map(|value| value * *factor),
            Effect::Slow(filter) => filter.follow(tick, measured),
            Effect::Delayed(by) => past.before(tick, *by)[self.sensor],
            Effect::Noise(deviation) => measured.map(|value| value + *deviation * normal(random)),
        }
    }
}

/// Readings of the sensors of a motion; the others are 0.
fn readings(motion: &Kinematics) -> Readings {
    let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = *motion;
    [position_m, velocity_mps, attitude_rad, rates_radps, [0.0; 3], [0.0; 3], [0.0; 3]]
}

/// Converts a time to whole samples, rounded up.
fn ticks(time_ms: f64, sample_s: f64) -> u64 {
    (time_ms / 1e3 / sample_s - 1e-6).ceil() as u64
}

/// Draws NaN, infinity or random bits; random bits alone would hardly ever be NaN or infinite.
fn garbage(random: &mut ChaCha8Rng) -> f64 {
    let bits = random.random::<u64>();
    match random.random::<u64>() % 4 {
        0 => f64::NAN,
        1 => f64::INFINITY.copysign(f64::from_bits(bits)),
        _ => f64::from_bits(bits),
    }
}

#[cfg(test)]
mod tests;
