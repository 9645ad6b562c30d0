//! The process that flies with libraries: takes a request, flies it, and takes the next, until its parent ends it.

use std::cell::RefCell;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Duration;

use contract::Topic;
use contract::exit;
use runtime::error::{SessionError, words_of_panic};
use runtime::realtime::{SharedPipes, WordPipe, die_of_crashes, now_ns};
use rustix::process::{Signal, getpid, set_child_subreaper, set_parent_process_death_signal};

use super::frames::{ChildAnswer, ChildRequest, ChildWork, End};
use super::surroundings::ProcessSurroundings;
use crate::libraries;
use crate::log::{Memory, Record};
use crate::nodes;

/// Number of words sent after which the parent is woken.
const WAKE_AFTER_WORDS: usize = 1 << 13;
/// Longest sleep between two looks at a pipe \[ns\].
const LOOK_NS: u64 = Duration::from_secs(1).as_nanos() as u64;

/// Sender of the answers to one request.
struct Sender<'a> {
    pipe: &'a WordPipe,
    flight: u16,
    words: Vec<u64>,
    /// Words sent since the parent was woken.
    unseen: usize,
}

/// Flies for the parent whose pipes are stdin; returns only after a panic of the launcher's own code.
///
/// # Errors
/// Stdin is no file with such pipes, for example because a user has called this command.
pub fn serve() -> io::Result<u8> {
    let pipes = SharedPipes::open(io::stdin())?;
    die_of_crashes();
    // The signal is set again, because a program with capabilities loses this setting when it is started.
    set_parent_process_death_signal(Some(Signal::KILL))?;
    // Processes that a library starts and leaves behind become children of this process, so that they are seen.
    set_child_subreaper(Some(getpid()))?;
    let before = ProcessSurroundings::now();
    let mut words = vec![];
    loop {
        let request = loop {
            if let Some(request) = ChildRequest::take(&mut words) {
                break request;
            }
            if pipes.requests.read(&mut words) == 0 {
                pipes.requests.wait_for_words(now_ns() + LOOK_NS);
            }
        };
        let flight = request.as_ref().map_or(0, |request| request.flight);
        let sender = RefCell::new(Sender { pipe: &pipes.answers, flight, words: vec![], unseen: 0 });
        let end = match request {
            Ok(request) => match catch_unwind(AssertUnwindSafe(|| carry_out(&request, &sender))) {
                Ok(Ok(end)) => end,
                Ok(Err(error)) => End::Refused(error.to_string()),
                Err(panic) => End::Panicked(words_of_panic(&*panic).to_owned()),
            },
            Err(why) => End::Refused(why),
        };
        let mut sender = sender.into_inner();
        ChildAnswer::end(flight, &end, ProcessSurroundings::now() == before, &mut sender.words);
        sender.send();
        pipes.answers.wake_reader();
        if matches!(end, End::Panicked(_)) {
            return Ok(exit::PROCESS_LOST); // the state of this process may be damaged
        }
    }
}

fn carry_out(
    ChildRequest { work, scenario, .. }: &ChildRequest,
    sender: &RefCell<Sender>,
) -> Result<End, SessionError> {
    match work {
        ChildWork::Fly { with_checksums } => {
            let watch = |record: &Record| {
                sender.borrow_mut().record(record);
                true
            };
            let ring = nodes::ring(scenario, *with_checksums)?;
            ring.fly(watch, |memory| sender.borrow_mut().memory(memory)).map(End::Flown)
        }
        ChildWork::Try { node: Some(name) } => {
            let topic = Topic::of_node(name);
            let topic = topic.ok_or_else(|| SessionError::UnknownNode(name.clone()))?;
            foreign::try_out(topic, scenario).map(|()| End::Tried)
        }
        ChildWork::Try { node: None } => {
            let mut all = libraries::all(scenario).into_iter();
            all.try_for_each(|(topic, own)| foreign::try_out(topic, &own)).map(|()| End::Tried)
        }
    }
}

impl Sender<'_> {
    fn record(&mut self, record: &Record) {
        ChildAnswer::record(self.flight, record, &mut self.words);
        self.send();
    }

    fn memory(&mut self, memory: &Memory) {
        ChildAnswer::memory(self.flight, memory, &mut self.words);
        self.send();
    }

    /// Sends all words, and waits while the pipe is full.
    fn send(&mut self) {
        let mut sent = 0;
        while sent < self.words.len() {
            let count = self.pipe.write(&self.words[sent..]);
            sent += count;
            self.unseen += count;
            if count == 0 || self.unseen > WAKE_AFTER_WORDS {
                self.unseen = 0;
                self.pipe.wake_reader();
            }
            if count == 0 {
                self.pipe.wait_for_room(now_ns() + LOOK_NS);
            }
        }
        self.words.clear();
    }
}
