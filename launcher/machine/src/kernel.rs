//! Kernel: preemption model, throttling of `SCHED_FIFO`, clock source.

use crate::finding::{Finding, Severity};
use crate::sources::Machine;

/// Clock sources that are read without a system call.
const FAST_CLOCKS: [&str; 3] = ["tsc", "arch_sys_counter", "kvm-clock"];

/// Checks if a wake-up can preempt the kernel within a system call.
pub(crate) fn preemption(machine: &Machine) -> Option<Finding> {
    const MEANS: &str = "a wake-up waits until the kernel leaves a system call of another process, up to some ms";
    const SET: &str = "echo full | sudo tee /sys/kernel/debug/sched/preempt, or boot with preempt=full";
    let (release, version) = (machine.text("proc/sys/kernel/osrelease")?, machine.text("proc/sys/kernel/version")?);
    let is_rt = machine.text("sys/kernel/realtime").is_some_and(|word| word == "1");
    let has = |word: &str| version.split_whitespace().any(|found| found == word);
    let found = |model: &str| format!("{model}, Linux {release}");
    if is_rt || has("PREEMPT_RT") {
        return Some(Finding::new(Severity::Ok, found("PREEMPT_RT"), ""));
    }
    let by_debugfs =
        machine.text("sys/kernel/debug/sched/preempt").and_then(|text| bracketed(&text).map(str::to_owned));
    let at_boot = || {
        let line = machine.text("proc/cmdline")?;
        line.split_whitespace().find_map(|word| word.strip_prefix("preempt=")).map(str::to_owned)
    };
    Some(match (has("PREEMPT_DYNAMIC"), by_debugfs.or_else(at_boot)) {
        (true, Some(model)) if ["full", "lazy"].contains(&model.as_str()) => {
            Finding::new(Severity::Ok, found(&format!("dynamic, {model}")), "")
        }
        (true, Some(model)) => Finding::new(Severity::Warn, found(&format!("dynamic, {model}")), MEANS).remedy(SET),
        (true, None) => Finding::new(
            Severity::Unknown,
            found("dynamic, /sys/kernel/debug/sched/preempt cannot be read"),
            "with `none` or `voluntary` a wake-up waits until the kernel leaves a system call of another process",
        )
        .remedy("sudo mount -t debugfs none /sys/kernel/debug; sudo cat /sys/kernel/debug/sched/preempt"),
        (false, _) if has("PREEMPT") => Finding::new(Severity::Ok, found("PREEMPT"), ""),
        (false, _) => Finding::new(Severity::Warn, found("none or voluntary"), MEANS)
            .remedy("install a kernel with PREEMPT_RT (Debian: sudo apt-get install linux-image-rt-amd64)"),
    })
}

/// Returns the word in brackets of a list such as `none voluntary (full)`.
fn bracketed(text: &str) -> Option<&str> {
    text.split_whitespace().find_map(|word| word.strip_prefix('(')?.strip_suffix(')'))
}

/// Checks the share of time that all `SCHED_FIFO` processes may take together.
pub(crate) fn throttling(machine: &Machine) -> Option<Finding> {
    const SET: &str = "sudo sysctl kernel.sched_rt_runtime_us=950000";
    let number = |name: &str| machine.number(format!("proc/sys/kernel/sched_rt_{name}_us"));
    let (runtime_us, period_us) = (number("runtime")?, number("period")?);
    let [runtime_ms, period_ms] = [runtime_us, period_us].map(|us| us as f64 / 1e3);
    let found = format!("{runtime_ms:.0} of every {period_ms:.0} ms are for SCHED_FIFO");
    Some(match runtime_us {
        ..0 => Finding::new(
            Severity::Warn,
            "off",
            "a node that never sleeps takes its processor for good, unless realtime.rttime_ms ends it",
        )
        .remedy(SET),
        _ if runtime_us * 2 < period_us => {
            Finding::new(Severity::Warn, found, "the nodes stop when it is used up").remedy(SET)
        }
        _ => Finding::new(Severity::Ok, found, ""),
    })
}

/// Checks if the clock is read without a system call.
pub(crate) fn clock_source(machine: &Machine) -> Option<Finding> {
    const FOLDER: &str = "sys/devices/system/clocksource/clocksource0";
    let current = machine.text(format!("{FOLDER}/current_clocksource"))?;
    if FAST_CLOCKS.contains(&current.as_str()) {
        return Some(Finding::new(Severity::Ok, current, ""));
    }
    let available = machine.text(format!("{FOLDER}/available_clocksource")).unwrap_or_default();
    let better = available.split_whitespace().find(|name| FAST_CLOCKS.contains(name));
    let finding = Finding::new(
        Severity::Warn,
        &current,
        "a reading of the clock takes a system call and up to some microseconds, and every message has several",
    );
    Some(finding.remedy(match better {
        Some(better) => format!("echo {better} | sudo tee /{FOLDER}/current_clocksource"),
        None => "boot with tsc=reliable, if the processor has an invariant time stamp counter".into(),
    }))
}
