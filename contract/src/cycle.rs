//! The cycle: wake, step, send, and the punctuality of it.
//!
//! ```text
//! release   when the work was due: the clock for the plant, the arrival of its input for everybody else
//! start     when the process began;            release jitter (plant) or hop (others) = start - release
//! publish   when it sent;                      execution = publish - start
//!                                              response  = publish - sample time;  miss = response > deadline
//! slip      a period without a cycle: a release the plant slept through, an input that a newer one overtook;
//!           counted as a miss too, and never made up for in a burst
//! late      a message that misses its deadline is counted, and sent, skipped, replaced by the last timely one, or the
//!           end of the run, as the scenario's `[deadline]` says
//! ```
//!
//! A node's loop is `while let Some(input) = inlet.wait() { outlet.send(...) }` in every mode; only the plant, which
//! turns the ring, knows what releases it ([`crate::pace`]).

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use crate::message::{Message, Stamp};
use crate::port::{Receive, Send};
use crate::realtime::{Board, now_ns, phase, thread_cpu_ns};
use crate::rehearsal::Rehearsal;
use crate::scenario::{Late, NodeDeadline};

/// Longest sleep without a look around: a lost wake-up costs no more than this.
pub(crate) const LOOK_AROUND_NS: u64 = 100_000_000;

/// Timing of the cycle under way, shared by a node's ports.
pub struct Punctuality {
    deadline: NodeDeadline,
    rehearsal: Rehearsal,
    /// Whether this cycle's CPU time is still to be read.
    open: Cell<bool>,
    /// The response that ended the run by the policy `stop` \[ns\], and its tick.
    broken: Cell<Option<(u64, u64)>>,
    release_ns: Cell<u64>,
    start_ns: Cell<u64>,
    used_cpu_ns: Cell<u64>,
    last_cpu_ns: Cell<u64>,
    misses: Cell<u64>,
    slips: Cell<u64>,
}

