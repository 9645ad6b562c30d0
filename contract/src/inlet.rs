//! The inlet: where a node hears one topic. What the guard refuses is counted and forgotten.

use std::sync::Arc;

use crate::Topic;
use crate::guard::{Guard, Refusal};
use crate::message::Message;
use crate::port::Receive;
use crate::realtime::{Board, now_ns, phase};

/// Where a node hears one topic.
pub struct Inlet<M> {
    port: Box<dyn Receive<M>>,
    board: Arc<Board>,
    guard: Guard<M>,
    /// Where refusals are counted: the office of who listens.
    listener: Topic,
    /// How often the bell had rung at the last look.
    seen: u32,
    /// Whether to look only when the bell has rung: a message is there for everybody then, not for some.
    by_bell: bool,
}

impl<M: Message> Inlet<M> {
    pub(crate) fn new(port: Box<dyn Receive<M>>, board: Arc<Board>, listener: Topic, by_bell: bool) -> Self {
        Self { port, board, guard: Guard::default(), listener, seen: 0, by_bell }
    }

    /// The newest message that was taken, without waiting; the default (sequence 0) before the first.
    pub fn newest(&mut self) -> &M {
        self.look();
        self.guard.newest()
    }

    /// Waits for a message that is taken until `deadline_ns` or the end of the run; whether one came.
    pub(crate) fn arrived(&mut self, deadline_ns: u64) -> bool {
        let board = self.board.clone();
        let bell = board.bell(M::TOPIC);
        loop {
            let rung = bell.count(); // before the look, so that a message after it is not slept through
            if self.look() {
                return true;
            }
            if now_ns() >= deadline_ns || board.phase().count() >= phase::LEAVE {
                return false;
            }
            bell.wait(rung, deadline_ns);
        }
    }

    /// Judges what has come since the last look; whether something was taken.
    fn look(&mut self) -> bool {
        let rung = self.board.bell(M::TOPIC).count();
        if self.by_bell && rung == self.seen {
            return false;
        }
        self.seen = rung;
        let office = self.board.office(M::TOPIC);
        let holder = office.holder();
        let mut taken = false;
        while let Some((message, port)) = self.port.receive() {
            if !message.stamp().is_heard() {
                continue;
            }
            let posing = message.stamp().epoch == u64::from(holder) && office.port(holder) != port;
            let judged = if posing { Err(Refusal::Publisher) } else { self.guard.take(&message, holder) };
            match judged {
                Ok(()) => taken = true,
                Err(refusal) => self.board.office(self.listener).refused[refusal as usize].count(),
            }
        }
        taken
    }
}
