//! Connections between processes: finds each working process whose messages do not arrive, or that receives nothing
//! from a publisher whose messages other processes receive.
//!
//! ```text
//! sends, and no listener receives anything           the sender is cut off
//! sends, and some listeners receive                  each of the others is cut off from it
//! works, and its port refuses every message          the sender is cut off
//! ```
//!
//! Only counts on the control page are used: messages handed to the port, messages received, ticks done. A fault of the
//! scenario that loses messages is not mistaken for a cut, because a lost message is sent too, marked as lost. A
//! process that sends nothing because of the policy of its deadline does not count as cut off either.

use contract::topic::Topic;
use runtime::port::PortFailure;
use runtime::realtime::ControlPage;
use runtime::shared_role::SharedRole;

/// Index of the launcher as a listener, after the indices of the nodes; the launcher listens to every topic.
const LAUNCHER: usize = Topic::COUNT;

/// Number of messages that must be missing or refused before a process counts as cut off.
const SENT: u32 = 3;
/// Ticks that a listener must finish after these messages: in the first tick it may have read its input already.
const WHOLE_TICKS: u32 = 2;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Disconnected {
    /// Process `epoch` sends on this topic, and no process receives its messages.
    Sender(Topic, u32),
    /// Process `epoch`, which publishes on the first topic, receives nothing on the second.
    Listener(Topic, u32, Topic),
    /// The launcher itself receives nothing on a topic that others receive.
    Launcher(Topic),
}

/// State of every publisher with its listeners.
#[derive(Debug, Default)]
pub struct Connections {
    pairs: [[Pair; Topic::COUNT + 1]; Topic::COUNT],
    ports: [Refusing; Topic::COUNT],
    /// Number of looks so far.
    looks: u32,
}

/// Counts of one process.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    epoch: u32,
    /// Ticks done; for the launcher, looks done.
    done: u32,
    sent: u32,
    send_failures: u32,
    received: [u32; Topic::COUNT],
}

/// Counts of a publisher and a listener when the listener last received a message.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    epochs: (u32, u32),
    received: u32,
    /// Messages that the publisher had sent when the listener last received one.
    sent: u32,
    /// Ticks that the listener had done when [`SENT`] more messages had been sent; `None` before that.
    due: Option<u32>,
}

/// Counts of a publisher when its port last accepted a message.
#[derive(Debug, Clone, Copy, Default)]
struct Refusing {
    epoch: u32,
    sent: u32,
    failures: u32,
}

impl Connections {
    /// Finds the processes that are cut off; `received` counts the messages that reached the launcher before this call.
    pub fn look(&mut self, page: &ControlPage, received: [u32; Topic::COUNT]) -> Vec<Disconnected> {
        self.looks = self.looks.wrapping_add(1);
        // Received messages are counted after sent ones, so that all messages counted as sent may have arrived.
        let mut nodes = Topic::ALL.map(|topic| Counts::of(page.role(topic)));
        for (counts, topic) in nodes.iter_mut().zip(Topic::ALL) {
            counts.received = Topic::ALL.map(|from| page.role(topic).received(counts.epoch, from).get());
        }
        let launcher = Counts { epoch: 1, done: self.looks, received, ..Counts::default() };
        self.judge(&nodes, &launcher)
    }

    fn judge(&mut self, nodes: &[Counts; Topic::COUNT], launcher: &Counts) -> Vec<Disconnected> {
        let mut found = vec![];
        for topic in Topic::ALL {
            let publisher = &nodes[topic as usize];
            if publisher.epoch == 0 {
                continue;
            }
            let pairs = &mut self.pairs[topic as usize];
            let launcher_cut_off = pairs[LAUNCHER].is_silent(topic, publisher, launcher);
            let present = topic.listeners().iter().filter(|listener| nodes[**listener as usize].epoch != 0);
            let mut cut_off = vec![];
            let mut arrives = !launcher_cut_off;
            for listener in present {
                let counts = &nodes[*listener as usize];
                if pairs[*listener as usize].is_silent(topic, publisher, counts) {
                    cut_off.push(Disconnected::Listener(*listener, counts.epoch, topic));
                } else {
                    arrives = true;
                }
            }
            if !arrives || self.ports[topic as usize].is_silent(publisher) {
                found.push(Disconnected::Sender(topic, publisher.epoch));
            } else {
                found.extend(launcher_cut_off.then_some(Disconnected::Launcher(topic)));
                found.append(&mut cut_off);
            }
        }
        found
    }
}

impl Counts {
    fn of(role: &SharedRole) -> Self {
        let epoch = role.active();
        Self {
            epoch,
            done: role.done(epoch).get(),
            sent: role.sent(epoch).get(),
            send_failures: role.port_failures[PortFailure::Send as usize].get(),
            received: [0; Topic::COUNT],
        }
    }
}

impl Pair {
    /// Returns whether the listener has received none of [`SENT`] messages, and still none [`WHOLE_TICKS`] ticks later.
    fn is_silent(&mut self, topic: Topic, publisher: &Counts, listener: &Counts) -> bool {
        let epochs = (publisher.epoch, listener.epoch);
        let received = listener.received[topic as usize];
        if (epochs, received) != (self.epochs, self.received) {
            *self = Self { epochs, received, sent: publisher.sent, due: None };
        }
        if self.due.is_none() && grown(self.sent, publisher.sent, SENT) {
            self.due = Some(listener.done);
        }
        self.due.is_some_and(|done| grown(done, listener.done, WHOLE_TICKS))
    }
}

