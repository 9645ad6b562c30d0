//! Faults of the sensors, which change the measurements but not the true motion.
//!
//! ```text
//! off            NaN: no measurement
//! stuck          the last measurement before the fault
//! garbage        NaN, infinite or random bits, on the share `probability` of the ticks
//! wrong          m + value (bias, on every axis), m value (scale), -m (sign)
//! slow           y = y + (1 - exp(-Ts / tau)) (m - y), with tau = `ms`, from the last measurement before the fault
//! delayed        the measurement `ms` ago, rounded up to whole samples, as it was before any fault
//! intermittent   off, on the share `probability` of the ticks
//! noise          m + value n, n white, normal and independent on every axis
//! ```
//!
//! Behind the EKF the faults act on its sensors: those of position and velocity on the receiver, of rates and
//! acceleration on one IMU or on every IMU. The measurement m includes the scenario's noise and the effects of earlier
//! faults of the same sensor.

use contract::message::Kinematics;
use navigation::IMUS;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use settings::fault_schedule::{Entry, FaultSchedule, MAX_SENSOR_DELAY_MS, MAX_SENSOR_DELAY_TICKS};
use settings::{Fault, FaultKind, FaultTarget, FilterName, Mode, Scenario, Wrong};

use super::memory::{
    ACCELERATION, ATTITUDE, FIELD, FLOW, HEIGHT, LowPass, POSITION, Past, RATES, Reading, Readings, SENSORS, VELOCITY,
};
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

/// Reading without a measurement.
const NONE: Reading = [f64::NAN; 3];

/// Faults of the sensors, with their memory.
#[derive(Debug, Clone)]
pub struct SensorFaults {
    faults: FaultSchedule<SensorFault>,
    past: Past,
    sampled: Sampled,
}

/// Settings that the effects of faults depend on.
#[derive(Debug, Clone, Copy)]
struct Sampled {
    seed: u64,
    sample_s: f64,
    /// Number of IMUs.
    imus: usize,
}

/// Fault of a sensor, or of the same sensor of every IMU.
#[derive(Debug, Clone)]
struct SensorFault {
    places: [Option<Place>; IMUS],
    random: ChaCha8Rng,
}

/// Reading that has the fault: its index in [`Readings`].
#[derive(Debug, Clone)]
struct Place {
    sensor: usize,
    effect: Effect,
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
    Slow(LowPass),
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
        let sampled = Sampled {
            seed: scenario.run.seed,
            sample_s: scenario.sample_s(),
            imus: if scenario.plant.sensors.filter == FilterName::Ekf { scenario.plant.sensors.imu.count } else { 1 },
        };
        let faults = FaultSchedule::new(scenario, |number, fault| SensorFault::new(sampled, number, fault));
        let places = faults.all().iter().flat_map(|fault| fault.effect.places.iter().flatten());
        let delays = places.map(|place| if let Effect::Delayed(by) = place.effect { by } else { 0 });
        let of_live =
            if scenario.run.mode == Mode::Realtime { ticks(MAX_SENSOR_DELAY_MS, sampled.sample_s) } else { 0 };
        let longest = delays.fold(of_live, u64::max).min(MAX_SENSOR_DELAY_TICKS);
        Self { past: Past::new(longest), faults, sampled }
    }

    /// Updates fault `number` if it is a fault of a sensor.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, SensorFault::new(self.sampled, number, fault));
    }

    /// Writes or reads the memory.
    pub fn remember(&mut self, tape: &mut Tape) {
        for fault in self.faults.all_mut() {
            for place in fault.effect.places.iter_mut().flatten() {
                match &mut place.effect {
                    Effect::Stuck(last) => tape.option(last, Tape::value),
                    Effect::Slow(filter) => filter.remember(tape),
                    _ => {}
                }
            }
        }
        self.past.visit(tape);
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
        for Entry { ticks, effect: SensorFault { places, random }, .. } in self.faults.all_mut() {
            begin_tick(random, tick);
            for Place { sensor, effect } in places.iter_mut().flatten() {
                let reading = &mut readings[*sensor];
                if ticks.contains(&tick) {
                    *reading = effect.read(tick, *reading, |by| self.past.before(tick, by)[*sensor], random);
                } else {
                    effect.watch(tick, *reading);
                }
            }
        }
    }
}

