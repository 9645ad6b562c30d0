//! Channels of the log, and the bytes of their messages: the same in the file and on a live connection.

use contract::Topic;
use contract::message::{Payload, Truth};

use super::{EVENTS, MEMORY, schema};

/// One channel, encoded as protobuf.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Channel {
    pub topic: String,
    /// Full name of the protobuf message.
    pub schema: &'static str,
    /// Serialised `FileDescriptorSet` that contains the message.
    pub descriptors: &'static [u8],
    pub publisher: &'static str,
}

/// Lists the channels: those of messages by `Record::kind`, then events, then snapshots.
pub fn channels() -> Vec<Channel> {
    let channel = |topic: &str, schema, publisher| {
        let topic = topic.to_owned();
        Channel { topic, schema, descriptors: schema::DESCRIPTORS, publisher }
    };
    let topics = Topic::ALL.map(|topic| (topic.name(), topic.publisher()));
    let messages = topics.into_iter().chain([(Truth::NAME, Topic::State.publisher())]).zip(schema::MESSAGES);
    let messages = messages.map(|((name, publisher), schema)| channel(&format!("/{name}"), schema, publisher));
    let others = [(EVENTS, schema::EVENT), (MEMORY, schema::MEMORY)];
    messages.chain(others.map(|(topic, schema)| channel(topic, schema, "launcher"))).collect()
}
