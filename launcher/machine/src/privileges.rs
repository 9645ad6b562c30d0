//! Scheduling class and locked memory: the privileges that the nodes ask for, and those that the kernel gives them.

use contract::topic::NODES;
use runtime::limits::LATER_BYTES;
use runtime::port::bytes_needed;
use settings::{Mode, Scenario, Scheduling, SchedulingPolicy};

use crate::cgroups;
use crate::finding::{Finding, Severity};
use crate::sources::{CAP_IPC_LOCK, CAP_SYS_NICE, Machine};

const CLASS: &str = "scheduling class";
const MEMORY: &str = "memory lock";
const MEGABYTE: u64 = 1 << 20;

/// Number of nodes that got each privilege.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Granted {
    /// Nodes in `SCHED_FIFO`.
    pub fifo: usize,
    /// Nodes with locked memory.
    pub locked: usize,
}

/// Judges what the nodes of a flight in real time of `scenario` were granted: the class, then the memory lock. Both
/// have the same remedy, because each `setcap` takes back the capabilities that an earlier `setcap` gave.
pub fn judge(scenario: &Scenario, Granted { fifo, locked }: Granted, program: &str) -> [Finding; 2] {
    let asked = asked(scenario);
    let lacks_fifo = fifo < asked.iter().filter(|asked| asked.policy == SchedulingPolicy::Fifo).count();
    let lacks_lock = locked < asked.iter().filter(|asked| asked.lock_memory).count();
    let class = match fifo {
        0 if lacks_fifo => "SCHED_OTHER for want of privilege".to_owned(),
        0 => "SCHED_OTHER, as the scenario has it".to_owned(),
        all if all == NODES.len() => "SCHED_FIFO".to_owned(),
        some => format!("SCHED_FIFO for {some} of 4 nodes{}", if lacks_fifo { " for want of privilege" } else { "" }),
    };
    let memory = match () {
        () if locked == NODES.len() => "locked",
        () if lacks_lock => "not locked for want of privilege",
        () => "not locked, as the scenario has it",
    };
    let capabilities = match (lacks_fifo, lacks_lock) {
        (true, true) => "cap_sys_nice,cap_ipc_lock",
        (true, false) => "cap_sys_nice",
        (false, _) => "cap_ipc_lock",
    };
    let setcap = format!("sudo setcap {capabilities}+ep {program}");
    let finding = |check, lacks, found: &str, means: &str| {
        if lacks {
            Finding::new(Severity::Bad, found, means).remedy(&setcap).of(check)
        } else {
            Finding::new(Severity::Ok, found, "").of(check)
        }
    };
    [
        finding(CLASS, lacks_fifo, &class, "every other process of this machine can delay the nodes"),
        finding(MEMORY, lacks_lock, memory, "a page that the system took back delays a cycle until it is loaded again"),
    ]
}

/// Checks class and memory lock. Without `granted`, the limits of this process decide, because its nodes inherit them.
pub(crate) fn check(machine: &Machine, scenario: &Scenario, granted: Option<Granted>, program: &str) -> Vec<Finding> {
    if scenario.run.mode != Mode::Realtime {
        return [CLASS, MEMORY]
            .map(|check| Finding::new(Severity::Ok, "not asked for in this mode", "").of(check))
            .into();
    }
    let [fifo, locked] = match granted {
        Some(Granted { fifo, locked }) => [Some(fifo), Some(locked)],
        None => [will_get_fifo(machine, scenario), will_get_lock(machine, scenario)],
    };
    let asked = asked(scenario);
    let all = |asks: fn(&Scheduling) -> bool| asked.iter().filter(|asked| asks(asked)).count();
    let judged = Granted {
        fifo: fifo.unwrap_or(all(|asked| asked.policy == SchedulingPolicy::Fifo)),
        locked: locked.unwrap_or(all(|asked| asked.lock_memory)),
    };
    let [mut class, mut memory] = judge(scenario, judged, program);
    if class.level == Severity::Bad {
        class.found = format!("{} ({})", class.found, limits_of_fifo(machine));
        if let Some(why) = cgroups::without_fifo(machine) {
            class = Finding {
                found: "SCHED_OTHER: the cgroup of this process gives no time to SCHED_FIFO".into(),
                ..class
            };
            class = class.remedy(why);
        }
    }
    if memory.level == Severity::Bad {
        memory.found = format!("{} ({})", memory.found, limits_of_lock(machine, scenario));
    }
    let unknown = |check| Finding::new(Severity::Unknown, "/proc/self/limits or status cannot be read", "").of(check);
    vec![if fifo.is_none() { unknown(CLASS) } else { class }, if locked.is_none() { unknown(MEMORY) } else { memory }]
}

fn asked(scenario: &Scenario) -> Vec<Scheduling> {
    (0..NODES.len()).map(|rank| scenario.scheduling_of(rank)).collect()
}

/// Returns the number of nodes that will be given `SCHED_FIFO`, by the rules of `sched_setscheduler`.
fn will_get_fifo(machine: &Machine, scenario: &Scenario) -> Option<usize> {
    let fifo = asked(scenario).into_iter().filter(|asked| asked.policy == SchedulingPolicy::Fifo);
    let may_all = machine.has_capability(CAP_SYS_NICE)?;
    let highest = machine.limit("Max realtime priority")?.soft;
    let has_time = cgroups::without_fifo(machine).is_none();
    let may = |asked: &Scheduling| may_all || highest.is_none_or(|highest| u64::from(asked.priority) <= highest);
    Some(fifo.filter(|asked| has_time && may(asked)).count())
}

/// Returns the number of nodes whose memory will stay locked: a node unlocks its memory if later mappings might fail.
fn will_get_lock(machine: &Machine, scenario: &Scenario) -> Option<usize> {
    let limit = machine.limit("Max locked memory")?.soft;
    let may = machine.has_capability(CAP_IPC_LOCK)? || limit.is_none_or(|most| most >= lock_bytes(machine, scenario));
    Some(asked(scenario).iter().filter(|asked| may && asked.lock_memory).count())
}

/// Memory that a node may have to lock \[bytes\]: its present mappings, about as large as those of this program, and
/// later mappings.
fn lock_bytes(machine: &Machine, scenario: &Scenario) -> u64 {
    let present_kb: u64 = machine.status("VmSize:").and_then(|kb| kb.parse().ok()).unwrap_or(0);
    present_kb * 1024 + bytes_needed(scenario.run.rate_hz) + LATER_BYTES as u64
}

fn limits_of_fifo(machine: &Machine) -> String {
    let highest = machine.limit("Max realtime priority").and_then(|limit| limit.soft).unwrap_or(0);
    format!("no CAP_SYS_NICE, highest priority {highest}")
}

fn limits_of_lock(machine: &Machine, scenario: &Scenario) -> String {
    let most = machine.limit("Max locked memory").and_then(|limit| limit.soft).unwrap_or(0);
    let needed_mb = lock_bytes(machine, scenario).div_ceil(MEGABYTE);
    format!("no CAP_IPC_LOCK, {:.1} MB may be locked of {needed_mb} MB", most as f64 / MEGABYTE as f64)
}
