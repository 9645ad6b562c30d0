//! What a slow and a delayed sensor remember: three numbers, sample by sample. Samples may be left out.

use std::collections::VecDeque;

/// First-order low-pass, exact for readings that hold from sample to sample.
#[derive(Debug, Clone)]
pub struct Filter {
    time_constant_s: f64,
    sample_s: f64,
    /// Tick and output of the last sample.
    last: Option<(u64, [f64; 3])>,
}

impl Filter {
    /// With a time constant \[s\], at a sample time \[s\]; 0 = it lets everything through.
    pub fn new(time_constant_s: f64, sample_s: f64) -> Self {
        Self { time_constant_s, sample_s, last: None }
    }

    /// Its output is `input` at sample `tick`.
    pub fn settle(&mut self, tick: u64, input: [f64; 3]) {
        self.last = Some((tick, input));
    }

    /// Its output at sample `tick` under `input`. An axis without a finite output begins again at its input.
    pub fn follow(&mut self, tick: u64, input: [f64; 3]) -> [f64; 3] {
        let (before, output) = self.last.unwrap_or((tick, input));
        let elapsed_s = tick.saturating_sub(before) as f64 * self.sample_s;
        let share = if self.time_constant_s > 0.0 { -(-elapsed_s / self.time_constant_s).exp_m1() } else { 1.0 };
        let along = |y: f64, m: f64| if y.is_finite() { y + share * (m - y) } else { m };
        let output = std::array::from_fn(|axis| along(output[axis], input[axis]));
        self.settle(tick, output);
        output
    }
}

/// The readings of the recent past.
#[derive(Debug, Clone)]
pub struct History {
    delay_ticks: u64,
    /// Rising in tick. The first is as old as the delay, or else the oldest there is; no other is that old.
    readings: VecDeque<(u64, [f64; 3])>,
}

impl History {
    /// For a delay \[s\], rounded up to whole samples of `sample_s`.
    pub fn new(delay_s: f64, sample_s: f64) -> Self {
        let delay_ticks = (delay_s / sample_s - 1e-6).ceil() as u64;
        // One per tick of the delay, the present one, and the one it displaces.
        Self { delay_ticks, readings: VecDeque::with_capacity(delay_ticks as usize + 2) }
    }

    /// Remembers `reading` at sample `tick` and tells the newest one that is as old as the delay; in the beginning the
    /// first there was.
    pub fn at_delay(&mut self, tick: u64, reading: [f64; 3]) -> [f64; 3] {
        // A sample taken twice replaces itself.
        if self.readings.back().is_some_and(|(at, _)| *at >= tick) {
            self.readings.pop_back();
        }
        self.readings.push_back((tick, reading));
        while self.readings.get(1).is_some_and(|(at, _)| at + self.delay_ticks <= tick) {
            self.readings.pop_front();
        }
        self.readings.front().map_or(reading, |&(_, old)| old)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_filter_closes_the_gap_exponentially_however_it_is_sampled() {
        let step = |ticks: &[u64]| {
            let mut filter = Filter::new(0.2, 0.01);
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
        assert_eq!(Filter::new(0.2, 0.01).follow(5, [1.0; 3]), [1.0; 3]);
        let mut instant = Filter::new(0.0, 0.01);
        instant.settle(5, [0.0; 3]);
        assert_eq!(instant.follow(5, [1.0; 3]), [1.0; 3]);
        let mut broken = Filter::new(0.2, 0.01);
        broken.settle(0, [f64::NAN, f64::INFINITY, 0.0]);
        let [x, y, z] = broken.follow(1, [1.0; 3]);
        assert_eq!([x, y], [1.0; 2]);
        assert!(z > 0.0 && z < 1.0, "the sound axis is filtered all the same");
    }

    #[test]
    fn a_history_tells_what_was_and_never_grows() {
        let mut history = History::new(0.1, 0.01);
        let room = history.readings.capacity();
        for tick in 0..1000u64 {
            let expected = tick.saturating_sub(10) as f64;
            for _ in 0..2 {
                assert_eq!(history.at_delay(tick, [tick as f64; 3]), [expected; 3]);
            }
        }
        assert_eq!(history.readings.capacity(), room);
        assert_eq!(history.readings.len(), 11);
    }

    #[test]
    fn a_history_with_gaps_tells_the_newest_that_is_old_enough() {
        let mut history = History::new(0.025, 0.01);
        let told = [0, 1, 2, 5, 6, 7, 20].map(|tick| history.at_delay(tick, [tick as f64; 3])[0]);
        assert_eq!(told, [0.0, 0.0, 0.0, 2.0, 2.0, 2.0, 7.0]);
        assert_eq!(History::new(0.0, 0.01).at_delay(3, [3.0; 3]), [3.0; 3]);
    }
}
