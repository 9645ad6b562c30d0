//! Observer: reads a flying stack from another process, message by message and event by event.
//!
//! ```text
//! ring    --- messages, on ports of its own ------------->  Observer::look  --> Seen::Message
//! launcher -- events, on the control socket, 5 times a s ->                 --> Seen::Event
//! ```
//!
//! An observer is a guest: it sends nothing and rings no doorbell, and no process of the flight waits for it. If it
//! is slow, its queues lose their oldest messages after five seconds. If it dies, the ring does not notice, and the
//! next observer, or the launcher, removes its ports. [`Observer`] is bound to the thread that made it, which should
//! call [`Observer::look`] at least once a second, and sleep [`OBSERVER_POLL`] after a look that found nothing.
//!
//! A flight takes [`OBSERVERS`] guests at once, because every port takes a place that a replaced process may need.

use std::fs::{File, OpenOptions};
use std::os::unix::fs::OpenOptionsExt;
use std::sync::Arc;
use std::time::Instant;

use anyhow::{Context, bail};
use runtime::domain::{Domain, wipe_the_dead};
use runtime::port::Bus;
use runtime::ports::Ports;
use runtime::realtime::{ControlPage, phase};
use rustix::fs::{FlockOperation, flock};
use serde_json::Value;
use settings::Scenario;

use crate::control::{ControlRequest, ask};
use crate::event::TimedEvent;
use crate::limits::{ANSWER_EVENTS, EVENTS_PERIOD, RECONNECT_PERIOD};
pub use crate::limits::{OBSERVER_POLL, OBSERVERS};
use crate::log::Record;
use crate::recorder::Observers;

/// Part of a flight that an observer sees.
#[derive(Debug, Clone, Copy)]
pub enum Seen<'a> {
    /// Message of the ring, or TRUTH; also a message that is not delivered to the nodes (`Stamp::delivery`) or not
    /// intact.
    Message(&'a Record),
    /// Event of a process or a fault, up to a fifth of a second late.
    Event(&'a TimedEvent),
}

/// State of the flight at a look.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Look {
    /// The flight goes on; the value is the number of messages and events that this look passed on.
    Flying(usize),
    /// The flight is over, and everything that arrived was passed on before.
    Ended,
    /// The launcher is gone without an end of the flight: it was killed.
    Lost,
}

/// Guest of a flight. Dropping it leaves the flight.
pub struct Observer {
    // The fields are dropped in this order: the ports, then the place, then files that were made after the flight had
    // ended.
    observers: Observers,
    page: Arc<ControlPage>,
    _ports: Ports,
    _place: File,
    _traces: Traces,
    domain: Domain,
    scenario: Scenario,
    /// Number of events passed on so far.
    told: usize,
    asked: Instant,
    compared: Instant,
    /// Messages sent and passed on at the last comparison, by [`Record::kind`].
    counts: [(u32, u64); Record::KINDS],
}

/// Removes files in shared memory that this process made after the launcher had wiped the run's folder.
struct Traces;

impl Drop for Traces {
    fn drop(&mut self) {
        wipe_the_dead();
    }
}

impl Observer {
    /// Joins the flight of `namespace` as a guest.
    ///
    /// # Errors
    /// No stack runs there, the stack is of another version, or it has its full number of guests. While a stack starts
    /// or ends, another attempt a moment later may succeed.
    pub fn join(namespace: &str) -> anyhow::Result<Self> {
        let domain = Domain::find(namespace)?;
        let traces = Traces;
        let place = take_place(&domain)?;
        let (mut ports, scenario) = Ports::join(namespace)?;
        match ports.page.phase.count() {
            phase::JOIN => {}
            phase::GO => Bus::remove_dead_ports(&domain)?, // removes the ports of killed observers
            _ => bail!("the flight in namespace '{namespace}' is ending"),
        }
        let observers = Observers::open(&mut ports, &scenario)?;
        let (page, now) = (ports.page.clone(), Instant::now());
        Ok(Self {
            observers,
            page,
            _ports: ports,
            _place: place,
            _traces: traces,
            domain,
            scenario,
            told: 0,
            asked: now,
            compared: now,
            counts: Default::default(),
        })
    }

    /// Settings with which the flight began.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Folder of the run in shared memory, for [`ask`] and `control::look`.
    pub fn domain(&self) -> &Domain {
        &self.domain
    }

    /// Returns whether all processes were ready and the flight has begun; stays true at its end.
    pub fn has_begun(&self) -> bool {
        self.page.phase.count() != phase::JOIN
    }

    /// Passes everything that has arrived to `each`: messages topic by topic, then events in order. Never waits for the
    /// ring, but up to two seconds for a launcher that does not answer.
    pub fn look(&mut self, mut each: impl FnMut(Seen)) -> Look {
        let ending = self.page.phase.count() > phase::GO;
        let is_due = self.asked.elapsed() >= EVENTS_PERIOD;
        let lost = is_due && !self.domain.is_live();
        let mut count = self.observers.drain(|record| each(Seen::Message(record)));
        if is_due && !ending && !lost {
            count += self.events(&mut each);
            self.reconnect();
        }
        match (count, ending, lost) {
            (0, true, _) => Look::Ended,
            (0, _, true) => Look::Lost,
            _ => Look::Flying(count),
        }
    }

    /// Asks the launcher for the events since the last request, and passes them to `each`; returns their number.
    fn events(&mut self, each: &mut impl FnMut(Seen)) -> usize {
        let before = self.told;
        while let Ok(Value::Array(news)) = ask(&self.domain, &ControlRequest::Events { since: self.told }) {
            self.told += news.len();
            let is_all = news.len() < ANSWER_EVENTS;
            for event in news.into_iter().filter_map(|event| serde_json::from_value(event).ok()) {
                each(Seen::Event(&event));
            }
            if is_all {
                break;
            }
        }
        self.asked = Instant::now(); // set even without an answer: the launcher starts, ends or is stopped
        self.told - before
    }

    /// Reconnects to the publishers of each kind of message if some were sent and none arrived since the last
    /// comparison.
    fn reconnect(&mut self) {
        if self.compared.elapsed() < RECONNECT_PERIOD {
            return;
        }
        self.compared = Instant::now();
        for (kind, known) in self.counts.iter_mut().enumerate() {
            let counts = self.observers.sent_and_drained(kind);
            let before = std::mem::replace(known, counts);
            if counts.0 != before.0 && counts.1 == before.1 {
                self.observers.reconnect(kind);
            }
        }
    }
}

/// Takes one of the places for guests; the kernel frees it when this process ends, in any way.
fn take_place(domain: &Domain) -> anyhow::Result<File> {
    for number in 0..OBSERVERS {
        let path = domain.file(&format!("observer.{number}"));
        let file = OpenOptions::new().write(true).create(true).truncate(false).mode(0o600).open(&path);
        let file = file.with_context(|| format!("cannot take a place in {}", path.display()))?;
        if flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok() {
            return Ok(file);
        }
    }
    bail!("the flight in namespace '{}' has {OBSERVERS} observers already; end one of them", domain.namespace())
}
