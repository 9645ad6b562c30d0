//! What can happen to the processes of a flight.

use contract::topic::Topic;
use serde::Serialize;

/// Something that happened to a process.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Event {
    /// The tick of the plant then.
    pub tick: u64,
    /// Which node.
    pub node: &'static str,
    /// Which incarnation.
    pub epoch: u32,
    /// What.
    pub what: What,
    /// Why, where that is not plain.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
}

/// What can happen to a process.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// It died.
    Died,
    /// It made no progress; unless it came back by itself it was killed.
    Hung,
    /// The scenario had it killed.
    Killed,
    /// It was started.
    Started,
    /// It holds the office.
    TookOver,
    /// It is not started any more.
    GivenUp,
    /// A newcomer works in the shadow.
    InShadow,
    /// A newcomer was sent away before it held the office.
    Rejected,
    /// A newcomer holds the office for good.
    Kept,
    /// A newcomer had to give the office back.
    Returned,
}

impl Event {
    /// That happened to the process `epoch` that speaks on `topic`.
    pub fn new(tick: u64, topic: Topic, epoch: u32, what: What) -> Self {
        Self { tick, node: topic.publisher(), epoch, what, why: None }
    }

    /// For a reason.
    #[must_use]
    pub fn because(self, why: impl Into<String>) -> Self {
        Self { why: Some(why.into()), ..self }
    }
}
