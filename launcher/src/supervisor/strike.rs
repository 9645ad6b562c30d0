//! Real time: the scenario's kills and stops, done by signals when their time has come.

use std::ops::Range;

use contract::realtime::Board;
use contract::scenario::{Fault, FaultKind, Scenario};
use contract::topic::Topic;

use super::Order;

/// A fault that is done to a process by signals.
pub struct Strike {
    topic: Topic,
    kind: FaultKind,
    ticks: Range<u64>,
    /// Who was struck.
    struck: Option<u32>,
    ended: bool,
}

impl Strike {
    /// Those of `scenario`.
    pub fn all(scenario: &Scenario) -> Vec<Self> {
        let by_signal = |fault: &Fault| {
            let topic = fault.target.process().filter(|_| matches!(fault.kind, FaultKind::Kill | FaultKind::Stop))?;
            let ticks = fault.ticks(scenario.sample_s());
            Some(Self { topic, kind: fault.kind, ticks, struck: None, ended: false })
        };
        scenario.fault.iter().filter_map(by_signal).collect()
    }

    /// What is to be done at `tick`, each once.
    pub fn at(&mut self, board: &Board, tick: u64, orders: &mut Vec<Order>) {
        let holder = board.office(self.topic).holder();
        if tick >= self.ticks.start && self.struck.is_none() && holder > 0 {
            self.struck = Some(holder);
            let kill = self.kind == FaultKind::Kill;
            orders.push(if kill { Order::Kill(self.topic, holder) } else { Order::Stop(self.topic, holder) });
        }
        if let Some(victim) = self.struck
            && tick >= self.ticks.end
            && !self.ended
            && self.kind == FaultKind::Stop
        {
            self.ended = true;
            orders.push(Order::Continue(self.topic, victim));
        }
    }
}
