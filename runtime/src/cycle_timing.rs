//! The timing record of a cycle (when it was due, began and sent), and the warm-up before it.
//!
//! ```text
//! release   when the work was due: by the clock for the plant; for other nodes when the input was sent, or became late
//! start     when the process began;            release jitter (plant) or hop (others) = start - release
//! publish   when the process sent;             execution = publish - start
//!                                              response  = publish - sample time;  miss = response > deadline
//! slip      a period without a cycle, because the process slept; it counts as a miss too, and is never made up for
//! late      a message that misses its deadline is counted. It is sent, skipped, replaced by the last timely message,
//!           or ends the run, as the scenario's `[deadline]` says
//!
//! publish           warm-up: CPU clock, loan      arrival: receive, step, send
//!    |  ...sleep...     |       ...sleep...            |
//!                  release - lead                   release
//! ```
//!
//! In the milliseconds between two cycles the caches lose the memory of a node. Sending one message touches 250 cache
//! lines on 50 pages: it takes 17 us after 10 ms asleep and 0.3 us right after another send (`measure timing` of commit
//! 12abaa4), and four such messages lie between sample and actuator. The warm-up touches that memory while no other
//! node waits. The warm-up also closes the previous cycle: it reads the thread's CPU clock (a system call), which only
//! the record needs.
//!
//! In lockstep there is no warm-up: no process sleeps long enough, and no release is known in advance. In process no
//! clock is read: all times are zero.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::error::SessionError;
use crate::limits::{WARM_UP_LEAD_NS, WARM_UP_PARTS};
use crate::port::WarmUp;
use crate::realtime::{now_ns, thread_cpu_ns};
use contract::message::Stamp;
use settings::{Late, NodeDeadline};

/// Clock that a node reads.
enum Clock {
    /// `CLOCK_MONOTONIC`.
    System,
    /// Time set by the caller: zero in process, and in a replay the time that the node read in the flight.
    Set(Cell<u64>),
}

/// Timing of the current cycle, shared by a node's ports and loop.
pub struct CycleTiming {
    deadline: NodeDeadline,
    clock: Clock,
    warm_up: RefCell<Vec<Rc<dyn WarmUp>>>,
    /// `true` while this cycle's CPU time is still to be read.
    open: Cell<bool>,
    /// Tick and response \[ns\] of the miss that ended the run by the policy `stop`.
    broken: Cell<Option<(u64, u64)>>,
    release_ns: Cell<u64>,
    start_ns: Cell<u64>,
    used_cpu_ns: Cell<u64>,
    last_cpu_ns: Cell<u64>,
    misses: Cell<u64>,
    slips: Cell<u64>,
}

impl CycleTiming {
    /// Timing of a process before its first cycle.
    pub fn new(deadline: NodeDeadline) -> Self {
        Self {
            deadline,
            clock: Clock::System,
            warm_up: RefCell::default(),
            open: Cell::default(),
            broken: Cell::default(),
            release_ns: Cell::default(),
            start_ns: Cell::default(),
            used_cpu_ns: Cell::default(),
            last_cpu_ns: Cell::default(),
            misses: Cell::default(),
            slips: Cell::default(),
        }
    }

    /// Timing of a node in process or in a replay: it reads the time that was [`set`](Self::set_now_ns), at first zero.
    pub fn without_clock(deadline: NodeDeadline) -> Self {
        Self { clock: Clock::Set(Cell::default()), ..Self::new(deadline) }
    }

    /// Present time \[ns\]: `CLOCK_MONOTONIC`, or the time that was set.
    pub fn now_ns(&self) -> u64 {
        match &self.clock {
            Clock::System => now_ns(),
            Clock::Set(now_ns) => now_ns.get(),
        }
    }

    /// Sets the present time of a node without clock; no effect on a node that reads the system's clock.
    pub fn set_now_ns(&self, to_ns: u64) {
        if let Clock::Set(now_ns) = &self.clock {
            now_ns.set(to_ns);
        }
    }

    /// Counts `periods` that passed without a cycle, as slips and as misses.
    pub fn slip(&self, periods: u64) {
        self.slips.set(self.slips.get() + periods);
        self.misses.set(self.misses.get() + periods);
    }

    /// Adds `port` to the warm-up; at start-up only, because it allocates.
    pub fn warm_up_with(&self, port: Rc<dyn WarmUp>) {
        self.warm_up.borrow_mut().push(port);
    }

    /// Closes the previous cycle and touches the memory that the next one will use.
    pub fn warm_up(&self) {
        self.close();
        self.warm_up.borrow().iter().for_each(|port| port.warm_up());
    }

