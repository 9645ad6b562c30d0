//! Events of the processes of a flight, and the pipe through which the launcher sends them to the recorder.
//!
//! ```text
//! launcher -> one line of JSON each -> stdin of the recorder -> topic /events of flight.mcap
//! ```
//!
//! Neither side ever waits for the other. A line of up to `PIPE_BUF` bytes goes into a pipe completely or not at all.
//! The launcher keeps an event that does not go in, and tries again at its next look.

use std::os::fd::AsFd;

use contract::scenario::Fault;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pipe::PIPE_BUF;
use rustix::time::Timespec;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::limits::REASON_CHARS;

/// One event of a process, of a fault, or of the files and intruders around the processes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Tick of the plant at that time; for the recorder, at the launcher's look.
    #[serde(default)]
    pub tick: u64,
    pub node: String,
    pub epoch: u32,
    pub what: What,
    /// Reason, if one is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Index of the swap that begins with this event, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swap: Option<usize>,
    /// Index of the swap whose program and settings the started process uses, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<usize>,
    /// Sender of the command, if it was ordered in flight.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Sender>,
    /// Fault given or ended in flight: its number, and its settings from then on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<Box<(usize, Fault)>>,
}

/// Event with the time of the flight, as in run.json and in the answers of the launcher.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TimedEvent {
    pub at_s: f64,
    /// The process that started had no memory of the process before it; known when the flight is over.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cold: bool,
    #[serde(flatten)]
    pub event: Event,
}

impl TimedEvent {
    /// Adds the time to `events` of a flight at `rate_hz`.
    pub fn all<'a>(events: impl IntoIterator<Item = &'a Event>, rate_hz: u32) -> Vec<Self> {
        let timed =
            |event: &Event| Self { at_s: event.tick as f64 / f64::from(rate_hz), cold: false, event: event.clone() };
        events.into_iter().map(timed).collect()
    }

    /// Returns what happened, in words.
    pub fn what(&self) -> String {
        name(self.event.what).replace('-', " ") + if self.cold { " cold" } else { "" }
    }
}

/// Process that sent a command to a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sender {
    /// Process id; 0 if the process is not visible from here.
    pub pid: i32,
    /// User id.
    pub user: u32,
}

/// Kinds of events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    Died,
    /// The process made no progress or was cut off, and is killed; the launcher, which may be cut off too, is not.
    Hung,
    Started,
    NotStarted,
    /// The process became active.
    TookOver,
    /// The node is not started again.
    GivenUp,
    /// The candidate works on standby.
    OnStandby,
    /// The candidate was ended before it became active.
    Rejected,
    /// The candidate stays active: its trial is over.
    Kept,
    /// The candidate was ended after it had become active; the process before it is active again.
    Returned,
    /// A fault was given to a node, a topic or a part of the vehicle.
    Injected,
    /// A fault given in flight was ended.
    Cleared,
    /// A file of a living process was removed from shared memory.
    ShmRemoved,
    /// A file of a living process in shared memory was cut short.
    ShmCutShort,
    IntruderRefused,
    IntruderLetIn,
    IntruderSpoke,
    /// An intruder could not make its attempt.
    IntruderFailed,
}

impl Event {
    pub fn new(tick: u64, node: &str, epoch: u32, what: What) -> Self {
        Self { tick, node: node.into(), epoch, what, why: None, swap: None, origin: None, by: None, fault: None }
    }

    #[must_use]
    pub fn because(self, why: impl AsRef<str>) -> Self {
        Self { why: Some(why.as_ref().chars().take(REASON_CHARS).collect()), ..self }
    }

    /// Returns the event as the one that swap number `swap` begins with; `None`: no swap.
    #[must_use]
    pub fn begins(self, swap: Option<usize>) -> Self {
        Self { swap, ..self }
    }
}

/// Makes reads from and writes to `pipe` non-blocking.
pub fn never_wait(pipe: impl AsFd) -> rustix::io::Result<()> {
    fcntl_setfl(pipe, OFlags::NONBLOCK)
}

/// Writes `event` into the non-blocking `pipe`; returns false if it does not fit, or cannot be written.
pub fn send(pipe: impl AsFd, event: &Event) -> bool {
    let Ok(mut line) = serde_json::to_vec(event) else { return false };
    line.push(b'\n');
    line.len() <= PIPE_BUF && rustix::io::write(pipe, &line).is_ok()
}

