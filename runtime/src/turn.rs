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

use crate::cycle::{LOOK_AROUND_NS, Punctuality};
use crate::inlet::Inlet;
use crate::ledger::News;
use crate::realtime::{Board, now_ns, phase};
use crate::seizure::{Seizures, burn};
use contract::Topic;
use contract::message::{Message, Stamp};
use contract::scenario::Scenario;
use contract::snapshot::Snapshot;

/// The turns of one process of a node.
pub struct Turns {
    /// `None` in lockstep.
    clock: Option<Clock>,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
    topic: Topic,
    epoch: u32,
    /// Lockstep: whether the plant has let this process in.
    let_in: bool,
    /// The sample to answer to next.
    next: u64,
    /// Faults in which the process itself goes wrong; in lockstep only those of its own settings.
    seizures: Seizures,
    news: News,
}

/// The ring's clock, as a node sees it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Clock {
    /// Between two samples \[ns\].
    pub period_ns: u64,
    /// From a sample to when the input of it is late \[ns\].
    pub patience_ns: u64,
}

impl Turns {
    pub(crate) fn new(
        clock: Option<Clock>,
        board: Arc<Board>,
        punctuality: Rc<Punctuality>,
        topic: Topic,
        epoch: u32,
        scenario: &Scenario,
    ) -> Self {
        let seizures = Seizures::new(scenario, topic);
        let news = News::new(board.clone());
        Self { clock, board, punctuality, topic, epoch, let_in: false, next: 0, seizures, news }
    }

    /// Sleeps until it is this node's turn, and begins the cycle: the sample to answer to. `None` when there is nothing
    /// more to do: the run is over, another process has taken over, or this node's budget is broken.
    ///
    /// `inlet` is where the node before this one is heard.
    pub fn next<M: Message>(&mut self, inlet: &mut Inlet<M>) -> Option<u64> {
        let tick = match self.clock {
            Some(clock) => self.by_the_clock(clock, inlet),
            None => self.by_the_ring(M::TOPIC),
        }?;
        self.news.tell(|number, fault| self.seizures.suffer(number, fault));
        let healthy = self.survives(tick);
        self.next = tick + 1;
        healthy.then_some(tick)
    }

    /// Lets a fault of the process itself have its way; false when the process is to leave.
    fn survives(&self, tick: u64) -> bool {
        let burns_until = self.seizures.burns_until(self.next, tick);
        if let (Some(until), Some(clock)) = (burns_until, self.clock) {
            let until_ns = self.board.origin_ns().saturating_add(until.saturating_mul(clock.period_ns));
            burn(&self.board, until_ns);
        }
        !self.seizures.leaves(self.next, tick)
    }

    /// Lineage of the answer to sample `tick`.
    pub fn lineage(&self, tick: u64) -> Stamp {
        let period_ns = self.clock.map_or(0, |clock| clock.period_ns);
        Stamp::at(tick, self.board.origin_ns() + tick * period_ns)
    }

    /// The answer to `tick` is out, and `memory` is what the node has to remember for the next.
    pub fn done(&self, tick: u64, memory: &Snapshot) {
        let office = self.board.office(self.topic);
        if office.holder() == self.epoch {
            office.memory.write(memory);
        }
        office.done(self.epoch).set(tick as u32 + 1);
        if self.clock.is_none() {
            self.board.bell(self.topic).ring();
        }
    }

    fn by_the_clock<M: Message>(&self, clock: Clock, inlet: &mut Inlet<M>) -> Option<u64> {
        while !self.is_over() {
            let now = now_ns();
            let sampled = self.board.bell(Topic::State);
            let rung = sampled.count(); // before the look, so that a tick after it is not slept through
            if !self.board.office(self.topic).staff().employs(self.epoch) {
                sampled.wait(rung, now + LOOK_AROUND_NS); // who is let in is let in with a tick
                continue;
            }
            let origin_ns = self.board.origin_ns();
            // The sample that is due next, or for one that slept or has only just come the present one.
            let present = now.saturating_sub(origin_ns + clock.patience_ns) / clock.period_ns;
            let due = if origin_ns > 0 { self.next.max(present) } else { 0 };
            let sample_ns = origin_ns + due * clock.period_ns;
            let late_ns = sample_ns + clock.patience_ns;
            let rehearsal_ns = self.punctuality.rehearsal_ns(sample_ns.saturating_sub(clock.period_ns));
            let wake_ns = if origin_ns > 0 { rehearsal_ns.unwrap_or(late_ns) } else { u64::MAX };

            if inlet.arrived(wake_ns.min(now + LOOK_AROUND_NS)) {
                let stamp = inlet.newest().stamp();
                if stamp.tick >= self.next {
                    return Some(self.begin(stamp.tick, stamp.publish_ns[M::TOPIC as usize]));
                }
            } else if rehearsal_ns.is_some_and(|due_ns| wake_ns == due_ns) {
                self.punctuality.rehearse();
            } else if wake_ns == late_ns && now_ns() >= late_ns {
                return Some(self.begin(due, late_ns));
            }
        }
        None
    }

    /// A cycle for `tick` begins that was due at `release_ns`.
    fn begin(&self, tick: u64, release_ns: u64) -> u64 {
        if self.next > 0 {
            self.punctuality.slip(tick.saturating_sub(self.next));
        }
        self.punctuality.begin(release_ns);
        tick
    }

    fn by_the_ring(&mut self, upstream: Topic) -> Option<u64> {
        let board = self.board.clone();
        let mine = board.office(self.topic);
        let sampled = |tick: u64| u64::from(board.office(Topic::State).done(1).get()) > tick;
        self.wait(Topic::State, |turns| {
            let employed = mine.staff().employs(turns.epoch);
            if employed && !turns.let_in {
                turns.next = u64::from(mine.since(turns.epoch).get());
            }
            turns.let_in = employed;
            employed && sampled(turns.next)
        })?;
        let before = board.office(upstream);
        self.wait(upstream, |turns| match before.holder() {
            0 => true,
            holder => u64::from(before.done(holder).get()) > turns.next,
        })?;
        self.punctuality.begin(now_ns());
        Some(self.next)
    }

    /// Sleeps by the bell of `topic` until `is_due`; `None` when the run is over first.
    fn wait(&mut self, topic: Topic, mut is_due: impl FnMut(&mut Self) -> bool) -> Option<()> {
        let board = self.board.clone();
        let bell = board.bell(topic);
        loop {
            let rung = bell.count(); // before the look, so that a change after it is not slept through
            if self.is_over() {
                return None;
            }
            if is_due(self) {
                return Some(());
            }
            bell.wait(rung, now_ns() + LOOK_AROUND_NS);
        }
    }

    fn is_over(&self) -> bool {
        let staff = self.board.office(self.topic).staff();
        let retired = staff.holder > self.epoch && !staff.employs(self.epoch);
        retired || self.board.phase().count() >= phase::LEAVE || self.punctuality.broken().is_some()
    }
}