impl Punctuality {
    /// Nothing done yet.
    pub(crate) fn new(deadline: NodeDeadline, rehearsal: Rehearsal) -> Self {
        Self {
            deadline,
            rehearsal,
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

    /// When the node is to rehearse the cycle of the sample after that of `sample_ns`, if that is still to come.
    pub(crate) fn rehearsal_ns(&self, sample_ns: u64) -> Option<u64> {
        self.rehearsal.due_ns(sample_ns, now_ns())
    }

    /// Closes the cycle before and rehearses the next.
    pub(crate) fn rehearse(&self) {
        self.close();
        self.rehearsal.run();
    }

    /// A cycle that was due at `release_ns` begins now.
    pub(crate) fn begin(&self, release_ns: u64) {
        self.close();
        self.release_ns.set(release_ns);
        self.start_ns.set(now_ns());
    }

    /// What becomes of a message of `sample_ns` that is ready at `publish_ns`; `None` when it is on time.
    fn late(&self, tick: u64, sample_ns: u64, publish_ns: u64) -> Option<Late> {
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
    fn report(&self, stamp: &mut Stamp) {
        stamp.release_ns = self.release_ns.get();
        stamp.start_ns = self.start_ns.get();
        stamp.cpu_ns = self.last_cpu_ns.get();
        stamp.misses = self.misses.get();
        stamp.slips = self.slips.get();
    }

    /// Reads the CPU's clock for the cycle before, once. It is a system call of a microsecond, so this comes with the
    /// rehearsal when there is one: a cycle is what the thread used from one closing to the next.
    fn close(&self) {
        if self.open.replace(false) {
            let used_ns = thread_cpu_ns();
            self.last_cpu_ns.set(used_ns - self.used_cpu_ns.replace(used_ns));
        }
    }
}

/// Where a node gets one topic from.
pub struct Inlet<M> {
    port: Box<dyn Receive<M>>,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
    newest: M,
}

impl<M: Message> Inlet<M> {
    pub(crate) fn new(port: Box<dyn Receive<M>>, board: Arc<Board>, punctuality: Rc<Punctuality>) -> Self {
        Self { port, board, punctuality, newest: M::default() }
    }

    /// Sleeps until a message comes, and begins a cycle with it; `None` when the run is over, or this node's budget broken.
    ///
    /// When several have come the newest wins, and the others count as slips.
    pub fn wait(&mut self) -> Option<M> {
        let before = *self.newest.stamp();
        while self.punctuality.broken().is_none() {
            let rehearsal_ns = self.punctuality.rehearsal_ns(before.sample_ns);
            if let Some(message) = self.arrived(rehearsal_ns.unwrap_or_else(|| now_ns() + LOOK_AROUND_NS)) {
                self.punctuality.slip(overtaken(&before, message.stamp()));
                self.punctuality.begin(message.stamp().publish_ns[M::TOPIC as usize]);
                return Some(message);
            }
            if self.board.phase().count() >= phase::LEAVE {
                return None;
            }
            if rehearsal_ns.is_some() {
                self.punctuality.rehearse();
            }
        }
        None
    }

    /// The newest message there is, without waiting; the default (sequence 0) before the first.
    pub fn newest(&mut self) -> &M {
        while let Some(message) = self.port.receive() {
            self.newest = message;
        }
        &self.newest
    }

    /// The newest message, once number `sequence` is among those that came.
    ///
    /// A publisher fills the queues of a topic one after another: who wakes on a message downstream of it may be
    /// quicker than its own queue. The message is on its way then, so this waits; only the end of the run cuts it short.
    pub fn catch_up(&mut self, sequence: u64) -> &M {
        while self.newest().stamp().sequence < sequence && self.board.phase().count() < phase::LEAVE {
            self.arrived(now_ns() + LOOK_AROUND_NS);
        }
        &self.newest
    }

    /// The newest message that came since the last look, waiting for one until `deadline_ns` or the end of the run.
    pub(crate) fn arrived(&mut self, deadline_ns: u64) -> Option<M> {
        let board = self.board.clone();
        let bell = board.bell(M::TOPIC);
        loop {
            let rung = bell.count(); // before the look, so that a message after it is not slept through
            let before = *self.newest.stamp();
            if *self.newest().stamp() != before {
                return Some(self.newest);
            }
            if now_ns() >= deadline_ns || board.phase().count() >= phase::LEAVE {
                return None;
            }
            bell.wait(rung, deadline_ns);
        }
    }
}

/// Where a node sends one topic to.
pub struct Outlet<M> {
    port: Rc<dyn Send<M>>,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
    epoch: u64,
    sequence: u64,
    timely: Option<M>,
}

impl<M: Message> Outlet<M> {
    pub(crate) fn new(port: Rc<dyn Send<M>>, board: Arc<Board>, punctuality: Rc<Punctuality>, epoch: u64) -> Self {
        punctuality.rehearsal.add(port.clone());
        Self { port, board, punctuality, epoch, sequence: 0, timely: None }
    }

    /// Stamps `message` with its `lineage` and this cycle's timing, sends it and wakes whoever waits for it; late ones as
    /// the deadline's policy says. True when the next cycle shall do less.
    pub fn send(&mut self, mut message: M, lineage: Stamp) -> bool {
        let publish_ns = now_ns();
        self.punctuality.open.set(true);
        let late = self.punctuality.late(lineage.tick, lineage.sample_ns, publish_ns);
        match late {
            None => self.timely = Some(message),
            Some(Late::Hold) => message = self.timely.unwrap_or(message),
            Some(Late::Send | Late::Degrade) => {}
            Some(Late::Skip | Late::Stop) => return false,
        }
        self.sequence += 1;
        let stamp = message.stamp_mut();
        *stamp = lineage.published(M::TOPIC, self.sequence, publish_ns);
        stamp.epoch = self.epoch;
        self.punctuality.report(stamp);
        self.port.send(&message);
        self.board.bell(M::TOPIC).ring();
        late == Some(Late::Degrade)
    }
}

/// How many messages lie between two of the same publisher; none before the first, or from another incarnation.
fn overtaken(before: &Stamp, after: &Stamp) -> u64 {
    if before.sequence == 0 || before.epoch != after.epoch {
        return 0;
    }
    after.sequence.saturating_sub(before.sequence + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_that_a_newer_one_overtook_are_counted() {
        let numbered = |epoch, sequence| Stamp { sequence, epoch, ..Stamp::default() };
        assert_eq!(overtaken(&numbered(1, 4), &numbered(1, 5)), 0, "the next one");
        assert_eq!(overtaken(&numbered(1, 4), &numbered(1, 305)), 300, "a process that was stopped for three seconds");
        assert_eq!(overtaken(&Stamp::default(), &numbered(1, 9)), 0, "joined late");
        assert_eq!(overtaken(&numbered(1, 4), &numbered(2, 9)), 0, "another incarnation");
    }

    fn due_in_ten_ms(late: Late) -> Punctuality {
        Punctuality::new(NodeDeadline { deadline_ns: 10_000_000, late }, Rehearsal::new(None))
    }

    #[test]
    fn a_late_message_is_a_miss_and_so_is_a_slot_slept_through() {
        let punctuality = due_in_ten_ms(Late::Skip);
        let mut stamp = Stamp::default();
        assert_eq!(punctuality.late(7, 1_000, 10_001_000), None, "just in time");
        assert_eq!(punctuality.late(7, 1_000, 900), None, "woken early");
        punctuality.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (0, 0));
        assert_eq!(punctuality.late(7, 1_000, 10_001_001), Some(Late::Skip));
        punctuality.slip(3);
        punctuality.report(&mut stamp);
        assert_eq!((stamp.misses, stamp.slips), (4, 3));
        assert_eq!(punctuality.broken(), None);
    }

    #[test]
    fn the_policy_stop_remembers_what_broke_the_budget() {
        let punctuality = due_in_ten_ms(Late::Stop);
        assert_eq!(punctuality.late(7, 1_000, 20_001_000), Some(Late::Stop));
        assert_eq!(punctuality.broken(), Some((7, 20_000_000)));
    }
}
