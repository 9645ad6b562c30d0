//! Costs of the parts of a hop, measured alone: called in a loop by one thread, and called after a sleep.

use std::hint::black_box;
use std::rc::Rc;
use std::thread::sleep;
use std::time::Duration;

use contract::message::Controls;
use runtime::domain::Hold;
use runtime::port::{Bus, MIN_OBSERVER_DEPTH, ReceivePort};
use runtime::realtime::now_ns;
use runtime::timed;
use serde::Serialize;

use crate::flights::namespace;
use outcome::percentiles::median_ns;

/// Calls in a row per mean, and number of means per median.
const CALLS: u64 = 200;
const BATCHES: usize = 101;

/// Sleep of a node at 100 Hz, after which its code and data have left the caches.
const COLD: Duration = Duration::from_millis(10);
const COLD_CALLS: usize = 101;

/// Number of clock readings noted by a node's cycle: start and publication.
const CLOCK_READINGS: f64 = 2.0;

/// Time of one call each \[ns\].
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Costs {
    /// Reading `CLOCK_MONOTONIC`.
    pub clock_ns: f64,
    /// Loan, copy and send of one message to two subscribers, as in a ring that the launcher watches.
    pub send_ns: f64,
    /// Receive and copy of one message.
    pub receive_ns: f64,
    /// The send, once after a sleep of 10 ms.
    pub cold_send_ns: f64,
    /// The receive, once after a sleep of 10 ms.
    pub cold_receive_ns: f64,
}

impl Costs {
    /// Measures all costs.
    pub fn measure() -> anyhow::Result<Self> {
        let hold = Hold::take(&namespace())?;
        let bus = Bus::attach(&hold.domain)?;
        let _services = bus.create_services(MIN_OBSERVER_DEPTH)?;
        let sender = bus.sender::<Controls>()?;
        let receivers = [bus.receiver::<Controls>(2)?, bus.receiver::<Controls>(2)?];
        let message = Controls::default();
        let send = || timed(|| _ = black_box(sender.send(&message))).1;
        let take = |receiver: &Rc<dyn ReceivePort<_>>| {
            _ = receiver.receive(&mut |message: &Controls, _| _ = black_box(*message));
        };
        let receive = || timed(|| receivers.iter().for_each(take)).1;
        let (mut sends, mut receives) = (vec![], vec![]);
        for _ in 0..BATCHES {
            let (mut sending_ns, mut receiving_ns) = (0, 0);
            for _ in 0..CALLS {
                sending_ns += send();
                receiving_ns += receive();
            }
            sends.push(sending_ns);
            receives.push(receiving_ns);
        }
        let (mut cold_sends, mut cold_receives) = (vec![], vec![]);
        for _ in 0..COLD_CALLS {
            sleep(COLD);
            cold_sends.push(send());
            sleep(COLD);
            cold_receives.push(timed(|| take(&receivers[0])).1);
            take(&receivers[1]);
        }
        let clock_batch = |_| timed(|| (0..CALLS).for_each(|_| _ = black_box(now_ns()))).1;
        let clock_ns = median_ns((0..BATCHES).map(clock_batch)) as f64 / CALLS as f64;
        let one = |batches: Vec<u64>| median_ns(batches) as f64 / CALLS as f64 - clock_ns;
        Ok(Self {
            clock_ns,
            send_ns: one(sends),
            receive_ns: one(receives) / receivers.len() as f64,
            cold_send_ns: median_ns(cold_sends) as f64 - clock_ns,
            cold_receive_ns: median_ns(cold_receives) as f64 - clock_ns,
        })
    }

    /// Returns the time that a cycle reads the clock while the next node waits \[ns\].
    pub fn stamps_ns(&self) -> f64 {
        CLOCK_READINGS * self.clock_ns
    }
}
