//! The cycle loop of a node that answers: it waits until the node must answer to a sample, with or without its input.
//!
//! ```text
//! wakes for          Timer                                           Barrier
//! the input          a message of the node before came: answer       the node before is done with the sample: answer
//! lateness           the input is late: answer without it            -  (the role before is vacant: answer)
//! the warm-up        shortly before the next sample                  -
//! the role           a sample is taken: the process may begin        the same
//! looking around     100 ms have passed, or the run ends             the same
//! ```
//!
//! A node answers to every sample once; its core handles an input that is old or missing. A slot that the process slept
//! through is skipped and counted. An input that comes after its sample was answered is used at the next sample.

use contract::message::Stamp;
use contract::snapshot::Snapshot;
use contract::topic::Topic;
use settings::Fault;

use crate::cycle_timing::warm_up_ns;
use crate::error::SessionError;
use crate::input::Upstream;
use crate::limits::LOOK_AROUND_NS;
use crate::member::Member;
use crate::process_faults::burn;
use crate::realtime::{now_ns, phase};
use crate::release::Release;
use crate::shared_role::Origin;

/// Loop of one process of a node that answers.
pub struct CycleLoop {
    member: Member,
    release: Release,
    /// Time after a sample at which the input for it is late \[ns\].
    patience_ns: u64,
    /// `true` if this process was active or on standby at the last look.
    assigned: bool,
    /// Sample to answer to next.
    next: u64,
    /// `true` if this process has answered to a sample since it was assigned; samples before its first answer are no
    /// slips.
    answered: bool,
}

/// Reason why a process in real time has woken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Wake {
    /// Input that came: its tick, and the time it was sent, from which the cycle is due \[ns\].
    Input(u64, u64),
    /// Input that did not come: its tick, and the time it was due \[ns\].
    Late(u64, u64),
    /// Time to warm up.
    WarmUp,
    /// Time to look around.
    LookAround,
}

impl CycleLoop {
    pub(crate) fn new(member: Member, release: Release, patience_ns: u64) -> Self {
        Self { member, release, patience_ns, assigned: false, next: 0, answered: false }
    }

    /// Sleeps until the node must answer, begins the cycle, and returns the sample to answer to; `None` if the run is
    /// over or another process has taken over.
    ///
    /// `input` receives the messages of the node before this one.
    ///
    /// # Errors
    /// A fault ends the process, or the process has missed a deadline with the policy `stop`.
    pub fn next(&mut self, input: &mut dyn Upstream) -> Result<Option<u64>, SessionError> {
        self.member.leave_if_copied();
        let due = match self.release {
            Release::Timer { period_ns } => self.by_the_timer(period_ns, input),
            Release::Barrier => self.by_the_barrier(input.topic()),
        };
        let Some(tick) = due else { return self.member.timing.verdict().map(|()| None) };
        let Member { page, faults, .. } = &self.member;
        faults.update();
        if let (Some(until), Release::Timer { .. }) = (faults.burns_until(self.next, tick), self.release) {
            burn(page, self.release.sample_ns(page, until));
        }
        if faults.leaves(self.next, tick) {
            return Err(SessionError::FaultExit { tick });
        }
        self.next = tick + 1;
        Ok(Some(tick))
    }

    /// Passes the faults that are new since the last tick to `apply`, with their numbers.
    pub fn new_faults(&self, apply: impl FnMut(usize, &Fault)) {
        self.member.faults.new_faults(apply);
    }

    /// Provenance of the answer to sample `tick`.
    pub fn provenance(&self, tick: u64) -> Stamp {
        Stamp::at(tick, self.release.sample_ns(&self.member.page, tick))
    }

    /// Marks `tick` as done after its answer was sent, and stores `memory` for the next process if this one is active.
    pub fn done(&self, tick: u64, memory: &Snapshot) {
        let Member { page, topic, epoch, .. } = &self.member;
        let role = page.role(*topic);
        if role.active() == *epoch {
            role.memory.write(Origin::of(*epoch, tick + 1, memory), memory);
        }
        role.done(*epoch).set(tick as u32 + 1);
        self.release.cycle_done(page.doorbell(*topic));
    }

