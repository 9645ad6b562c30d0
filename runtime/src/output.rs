//! The output: where a node speaks on one topic. It stamps, seals, sends and wakes.

use std::rc::Rc;
use std::sync::Arc;

use crate::cycle_timing::CycleTiming;
use crate::fault_table::FaultUpdates;
use crate::link::Link;
use crate::port::Send;
use crate::realtime::{ControlPage, now_ns};
use crate::skew::Skew;
use contract::Topic;
use contract::fault_schedule::FaultSchedule;
use contract::message::{Message, Stamp};
use contract::scenario::{Fault, FaultKind, Late, Mode, Scenario};
use contract::stamp::delivery;

/// Where a node speaks on one topic.
pub struct Output<M> {
    port: Rc<dyn Send<M>>,
    page: Arc<ControlPage>,
    cycle_timing: Rc<CycleTiming>,
    link: Link<M>,
    slow: Slowness,
    news: FaultUpdates,
    skew: Skew,
    clocked: bool,
    epoch: u32,
    sequence: u64,
    timely: Option<M>,
}

impl<M: Message> Output<M> {
    pub(crate) fn new(
        port: Rc<dyn Send<M>>,
        page: Arc<ControlPage>,
        cycle_timing: Rc<CycleTiming>,
        scenario: &Scenario,
        epoch: u32,
    ) -> Self {
        cycle_timing.warm_up.add(port.clone());
        Self {
            port,
            news: FaultUpdates::new(page.clone()),
            page,
            cycle_timing,
            link: Link::new(scenario),
            slow: Slowness::new(scenario, M::TOPIC),
            skew: Skew::new(scenario, M::TOPIC),
            clocked: scenario.run.mode == Mode::Realtime,
            epoch,
            sequence: 0,
            timely: None,
        }
    }

    /// Stamps `message` with its `provenance` and this cycle's timing, sends it and wakes whoever waits for it; late ones as
    /// the deadline's policy says. True when the next cycle shall do less.
    pub fn send(&mut self, mut message: M, mut provenance: Stamp) -> bool {
        let tick = provenance.tick;
        self.news.tell(|number, fault| {
            self.slow.apply_fault(number, fault);
            self.link.apply_fault(number, fault);
        });
        let held_ns = self.slow.held_up_ns(tick);
        if self.clocked && held_ns > 0 {
            self.page.phase().wait(self.page.phase().count(), now_ns() + held_ns);
        } else {
            provenance.held_ns += held_ns;
        }
        let publish_ns = self.skew.read_ns(tick, now_ns());
        self.cycle_timing.open.set(true);
        let late = self.cycle_timing.late(tick, provenance.sample_ns, publish_ns);
        match late {
            None => self.timely = Some(message),
            Some(Late::Hold) => message = self.timely.unwrap_or(message),
            Some(Late::Send | Late::Degrade) => {}
            Some(Late::Skip | Late::Stop) => return false,
        }
        self.sequence += 1;
        let stamp = message.stamp_mut();
        *stamp = provenance.published(M::TOPIC, self.sequence, publish_ns);
        stamp.epoch = u64::from(self.epoch);
        let role = self.page.role(M::TOPIC);
        let heard = role.active() == self.epoch;
        stamp.delivery = if heard { delivery::DELIVERED } else { delivery::STANDBY };
        self.cycle_timing.report(stamp);
        stamp.start_ns = self.skew.read_ns(tick, stamp.start_ns);
        self.link.pass(tick, &message.with_checksum(), |message| match self.port.send(message) {
            Ok(()) => role.sent(self.epoch).count(),
            Err(failure) => role.port_failures[failure as usize].count(),
        });
        let doorbell = self.page.doorbell(M::TOPIC);
        if self.clocked {
            doorbell.ring();
        } else {
            doorbell.mark(); // nobody is due before this node is done
        }
        late == Some(Late::Degrade)
    }
}

/// The faults that make a process slow.
pub struct Slowness {
    topic: Topic,
    /// Each holds it up for so long \[ns\].
    faults: FaultSchedule<u64>,
}

impl Slowness {
    /// For the process that speaks on `topic`.
    pub fn new(scenario: &Scenario, topic: Topic) -> Self {
        Self { topic, faults: FaultSchedule::new(scenario, |_, fault| hold_up_ns(topic, fault)) }
    }

    /// How long the answer to sample `tick` is held up \[ns\].
    pub fn held_up_ns(&self, tick: u64) -> u64 {
        self.faults.on(tick).map(|fault| fault.effect).sum()
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault, hold_up_ns(self.topic, fault));
    }
}

/// How long `fault` holds up the process that speaks on `topic`; nothing if it is not that kind of fault.
fn hold_up_ns(topic: Topic, fault: &Fault) -> Option<u64> {
    const USUAL_MS: f64 = 5.0;
    let slows = fault.target.process() == Some(topic) && fault.kind == FaultKind::Slow;
    slows.then(|| (fault.ms.unwrap_or(USUAL_MS) * 1e6) as u64)
}
