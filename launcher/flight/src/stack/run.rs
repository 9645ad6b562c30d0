//! Processes of a run and their common state. Carries out the orders of their roles.

use std::sync::Arc;

use contract::topic::Topic;
use guidance::Trajectory;
use runtime::console::eprint_line;
use runtime::domain::Domain;
use runtime::realtime::ControlPage;
use rustix::process::Signal as Unix;
use settings::{Mode, Scenario, candidate, to_toml};

use super::children::{Children, SpawnRequest};
use super::one_cpu::OneCpu;
use crate::event::Event;
use crate::log::Record;
use crate::roles::driver::Driver;
use crate::roles::lockstep::Lockstep;
use crate::roles::realtime::RealtimeRoles;
use ring::roles::Order;
use ring::roles::role::{Action, RoleInput, Signal};

pub struct FlightRun {
    pub domain: Domain,
    pub page: Arc<ControlPage>,
    pub children: Children,
    /// Driver of the roles of the nodes.
    pub driver: Box<dyn Driver>,
    /// Settings as they are now, with the faults and swaps that were ordered in flight.
    pub scenario: Scenario,
    pub trajectory: Trajectory,
    pub events: Vec<Event>,
    /// Time at which the newest message of each [kind](Record::kind) was sent \[ns\]; 0 before the first, and for
    /// TRUTH.
    pub newest_ns: [u64; Record::KINDS],
    /// Newest message of each kind that was delivered.
    pub newest: [Option<Record>; Record::KINDS],
}

impl FlightRun {
    pub fn new(domain: Domain, page: Arc<ControlPage>, scenario: &Scenario) -> Self {
        let driver: Box<dyn Driver> = match scenario.run.mode {
            Mode::Realtime => Box::new(RealtimeRoles::new(scenario, page.clone())),
            Mode::Lockstep | Mode::Inprocess => Box::new(Lockstep::new(scenario, page.clone())),
        };
        let one_cpu = (scenario.run.mode == Mode::Lockstep).then(OneCpu::take).flatten();
        Self {
            children: Children::new(domain.clone(), one_cpu),
            domain,
            page,
            driver,
            scenario: scenario.clone(),
            trajectory: Trajectory::new(scenario),
            events: vec![],
            newest_ns: [0; Record::KINDS],
            newest: [None; Record::KINDS],
        }
    }

    /// Returns the first sample before which every process is sure to see a change made now: the sample after the next
    /// one.
    pub fn next_tick(&self) -> u64 {
        self.page.plant_tick() + 2
    }

    /// Returns the time of `tick` in the flight \[s\].
    pub fn time_s(&self, tick: u64) -> f64 {
        tick as f64 / f64::from(self.scenario.run.rate_hz)
    }

    /// Gives `input`, an observation of a process of a node, to the node's role, and carries out the role's orders.
    pub fn on(&mut self, topic: Topic, input: RoleInput) {
        let orders = self.driver.on(&self.scenario, topic, input);
        self.carry_out(orders);
    }

    /// Carries out the orders that are due. In lockstep the messages before the plant's `question` have been observed.
    pub fn look(&mut self, question: Option<u64>) {
        let orders = self.driver.look(&self.scenario, question);
        self.carry_out(orders);
    }

    /// Returns why the run cannot go on, or `None`.
    pub fn stuck(&mut self) -> Option<String> {
        let Self { driver, children, .. } = self;
        driver.stuck(&|| children.any_traced())
    }

    /// Starts a process of a node, with program and settings of the swap `origin`, or of the run if it is `None`, and
    /// offers the process on the control page.
    pub fn start_node(&mut self, topic: Topic, epoch: u32, origin: Option<usize>) -> anyhow::Result<()> {
        self.page.role(topic).offer(epoch);
        let swap = origin.and_then(|i| self.scenario.swap.get(i));
        let own = swap.map(|swap| candidate(&self.scenario, swap)).transpose()?;
        let write = |own| self.domain.write(&format!("{}.{epoch}.toml", topic.publisher()), &to_toml(own));
        let settings = own.as_ref().map(write).transpose()?;
        let scenario = own.as_ref().unwrap_or(&self.scenario);
        self.children.spawn(&SpawnRequest {
            topic: Some(topic),
            epoch,
            log: None,
            program: Some(scenario.node.of(topic)),
            settings: settings.as_deref(),
            shares_cpu: scenario.scheduling_of(topic as usize).affinity.is_empty(),
        })
    }

    fn carry_out(&mut self, orders: Vec<Order>) {
        for (topic, action) in orders {
            match action {
                Action::Spawn(epoch, origin) => self.start_or_report(topic, epoch, origin),
                Action::Signal(epoch, signal) => self.children.signal(topic, epoch, unix(signal)),
                Action::Report(event) => self.events.push(event),
                Action::Activate(_) | Action::Standby(_) | Action::Vacate(_) => {} // done by the driver
            }
        }
    }

    fn start_or_report(&mut self, topic: Topic, epoch: u32, origin: Option<usize>) {
        let mut started = self.start_node(topic, epoch, origin);
        if let Err(error) = started.as_ref()
            && origin.is_some()
            && self.page.role(topic).active() == 0
        {
            // The program of the swap cannot be started. The program with which the flight began is started instead, so
            // that the node has a process.
            eprint_line(&format!("error: {error:#}; {} goes on as at the beginning", topic.publisher()));
            started = self.start_node(topic, epoch, None);
        }
        if let Err(error) = started {
            let why = format!("{error:#}");
            eprint_line(&format!("error: {why}"));
            self.on(topic, RoleInput::NotStarted(epoch, why));
        }
    }
}

pub fn unix(signal: Signal) -> Unix {
    match signal {
        Signal::Kill => Unix::KILL,
        Signal::Stop => Unix::STOP,
        Signal::Continue => Unix::CONT,
    }
}