/// The recorder's end of the pipe.
pub struct EventReader<P> {
    /// `None` after the launcher has closed its end.
    pipe: Option<P>,
    /// Beginning of a line whose end is still to come.
    rest: Vec<u8>,
}

impl<P: AsFd> EventReader<P> {
    pub fn new(pipe: P) -> Self {
        Self { pipe: Some(pipe), rest: vec![] }
    }

    /// Passes every complete line to `each` without waiting; returns their number. A line that is no event is an error.
    pub fn drain(&mut self, mut each: impl FnMut(serde_json::Result<Event>)) -> usize {
        let mut count = 0;
        while let Some(pipe) = self.pipe.as_ref().filter(|pipe| readable(pipe)) {
            let mut bytes = [0; PIPE_BUF];
            let Ok(length @ 1..) = rustix::io::read(pipe, &mut bytes) else {
                self.pipe = None;
                break;
            };
            self.rest.extend_from_slice(&bytes[..length]);
            let whole = self.rest.iter().rposition(|byte| *byte == b'\n').map_or(0, |end| end + 1);
            for line in self.rest[..whole].split_inclusive(|byte| *byte == b'\n') {
                each(serde_json::from_slice(line));
                count += 1;
            }
            self.rest.drain(..whole);
            if self.rest.len() > PIPE_BUF {
                self.rest.clear(); // longer than any line of an event
            }
        }
        count
    }
}

/// Returns whether a read would not wait: there are bytes, or the other end is closed.
fn readable(pipe: impl AsFd) -> bool {
    const AT_ONCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut [PollFd::new(&pipe, PollFlags::IN)], Some(&AT_ONCE)).is_ok_and(|ready| ready > 0)
}

/// Returns the name of a fault's target or kind, or of an event, as the scenario file and run.json spell it.
pub fn name(word: impl Serialize) -> String {
    json!(word).as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pipe::{PipeFlags, pipe_with};
    use std::os::fd::OwnedFd;

    fn event(tick: u64) -> Event {
        Event::new(tick, "mixer", 2, What::TookOver)
    }

    /// Returns the launcher's end of a pipe, and the recorder's.
    fn ends() -> (OwnedFd, EventReader<OwnedFd>) {
        let (reads, writes) = pipe_with(PipeFlags::CLOEXEC).unwrap();
        never_wait(&writes).unwrap();
        (writes, EventReader::new(reads))
    }

    fn read_all(reader: &mut EventReader<OwnedFd>) -> Vec<Event> {
        let mut all = vec![];
        let count = reader.drain(|event| all.push(event.unwrap()));
        assert_eq!(count, all.len());
        all
    }

    #[test]
    fn events_are_read_in_order_and_neither_side_waits() {
        let (writes, mut reader) = ends();
        assert_eq!(read_all(&mut reader), [], "nothing yet");
        let told = [event(1), event(2).because("3 m \u{3bc} \"off\"\n")];
        assert!(told.iter().all(|event| send(&writes, event)));
        assert_eq!(read_all(&mut reader), told);
        drop(writes);
        assert_eq!([read_all(&mut reader), read_all(&mut reader)], [[], []], "the launcher has gone");
    }

    #[test]
    fn a_full_pipe_takes_no_partial_line() {
        let (writes, mut reader) = ends();
        let longest = event(7).because("\u{1}".repeat(9999));
        let sent = (0..1000).take_while(|_| send(&writes, &longest)).count();
        assert!((10..1000).contains(&sent), "full after {sent}");
        assert_eq!(read_all(&mut reader), vec![longest.clone(); sent]);
        assert!(send(&writes, &longest), "there is room again");
    }

    #[test]
    fn sending_to_a_recorder_that_has_ended_returns_false() {
        let (writes, reader) = ends();
        drop(reader);
        assert!(!send(&writes, &event(1)));
    }

    #[test]
    fn a_line_that_is_no_event_is_an_error() {
        let (writes, mut reader) = ends();
        rustix::io::write(&writes, b"\n{}\n[1, 2\n").unwrap();
        let mut errors = 0;
        assert_eq!(reader.drain(|event| errors += u32::from(event.is_err())), 3);
        assert_eq!(errors, 3);
    }

    #[test]
    fn an_event_without_a_reason_has_no_field_for_it() {
        let plain = serde_json::to_string(&event(5)).unwrap();
        assert_eq!(plain, r#"{"tick":5,"node":"mixer","epoch":2,"what":"took-over"}"#);
        let reasoned = serde_json::to_value(event(5).because("too slow")).unwrap();
        assert_eq!(reasoned["why"], "too slow");
    }
}
