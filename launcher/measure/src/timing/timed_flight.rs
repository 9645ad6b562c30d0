//! The stack itself, flown and timed.

use std::sync::atomic::AtomicU32;

use anyhow::bail;
use contract::Scenario;
use contract::scenario::{Mode, Policy, from_merged};

use super::cycles::Cycles;
use super::machine::{CpuMeter, Placement};
use crate::killer::namespace;
use flight::inprocess;
use flight::stack::{Ended, Stack, StartError};
use view::bounds;
use view::summary::Summary;

pub struct TimedFlight {
    pub cycles: Cycles,
    /// Share of one processor that the four nodes used, where the run was long enough to tell \[%\].
    pub cpu_percent: Option<f64>,
    /// Whether all nodes were given the scheduling class they asked for.
    pub as_asked: bool,
    pub times_realtime: f64,
    /// Whether the vehicle flew to the end and inside the scenario's bounds.
    pub inside: bool,
}

pub fn realtime(rate_hz: u32, policy: Policy, duration_s: f64) -> Scenario {
    let mut scenario = Scenario::default();
    scenario.run.mode = Mode::Realtime;
    scenario.run.rate_hz = rate_hz;
    scenario.run.duration_s = duration_s;
    scenario.realtime.policy = policy;
    scenario
}

/// The paper's survey with the paper's controller, in real time; it is judged by what the paper claims.
pub fn paper(duration_s: f64) -> anyhow::Result<Scenario> {
    let text = include_str!("../../../../scenarios/survey-paper.toml");
    let mut scenario = from_merged(text, "scenarios/survey-paper.toml")?;
    scenario.run.mode = Mode::Realtime;
    scenario.run.duration_s = duration_s;
    Ok(scenario)
}

/// Flies `scenario` through processes.
pub fn fly(scenario: &Scenario, placement: Placement, interrupts: &AtomicU32) -> anyhow::Result<TimedFlight> {
    let namespace = namespace();
    let mut cycles = Cycles::new(scenario);
    let mut summary = Summary::new(scenario);
    let mut meter = CpuMeter::default();
    let stack = placement.during(|| Stack::start(&namespace, scenario, None, interrupts))?;
    let watch = |record| {
        cycles.observe(&record);
        summary.observe(&record);
    };
    let flown = stack.fly(interrupts, watch, |_| meter.read(&namespace));
    match &flown.ended {
        Ended::Flown => {}
        Ended::Interrupted => bail!(StartError::Interrupted),
        Ended::Lost(name) | Ended::Late(name) => bail!(StartError::Lost(format!("lost {name}"))),
        Ended::Unseen(what) => bail!(StartError::Lost(what.clone())),
    }
    let asked = if scenario.realtime.policy == Policy::Fifo { "fifo" } else { "other" };
    Ok(TimedFlight {
        cycles,
        cpu_percent: meter.share_percent(),
        as_asked: flown.scheduling.iter().all(|(_, got)| got.policy == asked),
        times_realtime: summary.time_s() / flown.wall.as_secs_f64(),
        inside: !summary.status().diverged() && bounds::check(scenario, &summary.metrics()).iter().all(|v| v.ok),
    })
}

/// Simulated over wall time of the default scenario in lockstep.
pub fn lockstep(duration_s: f64, interrupts: &AtomicU32) -> anyhow::Result<f64> {
    let mut scenario = realtime(100, Policy::Fifo, duration_s);
    scenario.run.mode = Mode::Lockstep;
    Ok(fly(&scenario, Placement::AllCpus, interrupts)?.times_realtime)
}

pub fn in_process(duration_s: f64) -> f64 {
    let mut scenario = realtime(100, Policy::Fifo, duration_s);
    scenario.run.mode = Mode::Inprocess;
    let mut summary = Summary::new(&scenario);
    let started = std::time::Instant::now();
    inprocess::fly(&scenario, |record| {
        summary.observe(&record);
        true
    });
    summary.time_s() / started.elapsed().as_secs_f64()
}
