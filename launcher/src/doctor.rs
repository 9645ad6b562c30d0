//! `doctor`: tells if this machine gives a flight in real time what its scenario asks for, and what to do.

use std::fmt::Write;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::bail;
use contract::exit;
use contract::topic::NODES;
use flight::duration::seconds;
use flight::event::name;
use flight::interrupts::catch_interrupts;
use flight::provenance::{Host, host};
use flight::stack::StartError;
use machine::host::{CpuTimes, stolen};
use machine::{Finding, Machine, Severity};
use measure::timing::canary::{Canary, CanarySummary, CanaryWatch};
use runtime::console::{eprint_line, print};
use serde::Serialize;
use settings::{Mode, Scenario, SchedulingPolicy};

use crate::fly::program;

/// Share of wake-ups later than the plant's deadline from which on a flight does not keep its deadlines.
const LATE_SHARE: f64 = 1e-3;
/// Column at which the text of a finding begins.
const COLUMN: usize = 27;

/// Arguments of `doctor`.
#[derive(clap::Args)]
pub struct DoctorArgs {
    /// Scenario file (TOML) of the flight; without one: the flight of `fly` without a scenario
    scenario: Option<PathBuf>,
    /// Override a setting, value in TOML
    #[arg(long = "set", value_name = "KEY=VALUE")]
    set: Vec<String>,
    /// Time for which the processors are watched; 0s = not at all
    #[arg(long = "watch", value_name = "TIME", default_value = "10s", value_parser = watch_time)]
    watch_s: f64,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Everything that `doctor` prints.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    host: Host,
    scenario: String,
    /// `true` if a flight gets what the scenario asks for.
    fit: bool,
    findings: Vec<Finding>,
    canary: Option<CanarySummary>,
}

/// Examines the machine; returns the exit code, 1 if a flight does not get what it asks for.
pub fn doctor(args: &DoctorArgs) -> anyhow::Result<u8> {
    let scenario = flight::scenario::load(args.scenario.as_deref(), &args.set)?;
    let machine = Machine::this();
    let mut findings = machine::scheduling(&machine, &scenario, None, &program());
    findings.extend(machine::required(&machine, &scenario));
    // The machine is not fit if it is unknown whether a flight gets something that the scenario asks for.
    let mut fit = findings.iter().all(|finding| matches!(finding.level, Severity::Ok | Severity::Warn));
    let mut canary = None;
    if scenario.run.mode == Mode::Realtime {
        findings.extend(machine::disturbances(&machine));
        if args.watch_s > 0.0 {
            let (watched, summary) = watch(&machine, &scenario, args)?;
            fit &= watched.iter().all(|finding| finding.level != Severity::Bad);
            findings.extend(watched);
            canary = Some(summary);
        }
    }
    let report = Report { host: host(), scenario: scenario.name, fit, findings, canary };
    print(&if args.json { serde_json::to_string_pretty(&report)? + "\n" } else { text(&report) });
    Ok(if fit { exit::FLOWN } else { exit::OUT_OF_BOUNDS })
}

/// Watches all processors: the time that the host took away, and the delay of wake-ups.
fn watch(machine: &Machine, scenario: &Scenario, args: &DoctorArgs) -> anyhow::Result<(Vec<Finding>, CanarySummary)> {
    let interrupts = catch_interrupts()?;
    if !args.json {
        eprint_line(&format!("watching the processors for {} s", args.watch_s));
    }
    let time = Duration::from_secs_f64(args.watch_s);
    let before = CpuTimes::read(machine);
    let canary = Canary::start(time + Duration::from_secs(2))?; // `stop` ends the canary earlier
    let fifo = canary.fifo;
    wait(time, &interrupts)?;
    let watch = canary.stop()?;
    let stolen = stolen(before, CpuTimes::read(machine)).of("stolen time");
    Ok((vec![stolen, wake_ups(&watch, scenario, fifo).of("canary")], watch.summary()))
}

fn wait(time: Duration, interrupts: &AtomicU32) -> anyhow::Result<()> {
    let end = Instant::now() + time;
    while Instant::now() < end {
        if interrupts.load(Ordering::Relaxed) > 0 {
            bail!(StartError::Interrupted);
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

/// Judges the wake-ups against the first deadline of a cycle, the plant's.
fn wake_ups(watch: &CanaryWatch, scenario: &Scenario, fifo: bool) -> Finding {
    let Some(delays) = watch.summary().covered else {
        return Finding::new(Severity::Unknown, "no wake-up was noted", "the processors could not be watched");
    };
    let deadline_ns = scenario.deadline_of(0).deadline_ns;
    let late = watch.covered_ns().filter(|late_ns| *late_ns > deadline_ns).count();
    let class = if fifo { "SCHED_FIFO" } else { "SCHED_OTHER" };
    let [p50_ms, p999_ms, max_ms] = [delays.p50_us, delays.p999_us, delays.max_us].map(|us| us / 1e3);
    let found =
        format!("{} wake-ups in {class}: p50 {p50_ms:.3} ms, p99.9 {p999_ms:.3} ms, max {max_ms:.3} ms late", delays.n);
    let deadline_ms = deadline_ns as f64 / 1e6;
    let means = format!("{late} were later than {deadline_ms} ms, the plant's deadline: a flight misses such cycles");
    let lacks_fifo =
        !fifo && (0..NODES.len()).any(|rank| scenario.scheduling_of(rank).policy == SchedulingPolicy::Fifo);
    let remedy = "end other work on this machine; on a virtual one, see stolen time";
    match late {
        _ if lacks_fifo => Finding::new(Severity::Bad, found, means).remedy("see scheduling class"),
        0 => Finding::new(Severity::Ok, found, format!("none was later than {deadline_ms} ms, the plant's deadline")),
        _ if late as f64 >= LATE_SHARE * delays.n as f64 => Finding::new(Severity::Bad, found, means).remedy(remedy),
        _ => Finding::new(Severity::Warn, found, means).remedy(remedy),
    }
}

/// Returns the findings as text, a line for each part of each finding, and the conclusion.
fn text(report: &Report) -> String {
    let mut text = String::new();
    for finding in &report.findings {
        let lines = finding.lines().join(&format!("\n{:COLUMN$}", ""));
        // Writing to a String never fails.
        let _ = writeln!(text, "{:<8} {:<17} {lines}", name(finding.level), finding.check);
    }
    let of = |level: Severity| report.findings.iter().filter(move |finding| finding.level == level);
    let bad: Vec<&str> = of(Severity::Bad).map(|finding| finding.check).collect();
    let (warnings, unknown) = (of(Severity::Warn).count(), of(Severity::Unknown).count());
    let conclusion = match () {
        () if report.fit => "gets what it asks for".to_owned(),
        () if bad.is_empty() => "may not get what it asks for: see unknown".to_owned(),
        () => format!("does not get what it asks for: {}", bad.join(", ")),
    };
    let _ = writeln!(text, "\n'{}' {conclusion} ({warnings} warnings, {unknown} unknown)", report.scenario);
    text
}

fn watch_time(text: &str) -> Result<f64, String> {
    let watch_s = seconds(text)?;
    if watch_s <= 600.0 { Ok(watch_s) } else { Err("expected 0s to 10min".to_owned()) }
}
