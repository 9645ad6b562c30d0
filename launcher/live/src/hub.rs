//! Frames on their way from the flight to the clients. A new client first gets the newest frame of each kind.

use std::collections::VecDeque;
use std::sync::atomic::AtomicUsize;
use std::sync::{Mutex, MutexGuard, PoisonError};

use axum::body::Bytes;
use axum::extract::ws::Utf8Bytes;
use serde_json::{Value, json};
use tokio::sync::broadcast;

/// Number of rows that are kept for new clients: a minute at 20 Hz.
pub const KEPT_ROWS: usize = 1200;
/// Number of frames that a slow client may be behind before it loses the oldest: ten seconds.
const QUEUE: usize = 256;
/// Number of messages that a slow Foxglove client may be behind before it loses the oldest: five seconds at 200 Hz.
const FOXGLOVE_QUEUE: usize = 4096;

/// Kind of a frame. The newest frame of a kind replaces the earlier ones, except for `Rows`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameKind {
    /// The flight and its settings. Everything of an earlier flight is forgotten.
    Flight = 0,
    /// Samples of the plots and the vehicle.
    Rows = 1,
    /// State of the nodes, as `trefoil status` has it.
    Status = 2,
    /// Timing of the nodes.
    Timing = 3,
    /// Faults, events, absences.
    Happened = 4,
    /// Phase of the flight that is shown, or the reason why there is none.
    Phase = 5,
    /// Position and speed of a recorded flight that is played.
    Position = 6,
}

const KINDS: [FrameKind; 7] = [
    FrameKind::Flight,
    FrameKind::Rows,
    FrameKind::Status,
    FrameKind::Timing,
    FrameKind::Happened,
    FrameKind::Phase,
    FrameKind::Position,
];

/// One message for Foxglove's clients.
#[derive(Debug, Clone)]
pub struct Published {
    /// Index of the channel.
    pub channel: usize,
    /// Time of the message in the log \[ns\].
    pub log_time_ns: u64,
    pub bytes: Bytes,
}

/// Meeting point of the observing thread and the clients.
pub struct Hub {
    kept: Mutex<Kept>,
    frames: broadcast::Sender<Utf8Bytes>,
    pub messages: broadcast::Sender<Published>,
    /// Number of orders that are being carried out.
    pub orders: AtomicUsize,
}

#[derive(Default)]
struct Kept {
    frames: [Option<Utf8Bytes>; KINDS.len()],
    /// Rows as JSON, the oldest first.
    rows: VecDeque<String>,
    /// Messages for Foxglove's clients that hold for the whole flight.
    fixed: Vec<Published>,
    namespace: Option<String>,
    is_over: bool,
}

impl Hub {
    pub fn new() -> Self {
        let (frames, messages) = (broadcast::Sender::new(QUEUE), broadcast::Sender::new(FOXGLOVE_QUEUE));
        Self { kept: Mutex::default(), frames, messages, orders: AtomicUsize::new(0) }
    }

    /// Sends a frame to all clients, and keeps it for new ones.
    pub fn send(&self, kind: FrameKind, mut content: Value) {
        content["kind"] = json!(format!("{kind:?}").to_lowercase());
        let text = Utf8Bytes::from(content.to_string());
        let mut kept = self.kept();
        if kind == FrameKind::Flight {
            *kept = Kept::default();
            kept.namespace = content["namespace"].as_str().map(str::to_owned);
        }
        kept.frames[kind as usize] = Some(text.clone());
        let _ = self.frames.send(text); // fails if there is no client
    }

    /// Sends rows of samples, each a JSON array. If `anew`, they are of another time of the flight, and replace all
    /// rows sent before.
    pub fn send_rows(&self, rows: Vec<String>, anew: bool) {
        let text = rows_frame(rows.iter(), anew);
        let mut kept = self.kept();
        if anew {
            kept.rows.clear();
        }
        kept.rows.extend(rows);
        let surplus = kept.rows.len().saturating_sub(KEPT_ROWS);
        kept.rows.drain(..surplus);
        let _ = self.frames.send(text); // fails if there is no client
    }

    /// Publishes a message for Foxglove's clients.
    pub fn publish(&self, message: Published) {
        let _ = self.messages.send(message); // fails if there is no client
    }

