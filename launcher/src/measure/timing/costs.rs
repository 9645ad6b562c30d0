//! What the parts of a hop cost by themselves, each called again and again by one thread.

use std::hint::black_box;

use contract::domain::Hold;
use contract::message::Controls;
use contract::port::Bus;
use contract::realtime::{now_ns, thread_cpu_ns};
use serde::Serialize;

use super::rings::namespace;
use crate::measure::mpc::distribution::median;

/// Calls in a row of which the mean is taken, and how many such means the median is of.
const CALLS: u64 = 200;
const BATCHES: usize = 101;

/// Readings of the clock that a node's cycle notes: start and publication.
const CLOCK_READINGS: f64 = 2.0;

/// Time of one call each \[ns\].
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Costs {
    /// Reading `CLOCK_MONOTONIC`.
    pub clock_ns: f64,
    /// Reading the thread's processor time; once a cycle, at the rehearsal, when nobody waits.
    pub cpu_clock_ns: f64,
    /// Loan, copy and send of one message to two subscribers, as in a ring that the launcher watches.
    pub send_ns: f64,
    /// Receive and copy of one message.
    pub receive_ns: f64,
}

impl Costs {
    /// Measures them.
    pub fn measure() -> anyhow::Result<Self> {
        let hold = Hold::take(&namespace())?;
        let bus = Bus::attach(&hold.domain)?;
        let _services = bus.create_services()?;
        let sender = bus.sender::<Controls>()?;
        let receivers = [bus.receiver::<Controls>(2, 0)?, bus.receiver::<Controls>(2, 0)?];
        let message = Controls::default();
        // A turn is send and twice receive; the receiving alone is told apart by a second look at the same clock.
        let mut sends = vec![];
        let mut receives = vec![];
        for _ in 0..BATCHES {
            let (mut sending_ns, mut receiving_ns) = (0, 0);
            for _ in 0..CALLS {
                let start_ns = now_ns();
                black_box(sender.send(&message));
                let sent_ns = now_ns();
                for receiver in &receivers {
                    black_box(receiver.receive());
                }
                sending_ns += sent_ns - start_ns;
                receiving_ns += now_ns() - sent_ns;
            }
            sends.push(sending_ns);
            receives.push(receiving_ns);
        }
        let clock_ns = per_call(|| _ = black_box(now_ns()));
        let one = |batches: &[u64]| median(batches) as f64 / CALLS as f64 - clock_ns;
        Ok(Self {
            clock_ns,
            cpu_clock_ns: per_call(|| _ = black_box(thread_cpu_ns())),
            send_ns: one(&sends),
            receive_ns: one(&receives) / receivers.len() as f64,
        })
    }

    /// All that a node's cycle notes of time while somebody waits \[ns\].
    pub fn stamps_ns(&self) -> f64 {
        CLOCK_READINGS * self.clock_ns
    }
}

fn per_call(mut call: impl FnMut()) -> f64 {
    let batch = |_| {
        let start_ns = now_ns();
        (0..CALLS).for_each(|_| call());
        now_ns() - start_ns
    };
    median(&(0..BATCHES).map(batch).collect::<Vec<_>>()) as f64 / CALLS as f64
}
