//! Ends of a flight in any mode, and the messages that its nodes refused.

use contract::guard::Refusal;
use contract::topic::Topic;
use runtime::realtime::ControlPage;
use serde::{Deserialize, Serialize};

/// End of a flight.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub enum Ended {
    /// The plant flew to the end.
    Flown,
    /// The user ended the flight, by Ctrl-C or `trefoil stop`.
    Interrupted,
    Lost(String),
    /// A node missed a deadline whose policy is `stop`.
    Late(String),
    /// The plant flew to the end, but the launcher missed messages, as the text says.
    Unseen(String),
}

pub type Refused = Vec<(String, [u32; Refusal::ALL.len()])>;

/// Counts the messages that each node has refused by now, by cause.
pub fn refused_by_listener(page: &ControlPage) -> Refused {
    let count =
        |topic: Topic| (topic.publisher().into(), Refusal::ALL.map(|r| page.role(topic).refused[r as usize].get()));
    Topic::ALL.map(count).into()
}
