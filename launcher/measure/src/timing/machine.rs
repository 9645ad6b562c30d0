//! State of the machine: processors, load, processor time, and the tool `cyclictest`.

use std::fs::read_to_string;
use std::process::{Child, Command, Stdio};

use anyhow::Context;
use runtime::realtime::now_ns;
use rustix::process::{Pid, Signal, kill_process};
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use serde::Serialize;

use crate::launched::StackProcess;

/// Processors that a ring may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// One processor for all processes.
    OneCpu,
    /// All processors; the kernel chooses.
    AllCpus,
}

impl Placement {
    pub fn name(self) -> &'static str {
        match self {
            Self::OneCpu => "one CPU",
            Self::AllCpus => "all CPUs",
        }
    }

    /// Runs `work` with this thread on these processors, which the processes that `work` starts inherit.
    pub fn during<T>(self, work: impl FnOnce() -> T) -> T {
        match self {
            Self::OneCpu => on_cpu(measured_cpu(), work),
            Self::AllCpus => work(),
        }
    }
}

/// Lists the processors that this process may use.
pub fn cpus() -> Vec<usize> {
    let Ok(set) = sched_getaffinity(None) else { return vec![0] };
    (0..CpuSet::MAX_CPU).filter(|cpu| set.is_set(*cpu)).collect()
}

/// Processor of the single-processor figures: the last, because the first serves most interrupts.
pub fn measured_cpu() -> usize {
    cpus().last().copied().unwrap_or(0)
}

/// Runs `work` with this thread on `cpu`, which the processes that `work` starts inherit.
pub fn on_cpu<T>(cpu: usize, work: impl FnOnce() -> T) -> T {
    let before = sched_getaffinity(None);
    let mut only = CpuSet::new();
    only.set(cpu);
    // If `cpu` is not allowed, the kernel chooses the processor.
    let _ = sched_setaffinity(None, &only);
    let result = work();
    if let Ok(before) = before {
        let _ = sched_setaffinity(None, &before);
    }
    result
}

/// Returns whether `program` can be started.
pub fn installed(program: &str) -> bool {
    Command::new(program).arg("--help").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
}

/// Program that is the reference for a bare loop.
pub const CYCLICTEST: &str = "cyclictest";

/// Running `stress-ng --cpu 4`; drop ends it.
pub struct Stress(Child);

impl Stress {
    /// Starts `stress-ng`; `None` if it is not installed. It ends by itself after `limit_s`, in case this process is
    /// killed.
    pub fn start(limit_s: f64) -> Option<Self> {
        let limit = format!("{}", limit_s.ceil());
        let mut command = Command::new("stress-ng");
        command.args(["--quiet", "--cpu", "4", "--timeout", &limit]).stdin(Stdio::null()).stdout(Stdio::null());
        let child = command.stderr(Stdio::null()).spawn().ok()?;
        std::thread::sleep(std::time::Duration::from_millis(200)); // its workers run by then
        Some(Self(child))
    }
}

impl Drop for Stress {
    fn drop(&mut self) {
        if let Some(pid) = Pid::from_raw(self.0.id() as i32) {
            let _ = kill_process(pid, Signal::TERM); // stress-ng ends its workers itself, or has ended already
        }
        let _ = self.0.wait();
    }
}

/// Meter of the processor time of a stack's processes.
#[derive(Default)]
pub struct CpuMeter {
    pids: Vec<Pid>,
    first: Option<(u64, u64)>,
    last: (u64, u64),
}

impl CpuMeter {
    /// Takes a reading, unless the last one is less than 200 ms old.
    pub fn read(&mut self, namespace: &str) {
        const EVERY_NS: u64 = 200_000_000;
        let now = now_ns();
        if now < self.last.0 + EVERY_NS {
            return;
        }
        if self.pids.is_empty() {
            let all = StackProcess::all(namespace).into_iter();
            self.pids = all.filter(|process| process.name != "launcher").map(|process| process.pid).collect();
        }
        self.last = (now, self.pids.iter().map(|pid| run_time_ns(*pid)).sum());
        self.first.get_or_insert(self.last);
    }

    /// Returns the share of one processor used between the first reading and the last \[%\].
    pub fn share_percent(&self) -> Option<f64> {
        let (first_ns, first_used_ns) = self.first?;
        let elapsed_ns = self.last.0 - first_ns;
        (elapsed_ns > 0).then(|| 100.0 * self.last.1.saturating_sub(first_used_ns) as f64 / elapsed_ns as f64)
    }
}

fn run_time_ns(pid: Pid) -> u64 {
    let text = read_to_string(format!("/proc/{}/schedstat", pid.as_raw_nonzero())).unwrap_or_default();
    text.split_whitespace().next().and_then(|ns| ns.parse().ok()).unwrap_or(0)
}

/// Runs cyclictest: `loops` wake-ups, one a millisecond, on `cpu` with `priority`; returns the delay of each \[ns\].
///
/// cyclictest is told not to change power management, because the loop compared with it does not either.
pub fn cyclictest(cpu: usize, priority: u32, loops: usize) -> anyhow::Result<Vec<u64>> {
    let (cpu, priority, loops) = (cpu.to_string(), priority.to_string(), loops.to_string());
    let output = Command::new(CYCLICTEST)
        .args(["--verbose", "--nsecs", "--mlockall", "--default-system", "--interval", "1000", "--distance", "0"])
        .args(["--affinity", &cpu, "--priority", &priority, "--loops", &loops])
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .context("cannot start cyclictest")?;
    Ok(latencies(&String::from_utf8_lossy(&output.stdout)))
}

/// Parses lines of thread, loop and latency; other lines are ignored.
fn latencies(text: &str) -> Vec<u64> {
    let latency = |line: &str| -> Option<u64> {
        let mut fields = line.split(':').map(|field| field.trim().parse::<u64>().ok());
        let (_, _, latency) = (fields.next()??, fields.next()??, fields.next()??);
        fields.next().is_none().then_some(latency)
    };
    text.lines().filter_map(latency).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn latencies_are_found_among_other_lines() {
        let text = "Max CPUs = 2\nThread 0 Interval: 1000\n       0:       0:   12873\n       0:       1:   14720\n";
        assert_eq!(latencies(text), [12_873, 14_720]);
    }
}
