//! Examines whether this machine gives a flight in real time what its scenario asks for, and what may disturb it.
//!
//! | module | holds |
//! |---|---|
//! | [`finding`] | the result of one check |
//! | [`sources`] | `/proc`, `/sys` and `/dev`, below a root folder |
//! | [`privileges`] | scheduling class and locked memory |
//! | [`resources`] | stack, memory, open files, shared memory |
//! | [`processors`] | their number, isolation, hardware threads, frequency, idle states |
//! | [`cgroups`] | limits on processor time, of both versions |
//! | [`kernel`] | preemption, throttling of `SCHED_FIFO`, clock source |
//! | [`host`] | virtualisation, and processor time that the host took away |
//!
//! `trefoil doctor` prints all findings. A flight prints those of [`scheduling`] that are bad as its first lines, and
//! is refused for those of [`required`].

pub mod cgroups;
pub mod finding;
pub mod host;
pub mod kernel;
pub mod privileges;
pub mod processors;
pub mod resources;
pub mod sources;

use settings::{Mode, Scenario};

pub use finding::{Finding, Level};
pub use privileges::Granted;
pub use sources::Machine;

/// Checks the scheduling that `scenario` asks for; a flight that does not get it flies without. `granted` is what its
/// processes got; `None`: they have not been started, so the limits and capabilities of this process tell.
pub fn scheduling(machine: &Machine, scenario: &Scenario, granted: Option<Granted>, program: &str) -> Vec<Finding> {
    let mut found = privileges::check(machine, scenario, granted, program);
    found.push(processors::affinity(machine, scenario));
    found
}

/// Checks the resources without which a flight of `scenario` is refused.
pub fn required(machine: &Machine, scenario: &Scenario) -> Vec<Finding> {
    let mut found = vec![resources::memory(machine)];
    if scenario.run.mode != Mode::Inprocess {
        found.push(resources::shared_memory(machine, scenario.run.rate_hz));
        found.push(resources::open_files(machine));
        found.push(resources::file_size(machine, scenario.run.rate_hz));
    }
    found
}

/// Checks what may disturb a flight in real time that gets everything it asks for.
pub fn disturbances(machine: &Machine) -> Vec<Finding> {
    vec![
        kernel::preemption(machine),
        kernel::throttling(machine),
        cgroups::quota(machine),
        processors::number(machine),
        processors::isolated(machine),
        processors::hardware_threads(machine),
        processors::governor(machine),
        processors::idle_states(machine),
        kernel::clock_source(machine),
        host::virtualisation(machine),
    ]
}

#[cfg(test)]
mod tests;
