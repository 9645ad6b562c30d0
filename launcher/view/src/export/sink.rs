//! Interface of the writers.

use contract::Topic;
use contract::message::{Stamp, Truth};
use flight::event::Event;
use flight::log::Record;

use crate::cycle::Cycle;

/// Writer of one format.
pub trait Sink {
    /// Adds a message; `truth` is the TRUTH of its tick, if the log has it.
    fn message(&mut self, record: &Record, truth: Option<&Truth>) -> anyhow::Result<()>;
    /// Adds the times of the cycle that made the message with `stamp` on `topic`.
    fn cycle(&mut self, topic: Topic, stamp: &Stamp, cycle: &Cycle) -> anyhow::Result<()>;
    /// Adds an event.
    fn event(&mut self, event: &Event) -> anyhow::Result<()>;
    /// Puts the files in their places; returns a note for users if something was left out.
    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>>;
}