impl Refusing {
    /// Returns whether the port has refused [`SENT`] messages since it last accepted one.
    fn is_silent(&mut self, publisher: &Counts) -> bool {
        let Counts { epoch, sent, send_failures: failures, .. } = *publisher;
        if (epoch, sent) != (self.epoch, self.sent) {
            *self = Self { epoch, sent, failures };
        }
        grown(self.failures, failures, SENT)
    }
}

/// Returns whether a count, which may wrap, has grown by at least `many`.
fn grown(before: u32, now: u32, many: u32) -> bool {
    (many..u32::MAX / 2).contains(&now.wrapping_sub(before))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Returns the counts of a ring in which every process and the launcher have done `ticks`.
    fn ring(ticks: u32) -> ([Counts; Topic::COUNT], Counts) {
        let node = Counts { epoch: 1, done: ticks, sent: ticks, send_failures: 0, received: [ticks; Topic::COUNT] };
        ([node; Topic::COUNT], node)
    }

    /// Returns the first finding within twenty ticks of a ring whose counts `change` alters on each tick.
    fn found(change: impl Fn(u32, &mut [Counts; Topic::COUNT], &mut Counts)) -> Vec<Disconnected> {
        let mut connections = Connections::default();
        let on_tick = |tick| {
            let (mut nodes, mut launcher) = ring(tick);
            change(tick, &mut nodes, &mut launcher);
            connections.judge(&nodes, &launcher)
        };
        (0..20).map(on_tick).find(|found| !found.is_empty()).unwrap_or_default()
    }

    #[test]
    fn a_ring_in_which_everything_arrives_is_left_alone() {
        assert_eq!(found(|_, _, _| {}), []);
    }

    #[test]
    fn a_listener_that_receives_nothing_while_others_do_is_cut_off() {
        let one = found(|tick, nodes, _| nodes[Topic::Actuators as usize].received[0] = tick.min(9));
        assert_eq!(one, [Disconnected::Listener(Topic::Actuators, 1, Topic::State)]);
        let alone = found(|tick, nodes, _| nodes[Topic::Actuators as usize].received[2] = tick.min(9));
        assert_eq!(alone, [Disconnected::Listener(Topic::Actuators, 1, Topic::Controls)], "the launcher receives it");
        let launcher = found(|tick, _, launcher| launcher.received[2] = tick.min(9));
        assert_eq!(launcher, [Disconnected::Launcher(Topic::Controls)]);
    }

    #[test]
    fn a_sender_whose_messages_arrive_nowhere_is_cut_off() {
        let silent = |tick: u32, nodes: &mut [Counts; Topic::COUNT], launcher: &mut Counts| {
            for node in nodes {
                node.received[0] = tick.min(9);
            }
            launcher.received[0] = tick.min(9);
        };
        assert_eq!(found(silent), [Disconnected::Sender(Topic::State, 1)]);
        let refused = |tick: u32, nodes: &mut [Counts; Topic::COUNT], _: &mut Counts| {
            nodes[3].sent = tick.min(9);
            nodes[3].send_failures = tick.saturating_sub(9);
        };
        assert_eq!(found(refused), [Disconnected::Sender(Topic::Actuators, 1)]);
    }

    #[test]
    fn a_process_that_sleeps_or_sends_nothing_is_left_alone() {
        let sleeps = |tick: u32, nodes: &mut [Counts; Topic::COUNT], _: &mut Counts| {
            nodes[3].received = [tick.min(9); Topic::COUNT];
            nodes[3].done = tick.min(9);
        };
        assert_eq!(found(sleeps), [], "a process that hangs is another matter");
        let skips = |tick: u32, nodes: &mut [Counts; Topic::COUNT], launcher: &mut Counts| {
            nodes[2].sent = tick.min(9);
            nodes[3].received[2] = tick.min(9);
            launcher.received[2] = tick.min(9);
        };
        assert_eq!(found(skips), []);
        assert_eq!(found(|_, nodes, _| nodes[3].epoch = 0), [], "the role is vacant");
    }

    #[test]
    fn a_burst_between_two_looks_is_no_cut() {
        let burst = found(|tick, nodes, launcher| {
            nodes[0].sent = if tick < 10 { 1 } else { 50 }; // many messages between two looks of the launcher
            nodes[0].done = nodes[0].sent;
            let received = if tick < 11 { 1 } else { 50 };
            for node in nodes {
                node.received[0] = received;
            }
            launcher.received[0] = received;
        });
        assert_eq!(burst, []);
    }

    #[test]
    fn a_replacement_begins_anew() {
        let replaced = found(|tick, nodes, _| {
            nodes[3].epoch = 1 + tick / 3;
            nodes[3].received = [0; Topic::COUNT];
        });
        assert_eq!(replaced, [], "each had less than three ticks");
    }

    proptest! {
        /// A process that receives late, or not everything, is left alone.
        #[test]
        fn a_late_listener_is_not_cut_off(lag in 0_u32..3, every in 1_u32..3) {
            let late = found(|tick, nodes, _| nodes[2].received = [tick.saturating_sub(lag); Topic::COUNT]);
            prop_assert_eq!(late, []);
            let seldom = found(|tick, nodes, _| nodes[2].received = [tick / every; Topic::COUNT]);
            prop_assert_eq!(seldom, []);
        }
    }
}