impl SensorFault {
    /// Builds the fault; `None` if it is not a fault of a sensor.
    fn new(sampled: Sampled, number: usize, fault: &Fault) -> Option<Self> {
        let of_imus = |sensors: [usize; IMUS]| {
            let has = |imu: usize| imu < sampled.imus && fault.imu.is_none_or(|only| only == imu as u64 + 1);
            std::array::from_fn(|imu| has(imu).then_some(sensors[imu]))
        };
        let (only, degree) = (|sensor| [Some(sensor), None], 1_f64.to_radians());
        // Unit of the settings, and default bias and noise deviation in that unit: much larger than the errors of a
        // good sensor, and no larger than the errors of a bad sensor.
        let (sensors, unit, sizes) = match fault.target {
            FaultTarget::Position => (only(POSITION), 1.0, [1.0, 0.3]),
            FaultTarget::Velocity => (only(VELOCITY), 1.0, [0.5, 0.2]),
            FaultTarget::Attitude => (only(ATTITUDE), degree, [5.0, 2.0]),
            FaultTarget::Field => (only(FIELD), 1.0, [0.1, 0.05]),
            FaultTarget::Height => (only(HEIGHT), 1.0, [1.0, 0.3]),
            FaultTarget::Flow => (only(FLOW), 1.0, [0.5, 0.2]),
            FaultTarget::Rates => (of_imus(RATES), degree, [10.0, 10.0]),
            FaultTarget::Acceleration => (of_imus(ACCELERATION), 1.0, [1.0, 1.0]),
            _ => return None,
        };
        let effect = Effect::new(sampled.sample_s, fault, unit, sizes)?;
        let place = |sensor: Option<usize>| Some(Place { sensor: sensor?, effect: effect.clone() });
        Some(Self { places: sensors.map(place), random: Stream::Fault(number).open(sampled.seed) })
    }
}

impl Effect {
    /// Builds the effect of a fault of a sensor whose settings are in `unit`, with the default sizes `[bias, noise]`;
    /// `None` if a sensor cannot have this kind of fault.
    fn new(sample_s: f64, fault: &Fault, unit: f64, [bias, noise]: [f64; 2]) -> Option<Self> {
        Some(match (fault.kind, fault.wrong()) {
            (FaultKind::Off, _) => Self::Off,
            (FaultKind::Stuck, _) => Self::Stuck(None),
            (FaultKind::Garbage, _) => Self::Garbage(fault.probability.unwrap_or(GARBAGE_SHARE)),
            (FaultKind::Wrong, Wrong::Bias) => Self::Bias(fault.value.unwrap_or(bias) * unit),
            (FaultKind::Wrong, Wrong::Scale) => Self::Scale(fault.value.unwrap_or(SCALE)),
            (FaultKind::Wrong, Wrong::Sign) => Self::Scale(-1.0),
            (FaultKind::Slow, _) => Self::Slow(LowPass::new(fault.ms.unwrap_or(SLOW_MS) / 1e3, sample_s)),
            (FaultKind::Delayed, _) => Self::Delayed(ticks(fault.ms.unwrap_or(DELAYED_MS), sample_s)),
            (FaultKind::Intermittent, _) => Self::Intermittent(fault.probability.unwrap_or(OFF_SHARE)),
            (FaultKind::Noise, _) => Self::Noise(fault.value.unwrap_or(noise) * unit),
            _ => return None,
        })
    }

    /// Stores a reading while the fault is not active.
    fn watch(&mut self, tick: u64, measured: Reading) {
        match self {
            Self::Stuck(last) => *last = Some(measured),
            Self::Slow(filter) => filter.settle(tick, measured),
            _ => {}
        }
    }

    /// Computes the reading of the sensor while the fault is active; `before` returns its reading a number of ticks
    /// ago.
    fn read(
        &mut self,
        tick: u64,
        measured: Reading,
        before: impl FnOnce(u64) -> Reading,
        random: &mut ChaCha8Rng,
    ) -> Reading {
        match self {
            Self::Off => NONE,
            Self::Stuck(last) => *last.get_or_insert(measured),
            Self::Garbage(share) if random.random::<f64>() < *share => measured.map(|_| garbage(random)),
            Self::Intermittent(share) if random.random::<f64>() < *share => NONE,
            Self::Garbage(_) | Self::Intermittent(_) => measured,
            Self::Bias(by) => measured.map(|value| value + *by),
            Self::Scale(factor) => measured.map(|value| value * *factor),
            Self::Slow(filter) => filter.follow(tick, measured),
            Self::Delayed(by) => before(*by),
            Self::Noise(deviation) => measured.map(|value| value + *deviation * normal(random)),
        }
    }
}

/// Readings of the sensors of a motion; readings of other sensors are 0.
fn readings(motion: &Kinematics) -> Readings {
    let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = *motion;
    let mut readings = [[0.0; 3]; SENSORS];
    readings[..4].copy_from_slice(&[position_m, velocity_mps, attitude_rad, rates_radps]);
    readings
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
