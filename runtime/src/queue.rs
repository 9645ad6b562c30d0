//! The queues: message transport in process, where one thread calls all nodes.
//!
//! Queues behave like the ports between processes ([`crate::port`]): a receiver has a queue for each publisher, which
//! loses the oldest message when it is full. A receiver that joins later gets a publisher's last message together with
//! the next one.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::rc::Rc;

use crate::error::{PortError, PortFailure};
use crate::port::{ReceivePort, SendPort, WarmUp};
use contract::message::{Actuators, Controls, LAYOUT, Payload, Reference, State, Truth};

/// Queues of all messages of one ring.
#[derive(Clone)]
pub struct Queues {
    /// [`Receivers`] of each message type, in the order of [`LAYOUT`].
    receivers: [Rc<dyn Any>; LAYOUT.len()],
    ports: Rc<Cell<u64>>,
}

/// Queues of all receivers of one message type.
type Receivers<M> = RefCell<Vec<Rc<Queue<M>>>>;

/// Queue of a receiver: messages, each with the number of the port that it was sent through.
struct Queue<M> {
    depth: usize,
    /// Number of the receiving port; ports are numbered in the order in which they were opened.
    number: u64,
    messages: RefCell<VecDeque<(M, u64)>>,
}

/// Port of a publisher.
struct Sender<M> {
    number: u64,
    receivers: Rc<Receivers<M>>,
    last: Cell<Option<M>>,
    /// Number of the newest receiver that the port has sent to.
    newest: Cell<u64>,
}

/// Port of a receiver, which gets nothing more when it is dropped.
struct Receiver<M> {
    queue: Rc<Queue<M>>,
    receivers: Rc<Receivers<M>>,
}

impl Default for Queues {
    fn default() -> Self {
        Self {
            receivers: [
                Rc::<Receivers<State>>::default(),
                Rc::<Receivers<Reference>>::default(),
                Rc::<Receivers<Controls>>::default(),
                Rc::<Receivers<Actuators>>::default(),
                Rc::<Receivers<Truth>>::default(),
            ],
            ports: Rc::new(Cell::new(crate::shared_role::VACANT)),
        }
    }
}

impl Queues {
    /// Opens the sending side of `M`.
    pub fn sender<M: Payload>(&self) -> Result<Rc<dyn SendPort<M>>, PortError> {
        let (receivers, number) = (self.receivers()?, self.number());
        // Receivers that exist already get the first message, and nothing before it.
        Ok(Rc::new(Sender { number, receivers, last: Cell::new(None), newest: Cell::new(number) }))
    }

    /// Opens the receiving side of `M` with a queue of `depth` for each publisher.
    pub fn receiver<M: Payload>(&self, depth: usize) -> Result<Rc<dyn ReceivePort<M>>, PortError> {
        let (receivers, number) = (self.receivers()?, self.number());
        let queue = Rc::new(Queue { depth, number, messages: RefCell::default() });
        receivers.borrow_mut().push(queue.clone());
        Ok(Rc::new(Receiver { queue, receivers }))
    }

    fn receivers<M: Payload>(&self) -> Result<Rc<Receivers<M>>, PortError> {
        let found = self.receivers.iter().find_map(|of| of.clone().downcast().ok());
        found.ok_or_else(|| PortError::Service { name: M::NAME, reason: "no message of the ring".into() })
    }

    fn number(&self) -> u64 {
        self.ports.set(self.ports.get() + 1);
        self.ports.get()
    }
}

impl<M: Copy> Queue<M> {
    fn push(&self, message: &M, port: u64) {
        let mut messages = self.messages.borrow_mut();
        let full =
            messages.len() >= self.depth && messages.iter().filter(|(_, from)| *from == port).count() == self.depth;
        if full && let Some(oldest) = messages.iter().position(|(_, from)| *from == port) {
            messages.remove(oldest);
        }
        messages.push_back((*message, port));
    }
}

