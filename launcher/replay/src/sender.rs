//! Senders of the messages that a process of a replay reads.

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, State};
use runtime::error::SessionError;
use runtime::ports::Ports;

use flight::log::Record;

/// Function that sends messages of one topic and ignores all others.
pub type SendRecord = Box<dyn Fn(&Record)>;

/// Opens the sender of the process `epoch` that publishes `topic`.
pub fn open(ports: &mut Ports, topic: Topic, epoch: u32) -> Result<SendRecord, SessionError> {
    fn of<M: Message>(ports: &mut Ports, epoch: u32) -> Result<SendRecord, SessionError> {
        let port = ports.sender::<M>(epoch)?;
        // A send fails if no port listens. A worker's port always listens; if another program takes the place of a
        // process, the wait for its answer (program.rs) notices its end.
        Ok(Box::new(move |record| _ = record.message().map(|message| port.send(message))))
    }
    match topic {
        Topic::State => of::<State>(ports, epoch),
        Topic::Reference => of::<Reference>(ports, epoch),
        Topic::Controls => of::<Controls>(ports, epoch),
        Topic::Actuators => of::<Actuators>(ports, epoch),
    }
}
