//! The output of a node: stamps a message, adds the checksum, sends it and wakes the receivers.

use std::any::Any;
use std::rc::Rc;

use crate::error::SessionError;
use crate::link::Link;
use crate::member::Member;
use crate::port::SendPort;
use crate::ports::Ports;
use contract::message::{Message, Stamp, State, Truth};
use contract::stamp::delivery;
use settings::{Late, Scenario};

/// Output of a node on its topic.
pub struct Output<M> {
    port: Rc<dyn SendPort<M>>,
    member: Member,
    link: Link<M>,
    sequence: u64,
    /// Last message that was on time.
    timely: Option<M>,
}

impl<M: Message> Output<M> {
    /// Opens the output of `member`, and claims the place in the role that the launcher offered to its epoch.
    pub fn open(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Self, SessionError> {
        let port = ports.sender(member.epoch)?;
        member.timing.warm_up_with(port.clone());
        Ok(Self { port, member: member.clone(), link: Link::new(scenario), sequence: 0, timely: None })
    }

    /// Returns the `known` message of a replay, if there is one; the next send reuses the number of that message.
    pub fn known(&mut self, known: Option<&dyn Any>) -> Option<M> {
        let known: &M = known?.downcast_ref()?;
        self.sequence = known.stamp().sequence.saturating_sub(1);
        Some(*known)
    }

    /// Stamps `message` with its `provenance` and this cycle's timing, sends it and wakes the processes that wait for
    /// it. A late message is treated by the deadline's policy; a withheld message is sent too, marked as such. Returns
    /// `true` if the next cycle shall do less, because this one was late under the policy `degrade`.
    pub fn send(&mut self, message: M, mut provenance: Stamp) -> bool {
        self.member.leave_if_copied();
        let Member { page, epoch, caller, timing, faults, continues, with_checksums, .. } = &self.member;
        let tick = provenance.tick;
        provenance.held_ns += caller.hold_up(page, faults.held_up_ns(tick));
        let publish_ns = faults.read_ns(tick, timing.now_ns());
        let late = timing.ready(tick, provenance.sample_ns, publish_ns);
        let late = late.map(|policy| if message.is_last() { Late::Send } else { policy });
        let (sent, withheld) = match late {
            None => {
                self.timely = Some(message);
                (Some(message), None)
            }
            Some(Late::Send | Late::Degrade) => (Some(message), None),
            Some(Late::Hold) => (self.timely.or(Some(message)), Some(message)),
            Some(Late::Skip | Late::Stop) => (None, Some(message)),
        };
        let role = page.role(M::TOPIC);
        let mut stamp = provenance.published(M::TOPIC, self.sequence + 1, publish_ns);
        (stamp.restored_epoch, stamp.restored_ticks) = (continues.get().epoch, continues.get().done);
        stamp.epoch = u64::from(*epoch);
        stamp.faults = faults.known();
        stamp.delivery = if role.active() == *epoch { delivery::DELIVERED } else { delivery::STANDBY };
        timing.report(&mut stamp);
        stamp.start_ns = faults.read_ns(tick, stamp.start_ns);
        let stamped = |mut message: M, delivery_bits: u64| {
            *message.stamp_mut() = stamp;
            message.stamp_mut().delivery |= delivery_bits;
            if *with_checksums { message.with_checksum() } else { message }
        };
        let deliver = |message: &M| match self.port.send(message) {
            Ok(()) => {
                role.sent(*epoch).count();
                role.sent_by_all.count();
            }
            Err(failure) => role.port_failures[failure as usize].count(),
        };
        if let Some(message) = withheld {
            deliver(&stamped(message, delivery::LATE));
        }
        if let Some(message) = sent {
            self.sequence = stamp.sequence;
            self.link.pass(tick, &stamped(message, 0), &faults.schedule(), deliver);
        }
        caller.message_sent(page.doorbell(M::TOPIC));
        late == Some(Late::Degrade)
    }
}

/// Output of the plant for TRUTH, which no node receives: no fault, deadline or doorbell concerns it.
pub struct TruthOutput {
    port: Rc<dyn SendPort<Truth>>,
    member: Member,
}

impl TruthOutput {
    /// Opens the output of `member`, which has opened its output for STATE.
    pub fn open(ports: &mut Ports, member: &Member) -> Result<Self, SessionError> {
        let port = ports.truth_sender()?;
        member.timing.warm_up_with(port.clone());
        Ok(Self { port, member: member.clone() })
    }

    /// Sends the `truth` of a sample after its STATE, so that no node waits for it; `states` is the output that sent
    /// that STATE.
    pub fn send(&self, truth: Truth, states: &Output<State>) {
        let Member { page, with_checksums, .. } = &self.member;
        let truth = Truth { sequence: states.sequence, ..truth };
        match self.port.send(&if *with_checksums { truth.with_checksum() } else { truth }) {
            Ok(()) => page.truths_sent.count(),
            Err(failure) => page.role(State::TOPIC).port_failures[failure as usize].count(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::TestRing;
    use contract::Topic;
    use contract::message::PlantStatus;
    use settings::{Fault, FaultKind, FaultTarget, Mode};

    #[test]
    fn truth_is_sent_as_it_is_whatever_a_fault_makes_of_state() {
        let mut ring = TestRing::flying(Mode::Lockstep);
        let drop = Fault::new(FaultTarget::State, FaultKind::Drop, 0.0, None);
        ring.run.fault = vec![Fault { probability: Some(1.0), ..drop }];
        let mut session = ring.session(Topic::State, 1);
        let mut states = session.output::<State>().unwrap();
        let truths = session.open(|ports, member, _| TruthOutput::open(ports, member)).unwrap();
        let receivers = (ring.queues.receiver::<State>(4).unwrap(), ring.queues.receiver::<Truth>(4).unwrap());
        for tick in 0..3 {
            states.send(State::default(), Stamp::at(tick, 0));
            truths.send(Truth { tick, ..Truth::default() }, &states);
        }
        while receivers.0.receive(&mut |state, _| assert!(state.stamp.is_faulted())).unwrap() {}
        let mut sent = vec![];
        let mut take = |truth: &Truth, from| {
            assert!(truth.is_intact() && from == ring.page.truth_port.get());
            sent.push((truth.tick, truth.sequence));
        };
        while receivers.1.receive(&mut take).unwrap() {}
        assert_eq!(sent, [(0, 1), (1, 2), (2, 3)]);
    }

    #[test]
    fn the_last_state_is_sent_however_late_it_is() {
        let mut ring = TestRing::flying(Mode::Realtime);
        ring.run.deadline.late = Late::Skip;
        let mut output = ring.session(Topic::State, 1).output::<State>().unwrap();
        let receiver = ring.queues.receiver::<State>(4).unwrap();
        for (tick, status) in [(0, PlantStatus::Flying), (1, PlantStatus::Finished)] {
            let late = Stamp::at(tick, 1); // sampled when the machine was started
            output.send(State { status: status as u64, ..State::default() }, late);
        }
        let mut withheld = vec![];
        while receiver.receive(&mut |state, _| withheld.push(state.stamp.is_withheld())).unwrap() {}
        assert_eq!(withheld, [true, false]);
    }
}
