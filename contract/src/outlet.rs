//! The outlet: where a node speaks on one topic. It stamps, seals, sends and wakes.

use std::rc::Rc;
use std::sync::Arc;

use crate::Topic;
use crate::cycle::Punctuality;
use crate::link::Link;
use crate::message::{Message, Stamp};
use crate::port::Send;
use crate::realtime::{Board, now_ns};
use crate::scenario::{Fault, FaultKind, Late, Mode, Scenario};
use crate::skew::Skew;
use crate::stamp::unheard;

/// Where a node speaks on one topic.
pub struct Outlet<M> {
    port: Rc<dyn Send<M>>,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
    link: Link<M>,
    /// Faults that make this process slow, and the sample time they go by \[s\].
    slow: Vec<Fault>,
    sample_s: f64,
    skew: Skew,
    clocked: bool,
    epoch: u32,
    sequence: u64,
    timely: Option<M>,
}

impl<M: Message> Outlet<M> {
    pub(crate) fn new(
        port: Rc<dyn Send<M>>,
        board: Arc<Board>,
        punctuality: Rc<Punctuality>,
        scenario: &Scenario,
        epoch: u32,
    ) -> Self {
        punctuality.rehearsal.add(port.clone());
        Self {
            port,
            board,
            punctuality,
            link: Link::new(scenario),
            slow: slowness(scenario, M::TOPIC),
            sample_s: scenario.sample_s(),
            skew: Skew::new(scenario, M::TOPIC),
            clocked: scenario.run.mode == Mode::Realtime,
            epoch,
            sequence: 0,
            timely: None,
        }
    }

    /// Stamps `message` with its `lineage` and this cycle's timing, sends it and wakes whoever waits for it; late ones as
    /// the deadline's policy says. True when the next cycle shall do less.
    pub fn send(&mut self, mut message: M, mut lineage: Stamp) -> bool {
        let tick = lineage.tick;
        let held_ns = held_up_ns(&self.slow, tick, self.sample_s);
        if self.clocked && held_ns > 0 {
            self.board.phase().wait(self.board.phase().count(), now_ns() + held_ns);
        } else {
            lineage.held_ns += held_ns;
        }
        let publish_ns = self.skew.read_ns(tick, now_ns());
        self.punctuality.open.set(true);
        let late = self.punctuality.late(tick, lineage.sample_ns, publish_ns);
        match late {
            None => self.timely = Some(message),
            Some(Late::Hold) => message = self.timely.unwrap_or(message),
            Some(Late::Send | Late::Degrade) => {}
            Some(Late::Skip | Late::Stop) => return false,
        }
        self.sequence += 1;
        let stamp = message.stamp_mut();
        *stamp = lineage.published(M::TOPIC, self.sequence, publish_ns);
        stamp.epoch = u64::from(self.epoch);
        let heard = self.board.office(M::TOPIC).holder.get() == self.epoch;
        stamp.unheard = if heard { unheard::HEARD } else { unheard::SHADOW };
        self.punctuality.report(stamp);
        stamp.start_ns = self.skew.read_ns(tick, stamp.start_ns);
        self.link.pass(tick, &message.sealed(), |message| _ = self.port.send(message));
        let bell = self.board.bell(M::TOPIC);
        if self.clocked {
            bell.ring();
        } else {
            bell.mark(); // nobody is due before this node is done
        }
        late == Some(Late::Degrade)
    }
}

/// The faults of `scenario` that make the process slow that speaks on `topic`.
pub fn slowness(scenario: &Scenario, topic: Topic) -> Vec<Fault> {
    let slow = |fault: &&Fault| fault.target.process() == Some(topic) && fault.kind == FaultKind::Slow;
    scenario.fault.iter().filter(slow).cloned().collect()
}

/// How long `faults` hold up the answer to sample `tick` \[ns\].
pub fn held_up_ns(faults: &[Fault], tick: u64, sample_s: f64) -> u64 {
    const USUAL_MS: f64 = 5.0;
    let at_work = faults.iter().filter(|fault| fault.strikes(tick, sample_s));
    at_work.map(|fault| (fault.ms.unwrap_or(USUAL_MS) * 1e6) as u64).sum()
}
