//! The pipe through which the launcher sends the events of a flight to the recorder.
//!
//! ```text
//! launcher -> one line of JSON each -> stdin of the recorder -> topic /events of flight.mcap
//! ```
//!
//! Neither side ever waits for the other. A line of up to `PIPE_BUF` bytes goes into a pipe completely or not at all.
//! The launcher keeps an event for which the pipe has no room, and tries again at its next look.

use std::os::fd::AsFd;

pub use ring::event::{Event, Sender, TimedEvent, What, name, size_in_words};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_setfl};
use rustix::pipe::PIPE_BUF;
use rustix::time::Timespec;

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

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::pipe::{PipeFlags, pipe_with};
    use std::os::fd::OwnedFd;

    fn event(tick: u64) -> Event {
        Event::new(tick, "mixer", 2, What::TookOver)
    }

    /// Returns the launcher's end and the recorder's end of a pipe.
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
}
