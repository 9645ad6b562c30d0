//! Progress: who hangs, judged by the ticks a node has done, and never for time in which the judge was away himself.
//!
//! ```text
//! answer     sample     sample     sample
//!   |----------|----------|----------|        hangs: none of HANG_TICKS samples answered,
//!        limit without an answer  |           and no answer for the limit
//! ```
//!
//! The instant at which both will hold is known beforehand: the launcher sleeps no longer than that.

use std::time::{Duration, Instant};

use contract::plan::HANG_TICKS;
use contract::topic::Topic;
use runtime::realtime::{ControlPage, now_ns};

/// At high rates a few ticks are no longer than the machine may hold a process up for reasons of its own.
const LEAST_HANG: Duration = Duration::from_millis(20);
/// The plant has nobody to answer for it: its motors are off after this time, so it is the end of the flight.
const PLANT_HANG: Duration = Duration::from_millis(500);
/// The third sample is looked for so long after it was due: the plant needs a moment to take it.
const GRACE: Duration = Duration::from_micros(500);

/// What a node was last seen to have done.
pub struct Progress {
    /// Ticks done.
    done: u64,
    /// When they had become so many.
    since: Instant,
}

impl Progress {
    /// None yet.
    pub fn new(now: Instant) -> Self {
        Self { done: 0, since: now }
    }

    /// It has `done` so many ticks now.
    pub fn note(&mut self, done: u64, now: Instant) {
        if done != self.done {
            self.begin(done, now);
        }
    }

    /// Somebody begins who has `done` so many.
    pub fn begin(&mut self, done: u64, now: Instant) {
        (self.done, self.since) = (done, now);
    }

    /// Nobody looked for so long, and what could not be seen counts against nobody.
    pub fn excuse(&mut self, absent: Duration) {
        self.since += absent;
    }

    /// Whether it hangs, after `samples` of the plant: it has left the last ones without an answer for `limit`.
    pub fn hangs(&self, samples: u64, limit: Duration, now: Instant) -> bool {
        samples >= self.done + HANG_TICKS && now.saturating_duration_since(self.since) >= limit
    }

    /// When it will hang if it makes no more progress; the first sample was taken at `origin`.
    pub fn deadline(&self, origin: Instant, sample_s: f64, limit: Duration) -> Instant {
        let last = self.done + HANG_TICKS - 1;
        let sampled = origin + Duration::from_secs_f64(last as f64 * sample_s) + GRACE;
        sampled.max(self.since + limit)
    }
}

/// How long the node that speaks on `topic` may make no progress.
pub fn limit(topic: Topic, sample_s: f64) -> Duration {
    // A little less than the ticks say, because progress is seen late too.
    let ticks = Duration::from_secs_f64(sample_s * (HANG_TICKS as f64 - 1.0));
    if topic == Topic::State { PLANT_HANG } else { ticks.max(LEAST_HANG) }
}

/// When the first sample was taken, once it was.
pub fn origin(page: &ControlPage, now: Instant) -> Option<Instant> {
    let origin_ns = page.origin_ns();
    let since = Duration::from_nanos(now_ns().saturating_sub(origin_ns));
    now.checked_sub(since).filter(|_| origin_ns > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMIT: Duration = Duration::from_millis(20);
    const SAMPLE_S: f64 = 0.01;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// A node that answered sample 4, of 40 ms, and no more; seen at 42 ms.
    fn stuck(origin: Instant) -> Progress {
        let mut progress = Progress::new(origin);
        progress.note(5, origin + ms(42));
        progress
    }

    #[test]
    fn a_node_hangs_with_the_third_sample_it_does_not_answer() {
        let origin = Instant::now();
        let progress = stuck(origin);
        assert!(!progress.hangs(7, LIMIT, origin + ms(69)), "samples 5 and 6");
        assert!(progress.hangs(8, LIMIT, origin + ms(71)), "and 7");
        assert_eq!(progress.deadline(origin, SAMPLE_S, LIMIT), origin + ms(70) + GRACE);
    }

    #[test]
    fn at_a_high_rate_it_hangs_when_the_limit_is_over() {
        let origin = Instant::now();
        let progress = stuck(origin);
        assert!(!progress.hangs(20, LIMIT, origin + ms(61)));
        assert!(progress.hangs(20, LIMIT, origin + ms(62)));
        assert_eq!(progress.deadline(origin, 0.001, LIMIT), origin + ms(62));
    }

    #[test]
    fn an_answer_begins_the_time_anew() {
        let origin = Instant::now();
        let mut progress = stuck(origin);
        progress.note(5, origin + ms(60));
        assert!(progress.hangs(8, LIMIT, origin + ms(71)), "the same is no progress");
        progress.note(6, origin + ms(72));
        assert!(!progress.hangs(9, LIMIT, origin + ms(90)));
    }

    #[test]
    fn what_the_launcher_slept_through_counts_against_nobody() {
        let origin = Instant::now();
        let mut progress = stuck(origin);
        // The machine stood still from 45 to 95 ms: the plant has skipped to its next sample, and the node had no time.
        progress.excuse(ms(50));
        assert!(!progress.hangs(10, LIMIT, origin + ms(96)));
        assert!(progress.hangs(12, LIMIT, origin + ms(112)), "but then it had");
    }
}
