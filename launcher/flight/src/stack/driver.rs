//! The driver of the roles that the run's mode needs, chosen once.

use std::time::Instant;

use contract::Scenario;
use contract::scenario::{Fault, Mode};
use contract::topic::Topic;
use runtime::realtime::ControlPage;

use crate::event::{Event, What};
use crate::log::Record;
use crate::roles::lockstep::Lockstep;
use crate::roles::realtime::{Realtime, plant_tick};
use crate::roles::role::{Action, Input, Role, Signal};

/// What is to be done for the node that speaks on a topic.
pub type Order = (Topic, Action);

/// The roles of the four nodes.
pub enum Driver {
    /// Against the clock.
    Realtime(Box<Realtime>),
    /// In lockstep.
    Lockstep(Box<Lockstep>),
}

impl Driver {
    /// That of a run of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        match scenario.run.mode {
            Mode::Realtime => Self::Realtime(Box::new(Realtime::new(scenario))),
            Mode::Lockstep | Mode::Inprocess => Self::Lockstep(Box::new(Lockstep::new(scenario))),
        }
    }

    /// Lockstep: the tick that the plant asks for.
    pub fn question(&self, page: &ControlPage) -> Option<u64> {
        match self {
            Self::Realtime(_) => None,
            Self::Lockstep(_) => Lockstep::question(page),
        }
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        match self {
            Self::Realtime(driver) => driver.observe(record),
            Self::Lockstep(driver) => driver.simulated.observe(record),
        }
    }

    /// What is to be done now.
    pub fn look(&mut self, page: &ControlPage, scenario: &Scenario, question: Option<u64>) -> Vec<Order> {
        match self {
            Self::Realtime(driver) => driver.look(page, scenario),
            Self::Lockstep(driver) => {
                let orders = driver.look(question);
                let reports = driver.simulated.events.drain(..).map(|event| (Topic::State, Action::Report(event)));
                reports.chain(orders).collect()
            }
        }
    }

    /// Everything has been done that was to be done.
    pub fn done(&mut self, page: &ControlPage) {
        if let Self::Lockstep(driver) = self {
            driver.answer(page);
        }
    }

    /// A process of a node has ended, or could not be started: `input` says which.
    pub fn exited(
        &mut self,
        page: &ControlPage,
        scenario: &Scenario,
        (topic, epoch): (Topic, u32),
        input: Input,
    ) -> Vec<Order> {
        match self {
            Self::Realtime(driver) => driver.on(page, scenario, topic, input),
            Self::Lockstep(driver) => {
                driver.exited(page, topic, epoch, input);
                vec![]
            }
        }
    }

    /// The process `epoch` of a node works, but not with the others, and `why`.
    pub fn unheard(
        &mut self,
        page: &ControlPage,
        scenario: &Scenario,
        (topic, epoch): (Topic, u32),
        why: &str,
    ) -> Vec<Order> {
        match self {
            Self::Realtime(driver) => driver.on(page, scenario, topic, Input::Unheard(epoch, why.into())),
            Self::Lockstep(_) => {
                let event = Event::new(plant_tick(page), topic.publisher(), epoch, What::Hung).because(why);
                vec![(topic, Action::Report(event)), (topic, Action::Signal(epoch, Signal::Kill))]
            }
        }
    }

    /// Whether the process `epoch` is active and no other could take its place.
    pub fn is_alone(&self, topic: Topic, epoch: u32) -> bool {
        match self {
            Self::Realtime(_) => self.role(topic).is_some_and(|role| role.is_alone(epoch)),
            Self::Lockstep(driver) => driver.simulated.is_alone(topic, epoch),
        }
    }

    /// Whether another process may be tried now, by order; why not.
    pub fn may_swap(&self, topic: Option<Topic>) -> Result<(), String> {
        match self {
            Self::Realtime(_) => topic.and_then(|topic| self.role(topic)).map_or(Ok(()), Role::may_swap),
            Self::Lockstep(_) => Err("a lockstep flight is to repeat: write the swap into its scenario".into()),
        }
    }

    /// Takes fault `number` as it is from now on; lockstep takes no others than the scenario's.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        if let Self::Realtime(driver) = self {
            driver.apply_fault(number, fault);
        }
    }

    /// A node that is given up.
    pub fn given_up(&self) -> Option<&'static str> {
        match self {
            Self::Realtime(driver) => {
                driver.nodes().iter().find(|node| node.role.given_up()).map(|node| node.role.name())
            }
            Self::Lockstep(driver) => driver.simulated.given_up(),
        }
    }

    /// Why the run cannot go on, if it cannot.
    pub fn stuck(&mut self, page: &ControlPage) -> Option<String> {
        let Self::Lockstep(driver) = self else { return None };
        if driver.simulated.assignment(Topic::State).active == 0 {
            return Some("plant".into());
        }
        let name = driver.stuck(page)?;
        Some(format!("{name} (the ring has not moved for the wall clock's limit, `supervision.wall_limit_s`)"))
    }

    /// When to look again.
    pub fn due(&self, page: &ControlPage) -> Instant {
        match self {
            Self::Realtime(driver) => driver.due(),
            Self::Lockstep(_) => Lockstep::due(page),
        }
    }

    fn role(&self, topic: Topic) -> Option<&Role> {
        let Self::Realtime(driver) = self else { return None };
        driver.nodes().get(topic as usize).map(|node| &node.role)
    }
}