    /// Begins a cycle that was due at `release_ns`.
    pub fn begin(&self, release_ns: u64) {
        self.close();
        self.release_ns.set(release_ns);
        self.start_ns.set(self.now_ns());
    }

    /// Returns `None` if a message ready at `publish_ns` is in time; else counts a miss and returns the policy.
    pub fn ready(&self, tick: u64, sample_ns: u64, publish_ns: u64) -> Option<Late> {
        self.open.set(true);
        let response_ns = publish_ns.saturating_sub(sample_ns);
        if response_ns <= self.deadline.deadline_ns {
            return None;
        }
        self.misses.set(self.misses.get() + 1);
        if self.deadline.late == Late::Stop {
            self.broken.set(Some((tick, response_ns)));
        }
        Some(self.deadline.late)
    }

    /// Returns whether a miss has ended the run, by the policy `stop`.
    pub fn is_broken(&self) -> bool {
        self.broken.get().is_some()
    }

    /// Returns the error of a miss that ended the run, if there was one.
    pub fn verdict(&self) -> Result<(), SessionError> {
        let deadline_ms = self.deadline.deadline_ns as f64 / 1e6;
        let late =
            |(tick, response_ns)| SessionError::Late { tick, response_ms: response_ns as f64 / 1e6, deadline_ms };
        self.broken.get().map_or(Ok(()), |broken| Err(late(broken)))
    }

    /// Writes this cycle's timing into the `stamp` of its message.
    pub fn report(&self, stamp: &mut Stamp) {
        stamp.release_ns = self.release_ns.get();
        stamp.start_ns = self.start_ns.get();
        stamp.cpu_ns = self.last_cpu_ns.get();
        stamp.misses = self.misses.get();
        stamp.slips = self.slips.get();
    }

    /// Closes the previous cycle, if it is open, by reading the thread's CPU clock; the CPU time of a cycle counts from
    /// one closing to the next. The system call takes a microsecond, so it is made in the warm-up if there is one.
    fn close(&self) {
        if self.open.replace(false) {
            let used_ns = thread_cpu_ns();
            self.last_cpu_ns.set(used_ns - self.used_cpu_ns.replace(used_ns));
        }
    }
}

/// Returns the time at which to warm up for the sample after that of `sample_ns`; `None` if that time has passed.
pub fn warm_up_ns(period_ns: u64, sample_ns: u64, now_ns: u64) -> Option<u64> {
    let due_ns = sample_ns + period_ns - WARM_UP_LEAD_NS.min(period_ns / WARM_UP_PARTS);
    (now_ns < due_ns).then_some(due_ns)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due_in_ten_ms(late: Late) -> CycleTiming {
        CycleTiming::new(NodeDeadline { deadline_ns: 10_000_000, late })
    }

    #[test]
    fn a_late_message_is_a_miss_and_so_is_a_slot_slept_through() {
        let timing = due_in_ten_ms(Late::Skip);
        let mut stamp = Stamp::default();
        assert_eq!(timing.ready(7, 1_000, 10_001_000), None, "just in time");
        assert_eq!(timing.ready(7, 1_000, 900), None, "woken early");
        timing.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (0, 0));
        assert_eq!(timing.ready(7, 1_000, 10_001_001), Some(Late::Skip));
        timing.slip(3);
        timing.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (4, 3));
        assert!(!timing.is_broken() && timing.verdict().is_ok());
    }

    #[test]
    fn the_policy_stop_remembers_what_broke_the_budget() {
        let timing = due_in_ten_ms(Late::Stop);
        assert_eq!(timing.ready(7, 1_000, 20_001_000), Some(Late::Stop));
        assert!(matches!(timing.verdict(), Err(SessionError::Late { tick: 7, response_ms: 20.0, deadline_ms: 10.0 })));
    }

    #[test]
    fn one_warm_up_lies_between_two_samples() {
        let at_100_hz = |sample_ns, now_ns| warm_up_ns(10_000_000, sample_ns, now_ns);
        let due_ns = 1_000 + 10_000_000 - WARM_UP_LEAD_NS;
        assert_eq!(at_100_hz(1_000, 2_000), Some(due_ns));
        assert_eq!(at_100_hz(1_000, due_ns), None, "it was this one that woke the node");
        assert_eq!(at_100_hz(0, 5_000_000_000), None, "before the first sample, or after a long silence");
        assert_eq!(warm_up_ns(500_000, 0, 1), Some(375_000), "at 2000 Hz the ring needs the rest");
    }
}
