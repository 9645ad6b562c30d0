//! Active and standby process of each node, as the messages and events of a flight tell.
//!
//! A log does not know all that the launcher knows of a stack under way: pids, the age of the newest message at an
//! instant, and ticks that a node is behind are left out.

use contract::topic::Topic;
use flight::control::view::rung;
use flight::event::{Event, What};
use flight::log::Record;
use serde_json::{Value, json};

/// State of the nodes.
#[derive(Default)]
pub struct NodeStates {
    of: [Node; Topic::COUNT],
    /// Rung of the mixer's newest command.
    rung: Option<&'static str>,
}

#[derive(Debug, Default, Clone, Copy)]
struct Node {
    /// Epoch of the active process; 0 while the role is vacant, `None` before its first message.
    active: Option<u32>,
    standby: Option<u32>,
    restarts: u32,
    /// Misses that the active process has counted.
    misses: Option<u64>,
}

impl Node {
    /// Makes the process `epoch` active. If it was on standby, the process that was active goes on standby.
    fn take_over(&mut self, epoch: u32) {
        if self.active == Some(epoch) {
            return;
        }
        if self.standby == Some(epoch) {
            self.standby = self.active.filter(|before| *before > 0);
        }
        self.active = Some(epoch);
    }

    fn note(&mut self, event: &Event) {
        let epoch = event.epoch;
        let is_standby = self.standby == Some(epoch);
        match event.what {
            What::Started => self.restarts += u32::from(event.swap.is_none()),
            What::OnStandby => self.standby = Some(epoch),
            What::TookOver => self.take_over(epoch),
            What::Kept => self.standby = None,
            What::Returned => {
                if self.active == Some(epoch) {
                    self.active = self.standby;
                }
                self.standby = None;
            }
            What::Rejected | What::Died | What::Hung if is_standby => self.standby = None,
            What::Died | What::Hung if self.active == Some(epoch) => self.active = Some(0),
            _ => {}
        }
    }
}

impl NodeStates {
    /// Takes in a message; only one that was delivered shows which process is active.
    pub fn observe(&mut self, record: &Record) {
        let Some((topic, stamp)) = record.stamped() else { return };
        if !record.is_intact() || !stamp.is_delivered() {
            return;
        }
        let node = &mut self.of[topic as usize];
        node.take_over(stamp.epoch as u32);
        node.misses = Some(stamp.misses);
        if topic == Topic::Actuators {
            self.rung = Some(rung(record));
        }
    }

    pub fn note(&mut self, event: &Event) {
        if let Some(topic) = Topic::of_node(&event.node) {
            self.of[topic as usize].note(event);
        }
    }

    /// Returns the frame of the ring. Nodes without any message are absent.
    pub fn status(&self) -> Value {
        let node = |topic: Topic| {
            let Node { active, standby, restarts, misses } = self.of[topic as usize];
            let (node, epoch) = (topic.publisher(), active?);
            Some(json!({ "node": node, "epoch": epoch, "standby": standby, "restarts": restarts, "misses": misses }))
        };
        json!({ "mixer": self.rung, "nodes": Topic::ALL.into_iter().filter_map(node).collect::<Vec<_>>() })
    }
}

#[cfg(test)]
mod tests {
    use contract::message::{Controls, Message, Stamp};
    use contract::stamp::delivery;

    use super::*;

    fn sent(nodes: &mut NodeStates, epoch: u32, delivery: u64) {
        let stamp = Stamp { tick: 1, sequence: 1, epoch: epoch.into(), delivery, misses: 7, ..Stamp::default() };
        nodes.observe(&Controls { stamp, ..Controls::default() }.with_checksum().into());
    }

    fn noted(nodes: &mut NodeStates, epoch: u32, what: What) -> [Value; 3] {
        nodes.note(&Event::new(1, "attitude-mpc", epoch, what));
        let node = &nodes.status()["nodes"][0];
        ["epoch", "standby", "restarts"].map(|key| node[key].clone())
    }

    #[test]
    fn a_node_is_vacant_from_a_death_until_the_next_process_takes_over() {
        let mut nodes = NodeStates::default();
        assert_eq!(nodes.status()["nodes"], json!([]), "nothing is known before the first message");
        sent(&mut nodes, 1, delivery::DELIVERED);
        assert_eq!(nodes.status()["nodes"][0]["misses"], 7);
        assert_eq!(noted(&mut nodes, 1, What::Died), [json!(0), Value::Null, json!(0)]);
        assert_eq!(noted(&mut nodes, 2, What::Started), [json!(0), Value::Null, json!(1)]);
        assert_eq!(noted(&mut nodes, 2, What::TookOver), [json!(2), Value::Null, json!(1)]);
    }

    #[test]
    fn a_candidate_and_the_process_before_it_change_places() {
        let mut nodes = NodeStates::default();
        sent(&mut nodes, 1, delivery::DELIVERED);
        let all = [json!(1), json!(2), json!(0)];
        assert_eq!(noted(&mut nodes, 2, What::OnStandby), all);
        sent(&mut nodes, 2, delivery::STANDBY);
        assert_eq!(nodes.status()["nodes"][0]["epoch"], 1, "a standby is not heard");
        sent(&mut nodes, 2, delivery::DELIVERED);
        assert_eq!(noted(&mut nodes, 2, What::TookOver), [json!(2), json!(1), json!(0)]);
        assert_eq!(noted(&mut nodes, 2, What::Returned), [json!(1), Value::Null, json!(0)]);
        noted(&mut nodes, 3, What::OnStandby);
        noted(&mut nodes, 3, What::TookOver);
        assert_eq!(noted(&mut nodes, 3, What::Kept), [json!(3), Value::Null, json!(0)]);
    }
}
