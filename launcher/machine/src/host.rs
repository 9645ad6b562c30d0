//! Host of a virtual machine, and the processor time that the host took away.

use crate::finding::{Finding, Severity};
use crate::sources::Machine;

/// Share of stolen time from which on the finding is a warning \[%\].
const STOLEN_PERCENT: f64 = 0.01;
/// Fields of a line of `/proc/stat`: user nice system idle iowait irq softirq steal.
const FIELDS: usize = 8;

/// Time of all processors since the machine was started, in ticks of the kernel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CpuTimes {
    stolen: u64,
    all: u64,
}

impl CpuTimes {
    /// Reads the times; `None` if they cannot be read.
    pub fn read(machine: &Machine) -> Option<Self> {
        let text = machine.text("proc/stat")?;
        let line = text.lines().find_map(|line| line.strip_prefix("cpu "))?;
        let times = line.split_whitespace().take(FIELDS).map(str::parse).collect::<Result<Vec<u64>, _>>().ok()?;
        Some(Self { stolen: *times.get(FIELDS - 1)?, all: times.iter().sum() })
    }
}

/// Checks how much time the host took away between two readings.
pub fn stolen(before: Option<CpuTimes>, after: Option<CpuTimes>) -> Finding {
    let (Some(before), Some(after)) = (before, after) else {
        return Finding::new(Severity::Unknown, "/proc/stat cannot be read", "");
    };
    let all = after.all.saturating_sub(before.all).max(1);
    let percent = 100.0 * after.stolen.saturating_sub(before.stolen) as f64 / all as f64;
    let found = format!("{percent:.2} % during this check");
    if percent < STOLEN_PERCENT {
        return Finding::new(Severity::Ok, found, "");
    }
    Finding::new(Severity::Warn, found, "the host gave the processors to others while processes here wanted them")
        .remedy("on the host: give each virtual processor one of its own, or fly on a machine that is not shared")
}

/// Checks if the machine is a virtual one.
pub(crate) fn virtualisation(machine: &Machine) -> Option<Finding> {
    let cpuinfo = machine.text("proc/cpuinfo")?;
    let flags = cpuinfo.lines().find(|line| line.starts_with("flags"));
    let is_guest = flags.map(|flags| flags.split_whitespace().any(|flag| flag == "hypervisor"));
    let maker = ["sys/hypervisor/type", "sys/class/dmi/id/sys_vendor", "sys/class/dmi/id/product_name"];
    let maker =
        maker.into_iter().find_map(|file| machine.text(file)).map_or(String::new(), |maker| format!(" ({maker})"));
    Some(match is_guest {
        Some(false) => Finding::new(Severity::Ok, "none", ""),
        Some(true) => Finding::new(
            Severity::Warn,
            format!("a virtual machine{maker}"),
            "its host may stop a processor at any moment, and no setting here prevents that",
        )
        .remedy("see the canary: it tells if that happens"),
        None => Finding::new(
            Severity::Unknown,
            format!("/proc/cpuinfo does not say whether this is a virtual machine{maker}"),
            "",
        ),
    })
}
