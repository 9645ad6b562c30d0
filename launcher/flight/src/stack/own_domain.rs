//! The domain of a run as its launcher makes it: the run's settings, the control page and the services of all topics.

use std::path::Path;

use anyhow::Context;
use contract::topic::Topic;
use runtime::domain::{Domain, Hold, SHM, check_room};
use runtime::port::{Bus, Services, bytes_needed, observer_depth};
use runtime::ports::Ports;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use settings::{Scenario, to_toml};

use super::surroundings;

/// Domain that this process holds. Dropping it wipes the run's shared memory.
pub struct OwnDomain {
    // The fields are dropped in this order: the services before the domain that holds their files.
    _services: Services,
    _bus: Bus,
    hold: Hold,
}

impl OwnDomain {
    /// Takes `namespace` for a run of `scenario`, in which process 1 of every node is active. Also returns the ports of
    /// the launcher, none of which is open yet.
    ///
    /// # Errors
    /// The system lacks something that a flight needs, or the namespace is taken.
    pub fn open(namespace: &str, scenario: &Scenario) -> anyhow::Result<(Self, Ports)> {
        surroundings::check(scenario.run.rate_hz)?;
        let hold = Hold::take(namespace)?;
        check_room(Path::new(SHM), bytes_needed(scenario.run.rate_hz))?; // files of a killed launcher are wiped by now
        let domain = &hold.domain;
        let shm = |what| move || format!("cannot write {what} in shared memory");
        domain.write("scenario.toml", &to_toml(scenario)).with_context(shm("settings"))?;
        ControlPage::create(&domain.file("page")).with_context(shm("the page"))?;
        let bus = Bus::attach(domain)?;
        let services = bus.create_services(observer_depth(scenario.run.rate_hz))?;
        let (ports, _) = Ports::join(namespace)?;
        for topic in Topic::ALL {
            ports.page.role(topic).assign(0, |_| Assignment { active: 1, standby: 0 });
        }
        Ok((Self { _services: services, _bus: bus, hold }, ports))
    }

    pub fn domain(&self) -> Domain {
        self.hold.domain.clone()
    }
}
