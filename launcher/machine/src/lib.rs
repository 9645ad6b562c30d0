//! Examines whether this machine gives a flight in real time what its scenario asks for, and what may disturb it.
//!
//! | module | holds |
//! |---|---|
//! | [`finding`] | the result of one check |
//! | [`sources`] | `/proc`, `/sys` and `/dev`, below a root folder |
//! | [`privileges`] | scheduling class and locked memory |
//! | [`resources`] | stack, memory, open files, shared memory |
//! | [`processors`] | number, isolation, hardware threads, frequency and idle states of the processors |
//! | [`cgroups`] | limits on processor time, of both versions |
//! | [`kernel`] | preemption, throttling of `SCHED_FIFO`, clock source |
//! | [`host`] | virtualisation, and processor time that the host took away |
//!
//! `trefoil doctor` prints all findings. A flight prints the bad findings of [`scheduling`] as its first lines, and is
//! refused for bad findings of [`required`].

pub mod cgroups;
pub mod finding;
pub mod host;
pub mod kernel;
pub mod privileges;
pub mod processors;
pub mod resources;
pub mod sources;

use settings::{Mode, Scenario};

pub use finding::{Finding, Severity};
pub use privileges::Granted;
pub use sources::Machine;

/// Checks the scheduling that `scenario` asks for; a flight that does not get this scheduling flies all the same.
/// `granted` counts the nodes that got each privilege; before they are started (`None`), the limits and capabilities of
/// this process decide.
pub fn scheduling(machine: &Machine, scenario: &Scenario, granted: Option<Granted>, program: &str) -> Vec<Finding> {
    let mut found = privileges::check(machine, scenario, granted, program);
    found.push(processors::affinity(machine, scenario).of("affinity"));
    found
}

/// Checks the resources without which a flight of `scenario` is refused.
pub fn required(machine: &Machine, scenario: &Scenario) -> Vec<Finding> {
    let mut found = vec![resources::memory(machine).of("limits on memory")];
    if scenario.run.mode != Mode::Inprocess {
        found.push(resources::shared_memory(machine, scenario.run.rate_hz).of("shared memory"));
        found.push(resources::open_files(machine).of("open files"));
        found.push(resources::file_size(machine, scenario.run.rate_hz).of("file size"));
    }
    found
}

/// A check of the machine; `None` if its source cannot be read.
type Check = fn(&Machine) -> Option<Finding>;

/// Checks of [`disturbances`]: name, source, and the check.
const DISTURBANCES: [(&str, &str, Check); 10] = [
    ("preemption", "/proc/sys/kernel", kernel::preemption),
    ("FIFO throttling", "/proc/sys/kernel/sched_rt_runtime_us", kernel::throttling),
    ("cgroup quota", "the cgroup of this process", cgroups::quota),
    ("processors", "/proc/self/status or /sys", processors::number),
    ("isolation", "/sys/devices/system/cpu/isolated", processors::isolated),
    ("hardware threads", "/sys/devices/system/cpu/smt/active", processors::hardware_threads),
    ("frequency", "/sys", |machine| Some(processors::governor(machine))),
    ("idle states", "/sys", |machine| Some(processors::idle_states(machine))),
    ("clock source", "/sys/devices/system/clocksource/clocksource0", kernel::clock_source),
    ("virtualisation", "/proc/cpuinfo", host::virtualisation),
];

/// Checks what may disturb a flight in real time that gets everything it asks for.
pub fn disturbances(machine: &Machine) -> Vec<Finding> {
    let finding = |(name, source, check): (&'static str, &str, Check)| {
        let unknown = || Finding::new(Severity::Unknown, format!("{source} cannot be read"), "");
        check(machine).unwrap_or_else(unknown).of(name)
    };
    DISTURBANCES.map(finding).into()
}

#[cfg(test)]
mod tests;
