//! The loop of the plant, which begins every tick: it waits for the release of the next sample, and meanwhile receives
//! the commands of the mixer.
//!
//! ```text
//! wakes for            Timer                                        Barrier
//! a command            it came: it acts from this instant           - (the command of a tick is read at its end)
//! the release          t0 + k T                                     all working processes are done with this sample
//! the warm-up          shortly before the release                   -
//! the observers        -                                            launcher and recorder are close enough behind
//! the launcher         -                                            it has assigned the roles of the next tick
//! looking around       the run ends                                 100 ms have passed, or the run ends
//! ```
//!
//! In real time sample `k` stands for the instant `t0 + k T` whatever happens; slots that the plant slept through are
//! skipped and never made up for. In lockstep the plant waits without a limit; the launcher ends a run that is stuck.
//!
//! Roles change between two ticks. In real time the plant activates the epoch that the launcher has named. In lockstep
//! it asks the launcher for the assignment of the tick that begins, if that may have changed.

use contract::message::{Message, Stamp};
use contract::topic::Topic;

use crate::cycle_timing::warm_up_ns;
use crate::error::SessionError;
use crate::input::{Input, Upstream};
use crate::limits::{GATHER_NS, LEAD_IN_NS, LEAD_TICKS, LOOK_AROUND_NS};
use crate::member::Member;
use crate::process_faults::burn;
use crate::realtime::{Doorbell, now_ns, phase};
use crate::release::Release;
use crate::shared_role::Origin;

/// Loop of the plant.
pub struct SampleLoop {
    member: Member,
    release: Release,
    /// Current tick; `None` before the first.
    tick: Option<u64>,
}

impl SampleLoop {
    pub(crate) fn new(member: Member, release: Release) -> Self {
        Self { member, release, tick: None }
    }

    /// Passes every received command to `command`, with the time from the sample to its arrival \[ns\], until the next
    /// sample is due. Then begins the next tick and returns it; `None` if the run is over.
    ///
    /// # Errors
    /// A fault ends the process, or the process has missed a deadline with the policy `stop`.
    pub fn next<M: Message>(
        &mut self,
        input: &mut Input<M>,
        command: impl FnMut(&M, u64),
    ) -> Result<Option<u64>, SessionError> {
        self.member.leave_if_copied();
        let due = match (self.tick, self.release) {
            (Some(tick), Release::Timer { period_ns }) => self.by_the_timer(tick, period_ns, input, command)?,
            (Some(tick), Release::Barrier) => self.by_the_barrier(tick, input, command),
            (None, _) => self.first(),
        };
        let Some(tick) = due.filter(|_| !self.is_over()) else {
            return self.member.timing.verdict().map(|()| None);
        };
        self.member.faults.update();
        let page = &self.member.page;
        match self.release {
            Release::Timer { .. } => {
                for topic in Topic::OF_CONTROLLERS {
                    page.role(topic).activate_pending(tick as u32);
                }
            }
            Release::Barrier if self.ask(tick).is_none() => return Ok(None),
            Release::Barrier => {}
        }
        self.tick = Some(tick);
        Ok(self.tick)
    }

    /// Provenance of the STATE of `tick`, which begins a new chain.
    pub fn provenance(&self, tick: u64) -> Stamp {
        Stamp::at(tick, self.release.sample_ns(&self.member.page, tick))
    }

    /// Marks `tick` as the last, before its STATE is sent: this tick is finished, and no other begins.
    pub fn ends_with(&self, tick: u64) {
        self.member.page.total_samples.set(tick + 1);
    }

    /// Marks `tick` as done after its STATE was sent, which in lockstep wakes the nodes.
    pub fn done(&self, tick: u64) {
        let Member { page, epoch, .. } = &self.member;
        page.role(Topic::State).done(*epoch).set(tick as u32 + 1);
        self.release.cycle_done(page.doorbell(Topic::State));
    }

    /// Stores the plant's `memory` after STATE of `tick`, for the recorder.
    pub fn remember(&self, tick: u64, memory: &[u64]) {
        self.member.page.plant_memory.write(Origin { epoch: u64::from(self.member.epoch), done: tick + 1 }, memory);
    }

    /// Begins tick 0, in real time once all nodes wait for it or after [`GATHER_NS`]; `None` if the run was called off.
    fn first(&self) -> Option<u64> {
        let Member { page, timing, .. } = &self.member;
        let going = page.phase.count() == phase::GO;
        if let Release::Timer { .. } = self.release
            && going
        {
            let limit_ns = now_ns() + GATHER_NS;
            for topic in Topic::OF_CONTROLLERS {
                let role = page.role(topic);
                let waits = || role.active() == 0 || role.waiting.get() == role.active();
                self.wait_until(limit_ns, page.doorbell(topic), waits);
            }
            let origin_ns = now_ns() + LEAD_IN_NS;
            page.origin_ns.set(origin_ns);
            // The doorbell of the phase rings at the end of the run only, so this is a sleep until the first release.
            page.phase.wait(page.phase.count(), origin_ns);
            timing.begin(origin_ns);
        } else {
            timing.begin(now_ns());
        }
        going.then_some(0)
    }

