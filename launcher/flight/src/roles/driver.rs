//! What the drivers of a flight through processes have in common: what is seen goes in, what is to be done comes out.

use std::time::Instant;

use contract::Scenario;
use contract::scenario::Fault;
use contract::topic::Topic;

use super::role::{Action, Input};
use super::supervised::Supervised;
use crate::log::Record;

/// What is to be done for the node that speaks on a topic.
pub type Order = (Topic, Action);

/// The roles of the four nodes, with what carries their inputs in. It changes the control page itself; starting, signalling
/// and reporting is left to be done.
pub trait Driver {
    fn nodes(&self) -> &[Supervised; Topic::COUNT];

    /// Takes one message in: trials are decided by them.
    fn observe(&mut self, record: &Record);

    /// Lockstep: the tick that the plant asks for, unless that was answered. All messages of the ticks before have been sent.
    fn question(&self) -> Option<u64> {
        None
    }

    /// What is to be done now, when all messages before the `question` have been observed. Swaps may have been added to
    /// `scenario` since the last look.
    fn look(&mut self, scenario: &Scenario, question: Option<u64>) -> Vec<Order>;

    /// Everything has been done that was to be done.
    fn done(&mut self) {}

    /// Takes in what was seen of a process of a node: that it has ended, could not be started, or is not received.
    fn on(&mut self, scenario: &Scenario, topic: Topic, input: Input) -> Vec<Order>;

    /// Whether another process may be tried now, by order; why not.
    fn may_swap(&self, topic: Option<Topic>) -> Result<(), String>;

    /// Takes fault `number` as it is from now on; lockstep takes no others than the scenario's.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}

    /// Why the run cannot go on, if it cannot. While `is_traced` says that a debugger has one of its processes, it waits.
    fn stuck(&mut self, _is_traced: &dyn Fn() -> bool) -> Option<String> {
        None
    }

    fn due(&self) -> Instant;
}