    /// Publishes messages that hold for the whole flight, and keeps them for new clients of Foxglove's protocol.
    pub fn send_fixed(&self, messages: Vec<Published>) {
        let mut kept = self.kept();
        kept.fixed.clone_from(&messages);
        for message in messages {
            self.publish(message);
        }
    }

    /// Returns the messages of `channel` that hold for the whole flight.
    pub fn fixed(&self, channel: usize) -> Vec<Published> {
        self.kept().fixed.iter().filter(|message| message.channel == channel).cloned().collect()
    }

    /// Returns the newest frames for a new client, and the receiver of the frames that follow.
    pub fn join(&self) -> (Vec<Utf8Bytes>, broadcast::Receiver<Utf8Bytes>) {
        let kept = self.kept();
        let frame = |kind: &FrameKind| match kind {
            FrameKind::Rows if !kept.rows.is_empty() => Some(rows_frame(kept.rows.iter(), true)),
            kind => kept.frames[*kind as usize].clone(),
        };
        (KINDS.iter().filter_map(frame).collect(), self.frames.subscribe())
    }

    /// Returns the namespace of the flight that is shown, if any.
    pub fn namespace(&self) -> Option<String> {
        self.kept().namespace.clone()
    }

    /// Ends the server: no frame follows.
    pub fn close(&self) {
        self.kept().is_over = true;
    }

    pub fn is_closed(&self) -> bool {
        self.kept().is_over
    }

    /// Returns whether any page is open.
    pub fn has_viewers(&self) -> bool {
        self.frames.receiver_count() > 0
    }

    /// Returns whether any client of Foxglove's protocol is connected; without one, no message is encoded.
    pub fn has_listeners(&self) -> bool {
        self.messages.receiver_count() > 0
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner) // a panic leaves no change half done
    }
}

/// Makes a frame of rows; if `anew`, they replace the rows that a client has.
fn rows_frame<'a>(rows: impl Iterator<Item = &'a String>, anew: bool) -> Utf8Bytes {
    let all: Vec<&str> = rows.map(String::as_str).collect();
    format!("{{\"kind\":\"rows\",\"anew\":{anew},\"rows\":[{}]}}", all.join(",")).into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_client_that_comes_late_gets_the_newest_of_each_kind_and_the_last_minute_of_rows() {
        let hub = Hub::new();
        hub.send(FrameKind::Status, json!({ "of": "an earlier flight" }));
        hub.send(FrameKind::Flight, json!({ "namespace": "here" }));
        hub.send(FrameKind::Timing, json!({ "n": 1 }));
        hub.send(FrameKind::Timing, json!({ "n": 2 }));
        (0..KEPT_ROWS + 5).for_each(|i| hub.send_rows(vec![format!("[{i}]")], false));
        let (first, mut later) = hub.join();
        let frames: Vec<Value> = first.iter().map(|text| serde_json::from_str(text).unwrap()).collect();
        let kinds: Vec<&str> = frames.iter().map(|frame| frame["kind"].as_str().unwrap()).collect();
        assert_eq!(kinds, ["flight", "rows", "timing"]);
        assert_eq!((&frames[1]["rows"][0], frames[1]["rows"].as_array().unwrap().len()), (&json!([5]), KEPT_ROWS));
        assert_eq!((frames[2]["n"].as_u64(), hub.namespace().as_deref()), (Some(2), Some("here")));
        hub.send(FrameKind::Phase, json!({}));
        assert!(later.try_recv().unwrap().contains("phase"));
        hub.send_rows(vec!["[1]".into()], true);
        let rows = hub.join().0[1].clone();
        assert!(rows.contains("\"anew\":true") && rows.contains("\"rows\":[[1]]"), "{rows}");
    }

    #[test]
    fn a_client_that_does_not_read_loses_the_oldest_and_holds_back_no_other() {
        let hub = Hub::new();
        let (_, mut sleeping) = hub.join();
        (0..2 * QUEUE).for_each(|n| hub.send(FrameKind::Timing, json!({ "n": n })));
        assert!(matches!(sleeping.try_recv(), Err(broadcast::error::TryRecvError::Lagged(n)) if n == QUEUE as u64));
        assert!(sleeping.try_recv().unwrap().contains(&format!("\"n\":{QUEUE}")), "the oldest that is left");
    }
}
