//! The pace: what releases the plant, the only node with a clock.
//!
//! In real time that is `CLOCK_MONOTONIC`: sample `k` stands for the instant `t0 + k T` whatever happens, and commands
//! act from the moment they arrive. In lockstep it is the ring itself: the next sample is due when this one's
//! ACTUATORS have come back. In process nobody waits, and this file is not used.

use std::rc::Rc;
use std::sync::Arc;

use crate::cycle::{Inlet, LOOK_AROUND_NS, Punctuality};
use crate::message::{Message, Stamp};
use crate::port::OBSERVER_DEPTH;
use crate::realtime::{Board, now_ns, phase};
use crate::scenario::{Mode, Scenario};

/// In lockstep, how long the plant waits on the wall clock for the ring to come round.
const WATCHDOG_NS: u64 = 5_000_000_000;
/// In lockstep, how many ticks the plant may be ahead of launcher and recorder, who see them all: half a queue.
const LEAD_TICKS: u64 = OBSERVER_DEPTH as u64 / 2;

/// What releases the plant.
pub struct Pace {
    kind: Kind,
    /// Period \[ns\].
    period_ns: u64,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
}

enum Kind {
    /// The clock: sample `k` stands for the instant `t0 + k T`, whatever happens.
    Clock { t0_ns: u64 },
    /// The ring: the next sample is due when this one's ACTUATORS have come back.
    Ring,
}

/// How a turn of the ring ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Turn {
    /// The next sample lies this many periods later: one, or more after a stall.
    Periods(u64),
    /// The run is over.
    Over,
    /// Lockstep: the ring has not come round within the watchdog's time.
    Stuck,
}

impl Pace {
    /// The pace of a scenario; the first sample is due shortly after this call.
    pub(crate) fn new(scenario: &Scenario, board: Arc<Board>, punctuality: Rc<Punctuality>) -> Self {
        const LEAD_IN_NS: u64 = 5_000_000;
        let kind = match scenario.run.mode {
            Mode::Realtime => Kind::Clock { t0_ns: now_ns() + LEAD_IN_NS },
            Mode::Lockstep | Mode::Inprocess => Kind::Ring,
        };
        let pace = Self { kind, period_ns: scenario.sample_ns(), board, punctuality };
        if let Kind::Clock { t0_ns } = pace.kind {
            // Nobody rings the bell of the phase before the end, so this is a sleep until the first release.
            pace.board.phase().wait(pace.board.phase().count(), t0_ns);
            pace.punctuality.begin(t0_ns);
        } else {
            pace.punctuality.begin(now_ns());
        }
        pace
    }

    /// Lineage of a STATE message: a new sample begins a new chain.
    pub fn sample(&self, tick: u64) -> Stamp {
        let sample_ns = match self.kind {
            Kind::Clock { t0_ns } => t0_ns + tick * self.period_ns,
            Kind::Ring => now_ns(),
        };
        Stamp { tick, sample_ns, ..Stamp::default() }
    }

    /// Hands every command that comes in to `heard`, with its arrival after the sample \[ns\], until the next release.
    pub fn turn<M: Message>(&mut self, tick: u64, inlet: &mut Inlet<M>, mut heard: impl FnMut(&M, u64)) -> Turn {
        match self.kind {
            Kind::Clock { t0_ns } => {
                let sample_ns = t0_ns + tick * self.period_ns;
                let release_ns = sample_ns + self.period_ns;
                let mut listen = |until_ns| {
                    while let Some(message) = inlet.arrived(until_ns) {
                        heard(&message, now_ns().saturating_sub(sample_ns));
                    }
                };
                if let Some(rehearsal_ns) = self.punctuality.rehearsal_ns(sample_ns) {
                    listen(rehearsal_ns);
                    self.punctuality.rehearse();
                }
                listen(release_ns);
                if self.board.phase().count() >= phase::LEAVE || self.punctuality.broken().is_some() {
                    return Turn::Over;
                }
                // The next release is never derived from this wake-up: slots that passed meanwhile are skipped.
                let periods = slots_passed(now_ns(), sample_ns, self.period_ns);
                let p = &self.punctuality;
                p.slip(periods - 1);
                p.begin(sample_ns + periods * self.period_ns);
                Turn::Periods(periods)
            }
            Kind::Ring => {
                let deadline_ns = now_ns() + WATCHDOG_NS;
                while let Some(message) = inlet.arrived(deadline_ns) {
                    if message.stamp().tick == tick {
                        heard(&message, 0);
                        return self.next_in_lockstep(tick);
                    }
                }
                if self.board.phase().count() >= phase::LEAVE { Turn::Over } else { Turn::Stuck }
            }
        }
    }

    /// Waits until launcher and recorder are close enough behind. Wall time only: the flight does not notice.
    fn next_in_lockstep(&self, tick: u64) -> Turn {
        for seen in [self.board.watched(), self.board.recorded()] {
            loop {
                let newest = seen.count();
                if tick < u64::from(newest) + LEAD_TICKS {
                    break;
                }
                if self.board.phase().count() >= phase::LEAVE {
                    return Turn::Over;
                }
                seen.wait(newest, now_ns() + LOOK_AROUND_NS);
            }
        }
        self.punctuality.begin(now_ns());
        Turn::Periods(1)
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
