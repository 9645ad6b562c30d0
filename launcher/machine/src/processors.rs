//! Processors: number, affinity, isolation, hardware threads, frequency, idle states.

use contract::topic::NODES;
use settings::{Mode, Scenario};

use crate::finding::{Finding, Severity};
use crate::sources::{Machine, cpu_list};

const CPUS: &str = "sys/devices/system/cpu";
/// Longest time to leave an idle state that is not reported \[us\].
const EXIT_LIMIT_US: i64 = 50;

/// Checks if this process may use the processors that the scenario names.
pub(crate) fn affinity(machine: &Machine, scenario: &Scenario) -> Finding {
    let mut asked: Vec<usize> = (0..NODES.len()).flat_map(|rank| scenario.scheduling_of(rank).affinity).collect();
    asked.sort_unstable();
    asked.dedup();
    if asked.is_empty() || scenario.run.mode == Mode::Inprocess {
        return Finding::new(Severity::Ok, "the scenario names no processors", "");
    }
    let Some(allowed) = machine.allowed_cpus() else {
        return Finding::new(Severity::Unknown, "/proc/self/status cannot be read", "");
    };
    let missing: Vec<usize> = asked.iter().copied().filter(|cpu| !allowed.contains(cpu)).collect();
    if missing.is_empty() {
        return Finding::new(Severity::Ok, format!("processors {}", list(&asked)), "");
    }
    let found = format!("processors {} of the scenario are not there for this process", list(&missing));
    Finding::new(Severity::Bad, found, "the kernel places the nodes where it likes").remedy(format!(
        "name some of {} in realtime.affinity, or let this process have others (taskset, cpuset, Docker: --cpuset-cpus)",
        list(&allowed)
    ))
}

/// Checks the number of processors.
pub(crate) fn number(machine: &Machine) -> Option<Finding> {
    let (allowed, online) = (machine.allowed_cpus()?, cpu_list(&machine.text(format!("{CPUS}/online"))?)?);
    let found = format!("{} of {} for this process", allowed.len(), online.len());
    if allowed.len() > 1 {
        return Some(Finding::new(Severity::Ok, found, ""));
    }
    let means = "launcher and recorder work only while no node does, and every interrupt delays a node";
    let finding = Finding::new(Severity::Warn, found, means);
    Some(if online.len() > 1 {
        finding.remedy("let this process have more (taskset, cpuset, Docker: --cpuset-cpus)")
    } else {
        finding
    })
}

/// Checks if some processors are kept free of other processes.
pub(crate) fn isolated(machine: &Machine) -> Option<Finding> {
    let isolated = cpu_list(&machine.text(format!("{CPUS}/isolated"))?)?;
    if isolated.is_empty() {
        let means = "the nodes share the processors with all other work";
        return Some(Finding::new(Severity::Ok, "none isolated", means));
    }
    let found = format!("processors {} are isolated", list(&isolated));
    let means = format!("nodes fly there only with realtime.affinity = {isolated:?}");
    Some(Finding::new(Severity::Ok, found, means))
}

/// Checks if cores run two threads at once.
pub(crate) fn hardware_threads(machine: &Machine) -> Option<Finding> {
    Some(match machine.text(format!("{CPUS}/smt/active"))?.as_str() {
        "0" => Finding::new(Severity::Ok, "one per core", ""),
        "1" => Finding::new(
            Severity::Warn,
            "two or more per core",
            "work on the other thread of a core slows a node down, by up to half",
        )
        .remedy("echo off | sudo tee /sys/devices/system/cpu/smt/control"),
        _ => return None,
    })
}

/// Checks if the frequency of the processors falls while the nodes sleep.
pub(crate) fn governor(machine: &Machine) -> Finding {
    let cpus = machine.numbered(CPUS, "cpu");
    let mut governors: Vec<String> =
        cpus.iter().filter_map(|(_, cpu)| machine.text(cpu.join("cpufreq/scaling_governor"))).collect();
    governors.sort();
    governors.dedup();
    match governors.as_slice() {
        [] => Finding::new(
            Severity::Unknown,
            "no frequency governor is visible",
            "on a virtual machine the host decides; on others the firmware may",
        ),
        [one] if one == "performance" => Finding::new(Severity::Ok, "performance", ""),
        several => Finding::new(
            Severity::Warn,
            several.join(", "),
            "a processor that slowed down while the nodes slept runs their next cycle slower",
        )
        .remedy("echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor"),
    }
}

/// Checks how long a processor takes to leave the deepest idle state that it may enter.
pub(crate) fn idle_states(machine: &Machine) -> Finding {
    let mut states = vec![];
    for (_, cpu) in machine.numbered(CPUS, "cpu") {
        for (number, state) in machine.numbered(&cpu.join("cpuidle").to_string_lossy(), "state") {
            let [exit_us, disabled] = ["latency", "disable"].map(|file| machine.number(state.join(file)));
            if let (Some(exit_us), Some(0)) = (exit_us, disabled) {
                states.push((exit_us, number, machine.text(state.join("name")).unwrap_or_default()));
            }
        }
    }
    // The kernel enters no state whose exit takes longer than the limit in this file, which a process sets by holding
    // it open.
    let held_us =
        machine.bytes("dev/cpu_dma_latency").and_then(|bytes| Some(i32::from_le_bytes(bytes.try_into().ok()?)));
    let held_us = held_us.map_or(i64::MAX, i64::from);
    states.retain(|(exit_us, ..)| *exit_us <= held_us);
    states.sort();
    let Some((exit_us, _, name)) = states.last() else {
        return Finding::new(
            Severity::Unknown,
            "no idle state is visible",
            "on a virtual machine the host decides how deep an idle processor sleeps",
        );
    };
    let found = format!("the deepest is {name}, left within {exit_us} us");
    if *exit_us <= EXIT_LIMIT_US {
        return Finding::new(Severity::Ok, found, "");
    }
    let mut deep: Vec<usize> =
        states.iter().filter(|(exit_us, ..)| *exit_us > EXIT_LIMIT_US).map(|(_, number, _)| *number).collect();
    deep.sort_unstable();
    deep.dedup();
    let which = deep.iter().map(usize::to_string).collect::<Vec<_>>().join(",");
    let which = if deep.len() > 1 { format!("{{{which}}}") } else { which };
    let means = "a wake-up from it comes later by that time, and with cold caches";
    let remedy = format!("echo 1 | sudo tee /sys/devices/system/cpu/cpu*/cpuidle/state{which}/disable");
    Finding::new(Severity::Warn, found, means).remedy(remedy)
}

fn list(cpus: &[usize]) -> String {
    cpus.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}
