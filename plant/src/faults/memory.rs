//! Readings of all sensors, and the past that slow and delayed sensors need. Samples may be missing.

use std::collections::VecDeque;

use navigation::IMUS;

use crate::memory::Tape;

/// Reading of one sensor on its three axes, in SI units.
pub type Reading = [f64; 3];
/// Number of sensors.
pub const SENSORS: usize = 10;
/// Readings of all sensors, each at the index below. Readings of sensors that the vehicle does not have are 0.
pub type Readings = [Reading; SENSORS];
/// Index of the position.
pub const POSITION: usize = 0;
/// Index of the velocity.
pub const VELOCITY: usize = 1;
/// Index of the attitude, which the EKF does not measure.
pub const ATTITUDE: usize = 2;
/// Indices of the rates of each IMU; a vehicle without the EKF has only the first.
pub const RATES: [usize; IMUS] = [3, 7];
/// Indices of the specific force of each IMU.
pub const ACCELERATION: [usize; IMUS] = [4, 8];
/// Index of the height, which is the first number of the reading.
pub const HEIGHT: usize = 5;
/// Index of the velocity over the ground, which is the first two numbers of the reading.
pub const FLOW: usize = 6;
/// Index of the magnetic field.
pub const FIELD: usize = 9;

/// First-order low-pass, exact for readings that are constant from sample to sample.
#[derive(Debug, Clone)]
pub struct LowPass {
    time_constant_s: f64,
    sample_s: f64,
    /// Tick and output of the last sample.
    last: Option<(u64, [f64; 3])>,
}

impl LowPass {
    /// Builds a filter with a time constant \[s\], 0 for none, and a sample time \[s\].
    pub fn new(time_constant_s: f64, sample_s: f64) -> Self {
        Self { time_constant_s, sample_s, last: None }
    }

    /// Writes or reads the last sample.
    pub fn remember(&mut self, tape: &mut Tape) {
        tape.option(&mut self.last, |tape, (tick, output)| {
            tape.value(tick);
            tape.value(output);
        });
    }

    /// Sets the output at sample `tick` to `input`.
    pub fn settle(&mut self, tick: u64, input: [f64; 3]) {
        self.last = Some((tick, input));
    }

    /// Computes the output at sample `tick` under `input`. An axis without a finite output restarts at its input.
    pub fn follow(&mut self, tick: u64, input: [f64; 3]) -> [f64; 3] {
        let (before, output) = self.last.unwrap_or((tick, input));
        let elapsed_s = tick.saturating_sub(before) as f64 * self.sample_s;
        let share = if self.time_constant_s > 0.0 { -libm::expm1(-elapsed_s / self.time_constant_s) } else { 1.0 };
        let along = |y: f64, m: f64| if y.is_finite() { y + share * (m - y) } else { m };
        let output = std::array::from_fn(|axis| along(output[axis], input[axis]));
        self.settle(tick, output);
        output
    }
}

/// Readings of all sensors in the recent past.
#[derive(Debug, Clone)]
pub struct Past {
    /// Number of ticks that are kept.
    ticks: u64,
    /// Ticks and readings, oldest first. Only the first may be `ticks` old or older.
    readings: VecDeque<(u64, Readings)>,
}

impl Past {
    /// Builds a memory of `ticks`.
    pub fn new(ticks: u64) -> Self {
        // Room for one reading per tick, the present reading, and the reading that the present one displaces.
        Self { ticks, readings: VecDeque::with_capacity(ticks as usize + 2) }
    }

    /// Number of ticks that are kept.
    pub fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Writes or reads all readings.
    pub fn visit(&mut self, tape: &mut Tape) {
        tape.queue(&mut self.readings, self.ticks as usize + 1, |tape, (tick, readings)| {
            tape.value(tick);
            tape.value(readings);
        });
    }

    /// Stores the `readings` of sample `tick`.
    pub fn remember(&mut self, tick: u64, readings: Readings) {
        // A sample taken twice replaces itself.
        if self.readings.back().is_some_and(|(at, _)| *at >= tick) {
            self.readings.pop_back();
        }
        self.readings.push_back((tick, readings));
        while self.readings.get(1).is_some_and(|(at, _)| at.saturating_add(self.ticks) <= tick) {
            self.readings.pop_front();
        }
    }

    /// Newest readings that are at least `age` ticks old at sample `tick`, else the oldest readings; NaN without any.
    pub fn before(&self, tick: u64, age: u64) -> Readings {
        let old_enough = self.readings.partition_point(|(at, _)| at.saturating_add(age) <= tick);
        self.readings.get(old_enough.saturating_sub(1)).map_or([[f64::NAN; 3]; SENSORS], |(_, readings)| *readings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_closes_the_gap_exponentially_however_it_is_sampled() {
        let step = |ticks: &[u64]| {
            let mut filter = LowPass::new(0.2, 0.01);
            filter.settle(0, [0.0; 3]);
            ticks.iter().fold([0.0; 3], |_, tick| filter.follow(*tick, [1.0, -2.0, 0.0]))
        };
        let expected = 1.0 - (-1f64).exp();
        for ticks in [(1..=20).collect(), vec![7, 13, 20], vec![20], vec![20, 20, 20]] {
            let [x, y, z] = step(&ticks);
            assert!((x - expected).abs() < 1e-14 && (y + 2.0 * expected).abs() < 1e-14, "{ticks:?}");
            assert_eq!(z, 0.0);
        }
    }

    #[test]
    fn a_filter_without_a_past_a_lag_or_a_number_begins_at_its_input() {
        assert_eq!(LowPass::new(0.2, 0.01).follow(5, [1.0; 3]), [1.0; 3]);
        let mut instant = LowPass::new(0.0, 0.01);
        instant.settle(5, [0.0; 3]);
        assert_eq!(instant.follow(5, [1.0; 3]), [1.0; 3]);
        let mut broken = LowPass::new(0.2, 0.01);
        broken.settle(0, [f64::NAN, f64::INFINITY, 0.0]);
        let [x, y, z] = broken.follow(1, [1.0; 3]);
        assert_eq!([x, y], [1.0; 2]);
        assert!(z > 0.0 && z < 1.0, "the sound axis is filtered all the same");
    }

    /// Stores `tick` as the reading of sample `tick` and returns the reading `age` ticks before.
    fn told(past: &mut Past, tick: u64, age: u64) -> f64 {
        past.remember(tick, [[tick as f64; 3]; SENSORS]);
        past.before(tick, age)[3][2]
    }

    #[test]
    fn the_past_is_returned_unchanged_in_bounded_room() {
        let mut past = Past::new(10);
        let room = past.readings.capacity();
        for tick in 0..1000u64 {
            for age in [10, 0, 7] {
                assert_eq!(told(&mut past, tick, age), tick.saturating_sub(age) as f64);
            }
        }
        assert_eq!(told(&mut past, 1000, 50), 990.0, "the oldest there is");
        assert_eq!(past.readings.capacity(), room);
        assert_eq!(past.readings.len(), 11);
    }

    #[test]
    fn with_gaps_the_newest_readings_that_are_old_enough_count() {
        let mut past = Past::new(3);
        assert!(past.before(0, 0)[0][0].is_nan(), "nothing was measured yet");
        assert_eq!([0, 1, 2, 5, 6, 7, 20].map(|tick| told(&mut past, tick, 3)), [0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 7.0]);
        assert_eq!(told(&mut Past::new(0), 3, 0), 3.0);
    }
}
