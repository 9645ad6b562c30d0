//! Figures computed from the times: distributions, ratios and misses.

use std::collections::BTreeMap;

use serde::Serialize;

use super::canary::CanarySummary;
use super::machine::Placement;
use super::raw::{Raw, Rings};
use super::series::Ratio;
use super::timed_flights::TimedFlights;
use outcome::percentiles::Percentiles;

/// Number of releases per maximum. A single maximum is mostly chance, so two loops are compared by many.
const MAXIMUM_OF: usize = 200;
/// Number of processes in a ring, and so of hops.
const HOPS: f64 = 4.0;
/// Number of clock readings noted by a node's cycle: start and publication.
const CLOCK_READINGS: f64 = 2.0;

#[derive(Debug, Clone, Serialize)]
pub struct TimingResults {
    pub rounds: usize,
    /// `true` if the canaries were given `SCHED_FIFO`.
    pub fifo: bool,
    pub canary: CanarySummary,
    /// Distribution of every series over all rounds.
    pub series: BTreeMap<String, Percentiles>,
    /// Our loop over cyclictest: p50, p99, and the maximum of every 200 releases.
    pub loop_over_cyclictest: [Option<Ratio>; 3],
    pub rings: Vec<RingTimes>,
    /// Flights that were flown; without `stress-ng`, flights under load are absent.
    pub flights: Vec<TimedFlights>,
    /// Time of one reading of `CLOCK_MONOTONIC` \[ns\].
    pub clock_ns: u64,
    /// Ratio of simulated time to wall time through four processes in lockstep.
    pub lockstep: Option<Ratio>,
    pub in_process: Option<Ratio>,
}

#[derive(Debug, Clone, Serialize)]
pub struct RingTimes {
    pub placement: Placement,
    /// Sense to act without execution, over the raw ring's time: p50.
    pub p50_over_raw: Option<Ratio>,
    pub p99_over_raw: Option<Ratio>,
    /// Cost of the clock readings of four nodes, over the stack's time with execution \[%\].
    pub stamps_percent: Option<f64>,
}

impl TimingResults {
    pub fn of(raw: &Raw, rounds: usize) -> Self {
        let named = |s: &super::series::MeasuredTimes| Some((s.name.clone(), s.all()?));
        let over = |figure: fn(&Percentiles) -> f64| raw.ours.over(&raw.cyclictest, figure);
        let maxima = raw.ours.split(MAXIMUM_OF).over(&raw.cyclictest.split(MAXIMUM_OF), |d| d.max_us);
        Self {
            rounds,
            fifo: raw.fifo,
            canary: raw.watch.summary(),
            series: raw.series().into_iter().filter_map(named).collect(),
            loop_over_cyclictest: [over(|d| d.p50_us), over(|d| d.p99_us), maxima],
            rings: raw.rings.iter().map(|rings| RingTimes::of(rings, raw.clock_ns)).collect(),
            flights: raw.flights().filter(|flights| flights.slots > 0).cloned().collect(),
            clock_ns: raw.clock_ns,
            lockstep: Ratio::of(raw.lockstep.iter().copied()),
            in_process: Ratio::of(raw.in_process.iter().copied()),
        }
    }

    pub fn flights(&self, name: &str) -> Option<&TimedFlights> {
        self.flights.iter().find(|flights| flights.name == name)
    }
}

impl RingTimes {
    fn of(rings: &Rings, clock_ns: u64) -> Self {
        let p50: fn(&Percentiles) -> f64 = |d| d.p50_us;
        let with_execution_us = rings.stack.each(p50).into_iter().zip(rings.executions.each(p50)).map(|(t, e)| t + e);
        let usual_us = Ratio::of(with_execution_us).map(|ratio| ratio.median);
        Self {
            placement: rings.placement,
            p50_over_raw: rings.stack.over(&rings.raw, p50),
            p99_over_raw: rings.stack.over(&rings.raw, |d| d.p99_us),
            stamps_percent: usual_us.map(|usual| 100.0 * HOPS * CLOCK_READINGS * clock_ns as f64 / (usual * 1e3)),
        }
    }
}
