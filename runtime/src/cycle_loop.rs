//! A node's turn: when it is to answer to which sample, whether its input has come or not.
//!
//! ```text
//! against the clock    the input came, or the deadline of the node before it has passed
//! in lockstep          the plant has sampled, and the node before it is done with that sample, or not there
//! ```
//!
//! A node answers to every sample once, however little it knows: what it makes of an input that is old or missing is the
//! business of its core. A slot that was slept through is skipped and counted. An input that comes after its sample was
//! answered is known at the next.

use std::rc::Rc;
use std::sync::Arc;

use crate::cycle_timing::{CycleTiming, LOOK_AROUND_NS};
use crate::fault_table::FaultUpdates;
use crate::input::Input;
use crate::process_fault::{ProcessFaults, burn};
use crate::realtime::{ControlPage, now_ns, phase};
use contract::Topic;
use contract::message::{Message, Stamp};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;

/// The turns of one process of a node.
pub struct CycleLoop {
    /// `None` in lockstep.
    clock: Option<Clock>,
    page: Arc<ControlPage>,
    cycle_timing: Rc<CycleTiming>,
    topic: Topic,
    epoch: u32,
    /// Lockstep: whether the plant has let this process in.
    let_in: bool,
    /// The sample to answer to next.
    next: u64,
    /// Faults in which the process itself goes wrong; in lockstep only those of its own settings.
    process_faults: ProcessFaults,
    news: FaultUpdates,
}

/// The ring's clock, as a node sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Between two samples \[ns\].
    pub period_ns: u64,
    /// From a sample to when the input of it is late \[ns\].
    pub patience_ns: u64,
}

impl CycleLoop {
    pub(crate) fn new(
        clock: Option<Clock>,
        page: Arc<ControlPage>,
        cycle_timing: Rc<CycleTiming>,
        topic: Topic,
        epoch: u32,
        scenario: &Scenario,
    ) -> Self {
        let process_faults = ProcessFaults::new(scenario, topic);
        let news = FaultUpdates::new(page.clone());
        Self { clock, page, cycle_timing, topic, epoch, let_in: false, next: 0, process_faults, news }
    }

    /// Sleeps until it is this node's turn, and begins the cycle: the sample to answer to. `None` when there is nothing
    /// more to do: the run is over, another process has taken over, or this node's budget is broken.
    ///
    /// `input` is where the node before this one is heard.
    pub fn next<M: Message>(&mut self, input: &mut Input<M>) -> Option<u64> {
        let tick = match self.clock {
            Some(clock) => self.by_the_clock(clock, input),
            None => self.by_the_ring(M::TOPIC),
        }?;
        self.news.tell(|number, fault| self.process_faults.apply_fault(number, fault));
        let healthy = self.survives(tick);
        self.next = tick + 1;
        healthy.then_some(tick)
    }

    /// Lets a fault of the process itself have its way; false when the process is to leave.
    fn survives(&self, tick: u64) -> bool {
        let burns_until = self.process_faults.burns_until(self.next, tick);
        if let (Some(until), Some(clock)) = (burns_until, self.clock) {
            let until_ns = self.page.origin_ns().saturating_add(until.saturating_mul(clock.period_ns));
            burn(&self.page, until_ns);
        }
        !self.process_faults.leaves(self.next, tick)
    }

    /// Lineage of the answer to sample `tick`.
    pub fn provenance(&self, tick: u64) -> Stamp {
        let period_ns = self.clock.map_or(0, |clock| clock.period_ns);
        Stamp::at(tick, self.page.origin_ns() + tick * period_ns)
    }

    /// The answer to `tick` is out, and `memory` is what the node has to remember for the next.
    pub fn done(&self, tick: u64, memory: &Snapshot) {
        let role = self.page.role(self.topic);
        if role.active() == self.epoch {
            role.memory.write(memory);
        }
        role.done(self.epoch).set(tick as u32 + 1);
        if self.clock.is_none() {
            self.page.doorbell(self.topic).ring();
        }
    }

