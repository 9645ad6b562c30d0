//! Kills and stops of processes, done by signals when their time has come.

use std::ops::Range;

use contract::scenario::{Fault, FaultKind};
use contract::topic::Topic;
use runtime::realtime::ControlPage;

use super::Order;

/// A fault that is done to a process by signals.
pub struct Strike {
    topic: Topic,
    kind: FaultKind,
    /// Who was struck.
    struck: Option<u32>,
    ended: bool,
}

impl Strike {
    /// What `fault` is to a process; `None` when it is not done by signals.
    pub fn of(fault: &Fault) -> Option<Self> {
        let topic = fault.target.process().filter(|_| matches!(fault.kind, FaultKind::Kill | FaultKind::Stop))?;
        Some(Self { topic, kind: fault.kind, struck: None, ended: false })
    }

    /// What is to be done at `tick`, each once, when its time is `ticks`.
    pub fn at(&mut self, page: &ControlPage, ticks: &Range<u64>, tick: u64, orders: &mut Vec<Order>) {
        let active = page.role(self.topic).active();
        if tick >= ticks.start && !ticks.is_empty() && self.struck.is_none() && active > 0 {
            self.struck = Some(active);
            let kill = self.kind == FaultKind::Kill;
            orders.push(if kill { Order::Kill(self.topic, active) } else { Order::Stop(self.topic, active) });
        }
        if let Some(victim) = self.struck
            && tick >= ticks.end
            && !self.ended
            && self.kind == FaultKind::Stop
        {
            self.ended = true;
            orders.push(Order::Continue(self.topic, victim));
        }
    }
}
