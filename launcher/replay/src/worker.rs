//! Process of a replay: its core, ports, link and faults, with a control page and queues of its own. The caller sends
//! the messages that the process reads, and collects the messages that the process sends.

use std::collections::HashMap;
use std::collections::hash_map::Entry;

use contract::Topic;
use contract::message::{Actuators, Stamp};
use contract::snapshot::Snapshot;
use flight::log::{Memory, Record};
use flight::nodes;
use flight::recorder::Observers;
use plant::sampler::Sampler;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::Node;
use runtime::ports::Ports;
use runtime::shared_role::{Assignment, Origin};
use settings::{Fault, Scenario};

use crate::script::Cycle;
use crate::sender::{self, SendRecord};
use ring::workers::Ring;

pub struct Worker {
    ring: Ring,
    member: Member,
    core: Core,
    observers: Observers,
    /// Senders of the messages that the process reads, by topic and epoch.
    senders: HashMap<(Topic, u32), SendRecord>,
    /// Number of changes of the fault table that the process knows.
    faults: u64,
}

enum Core {
    Plant(Box<Sampler>),
    Node(Box<dyn Node>),
}

impl Worker {
    /// Creates the process `epoch` of the node that answers on `topic`; it begins with `memory`, if given.
    pub fn new(
        topic: Topic,
        epoch: u32,
        scenario: &Scenario,
        memory: Option<&(Origin, Snapshot)>,
    ) -> Result<Self, SessionError> {
        let ring = Ring::new(true)?;
        ring.page.role(topic).offer(epoch);
        let member = Member::of_recording(ring.page.clone(), topic, epoch, scenario);
        let mut ports: Ports = ring.ports();
        let mut scenario = scenario.clone();
        scenario.attitude.mpc.time_limit_ms = 0.0; // the result must not depend on this machine
        let mut core = match topic {
            Topic::State => {
                let vehicle = nodes::vehicle(&scenario)?;
                Core::Plant(Box::new(Sampler::open(&mut ports, &member, &scenario, vehicle)?))
            }
            _ => Core::Node(nodes::open(&mut ports, &member, &scenario)?),
        };
        if let (Core::Node(node), Some((origin, memory))) = (&mut core, memory)
            && node.restore(memory)
        {
            member.continues.set(*origin);
        }
        let observers = Observers::open(&mut ring.ports(), &scenario)?;
        Ok(Self { ring, member, core, observers, senders: HashMap::new(), faults: 0 })
    }

    /// Sends `message` to the process, as the newest of its topic. ACTUATORS is ignored: the plant gets commands by
    /// [`Self::command`].
    pub fn read(&mut self, message: &Record) -> Result<(), SessionError> {
        let Some((topic, stamp)) = message.stamped().filter(|(topic, _)| *topic != Topic::Actuators) else {
            return Ok(());
        };
        let epoch = stamp.epoch as u32;
        let role = self.ring.page.role(topic);
        let sender = match self.senders.entry((topic, epoch)) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(new) => {
                role.offer(epoch);
                new.insert(sender::open(&mut self.ring.ports(), topic, epoch)?)
            }
        };
        role.assign(0, |_| Assignment { active: epoch, standby: 0 });
        sender(message);
        self.ring.page.doorbell(topic).mark();
        Ok(())
    }

    /// Gives the plant a command that arrives `after_ns` after its last sample.
    pub fn command(&mut self, command: &Actuators, after_ns: u64) {
        if let Core::Plant(sampler) = &mut self.core {
            sampler.plant.command(command, after_ns);
        }
    }

    /// Runs one cycle under those of the faults `given` in flight that the process knew in that cycle; `each` gets the
    /// messages that it sends. A `known` message is not computed but sent again, so that ports and faults get the state
    /// of the flight.
    pub fn run(
        &mut self,
        cycle: &Cycle,
        given: &[(usize, Fault)],
        known: Option<&Record>,
        mut each: impl FnMut(&Record),
    ) -> Result<(), SessionError> {
        let Member { page, topic, epoch, timing, faults, .. } = &self.member;
        for (number, fault) in given.iter().take(cycle.faults as usize).skip(self.faults as usize) {
            page.fault_table.enter(*number, fault);
        }
        self.faults = self.faults.max(cycle.faults);
        let active = if cycle.standby {
            Assignment { active: 0, standby: *epoch }
        } else {
            Assignment { active: *epoch, standby: 0 }
        };
        page.role(*topic).assign(cycle.tick as u32, |_| active);
        // The clock is set without the offset of a fault: `publish_ns` has the offset already, and the fault adds it
        // again.
        let read_ns = faults.read_ns(cycle.tick, cycle.publish_ns);
        let provenance = Stamp::at(cycle.tick, cycle.sample_ns);
        faults.update();
        timing.set_now_ns((2 * cycle.publish_ns).saturating_sub(read_ns));
        let known = known.map(Record::as_any);
        match &mut self.core {
            Core::Plant(sampler) => {
                let state = sampler.sample(cycle.tick, known)?;
                sampler.send(state, provenance, || {});
            }
            Core::Node(node) => {
                faults.new_faults(|number, fault| node.apply_fault(number, fault));
                node.answer(provenance, known)?;
            }
        }
        let own = *topic;
        self.observers.drain(|record| {
            if record.stamped().is_none_or(|(topic, _)| topic == own) {
                each(record);
            }
        });
        Ok(())
    }

    /// Notes the origin of the memory with which the process began, if the memory itself is not known.
    pub fn continue_from(&self, origin: Origin) {
        self.member.continues.set(origin);
    }

    /// Continues from `memory`, which the process had in the flight; returns false if it does not fit the core.
    pub fn restore(&mut self, memory: &Memory) -> bool {
        match &mut self.core {
            Core::Plant(sampler) => sampler.plant.restore(memory.origin.done - 1, &memory.words),
            Core::Node(node) => memory.padded().is_some_and(|words| node.restore(&words) && node.memory() == words),
        }
    }

    /// Returns the memory of the process; `None` for the plant.
    pub fn memory(&self) -> Option<Snapshot> {
        match &self.core {
            Core::Plant(_) => None,
            Core::Node(node) => Some(node.memory()),
        }
    }
}