    fn by_the_clock<M: Message>(&self, clock: Clock, input: &mut Input<M>) -> Option<u64> {
        while !self.is_over() {
            let now = now_ns();
            let sampled = self.page.doorbell(Topic::State);
            let rung = sampled.count(); // before the look, so that a tick after it is not slept through
            if !self.page.role(self.topic).assignment().includes(self.epoch) {
                sampled.wait(rung, now + LOOK_AROUND_NS); // who is let in is let in with a tick
                continue;
            }
            let origin_ns = self.page.origin_ns();
            // The sample that is due next, or for one that slept or has only just come the present one.
            let present = now.saturating_sub(origin_ns + clock.patience_ns) / clock.period_ns;
            let due = if origin_ns > 0 { self.next.max(present) } else { 0 };
            let sample_ns = origin_ns + due * clock.period_ns;
            let late_ns = sample_ns + clock.patience_ns;
            let warm_up_ns = self.cycle_timing.warm_up_ns(sample_ns.saturating_sub(clock.period_ns));
            let wake_ns = if origin_ns > 0 { warm_up_ns.unwrap_or(late_ns) } else { u64::MAX };

            if input.arrived(wake_ns.min(now + LOOK_AROUND_NS)) {
                let stamp = input.newest().stamp();
                if stamp.tick >= self.next {
                    return Some(self.begin(stamp.tick, stamp.publish_ns[M::TOPIC as usize]));
                }
            } else if warm_up_ns.is_some_and(|due_ns| wake_ns == due_ns) {
                self.cycle_timing.warm_up();
            } else if wake_ns == late_ns && now_ns() >= late_ns {
                return Some(self.begin(due, late_ns));
            }
        }
        None
    }

    /// A cycle for `tick` begins that was due at `release_ns`.
    fn begin(&self, tick: u64, release_ns: u64) -> u64 {
        if self.next > 0 {
            self.cycle_timing.slip(tick.saturating_sub(self.next));
        }
        self.cycle_timing.begin(release_ns);
        tick
    }

    fn by_the_ring(&mut self, upstream: Topic) -> Option<u64> {
        let page = self.page.clone();
        let mine = page.role(self.topic);
        let sampled = |tick: u64| u64::from(page.role(Topic::State).done(1).get()) > tick;
        self.wait(Topic::State, |cycle_loop| {
            let employed = mine.assignment().includes(cycle_loop.epoch);
            if employed && !cycle_loop.let_in {
                cycle_loop.next = u64::from(mine.since(cycle_loop.epoch).get());
            }
            cycle_loop.let_in = employed;
            employed && sampled(cycle_loop.next)
        })?;
        let before = page.role(upstream);
        self.wait(upstream, |cycle_loop| match before.active() {
            0 => true,
            active => u64::from(before.done(active).get()) > cycle_loop.next,
        })?;
        self.cycle_timing.begin(now_ns());
        Some(self.next)
    }

    /// Sleeps by the doorbell of `topic` until `is_due`; `None` when the run is over first.
    fn wait(&mut self, topic: Topic, mut is_due: impl FnMut(&mut Self) -> bool) -> Option<()> {
        let page = self.page.clone();
        let doorbell = page.doorbell(topic);
        loop {
            let rung = doorbell.count(); // before the look, so that a change after it is not slept through
            if self.is_over() {
                return None;
            }
            if is_due(self) {
                return Some(());
            }
            doorbell.wait(rung, now_ns() + LOOK_AROUND_NS);
        }
    }

    fn is_over(&self) -> bool {
        let assignment = self.page.role(self.topic).assignment();
        let retired = assignment.active > self.epoch && !assignment.includes(self.epoch);
        retired || self.page.phase().count() >= phase::LEAVE || self.cycle_timing.broken().is_some()
    }
}
