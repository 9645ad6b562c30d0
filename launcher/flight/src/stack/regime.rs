//! Who decides on the assignment: against the clock the supervisor, from what it sees; in lockstep the script.

use std::time::{Duration, Instant};

use contract::Scenario;
use contract::scenario::{Fault, Mode};
use contract::topic::Topic;
use runtime::realtime::ControlPage;

use super::script::Script;
use crate::event::Event;
use crate::log::Record;
use crate::supervisor::{Order, Supervisor};

/// How often the queues and the children are looked at in lockstep.
const LOOK: Duration = Duration::from_millis(5);
/// The same while everybody waits for an answer, or soon may.
const QUICK_LOOK: Duration = Duration::from_micros(100);

/// The one or the other.
pub enum Regime {
    /// Against the clock.
    Clock(Supervisor),
    /// In lockstep.
    Script(Box<Script>),
}

impl Regime {
    /// That of a run of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        match scenario.run.mode {
            Mode::Realtime => Self::Clock(Supervisor::new(scenario)),
            Mode::Lockstep | Mode::Inprocess => Self::Script(Box::new(Script::new(scenario))),
        }
    }

    /// Lockstep: the tick that the plant asks for.
    pub fn question(&self, page: &ControlPage) -> Option<u64> {
        match self {
            Self::Clock(_) => None,
            Self::Script(_) => Script::question(page),
        }
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        match self {
            Self::Clock(supervisor) => supervisor.observe(record),
            Self::Script(script) => script.succession.observe(record),
        }
    }

    /// What is to be done now.
    pub fn orders(&mut self, page: &ControlPage, scenario: &Scenario, question: Option<u64>) -> Vec<Order> {
        match self {
            Self::Clock(supervisor) => supervisor.orders(page, scenario),
            Self::Script(script) => script.orders(page, question),
        }
    }

    /// The orders have been carried out.
    pub fn answer(&mut self, page: &ControlPage) {
        if let Self::Script(script) = self {
            script.answer(page);
        }
    }

    /// A process has ended that was not asked to. False when the run cannot go on without it.
    pub fn died(&mut self, page: &ControlPage, topic: Topic, epoch: u32) -> bool {
        match self {
            Self::Clock(supervisor) => supervisor.died(page, topic, epoch),
            Self::Script(script) => script.died(page, topic, epoch),
        }
    }

    /// The process `epoch` of a node works, but not with the others, and `why`.
    pub fn delivery(&mut self, page: &ControlPage, topic: Topic, epoch: u32, why: &str) -> Order {
        match self {
            Self::Clock(supervisor) => supervisor.delivery(page, topic, epoch, why),
            Self::Script(script) => script.delivery(page, topic, epoch, why),
        }
    }

    /// Whether the process `epoch` is active, and there is nobody to have it back.
    pub fn is_alone(&self, page: &ControlPage, topic: Topic, epoch: u32) -> bool {
        match self {
            Self::Clock(supervisor) => supervisor.is_alone(page, topic, epoch),
            Self::Script(script) => script.succession.is_alone(topic, epoch),
        }
    }

    /// Whether somebody may take over now from who speaks on `topic`, or from the recorder; why not.
    pub fn may_swap(&self, page: &ControlPage, topic: Option<Topic>) -> Result<(), String> {
        match self {
            Self::Clock(supervisor) => topic.map_or(Ok(()), |topic| supervisor.may_swap(page, topic)),
            Self::Script(_) => Err("a lockstep flight is to repeat: write the swap into its scenario".into()),
        }
    }

    /// Takes fault `number` as it is from now on.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        if let Self::Clock(supervisor) = self {
            supervisor.apply_fault(number, fault); // lockstep takes no others than the scenario's
        }
    }

    /// A node for which nobody is started any more.
    pub fn given_up(&self) -> Option<&'static str> {
        match self {
            Self::Clock(supervisor) => supervisor.given_up(),
            Self::Script(script) => script.succession.given_up(),
        }
    }

    /// Everything that happened.
    pub fn events(&mut self) -> &mut Vec<Event> {
        match self {
            Self::Clock(supervisor) => &mut supervisor.events,
            Self::Script(script) => &mut script.succession.events,
        }
    }

    /// When to ask for orders again.
    pub fn due(&self, page: &ControlPage) -> Instant {
        match self {
            Self::Clock(supervisor) => supervisor.due(),
            Self::Script(_) if page.asked().count() > 0 => Instant::now() + QUICK_LOOK,
            Self::Script(_) => Instant::now() + LOOK,
        }
    }
}
