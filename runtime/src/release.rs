//! The release: what releases the plant, the only node with a clock, and the boundary between two ticks.
//!
//! In real time that is `CLOCK_MONOTONIC`: sample `k` stands for the instant `t0 + k T` whatever happens, and commands
//! act from the moment they arrive. In lockstep it is the ring itself: the next sample is due when everybody who works
//! is done with this one. In process nobody waits, and this file is not used.
//!
//! Between two ticks the roles change hands. Against the clock the plant lets in whom the launcher has named; in lockstep
//! it waits until the launcher has said who works on the tick that begins, whenever that may change.

use std::rc::Rc;
use std::sync::Arc;

use crate::cycle_timing::{CycleTiming, LOOK_AROUND_NS};
use crate::input::Input;
use crate::port::LEAST_DEPTH;
use crate::process_fault::{ProcessFaults, burn};
use crate::realtime::{ControlPage, Doorbell, now_ns, phase};
use contract::Topic;
use contract::message::{Message, Stamp};
use contract::scenario::{Fault, Mode, Scenario};

/// In lockstep, how long the plant waits on the wall clock for the ring to come round, or for a process to come back
/// or to follow.
const WATCHDOG_NS: u64 = 10_000_000_000;
/// In lockstep, how many ticks the plant may be ahead of launcher and recorder, who see them all: a quarter of a queue, for a
/// fault may send every message twice.
pub const LEAD_TICKS: u64 = LEAST_DEPTH as u64 / 4;
/// The nodes that answer to the plant.
const OTHERS: [Topic; 3] = [Topic::Reference, Topic::Controls, Topic::Actuators];

/// What releases the plant.
pub struct Release {
    kind: Kind,
    /// Period \[ns\].
    period_ns: u64,
    page: Arc<ControlPage>,
    cycle_timing: Rc<CycleTiming>,
    process_faults: ProcessFaults,
}

enum Kind {
    /// The clock: sample `k` stands for the instant `t0 + k T`, whatever happens.
    Clock { t0_ns: u64 },
    /// The ring: the next sample is due when everybody is done with this one.
    Ring,
}

/// How a turn of the ring ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CycleEnd {
    /// The next sample lies this many periods later: one, or more after a stall.
    Periods(u64),
    /// The run is over.
    Over,
    /// Lockstep: the ring has not come round within the watchdog's time.
    Stuck,
    /// Against the clock: a fault has the plant end by itself.
    FaultExit,
}

impl Release {
    /// The release of a scenario; the first sample is due shortly after this call.
    pub(crate) fn new(scenario: &Scenario, page: Arc<ControlPage>, cycle_timing: Rc<CycleTiming>) -> Self {
        const LEAD_IN_NS: u64 = 5_000_000;
        let kind = match scenario.run.mode {
            Mode::Realtime => Kind::Clock { t0_ns: now_ns() + LEAD_IN_NS },
            Mode::Lockstep | Mode::Inprocess => Kind::Ring,
        };
        let process_faults = ProcessFaults::new(scenario, Topic::State);
        let release = Self { kind, period_ns: scenario.sample_ns(), page, cycle_timing, process_faults };
        if let Kind::Clock { t0_ns } = release.kind {
            release.page.set_origin_ns(t0_ns);
            // Nobody rings the doorbell of the phase before the end, so this is a sleep until the first release.
            release.page.phase().wait(release.page.phase().count(), t0_ns);
            release.cycle_timing.begin(t0_ns);
        } else {
            release.cycle_timing.begin(now_ns());
        }
        release
    }