    fn by_the_timer<M: Message>(
        &self,
        tick: u64,
        period_ns: u64,
        input: &mut Input<M>,
        mut command: impl FnMut(&M, u64),
    ) -> Result<Option<u64>, SessionError> {
        let Member { page, timing, faults, .. } = &self.member;
        let sample_ns = self.release.sample_ns(page, tick);
        let mut receive = |until_ns| {
            while input.arrived(until_ns) {
                command(input.newest(), now_ns().saturating_sub(sample_ns));
            }
        };
        if let Some(warm_up_ns) = warm_up_ns(period_ns, sample_ns, now_ns()) {
            receive(warm_up_ns);
            timing.warm_up();
        }
        receive(sample_ns + period_ns);
        if self.is_over() {
            return Ok(None);
        }
        let due = tick + periods_passed(now_ns(), sample_ns, period_ns);
        if faults.leaves(tick + 1, due) {
            return Err(SessionError::FaultExit { tick: tick + 1 });
        }
        if let Some(until) = faults.burns_until(tick + 1, due) {
            burn(page, self.release.sample_ns(page, until));
        }
        // The next release is never derived from this wake-up: slots that passed meanwhile are skipped.
        let periods = periods_passed(now_ns(), sample_ns, period_ns);
        timing.slip(periods - 1);
        timing.begin(sample_ns + periods * period_ns);
        Ok(Some(tick + periods))
    }

    fn by_the_barrier<M: Message>(
        &self,
        tick: u64,
        input: &mut Input<M>,
        mut command: impl FnMut(&M, u64),
    ) -> Option<u64> {
        let page = &self.member.page;
        for topic in Topic::OF_CONTROLLERS {
            let role = page.role(topic);
            let done = || role.assignment().epochs().all(|epoch| u64::from(role.done(epoch).get()) > tick);
            self.wait_for(page.doorbell(topic), done)?;
        }
        if let Some(message) = input.fresh() {
            command(message, message.stamp().held_ns);
        }
        for seen in [&page.watched, &page.recorded] {
            self.wait_for(seen, || tick < u64::from(seen.count()) + LEAD_TICKS)?; // does not affect the flight
        }
        self.member.timing.begin(now_ns());
        Some(tick + 1)
    }

    /// Waits for the launcher's assignment of `tick`, if it may have changed; `None` if the run is over.
    fn ask(&self, tick: u64) -> Option<()> {
        let page = &self.member.page;
        if tick >= u64::from(page.next_decision.get())
            || Topic::OF_CONTROLLERS.iter().any(|topic| page.role(*topic).active() == 0)
        {
            page.asked.raise(tick as u32 + 1);
            self.wait_for(&page.decided, || u64::from(page.decided.count()) > tick)?;
        }
        page.origin_ns.set(now_ns());
        Some(())
    }

    /// Sleeps at `doorbell` until `is_so` returns `true`; `None` if the run is over first.
    fn wait_for(&self, doorbell: &Doorbell, is_so: impl Fn() -> bool) -> Option<()> {
        self.wait_until(u64::MAX, doorbell, is_so)
    }

    /// Sleeps at `doorbell` until `is_so` returns `true`; `None` if the run is over or `limit_ns` has passed first.
    fn wait_until(&self, limit_ns: u64, doorbell: &Doorbell, is_so: impl Fn() -> bool) -> Option<()> {
        loop {
            let rung = doorbell.count(); // read first, so that no change is slept through
            if is_so() {
                return Some(());
            }
            let now_ns = now_ns();
            if self.member.page.phase.count() >= phase::LEAVE || now_ns >= limit_ns {
                return None;
            }
            doorbell.wait(rung, limit_ns.min(now_ns + LOOK_AROUND_NS));
        }
    }

    fn is_over(&self) -> bool {
        let Member { page, timing, .. } = &self.member;
        let was_last = self.tick.is_some_and(|tick| page.total_samples.get() == tick + 1);
        was_last || page.phase.count() >= phase::LEAVE || timing.is_broken()
    }
}

/// Whole periods from `sample_ns` to `now_ns`, at least one.
fn periods_passed(now_ns: u64, sample_ns: u64, period_ns: u64) -> u64 {
    (now_ns.saturating_sub(sample_ns) / period_ns).max(1)
}

#[cfg(test)]
mod tests;
