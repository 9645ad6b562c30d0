//! Events: what happened to the processes of a flight, and the pipe on which the launcher tells the recorder of it.
//!
//! ```text
//! supervisor -> one line of JSON each -> stdin of the recorder -> topic /events of flight.mcap
//! ```
//!
//! Neither side ever waits for the other. A line of up to `PIPE_BUF` bytes goes into a pipe whole or not at all: what
//! does not go in stays with the launcher, which tries again at its next look around.

use std::os::fd::AsFd;

use contract::Scenario;
use contract::scenario::Fault;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pipe::PIPE_BUF;
use rustix::time::Timespec;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::limits::REASON_CHARS;

/// Something that happened to a process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// The tick of the plant then; where a recorder died, that of the launcher's look. In run.json its time stands instead.
    #[serde(default)]
    pub tick: u64,
    pub node: String,
    pub epoch: u32,
    pub what: What,
    /// The reason, where there is one to tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// The number of the swap that begins with it, where one does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swap: Option<usize>,
    /// The number of the swap whose program and settings a process that was started has, where it has those of one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<usize>,
    /// Who ordered it by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Sender>,
    /// A fault that was given or ended in flight, with its number: as it is from now on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<Box<(usize, Fault)>>,
}

/// Who gave a command to a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sender {
    /// The process; 0 for one that is not to be seen from here.
    pub pid: i32,
    /// Number of the user.
    pub user: u32,
}

/// What can happen to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    Died,
    /// It made no progress, and was killed.
    Hung,
    Started,
    NotStarted,
    /// It is active.
    TookOver,
    /// It is not started any more.
    GivenUp,
    /// A candidate works on standby.
    OnStandby,
    /// A candidate was sent away before it held the role.
    Rejected,
    /// A candidate is active for good.
    Kept,
    /// A candidate had to give the role back.
    Returned,
    /// A fault was given to it, whatever it is: a node, a topic, a part of the vehicle.
    Injected,
    /// A fault of it was ended.
    Cleared,
    /// A file of a process that lives is gone from shared memory.
    ShmRemoved,
    /// A file of a process that lives was cut short.
    ShmCutShort,
    IntruderRefused,
    IntruderLetIn,
    IntruderSpoke,
    /// An intruder could not try.
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

    /// The same, with which swap number `swap` begins; none, when it is none.
    #[must_use]
    pub fn begins(self, swap: Option<usize>) -> Self {
        Self { swap, ..self }
    }
}

/// Makes reading from and writing to `pipe` never wait.
pub fn never_wait(pipe: impl AsFd) -> rustix::io::Result<()> {
    fcntl_setfl(pipe, OFlags::NONBLOCK)
}

/// Writes `event` into a `pipe` that never waits; whether it is in.
pub fn send(pipe: impl AsFd, event: &Event) -> bool {
    let Ok(mut line) = serde_json::to_vec(event) else { return false };
    line.push(b'\n');
    line.len() <= PIPE_BUF && rustix::io::write(pipe, &line).is_ok()
}

/// Where the recorder reads events: its end of the pipe.
pub struct EventReader<P> {
    /// `None` when the launcher has closed its end.
    pipe: Option<P>,
    /// A line whose end is still to come.
    rest: Vec<u8>,
}

impl<P: AsFd> EventReader<P> {
    pub fn new(pipe: P) -> Self {
        Self { pipe: Some(pipe), rest: vec![] }
    }

    /// Hands what has come to `each`, without waiting; how many there were. A line that is no event is an error.
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

/// Whether there is something to read, or an end to find.
fn readable(pipe: impl AsFd) -> bool {
    const AT_ONCE: Timespec = Timespec { tv_sec: 0, tv_nsec: 0 };
    poll(&mut [PollFd::new(&pipe, PollFlags::IN)], Some(&AT_ONCE)).is_ok_and(|ready| ready > 0)
}

/// What happened, by the time of the flight.
pub fn events<'a>(scenario: &Scenario, events: impl IntoIterator<Item = &'a Event>) -> Value {
    let one = |event: &Event| {
        let mut told = json!(event);
        told["at_s"] = json!(event.tick as f64 / f64::from(scenario.run.rate_hz));
        told.as_object_mut().map(|fields| fields.remove("tick"));
        told
    };
    events.into_iter().map(one).collect()
}

/// A target or kind as the scenario file spells it, an event as run.json does.
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

    /// The launcher's end and the recorder's.
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
    fn what_is_sent_is_read_in_order_and_neither_side_waits() {
        let (writes, mut reader) = ends();
        assert_eq!(read_all(&mut reader), [], "nothing yet");
        let told = [event(1), event(2).because("3 m \u{3bc} \"off\"\n")];
        assert!(told.iter().all(|event| send(&writes, event)));
        assert_eq!(read_all(&mut reader), told);
        drop(writes);
        assert_eq!([read_all(&mut reader), read_all(&mut reader)], [[], []], "the launcher has gone");
    }

    #[test]
    fn a_pipe_that_is_full_takes_no_half_lines() {
        let (writes, mut reader) = ends();
        let longest = event(7).because("\u{1}".repeat(9999));
        let sent = (0..1000).take_while(|_| send(&writes, &longest)).count();
        assert!((10..1000).contains(&sent), "full after {sent}");
        assert_eq!(read_all(&mut reader), vec![longest.clone(); sent]);
        assert!(send(&writes, &longest), "there is room again");
    }

    #[test]
    fn a_recorder_that_has_gone_is_not_told() {
        let (writes, reader) = ends();
        drop(reader);
        assert!(!send(&writes, &event(1)));
    }

    #[test]
    fn what_is_no_event_is_an_error() {
        let (writes, mut reader) = ends();
        rustix::io::write(&writes, b"\n{}\n[1, 2\n").unwrap();
        let mut errors = 0;
        assert_eq!(reader.drain(|event| errors += u32::from(event.is_err())), 3);
        assert_eq!(errors, 3);
    }

    #[test]
    fn a_reason_is_there_only_when_there_is_one() {
        let plain = serde_json::to_string(&event(5)).unwrap();
        assert_eq!(plain, r#"{"tick":5,"node":"mixer","epoch":2,"what":"took-over"}"#);
        let reasoned = serde_json::to_value(event(5).because("too slow")).unwrap();
        assert_eq!(reasoned["why"], "too slow");
    }
}