    fn by_the_timer(&mut self, period_ns: u64, input: &mut dyn Upstream) -> Option<u64> {
        while !self.is_over() {
            let (tick, release_ns) = match self.sleep(period_ns, input) {
                Wake::Input(tick, release_ns) | Wake::Late(tick, release_ns) => (tick, release_ns),
                Wake::WarmUp => {
                    self.member.timing.warm_up();
                    continue;
                }
                Wake::LookAround => continue,
            };
            if self.answered {
                self.member.timing.slip(tick.saturating_sub(self.next));
            }
            self.answered = true;
            self.member.timing.begin(release_ns);
            return Some(tick);
        }
        None
    }

    /// Sleeps until there is a reason to wake, and returns it.
    fn sleep(&mut self, period_ns: u64, input: &mut dyn Upstream) -> Wake {
        let now = now_ns();
        let look_around_ns = now + LOOK_AROUND_NS;
        let rung = self.member.page.doorbell(Topic::State).count(); // read first, so that no tick is slept through
        let is_assigned = self.is_assigned();
        let page = &self.member.page;
        let state_bell = page.doorbell(Topic::State);
        let origin_ns = page.origin_ns.get();
        if !is_assigned || origin_ns == 0 {
            // A process becomes active or standby with a tick; the first input may never come.
            state_bell.wait(rung, look_around_ns);
            return Wake::LookAround;
        }
        // The sample that is due next; the present one for a process that slept.
        let present = now.saturating_sub(origin_ns + self.patience_ns) / period_ns;
        let due = self.next.max(present);
        let sample_ns = origin_ns + due * period_ns;
        let late_ns = sample_ns + self.patience_ns;
        let will_be_sampled = page.total_samples.get() == 0 || due < page.total_samples.get();
        let warm_up_ns = warm_up_ns(period_ns, sample_ns.saturating_sub(period_ns), now);
        let wake_ns = if will_be_sampled { warm_up_ns.unwrap_or(late_ns) } else { u64::MAX };

        if input.arrived(wake_ns.min(look_around_ns)) {
            let stamp = input.stamp();
            if stamp.tick >= self.next {
                return Wake::Input(stamp.tick, stamp.publish_ns[input.topic() as usize]);
            }
        } else if warm_up_ns == Some(wake_ns) && now_ns() >= wake_ns {
            return Wake::WarmUp;
        } else if wake_ns == late_ns && now_ns() >= late_ns {
            return Wake::Late(due, late_ns);
        }
        Wake::LookAround
    }

    fn by_the_barrier(&mut self, upstream: Topic) -> Option<u64> {
        let page = self.member.page.clone();
        let before = page.role(upstream);
        self.wait(Topic::State, |cycle_loop| cycle_loop.is_assigned() && page.samples_taken() > cycle_loop.next)?;
        self.wait(upstream, |cycle_loop| match before.active() {
            0 => true,
            active => u64::from(before.done(active).get()) > cycle_loop.next,
        })?;
        self.member.timing.begin(now_ns());
        Some(self.next)
    }

    /// Sleeps at the doorbell of `topic` until `is_due` returns `true`; `None` if the run is over first.
    fn wait(&mut self, topic: Topic, mut is_due: impl FnMut(&mut Self) -> bool) -> Option<()> {
        let page = self.member.page.clone();
        let doorbell = page.doorbell(topic);
        loop {
            let rung = doorbell.count(); // read first, so that no change is slept through
            if self.is_over() {
                return None;
            }
            if is_due(self) {
                return Some(());
            }
            doorbell.wait(rung, now_ns() + LOOK_AROUND_NS);
        }
    }

    /// Returns whether this process is active or on standby. If it has just become active or standby, its next sample
    /// is the tick that its role names.
    fn is_assigned(&mut self) -> bool {
        let Member { page, topic, epoch, .. } = &self.member;
        let role = page.role(*topic);
        let assigned = role.assignment().includes(*epoch);
        if assigned && !self.assigned {
            (self.next, self.answered) = (u64::from(role.since(*epoch).get()), false);
        }
        self.assigned = assigned;
        assigned
    }

    fn is_over(&self) -> bool {
        let Member { page, topic, epoch, timing, .. } = &self.member;
        let assignment = page.role(*topic).assignment();
        let retired = assignment.active > *epoch && !assignment.includes(*epoch);
        retired || page.phase.count() >= phase::LEAVE || timing.is_broken()
    }
}

#[cfg(test)]
mod tests;
