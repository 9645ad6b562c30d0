//! Real time: the scenario's kills and stops, done by signals when their time has come.

use std::ops::Range;

use contract::scenario::{Fault, FaultKind, Scenario};
use contract::topic::Topic;

use super::Order;

/// A fault that is done to a process by signals.
pub struct Strike {
    topic: Topic,
    kind: FaultKind,
    ticks: Range<u64>,
    struck: bool,
    ended: bool,
}

impl Strike {
    /// Those of `scenario`.
    pub fn all(scenario: &Scenario) -> Vec<Self> {
        let by_signal = |fault: &Fault| {
            let topic = fault.target.process().filter(|_| matches!(fault.kind, FaultKind::Kill | FaultKind::Stop))?;
            let ticks = fault.ticks(scenario.sample_s());
            Some(Self { topic, kind: fault.kind, ticks, struck: false, ended: false })
        };
        scenario.fault.iter().filter_map(by_signal).collect()
    }

    /// What is to be done at `tick`, each once.
    pub fn at(&mut self, tick: u64, orders: &mut Vec<Order>) {
        if tick >= self.ticks.start && !self.struck {
            self.struck = true;
            let kill = self.kind == FaultKind::Kill;
            orders.push(if kill { Order::Kill(self.topic) } else { Order::Stop(self.topic) });
        }
        if tick >= self.ticks.end && !self.ended && self.kind == FaultKind::Stop {
            self.ended = true;
            orders.push(Order::Continue(self.topic));
        }
    }
}
