//! Interface of the writers.

use contract::Topic;
use contract::message::{Stamp, Truth};
use flight::event::Event;
use flight::log::Record;

use crate::cycle::CycleTimes;

/// Writer of one format.
pub trait Sink {
    /// Adds a message; `truth` is the TRUTH of its tick, if the log has it.
    fn message(&mut self, record: &Record, truth: Option<&Truth>) -> anyhow::Result<()>;
    /// Adds the times of the cycle that made the message with this stamp on this topic. A format without cycles ignores
    /// them, because the stamps have them.
    fn cycle(&mut self, _: Topic, _: &Stamp, _: &CycleTimes) -> anyhow::Result<()> {
        Ok(())
    }
    /// Adds an event.
    fn event(&mut self, event: &Event) -> anyhow::Result<()>;
    /// Puts the files in their places; returns a note for users if something was left out.
    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>>;
}