    /// Takes fault `number` as it is from now on: see [`contract::fault_schedule::FaultSchedule::apply_fault`].
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.process_faults.apply_fault(number, fault);
    }

    /// Begins tick `tick`: lets in who takes over with it, and gives the provenance of its STATE: a new chain. `None` when
    /// a process that is to come back does not.
    pub fn sample(&self, tick: u64) -> Option<Stamp> {
        let sample_ns = match &self.kind {
            Kind::Clock { t0_ns } => {
                for topic in OTHERS {
                    self.page.role(topic).activate_pending(tick as u32);
                }
                t0_ns + tick * self.period_ns
            }
            Kind::Ring => {
                let vacant = OTHERS.iter().any(|topic| self.page.role(*topic).active() == 0);
                if vacant || tick >= u64::from(self.page.ask_from().get()) {
                    self.ask(tick)?;
                }
                let now_ns = now_ns();
                self.page.set_origin_ns(now_ns);
                now_ns
            }
        };
        Some(Stamp::at(tick, sample_ns))
    }

    /// STATE of `tick` is out.
    pub fn sampled(&self, tick: u64) {
        let role = self.page.role(Topic::State);
        role.done(1).set(tick as u32 + 1);
        if let Kind::Ring = self.kind {
            self.page.doorbell(Topic::State).ring();
        }
    }

    /// Hands every command that comes in to `heard`, with its arrival after the sample \[ns\], until the next release.
    pub fn turn<M: Message>(&mut self, tick: u64, input: &mut Input<M>, mut heard: impl FnMut(&M, u64)) -> CycleEnd {
        let Kind::Clock { t0_ns } = self.kind else { return self.turn_in_lockstep(tick, input, heard) };
        let sample_ns = t0_ns + tick * self.period_ns;
        let release_ns = sample_ns + self.period_ns;
        let mut listen = |until_ns| {
            while input.arrived(until_ns) {
                heard(input.newest(), now_ns().saturating_sub(sample_ns));
            }
        };
        if let Some(warm_up_ns) = self.cycle_timing.warm_up_ns(sample_ns) {
            listen(warm_up_ns);
            self.cycle_timing.warm_up();
        }
        listen(release_ns);
        if self.page.phase().count() >= phase::LEAVE || self.cycle_timing.broken().is_some() {
            return CycleEnd::Over;
        }
        let due = tick + slots_passed(now_ns(), sample_ns, self.period_ns);
        if self.process_faults.leaves(tick + 1, due) {
            return CycleEnd::FaultExit;
        }
        if let Some(until) = self.process_faults.burns_until(tick + 1, due) {
            burn(&self.page, t0_ns.saturating_add(until.saturating_mul(self.period_ns)));
        }
        // The next release is never derived from this wake-up: slots that passed meanwhile are skipped.
        let periods = slots_passed(now_ns(), sample_ns, self.period_ns);
        let p = &self.cycle_timing;
        p.slip(periods - 1);
        p.begin(sample_ns + periods * self.period_ns);
        CycleEnd::Periods(periods)
    }

    fn turn_in_lockstep<M: Message>(
        &self,
        tick: u64,
        input: &mut Input<M>,
        mut heard: impl FnMut(&M, u64),
    ) -> CycleEnd {
        for topic in OTHERS {
            let role = self.page.role(topic);
            let done = || role.assignment().epochs().all(|epoch| u64::from(role.done(epoch).get()) > tick);
            if !self.wait_for(self.page.doorbell(topic), done) {
                return self.over_or_stuck();
            }
        }
        if input.arrived(0) {
            let command = input.newest();
            heard(command, command.stamp().held_ns);
        }
        self.let_the_watchers_follow(tick)
    }

    /// Lockstep: has the launcher say who works on `tick`.
    fn ask(&self, tick: u64) -> Option<()> {
        let ruled = self.page.ruled();
        self.page.asked().raise(tick as u32 + 1);
        self.wait_for(ruled, || u64::from(ruled.count()) > tick).then_some(())
    }

    /// Waits on the wall clock by `doorbell`; false when the run is over first, or the watchdog barks.
    fn wait_for(&self, doorbell: &Doorbell, is_so: impl Fn() -> bool) -> bool {
        let watchdog_ns = now_ns() + WATCHDOG_NS;
        loop {
            let rung = doorbell.count(); // before the look, so that a change after it is not slept through
            if is_so() {
                return true;
            }
            if self.page.phase().count() >= phase::LEAVE || now_ns() > watchdog_ns {
                return false;
            }
            doorbell.wait(rung, now_ns() + LOOK_AROUND_NS);
        }
    }

    /// Waits until launcher and recorder are close enough behind. Wall time only: the flight does not notice.
    fn let_the_watchers_follow(&self, tick: u64) -> CycleEnd {
        for seen in [self.page.watched(), self.page.recorded()] {
            if !self.wait_for(seen, || tick < u64::from(seen.count()) + LEAD_TICKS) {
                return self.over_or_stuck();
            }
        }
        self.cycle_timing.begin(now_ns());
        CycleEnd::Periods(1)
    }

    /// What it means that [`Self::wait_for`] waited in vain.
    fn over_or_stuck(&self) -> CycleEnd {
        if self.page.phase().count() >= phase::LEAVE { CycleEnd::Over } else { CycleEnd::Stuck }
    }
}

/// Whole periods from `sample_ns` to `now_ns`, at least one.
fn slots_passed(now_ns: u64, sample_ns: u64, period_ns: u64) -> u64 {
    (now_ns.saturating_sub(sample_ns) / period_ns).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stall_skips_the_slots_it_covered() {
        let period = 10_000_000;
        assert_eq!(slots_passed(1_000 + period, 1_000, period), 1, "on time");
        assert_eq!(slots_passed(1_000 + period + period / 2, 1_000, period), 1, "late within the slot");
        assert_eq!(slots_passed(1_000 + 3 * period + 5, 1_000, period), 3, "a stall over three slots");
        assert_eq!(slots_passed(1_000 + period - 7, 1_000, period), 1, "woken early");
        assert_eq!(slots_passed(0, 1_000, period), 1, "a clock behind the sample");
    }
}
