//! The warm-up: shortly before its next cycle is due a node wakes once and touches what the cycle will touch.
//!
//! ```text
//! publish           warm-up: CPU clock, loan      arrival: receive, step, send
//!    |  ...sleep...     |       ...sleep...            |
//!                  release - lead                   release
//! ```
//!
//! In the milliseconds between two cycles the processor forgets a node. Sending one message walks 250 cache lines on 50
//! pages: 12 us after 10 ms asleep, 0.5 us right after another one (`launcher measure timing`), and four such messages lie
//! between sample and actuator. The warm-up pays for that while nobody waits. It also closes the cycle before: what is
//! read for the record only, the thread's CPU clock (a system call), is read here.
//!
//! In lockstep nobody sleeps long enough to forget, and there is no release to come before.

use std::cell::RefCell;
use std::rc::Rc;

/// How long before the release: the four nodes warm-up one after another on a machine with one processor \[ns\].
const LEAD_NS: u64 = 250_000;
/// The least part of the period that stays between a warm-up and the cycle before.
const PERIODS: u64 = 4;

/// A port that can touch its memory without any effect.
pub trait WarmUp {
    /// Does so.
    fn warm_up(&self);
}

/// When a node warms up, and what.
pub struct WarmUpPlan {
    /// `None` where no clock releases the ring.
    period_ns: Option<u64>,
    ports: RefCell<Vec<Rc<dyn WarmUp>>>,
}

impl WarmUpPlan {
    /// For a ring with this period, if it has one; of nothing yet.
    pub fn new(period_ns: Option<u64>) -> Self {
        Self { period_ns, ports: RefCell::default() }
    }

    /// Takes `port` in; at start-up only.
    pub fn add(&self, port: Rc<dyn WarmUp>) {
        self.ports.borrow_mut().push(port);
    }

    /// When to warm-up for the sample that follows the one of `sample_ns`, unless `now_ns` is past that.
    pub fn due_ns(&self, sample_ns: u64, now_ns: u64) -> Option<u64> {
        let period_ns = self.period_ns?;
        let due_ns = sample_ns + period_ns - LEAD_NS.min(period_ns / PERIODS);
        (now_ns < due_ns).then_some(due_ns)
    }

    /// Touches everything.
    pub fn run(&self) {
        self.ports.borrow().iter().for_each(|port| port.warm_up());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_rehearsal_lies_between_two_samples() {
        let at_100_hz = WarmUpPlan::new(Some(10_000_000));
        assert_eq!(at_100_hz.due_ns(1_000, 2_000), Some(1_000 + 10_000_000 - LEAD_NS));
        assert_eq!(at_100_hz.due_ns(1_000, 1_000 + 10_000_000 - LEAD_NS), None, "it was this one that woke the node");
        assert_eq!(at_100_hz.due_ns(0, 5_000_000_000), None, "before the first sample, or after a long silence");
        assert_eq!(WarmUpPlan::new(Some(500_000)).due_ns(0, 1), Some(375_000), "at 2000 Hz the ring needs the rest");
        assert_eq!(WarmUpPlan::new(None).due_ns(1_000, 2_000), None, "lockstep");
    }
}
