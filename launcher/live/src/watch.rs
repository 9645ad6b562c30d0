//! Thread that observes the flights of a namespace, one after the other, and fills the hub.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use flight::control::view::view;
use flight::log::Record;
use flight::observer::{Look, OBSERVER_POLL, Observer, Seen};
use runtime::domain::Domain;
use serde_json::json;

use crate::foxglove::Encoder;
use crate::frames::Frames;
use crate::hub::{FrameKind, Hub};

/// Time between two attempts to join a flight.
const TRY_PERIOD: Duration = Duration::from_millis(20);
/// Time between two frames of rows.
const ROWS_PERIOD: Duration = Duration::from_millis(50);
/// Time between two frames of the nodes' state.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// Time between two frames of timing.
const TIMING_PERIOD: Duration = Duration::from_secs(1);

/// Flights to observe, and the hub for their frames.
pub struct Watch {
    pub namespace: Option<String>,
    pub one_flight: bool,
    pub hub: Arc<Hub>,
    pub interrupts: Arc<AtomicU32>,
}

impl Watch {
    /// Observes until an interrupt, or the end of the only flight.
    pub fn run(&self) {
        let mut waiting_for = None;
        while !self.is_interrupted() {
            match self.join() {
                Ok(observer) => {
                    waiting_for = None;
                    self.observe(observer);
                    if self.one_flight {
                        break;
                    }
                }
                Err(why) if self.hub.namespace().is_none() && waiting_for.as_ref() != Some(&why) => {
                    self.hub.send(FrameKind::Phase, json!({ "phase": "waiting", "why": why }));
                    waiting_for = Some(why);
                }
                Err(_) => {}
            }
            std::thread::sleep(TRY_PERIOD);
        }
        self.hub.close();
    }

    fn is_interrupted(&self) -> bool {
        self.interrupts.load(Ordering::Relaxed) > 0
    }

    /// Joins the flight; the error is the reason that the page shows.
    fn join(&self) -> Result<Observer, String> {
        let namespace = match &self.namespace {
            Some(namespace) => namespace.clone(),
            None => match Domain::list().as_slice() {
                [] => return Err("no stack is flying; `trefoil fly` starts one".into()),
                [only] => only.namespace().to_owned(),
                several => return Err(format!("{} stacks fly; say which one with --namespace", several.len())),
            },
        };
        Observer::join(&namespace).map_err(|error| format!("{error:#}"))
    }

    /// Observes one flight to its end.
    fn observe(&self, mut observer: Observer) {
        let hub = &self.hub;
        let mut frames = Frames::new(observer.scenario());
        let mut flight = frames.flight();
        flight["namespace"] = json!(observer.domain().namespace());
        hub.send(FrameKind::Flight, flight);
        let mut foxglove = Encoder::begin(observer.scenario(), hub);
        hub.send(FrameKind::Phase, json!({ "phase": "starting" }));
        let [mut rows_due, mut status_due, mut timing_due] = [Instant::now(); 3];
        let (mut has_begun, mut end, mut records) = (false, None, vec![]);
        while end.is_none() {
            let mut has_event = false;
            let look = observer.look(|seen| match seen {
                Seen::Message(record) => records.push(*record),
                Seen::Event(event) => {
                    frames.note(event);
                    has_event = true;
                    foxglove.on_event(&event.event, hub);
                }
            });
            // The observer gives one topic after the other; sorting brings the messages of a tick together.
            records.sort_by_key(Record::tick);
            for record in records.drain(..) {
                frames.observe(&record);
                foxglove.on_record(&record, hub);
            }
            match look {
                Look::Flying(0) if self.is_interrupted() => end = Some("the page's server was stopped"),
                Look::Flying(0) => std::thread::sleep(OBSERVER_POLL),
                Look::Flying(_) => {}
                Look::Ended => end = Some("the flight has ended"),
                Look::Lost => end = Some("the launcher was killed"),
            }
            if observer.has_begun() && !std::mem::replace(&mut has_begun, true) {
                hub.send(FrameKind::Phase, json!({ "phase": "flying" }));
            }
            if is_due(&mut rows_due, ROWS_PERIOD) || end.is_some() {
                let rows = frames.rows();
                if !rows.is_empty() {
                    hub.send_rows(rows.into_iter().map(|row| row.json).collect(), false);
                }
            }
            if is_due(&mut status_due, STATUS_PERIOD) && end.is_none() {
                hub.send(FrameKind::Status, view(observer.domain()));
            }
            if is_due(&mut timing_due, TIMING_PERIOD) || has_event || end.is_some() {
                let happened = frames.happenings();
                hub.send(FrameKind::Timing, frames.timing(&happened));
                hub.send(FrameKind::Happened, json!(happened));
            }
        }
        drop(observer); // before the page is told, so that a launcher that waits for the observer can go on
        hub.send(FrameKind::Phase, json!({ "phase": "ended", "why": end }));
    }
}

/// Returns whether the time `due` has come, and if so sets the next one.
fn is_due(due: &mut Instant, period: Duration) -> bool {
    let now = Instant::now();
    let is = now >= *due;
    if is {
        *due = now + period;
    }
    is
}
