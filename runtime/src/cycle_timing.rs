//! The cycle: wake, step, send, and the cycle timing of it.
//!
//! ```text
//! release   when the work was due: the clock for the plant, the arrival of its input for everybody else
//! start     when the process began;            release jitter (plant) or hop (others) = start - release
//! publish   when it sent;                      execution = publish - start
//!                                              response  = publish - sample time;  miss = response > deadline
//! slip      a period without a cycle: a sample or an answer slept through; counted as a miss too, and never made up for in a burst
//! late      a message that misses its deadline is counted, and sent, skipped, replaced by the last timely one, or the
//!           end of the run, as the scenario's `[deadline]` says
//! ```
//!
//! A node's loop is `while let Some(tick) = cycle_loop.next(..) { output.send(..); cycle_loop.done(..) }` in every mode
//! ([`crate::cycle_loop`], [`crate::input`], [`crate::output`]); only the plant, which turns the ring, knows what releases it ([`crate::release`]).

use std::cell::Cell;

use crate::realtime::{now_ns, thread_cpu_ns};
use crate::warm_up::WarmUpPlan;
use contract::message::Stamp;
use contract::scenario::{Late, NodeDeadline};

/// Longest sleep without a look around: a lost wake-up costs no more than this.
pub(crate) const LOOK_AROUND_NS: u64 = 100_000_000;

/// Timing of the cycle under way, shared by a node's ports.
pub struct CycleTiming {
    deadline: NodeDeadline,
    pub(crate) warm_up: WarmUpPlan,
    /// Whether this cycle's CPU time is still to be read.
    pub(crate) open: Cell<bool>,
    /// The response that ended the run by the policy `stop` \[ns\], and its tick.
    broken: Cell<Option<(u64, u64)>>,
    release_ns: Cell<u64>,
    start_ns: Cell<u64>,
    used_cpu_ns: Cell<u64>,
    last_cpu_ns: Cell<u64>,
    misses: Cell<u64>,
    slips: Cell<u64>,
}

impl CycleTiming {
    /// Nothing done yet.
    pub(crate) fn new(deadline: NodeDeadline, warm_up: WarmUpPlan) -> Self {
        Self {
            deadline,
            warm_up,
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

    /// That many periods passed without a cycle.
    pub(crate) fn slip(&self, periods: u64) {
        self.slips.set(self.slips.get() + periods);
        self.misses.set(self.misses.get() + periods);
    }

    /// When the node is to warm-up the cycle of the sample after that of `sample_ns`, if that is still to come.
    pub(crate) fn warm_up_ns(&self, sample_ns: u64) -> Option<u64> {
        self.warm_up.due_ns(sample_ns, now_ns())
    }

    /// Closes the cycle before and warms up the next.
    pub(crate) fn warm_up(&self) {
        self.close();
        self.warm_up.run();
    }

    /// A cycle that was due at `release_ns` begins now.
    pub(crate) fn begin(&self, release_ns: u64) {
        self.close();
        self.release_ns.set(release_ns);
        self.start_ns.set(now_ns());
    }

    /// What becomes of a message of `sample_ns` that is ready at `publish_ns`; `None` when it is on time.
    pub(crate) fn late(&self, tick: u64, sample_ns: u64, publish_ns: u64) -> Option<Late> {
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

    /// The tick and the response \[ns\] that ended the run, by the policy `stop`.
    pub(crate) fn broken(&self) -> Option<(u64, u64)> {
        self.broken.get()
    }

    /// Writes this cycle's timing into the `stamp` of its message.
    pub(crate) fn report(&self, stamp: &mut Stamp) {
        stamp.release_ns = self.release_ns.get();
        stamp.start_ns = self.start_ns.get();
        stamp.cpu_ns = self.last_cpu_ns.get();
        stamp.misses = self.misses.get();
        stamp.slips = self.slips.get();
    }

    /// Reads the CPU's clock for the cycle before, once. It is a system call of a microsecond, so this comes with the
    /// warm-up when there is one: a cycle is what the thread used from one closing to the next.
    fn close(&self) {
        if self.open.replace(false) {
            let used_ns = thread_cpu_ns();
            self.last_cpu_ns.set(used_ns - self.used_cpu_ns.replace(used_ns));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn due_in_ten_ms(late: Late) -> CycleTiming {
        CycleTiming::new(NodeDeadline { deadline_ns: 10_000_000, late }, WarmUpPlan::new(None))
    }

    #[test]
    fn a_late_message_is_a_miss_and_so_is_a_slot_slept_through() {
        let cycle_timing = due_in_ten_ms(Late::Skip);
        let mut stamp = Stamp::default();
        assert_eq!(cycle_timing.late(7, 1_000, 10_001_000), None, "just in time");
        assert_eq!(cycle_timing.late(7, 1_000, 900), None, "woken early");
        cycle_timing.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (0, 0));
        assert_eq!(cycle_timing.late(7, 1_000, 10_001_001), Some(Late::Skip));
        cycle_timing.slip(3);
        cycle_timing.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (4, 3));
        assert_eq!(cycle_timing.broken(), None);
    }

    #[test]
    fn the_policy_stop_remembers_what_broke_the_budget() {
        let cycle_timing = due_in_ten_ms(Late::Stop);
        assert_eq!(cycle_timing.late(7, 1_000, 20_001_000), Some(Late::Stop));
        assert_eq!(cycle_timing.broken(), Some((7, 20_000_000)));
    }
}