impl<M: Payload> SendPort<M> for Sender<M> {
    fn send(&self, message: &M) -> Result<(), PortFailure> {
        let queues = self.receivers.borrow();
        let newest = self.newest.get();
        for queue in queues.iter() {
            if queue.number > newest
                && let Some(last) = self.last.get()
            {
                queue.push(&last, self.number);
            }
            queue.push(message, self.number);
            self.newest.set(queue.number.max(self.newest.get()));
        }
        self.last.set(Some(*message));
        if queues.is_empty() { Err(PortFailure::Send) } else { Ok(()) }
    }

    fn number(&self) -> u64 {
        self.number
    }
}

impl<M> WarmUp for Sender<M> {
    fn warm_up(&self) {}
}

impl<M: Payload> ReceivePort<M> for Receiver<M> {
    fn receive(&self, take: &mut dyn FnMut(&M, u64)) -> Result<bool, PortFailure> {
        let mut messages = self.queue.messages.borrow_mut();
        messages.front().inspect(|(message, port)| take(message, *port));
        Ok(messages.pop_front().is_some())
    }

    fn cannot_reach(&self, _port: u64) -> bool {
        false
    }

    fn reconnect(&self) -> Result<(), PortError> {
        Ok(())
    }
}

impl<M> Drop for Receiver<M> {
    fn drop(&mut self) {
        self.receivers.borrow_mut().retain(|queue| !Rc::ptr_eq(queue, &self.queue));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::Stamp;

    fn controls(tick: u64) -> Controls {
        Controls { stamp: Stamp { tick, ..Stamp::default() }, ..Controls::default() }
    }

    fn ticks(receiver: &dyn ReceivePort<Controls>) -> Vec<(u64, u64)> {
        let mut ticks = vec![];
        while receiver.receive(&mut |message, port| ticks.push((message.stamp.tick, port))).unwrap() {}
        ticks
    }

    #[test]
    fn a_full_queue_loses_the_oldest_of_the_publisher_that_sends() {
        let queues = Queues::default();
        let (one, other) = (queues.sender::<Controls>().unwrap(), queues.sender::<Controls>().unwrap());
        let receiver = queues.receiver::<Controls>(2).unwrap();
        assert!(other.send(&controls(9)).is_ok());
        for tick in 1..=3 {
            assert!(one.send(&controls(tick)).is_ok());
        }
        assert_eq!(ticks(&*receiver), [(9, other.number()), (2, one.number()), (3, one.number())]);
        assert_eq!(ticks(&*receiver), []);
    }

    #[test]
    fn a_receiver_that_joins_later_gets_the_last_message_with_the_next() {
        let queues = Queues::default();
        let sender = queues.sender::<Controls>().unwrap();
        assert!(sender.send(&controls(1)).is_err(), "no listener is there");
        let receiver = queues.receiver::<Controls>(2).unwrap();
        assert_eq!(ticks(&*receiver), []);
        assert!(sender.send(&controls(2)).is_ok() && sender.send(&controls(3)).is_ok());
        assert_eq!(
            ticks(&*receiver).iter().map(|(tick, _)| *tick).collect::<Vec<_>>(),
            [2, 3],
            "1 is the oldest of three"
        );
        let late = queues.receiver::<Controls>(2).unwrap();
        assert!(sender.send(&controls(4)).is_ok());
        assert_eq!(ticks(&*late).iter().map(|(tick, _)| *tick).collect::<Vec<_>>(), [3, 4]);
        assert_eq!(ticks(&*receiver).len(), 1);
    }

    #[test]
    fn receivers_that_exist_already_get_a_publisher_s_first_message_once() {
        let queues = Queues::default();
        let receiver = queues.receiver::<Controls>(2).unwrap();
        let sender = queues.sender::<Controls>().unwrap();
        assert!(sender.send(&controls(1)).is_ok());
        assert_eq!(ticks(&*receiver).len(), 1);
        drop(receiver);
        assert!(sender.send(&controls(2)).is_err());
    }
}
