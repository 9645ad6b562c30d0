//! The input of a node on one topic. Messages that the guard refuses are counted and dropped.

use std::rc::Rc;

use crate::error::SessionError;
use crate::limits::NODE_DEPTH;
use crate::member::Member;
use crate::port::ReceivePort;
use crate::ports::Ports;
use crate::realtime::{now_ns, phase};
use contract::guard::{Guard, Refusal};
use contract::message::{Message, Stamp};
use contract::topic::Topic;

/// Input from the node before this one, whose messages wake this node.
pub trait Upstream {
    /// Topic of the messages.
    fn topic(&self) -> Topic;
    /// Waits until a message is accepted, `deadline_ns` has passed or the run ends; returns whether one was accepted.
    fn arrived(&mut self, deadline_ns: u64) -> bool;
    /// Stamp of the newest message that was accepted so far.
    fn stamp(&self) -> &Stamp;
}

/// Input of a node on one topic.
pub struct Input<M> {
    port: Rc<dyn ReceivePort<M>>,
    member: Member,
    guard: Guard<M>,
    /// Count of the doorbell at the last look.
    seen: u32,
}

impl<M: Message> Input<M> {
    /// Opens the input of `member`.
    pub fn open(ports: &mut Ports, member: &Member) -> Result<Self, SessionError> {
        Ok(Self::new(ports.receiver(NODE_DEPTH)?, member.clone()))
    }

    fn new(port: Rc<dyn ReceivePort<M>>, member: Member) -> Self {
        let guard = if member.with_checksums { Guard::default() } else { Guard::without_checksums() };
        Self { port, member, guard, seen: 0 }
    }

    /// Newest accepted message, without waiting; the default (sequence 0) before the first message.
    pub fn newest(&mut self) -> &M {
        self.look();
        self.guard.newest()
    }

    /// Newest message that was accepted so far, without a look for later ones; the default before the first message.
    pub fn known(&self) -> &M {
        self.guard.newest()
    }

    /// Newest message, if one was accepted since the last look.
    pub fn fresh(&mut self) -> Option<&M> {
        self.look().then(|| self.guard.newest())
    }

    /// Passes the messages received since the last look to the guard; returns whether it accepted one.
    ///
    /// Messages count as received when the doorbell has counted them, so that they arrive for all receivers at once.
    fn look(&mut self) -> bool {
        let Member { page, topic, epoch, caller, .. } = &self.member;
        let rung = page.doorbell(M::TOPIC).count();
        if rung == self.seen {
            return false;
        }
        self.seen = rung;
        let (publisher, listener) = (page.role(M::TOPIC), page.role(*topic));
        let active = publisher.active();
        let samples_taken = page.samples_taken();
        let mut taken = false;
        let mut judge = |message: &M, port| {
            let from_active = publisher.port(active) == port;
            if from_active {
                listener.received(*epoch, M::TOPIC).count();
            }
            let stamp = message.stamp();
            if !stamp.is_delivered() {
                return; // from a process on standby, lost by a fault, or a probe: no refusal
            }
            // The message has the epoch of the active process, but came through the port of another process.
            let forged = stamp.epoch == u64::from(active) && !from_active;
            let samples = caller.samples_by_now(page, samples_taken, stamp.tick);
            let judged = if forged { Err(Refusal::Publisher) } else { self.guard.take(message, active, samples) };
            match judged {
                Ok(()) => taken = true,
                Err(refusal) => listener.refused[refusal as usize].count(),
            }
        };
        loop {
            match self.port.receive(&mut judge) {
                Ok(true) => {}
                Ok(false) => return taken,
                Err(failure) => {
                    listener.port_failures[failure as usize].count();
                    return taken;
                }
            }
        }
    }
}

impl<M: Message> Upstream for Input<M> {
    fn topic(&self) -> Topic {
        M::TOPIC
    }

    fn arrived(&mut self, deadline_ns: u64) -> bool {
        let page = self.member.page.clone();
        let doorbell = page.doorbell(M::TOPIC);
        loop {
            let rung = doorbell.count(); // read first, so that no message is slept through
            if self.look() {
                return true;
            }
            if now_ns() >= deadline_ns || page.phase.count() >= phase::LEAVE {
                return false;
            }
            doorbell.wait(rung, deadline_ns);
        }
    }

    fn stamp(&self) -> &Stamp {
        self.known().stamp()
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::queue::Queues;
    use crate::realtime::ControlPage;
    use crate::release::{Caller, Release};
    use crate::shared_role::Assignment;
    use contract::message::Controls;
    use settings::Scenario;

    /// Sends answers to the samples `ticks`, when the plant has taken five samples, the first of them `since_ns` ago.
    /// Returns the ticks of the accepted answers, and the number of those refused for their age.
    fn taken(release: Release, since_ns: u64, ticks: &[u64]) -> (Vec<u64>, u32) {
        let page = Arc::new(ControlPage::private().unwrap());
        page.role(Topic::State).offer(1);
        page.role(Topic::State).done(1).set(5);
        page.origin_ns.set(now_ns() - since_ns);
        let role = page.role(Topic::Controls);
        role.assign(0, |_| Assignment { active: 1, standby: 0 });
        role.offer(1);
        let queues = Queues::default();
        let (receiver, sender) = (queues.receiver(1).unwrap(), queues.sender::<Controls>().unwrap());
        assert!(role.claim(1, sender.number()));
        page.role(Topic::Actuators).offer(1);
        let member = Member::new(page.clone(), Topic::Actuators, 1, &Scenario::default(), true);
        let mut input = Input::<Controls>::new(receiver, Member { caller: Caller::Loop(release), ..member });
        let mut taken = vec![];
        for (sequence, tick) in (1..).zip(ticks) {
            let stamp = Stamp { tick: *tick, sequence, epoch: 1, ..Stamp::default() };
            sender.send(&Controls { stamp, ..Controls::default() }.with_checksum()).unwrap();
            page.doorbell(Topic::Controls).mark();
            taken.extend(input.arrived(0).then(|| input.newest().stamp.tick));
        }
        let listener = page.role(Topic::Actuators);
        assert_eq!(listener.received(1, Topic::Controls).get() as usize, ticks.len(), "taken or not");
        (taken, listener.refused[Refusal::Age as usize].get())
    }

    const TEN_S_NS: u64 = 10_000_000_000;
    const TIMER: Release = Release::Timer { period_ns: TEN_S_NS };

    #[test]
    fn an_answer_to_a_sample_that_is_yet_to_come_is_refused() {
        assert_eq!(taken(Release::Barrier, 0, &[4, 5, u64::MAX, 6]), (vec![4], 3));
        assert_eq!(taken(TIMER, 0, &[3, 5, u64::MAX, 4]), (vec![3, 4], 2), "the others are taken");
    }

    #[test]
    fn an_answer_to_a_sample_that_the_plant_has_overslept_is_taken() {
        let ticks = [4, 5, 6, 7, 8];
        assert_eq!(taken(TIMER, 6 * TEN_S_NS + TEN_S_NS / 2, &ticks), (vec![4, 5, 6], 2));
        let in_lockstep = taken(Release::Barrier, 6 * TEN_S_NS + TEN_S_NS / 2, &ticks);
        assert_eq!(in_lockstep, (vec![4], 4), "the plant oversleeps none");
    }
}
