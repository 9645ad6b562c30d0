//! The outlet: where a node speaks on one topic. It stamps, seals, sends and wakes.

use std::rc::Rc;
use std::sync::Arc;

use crate::cycle::Punctuality;
use crate::ledger::News;
use crate::link::Link;
use crate::port::Send;
use crate::realtime::{Board, now_ns};
use crate::skew::Skew;
use contract::Topic;
use contract::message::{Message, Stamp};
use contract::roll::Roll;
use contract::scenario::{Fault, FaultKind, Late, Mode, Scenario};
use contract::stamp::unheard;

/// Where a node speaks on one topic.
pub struct Outlet<M> {
    port: Rc<dyn Send<M>>,
    board: Arc<Board>,
    punctuality: Rc<Punctuality>,
    link: Link<M>,
    slow: Slowness,
    news: News,
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
            news: News::new(board.clone()),
            board,
            punctuality,
            link: Link::new(scenario),
            slow: Slowness::new(scenario, M::TOPIC),
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
        self.news.tell(|number, fault| {
            self.slow.suffer(number, fault);
            self.link.suffer(number, fault);
        });
        let held_ns = self.slow.held_up_ns(tick);
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
        let office = self.board.office(M::TOPIC);
        let heard = office.holder() == self.epoch;
        stamp.unheard = if heard { unheard::HEARD } else { unheard::SHADOW };
        self.punctuality.report(stamp);
        stamp.start_ns = self.skew.read_ns(tick, stamp.start_ns);
        self.link.pass(tick, &message.sealed(), |message| match self.port.send(message) {
            Ok(()) => office.sent(self.epoch).count(),
            Err(failure) => office.port_failures[failure as usize].count(),
        });
        let bell = self.board.bell(M::TOPIC);
        if self.clocked {
            bell.ring();
        } else {
            bell.mark(); // nobody is due before this node is done
        }
        late == Some(Late::Degrade)
    }
}

/// The faults that make a process slow.
pub struct Slowness {
    topic: Topic,
    /// Each holds it up for so long \[ns\].
    faults: Roll<u64>,
}

impl Slowness {
    /// For the process that speaks on `topic`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        Self { topic, faults: Roll::new(scenario, |_, fault| hold_up_ns(topic, fault)) }
    }

    /// How long the answer to sample `tick` is held up \[ns\].
    pub fn held_up_ns(&self, tick: u64) -> u64 {
        self.faults.on(tick).map(|fault| fault.effect).sum()
    }

    fn suffer(&mut self, number: usize, fault: &Fault) {
        self.faults.suffer(number, fault, hold_up_ns(self.topic, fault));
    }
}

/// How long `fault` holds up the process that speaks on `topic`; nothing if it is not that kind of fault.
fn hold_up_ns(topic: Topic, fault: &Fault) -> Option<u64> {
    const USUAL_MS: f64 = 5.0;
    let slows = fault.target.process() == Some(topic) && fault.kind == FaultKind::Slow;
    slows.then(|| (fault.ms.unwrap_or(USUAL_MS) * 1e6) as u64)
}
