//! Ring in one thread: runs the four steps in order, message by message as the processes would exchange them.
//!
//! | module | holds |
//! |---|---|
//! | `workers` | stand-ins for the processes of one node |
//!
//! Flights are bit-identical to lockstep, because the same cores get the same messages in the same order through the
//! same inputs and outputs, under the same roles. Nothing here reads a clock: stamps carry tick and sequence only.

pub(crate) mod workers;

use contract::message::{Content, Stamp};
use contract::scenario::{Scenario, candidate};
use contract::snapshot::PLANT_WORDS;
use contract::topic::Topic;
use plant::Plant;
use plant::vehicle::Vehicle;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::output::Output;
use runtime::shared_role::Origin;

use crate::event::Event;
use crate::log::{Memory, Record};
use crate::nodes::vehicle;
use crate::recorder::Observers;
use crate::roles::driver::Order;
use crate::roles::role::{self, Action};
use crate::roles::simulated::Simulated;
use crate::roles::supervised::given_up;
use crate::stack::{Ended, Refused, refused_by_listener};
use workers::{Ring, Workers};

/// Result of a flight in one thread, except its messages.
pub struct Flown {
    pub ended: Ended,
    pub events: Vec<Event>,
    pub refused: Refused,
    /// Reasons for which cores of users failed, in order.
    pub failures: Vec<String>,
}

/// Flies `scenario` to its end, or until `watch`, which gets every message, returns false.
pub fn fly(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Flown {
    fly_remembering(scenario, watch, |_| {})
}

/// Flies like [`fly`]; `remember` also gets the memory of every node, every ten seconds.
pub fn fly_remembering(
    scenario: &Scenario,
    watch: impl FnMut(&Record) -> bool,
    remember: impl FnMut(&Memory),
) -> Flown {
    let flown = fly_ring(scenario, true, watch, remember);
    flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"))
}

/// Flies like [`fly`] a flight of which no message is kept: messages carry checksums only if a fault or a swap
/// [may change them](changes_messages).
///
/// # Errors
/// Something derived from `scenario`, such as the gain of the controller, does not exist. Only the values of `scenario`
/// itself need to have been checked.
pub fn fly_unlogged(scenario: &Scenario, watch: impl FnMut(&Record) -> bool) -> Result<Flown, SessionError> {
    fly_ring(scenario, changes_messages(scenario), watch, |_| {})
}

/// Returns whether a fault or a swap may change a message. If so, receivers accept or refuse it by its checksum.
pub fn changes_messages(scenario: &Scenario) -> bool {
    !scenario.swap.is_empty() || scenario.fault.iter().any(|fault| fault.target.topic().is_some())
}

fn fly_ring(
    scenario: &Scenario,
    with_checksums: bool,
    mut watch: impl FnMut(&Record) -> bool,
    mut remember: impl FnMut(&Memory),
) -> Result<Flown, SessionError> {
    let ring = Ring::new(with_checksums).map_err(|why| SessionError::Io { what: "memory of the ring".into(), why })?;
    let observers = Observers::open(&mut ring.ports(), scenario)?;
    let mut roles = Simulated::new(scenario);
    let mut plant = Plant::with(scenario, vehicle(scenario)?);
    let (member, mut ports) = ring.member(Topic::State, 1, scenario, scenario);
    let mut states = Output::open(&mut ports, &member, scenario)?;
    let mut commands = Input::open(&mut ports, &member)?;
    let mut nodes = Vec::with_capacity(3);
    for topic in [Topic::Reference, Topic::Controls, Topic::Actuators] {
        nodes.push(Workers::new(&ring, topic, scenario)?);
    }
    let mut failures = vec![];
    let ended = loop {
        let mut go_on = true;
        let state = plant.sample();
        let tick = state.stamp.tick;
        for order in roles.begin(tick) {
            obey(&mut nodes, scenario, order)?;
        }
        if roles.assignment(Topic::State).active == 0 {
            break Ended::Lost("plant".into());
        }
        for topic in Topic::ALL {
            ring.page.role(topic).assign(tick as u32, |_| roles.assignment(topic));
        }
        let sample = Stamp::at(tick, tick * scenario.sample_ns());
        states.send(state, sample);
        ring.page.role(Topic::State).done(1).set(tick as u32 + 1);
        for workers in &mut nodes {
            failures.extend(answer(workers, &ring, &mut roles, sample));
        }
        if scenario.is_remembered(tick) {
            memories(&mut plant, &nodes, tick).iter().for_each(&mut remember);
        }
        observers.drain(|record| {
            roles.observe(record);
            go_on &= watch(record);
        });
        let command = commands.fresh();
        if !go_on || state.is_last() {
            break given_up(&roles.nodes).map_or(Ended::Flown, |name| Ended::Lost(name.into()));
        }
        if let Some(command) = command {
            plant.command(command, command.stamp.held_ns);
        }
        if let Err(error) = plant.advance(1) {
            failures.push(format!("plant 1, tick {}: {error}", tick + 1));
            break Ended::Lost("plant".into());
        }
    };
    Ok(Flown { ended, events: roles.events, refused: refused_by_listener(&ring.page), failures })
}

/// Returns the memories of all nodes after sample `tick`; none if the vehicle has no memory to continue from.
fn memories(plant: &mut Plant<dyn Vehicle>, nodes: &[Workers], tick: u64) -> Vec<Memory> {
    let mut words = [0; PLANT_WORDS];
    if !plant.memory(&mut words) {
        return vec![];
    }
    let vehicle = Memory::new(tick, Topic::State, Origin { epoch: 1, done: tick + 1 }, &words);
    let of_node = |workers: &Workers| {
        let (origin, memory) = workers.memory()?;
        Some(Memory::new(tick, workers.topic, origin, &memory))
    };
    std::iter::once(vehicle).chain(nodes.iter().filter_map(of_node)).collect()
}

/// Carries out an order before a tick. The plant has no other process: without it the flight ends.
fn obey(nodes: &mut [Workers], run: &Scenario, (topic, action): Order) -> Result<(), SessionError> {
    let Some(workers) = nodes.iter_mut().find(|workers| workers.topic == topic) else { return Ok(()) };
    match action {
        Action::Spawn(epoch, origin) => {
            let own = origin.and_then(|i| candidate(run, &run.swap[i]).ok()); // its errors were reported before
            workers.begin(epoch, own.as_ref().unwrap_or(run), run)?;
        }
        Action::Signal(epoch, role::Signal::Kill) => workers.end(epoch),
        _ => {} // the simulated roles have done it
    }
    Ok(())
}

/// Lets the processes that work for one node answer to a sample, except those that leave instead. Returns why cores
/// failed.
fn answer(workers: &mut Workers, ring: &Ring, roles: &mut Simulated, sample: Stamp) -> Vec<String> {
    let topic = workers.topic;
    let mut end = |workers: &mut Workers, epoch| {
        workers.end(epoch);
        roles.exited(topic, epoch, sample.tick, role::RoleInput::Exited(epoch));
        ring.page.role(topic).assign(sample.tick as u32, |_| roles.assignment(topic));
    };
    while let Some(epoch) = workers.leaves(sample.tick) {
        end(workers, epoch);
    }
    let failed = workers.answer(sample);
    let why = |(epoch, error)| {
        end(workers, epoch);
        format!("{} {epoch}, tick {}: {error}", topic.publisher(), sample.tick)
    };
    failed.into_iter().map(why).collect()
}
