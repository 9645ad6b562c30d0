//! The input: where a node hears one topic. What the guard refuses is counted and forgotten.

use std::rc::Rc;
use std::sync::Arc;

use crate::port::Receive;
use crate::realtime::{ControlPage, now_ns, phase};
use contract::Topic;
use contract::guard::{Guard, Refusal};
use contract::message::Message;

/// Where a node hears one topic.
pub struct Input<M> {
    port: Rc<dyn Receive<M>>,
    page: Arc<ControlPage>,
    guard: Guard<M>,
    /// Where refusals are counted: the role of who listens.
    listener: Topic,
    /// Which process of it listens.
    epoch: u32,
    /// How often the doorbell had rung at the last look.
    seen: u32,
    /// Between two samples \[ns\]; `None` in lockstep.
    period_ns: Option<u64>,
}

impl<M: Message> Input<M> {
    pub(crate) fn new(
        port: Rc<dyn Receive<M>>,
        page: Arc<ControlPage>,
        (listener, epoch): (Topic, u32),
        period_ns: Option<u64>,
    ) -> Self {
        Self { port, page, guard: Guard::default(), listener, epoch, seen: 0, period_ns }
    }

    /// The newest message that was taken, without waiting; the default (sequence 0) before the first.
    pub fn newest(&mut self) -> &M {
        self.look();
        self.guard.newest()
    }

    /// Waits for a message that is taken until `deadline_ns` or the end of the run; whether one came.
    pub(crate) fn arrived(&mut self, deadline_ns: u64) -> bool {
        let page = self.page.clone();
        let doorbell = page.doorbell(M::TOPIC);
        loop {
            let rung = doorbell.count(); // before the look, so that a message after it is not slept through
            if self.look() {
                return true;
            }
            if now_ns() >= deadline_ns || page.phase().count() >= phase::LEAVE {
                return false;
            }
            doorbell.wait(rung, deadline_ns);
        }
    }

    /// Judges what has come since the last look; whether something was taken.
    fn look(&mut self) -> bool {
        let rung = self.page.doorbell(M::TOPIC).count();
        if self.period_ns.is_some() && rung == self.seen {
            return false; // against the clock a message is there when the doorbell has rung: for everybody, not for some
        }
        self.seen = rung;
        let role = self.page.role(M::TOPIC);
        let own = self.page.role(self.listener);
        let active = role.active();
        let mut taken = false;
        loop {
            let (message, port) = match self.port.receive() {
                Ok(Some(received)) => received,
                Ok(None) => break,
                Err(failure) => {
                    own.port_failures[failure as usize].count();
                    break;
                }
            };
            let from_holder = role.port(active) == port;
            if from_holder {
                own.received(self.epoch, M::TOPIC).count();
            }
            if !message.stamp().is_delivered() {
                continue;
            }
            let posing = message.stamp().epoch == u64::from(active) && !from_holder;
            let samples = self.samples(message.stamp().tick);
            let judged = if posing { Err(Refusal::Publisher) } else { self.guard.take(&message, active, samples) };
            match judged {
                Ok(()) => taken = true,
                Err(refusal) => own.refused[refusal as usize].count(),
            }
        }
        taken
    }

    /// How many samples there are when one that tells of sample `tick` is to be judged: those that the plant has taken,
    /// and against the clock those that it has overslept, to which the nodes answer all the same.
    fn samples(&self, tick: u64) -> u64 {
        let taken = u64::from(self.page.role(Topic::State).done(1).get());
        match self.period_ns {
            Some(period_ns) if tick >= taken && self.page.origin_ns() > 0 => {
                taken.max(now_ns().saturating_sub(self.page.origin_ns()) / period_ns + 1)
            }
            _ => taken,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;

    use super::*;
    use crate::port::{PortError, PortFailure};
    use crate::shared_role::Assignment;
    use contract::message::{Controls, Stamp};

    const PORT: u64 = 71;

    /// What is sent through the only port there is.
    impl Receive<Controls> for RefCell<Vec<Controls>> {
        fn receive(&self) -> Result<Option<(Controls, u64)>, PortFailure> {
            Ok(self.borrow_mut().pop().map(|message| (message, PORT)))
        }

        fn cannot_reach(&self, _port: u64) -> bool {
            false
        }

        fn reconnect(&self) -> Result<(), PortError> {
            Ok(())
        }
    }

    /// What comes of answers to the samples `ticks`, when the plant has taken five and the first was taken so long ago
    /// \[ns\]: the ticks that are taken, and how many were refused for their age.
    fn taken(period_ns: Option<u64>, since_ns: u64, ticks: &[u64]) -> (Vec<u64>, u32) {
        let folder = tempfile::tempdir().unwrap();
        let page = Arc::new(ControlPage::create(&folder.path().join("page")).unwrap());
        page.role(Topic::State).done(1).set(5);
        page.set_origin_ns(now_ns() - since_ns);
        let role = page.role(Topic::Controls);
        role.assign(0, |_| Assignment { active: 1, standby: 0 });
        role.offer(1);
        assert!(role.claim(1, PORT));
        let line = Rc::new(RefCell::new(vec![]));
        let mut input = Input::new(line.clone(), page.clone(), (Topic::Actuators, 1), period_ns);
        let mut heard = vec![];
        for (sequence, tick) in (1..).zip(ticks) {
            let stamp = Stamp { tick: *tick, sequence, epoch: 1, ..Stamp::default() };
            line.borrow_mut().push(Controls { stamp, ..Controls::default() }.with_checksum());
            page.doorbell(Topic::Controls).mark();
            heard.extend(input.arrived(0).then(|| input.newest().stamp.tick));
        }
        let listener = page.role(Topic::Actuators);
        assert_eq!(listener.received(1, Topic::Controls).get() as usize, ticks.len(), "taken or not");
        (heard, listener.refused[Refusal::Age as usize].get())
    }

    #[test]
    fn an_answer_to_a_sample_that_is_yet_to_come_is_refused() {
        assert_eq!(taken(None, 0, &[4, 5, u64::MAX, 6]), (vec![4], 3));
        let ten_s_ns = 10_000_000_000;
        assert_eq!(taken(Some(ten_s_ns), 0, &[3, 5, u64::MAX, 4]), (vec![3, 4], 2), "nobody is the worse for it");
    }

    #[test]
    fn an_answer_to_a_sample_that_the_plant_has_overslept_is_taken() {
        let ten_s_ns = 10_000_000_000;
        let ticks = [4, 5, 6, 7, 8];
        assert_eq!(taken(Some(ten_s_ns), 6 * ten_s_ns + ten_s_ns / 2, &ticks), (vec![4, 5, 6], 2));
        assert_eq!(
            taken(None, 6 * ten_s_ns + ten_s_ns / 2, &ticks),
            (vec![4], 4),
            "in lockstep it sleeps no sample through"
        );
    }
}
