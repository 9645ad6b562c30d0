//! Driver of the roles of a flight through processes: observations go in, orders to processes come out.

use std::time::Instant;

use contract::topic::Topic;
use settings::{Fault, Scenario};

use crate::log::Record;
use ring::roles::Order;
use ring::roles::role::RoleInput;
use ring::roles::supervised::Supervised;

/// Roles of the four nodes, and the source of their inputs. A driver changes the control page itself; its caller starts
/// and signals processes, and records events.
pub trait Driver {
    fn nodes(&self) -> &[Supervised; Topic::COUNT];

    /// Takes in one message, for the trials.
    fn observe(&mut self, record: &Record);

    /// Returns the tick that the plant waits for in lockstep; `None` after the answer, and in real time. When the plant
    /// waits for a tick, all messages of earlier ticks have been sent.
    fn question(&self) -> Option<u64> {
        None
    }

    /// Returns the orders that are due. All messages before the `question` must have been observed. Swaps may have been
    /// added to `scenario` since the last look.
    fn look(&mut self, scenario: &Scenario, question: Option<u64>) -> Vec<Order>;

    /// Called after all orders of this look were carried out.
    fn done(&mut self) {}

    /// Handles an observation of a process of a node: the process has ended, could not be started, or is cut off.
    fn on(&mut self, scenario: &Scenario, topic: Topic, input: RoleInput) -> Vec<Order>;

    /// Returns `Ok` if a swap may be ordered now, else the reason why not.
    fn may_swap(&self, topic: Topic) -> Result<(), String>;

    /// Adds fault `number`, or changes it to `fault`. The driver in lockstep ignores the call: there only the scenario
    /// has faults.
    fn apply_fault(&mut self, _number: usize, _fault: &Fault) {}

    /// Returns why the run cannot go on, or `None`. A ring that does not move is not stuck while a debugger
    /// traces one of its processes (`is_traced`).
    fn stuck(&mut self, _is_traced: &dyn Fn() -> bool) -> Option<String> {
        None
    }

    fn due(&self) -> Instant;
}
