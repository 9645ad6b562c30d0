//! Timed flights of the stack.

use std::sync::atomic::AtomicU32;
use std::time::Instant;

use outcome::judge::Verdict;
use outcome::percentiles::Percentiles;
use serde::Serialize;
use settings::{Mode, Scenario, SchedulingPolicy, from_merged, load};

use super::canary::CanaryWatch;
use super::cycles::Cycles;
use super::machine::{CpuMeter, Placement};
use super::series::MeasuredTimes;
use crate::flights::{Started, in_process};

/// Flights under equal conditions.
#[derive(Debug, Clone, Serialize)]
pub struct TimedFlights {
    pub name: String,
    pub rate_hz: u32,
    pub policy: SchedulingPolicy,
    /// `true` if flown under `stress-ng --cpu 4`.
    pub loaded: bool,
    /// `true` if all nodes were given the scheduling class `policy`.
    pub as_asked: bool,
    pub slots: usize,
    pub misses: usize,
    /// Number of misses during which the host delayed a canary.
    pub explained: usize,
    pub longest_run: usize,
    pub age: Option<Percentiles>,
    /// Share of one processor that the four nodes used \[%\]; `None` if no flight was long enough.
    pub cpu_percent: Option<f64>,
    /// `true` if every flight reached its end inside the scenario's bounds.
    pub inside: bool,
    /// Ages at the actuator, flight by flight.
    #[serde(skip)]
    pub ages: MeasuredTimes,
    /// Time covered by each slot that was missed \[ns\]; `None` for other slots.
    #[serde(skip)]
    missed: Vec<Option<(u64, u64)>>,
}

impl TimedFlights {
    /// Makes a record without flights.
    pub fn new(name: impl Into<String>, rate_hz: u32, policy: SchedulingPolicy, loaded: bool) -> Self {
        let name = name.into();
        Self {
            ages: MeasuredTimes::new(format!("age, {name}")),
            name,
            rate_hz,
            policy,
            loaded,
            as_asked: true,
            slots: 0,
            misses: 0,
            explained: 0,
            longest_run: 0,
            age: None,
            cpu_percent: None,
            inside: true,
            missed: vec![],
        }
    }

    /// Flies the default scenario once more.
    pub fn fly_for(&mut self, duration_s: f64, interrupts: &AtomicU32) -> anyhow::Result<()> {
        self.fly(&realtime(self.rate_hz, self.policy, duration_s), interrupts)
    }

    pub fn fly(&mut self, scenario: &Scenario, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let (mut cycles, mut meter) = (Cycles::new(scenario), CpuMeter::default());
        let stack = Started::new(scenario, interrupts)?;
        let namespace = stack.namespace.clone();
        let (summary, flown) =
            stack.fly_to_the_end(interrupts, |record| cycles.observe(record), || meter.read(&namespace))?;
        let class = if self.policy == SchedulingPolicy::Fifo { "fifo" } else { "other" };
        self.as_asked &= flown.scheduling.iter().all(|(_, got)| got.policy == class);
        self.inside &= Verdict::of(&summary, scenario, &flown.how).passed();
        self.cpu_percent = meter.share_percent().or(self.cpu_percent);
        self.missed.extend(cycles.misses());
        self.ages.rounds.push(cycles.ages_ns());
        Ok(())
    }

    /// Computes the figures of all flights; `watch` holds the canaries' wake-ups during them.
    pub fn conclude(&mut self, watch: &CanaryWatch) {
        let missed = || self.missed.iter().flatten();
        self.slots = self.missed.len();
        self.misses = missed().count();
        self.explained = missed().filter(|(from_ns, to_ns)| watch.explains(*from_ns, *to_ns)).count();
        self.longest_run = self.missed.split(Option::is_none).map(<[_]>::len).max().unwrap_or(0);
        self.age = self.ages.all();
    }

    pub fn unexplained(&self) -> usize {
        self.misses - self.explained
    }
}

/// Returns the default scenario in real time.
pub fn realtime(rate_hz: u32, policy: SchedulingPolicy, duration_s: f64) -> Scenario {
    let mut scenario = load(None, &[format!("run.rate_hz={rate_hz}")]).expect("a rate that scenarios have");
    scenario.run.mode = Mode::Realtime;
    scenario.run.duration_s = duration_s;
    scenario.realtime.policy = policy;
    scenario
}

/// Returns the paper's survey with the paper's controller, in real time, with the bounds that the paper claims.
pub fn paper(duration_s: f64) -> anyhow::Result<Scenario> {
    let text = include_str!("../../../../scenarios/survey-paper.toml");
    let mut scenario = from_merged(text, "scenarios/survey-paper.toml")?;
    scenario.run.mode = Mode::Realtime;
    scenario.run.duration_s = duration_s;
    Ok(scenario)
}

/// Flies `scenario` through processes that are started on the processors of `placement`.
pub fn cycles(scenario: &Scenario, placement: Placement, interrupts: &AtomicU32) -> anyhow::Result<Cycles> {
    let mut cycles = Cycles::new(scenario);
    let stack = placement.during(|| Started::new(scenario, interrupts))?;
    stack.fly_to_the_end(interrupts, |record| cycles.observe(record), || {})?;
    Ok(cycles)
}

/// Measures the ratio of simulated time to wall time of the default scenario through four processes in lockstep.
pub fn lockstep_speed(duration_s: f64, interrupts: &AtomicU32) -> anyhow::Result<f64> {
    let mut scenario = realtime(100, SchedulingPolicy::Fifo, duration_s);
    scenario.run.mode = Mode::Lockstep;
    let (summary, flown) = Started::new(&scenario, interrupts)?.fly_to_the_end(interrupts, |_| {}, || {})?;
    Ok(summary.time_s() / flown.wall.as_secs_f64())
}

/// Measures the ratio of simulated time to wall time of the default scenario by one thread.
pub fn in_process_speed(duration_s: f64) -> f64 {
    let mut scenario = realtime(100, SchedulingPolicy::Fifo, duration_s);
    scenario.run.mode = Mode::Inprocess;
    let started = Instant::now();
    let (summary, _) = in_process(&scenario, |_| {});
    summary.time_s() / started.elapsed().as_secs_f64()
}
