//! `explain`: what each late, lost or missing message of a flight cost.
//!
//! Every disturbed tick ([`flight::replay::Disturbed`]) is undone in a flight of its own, every burst of ticks one after another
//! in one more, and all of them in a last one. The cost is the figure of the flight less that of the flight without, and the
//! largest distance between the courses of the two. Costs of single ticks do not add up to that of all: the vehicle recovers
//! from one before the next, or does not.
//!
//! | module | holds |
//! |---|---|
//! | `work` | how many flights that takes, and how long |
//! | `shown` | tables, page and JSON |

mod shown;
mod work;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::bail;
use contract::scenario::{Mode, Scenario};
use flight::inprocess;
use flight::log::Record;
use flight::replay::{Disturbed, Plan, Recording, replay, without};
use guidance::Trajectory;
use serde::Serialize;

use crate::metrics::Metrics;
use crate::summary::Summary;
use crate::ticks::{length_m, position_error_m};
pub use work::Work;
use work::{bursts, processors};

/// What a flight came to, as far as costs are told of.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    pub metrics: Metrics,
    /// Largest angle between the body's z axis and the vertical \[deg\].
    pub worst_tilt_deg: f64,
    /// Position error at each sample \[m\].
    pub error_m: Vec<f64>,
    /// True position at each sample, NED \[m\].
    pub course_m: Vec<[f64; 3]>,
    pub state_hash: Option<String>,
}

/// What one or several ticks cost: the figure of the flight less that of the flight without.
#[derive(Debug, Clone, Serialize)]
pub struct Cost {
    /// The first tick and the last.
    pub ticks: (u64, u64),
    /// When the first was \[s\].
    pub at_s: f64,
    pub node: &'static str,
    pub what: String,
    /// Of the largest position error \[m\]: 0 where another tick has the largest.
    pub max_error_m: f64,
    /// Largest distance between the courses of the flight and of the flight without \[m\].
    pub max_distance_m: f64,
    /// Of its integral \[m s\].
    pub error_integral_ms: f64,
    /// Of the worst tilt \[deg\].
    pub worst_tilt_deg: f64,
    /// The position error around it in the flight without it: time \[s\], error \[m\].
    #[serde(skip)]
    pub without_m: Vec<(f64, f64)>,
}

/// What the disturbed ticks of a flight cost.
#[derive(Debug, Clone)]
pub struct Explained {
    pub name: String,
    pub sample_s: f64,
    pub flight: Outcome,
    /// With every disturbed tick undone.
    pub without_any: Outcome,
    /// Another flight, as far as this one is known: in process, with the controllers of this program, and without any fault
    /// and swap of the scenario, those of air, sensors and actuators too.
    pub undisturbed: Outcome,
    /// Disturbed ticks, and bursts of more than one.
    pub disturbed: usize,
    pub bursts_found: usize,
    /// Single ticks, and bursts of more than one; the costliest first. Empty where that was too much work.
    pub ticks: Vec<Cost>,
    pub bursts: Vec<Cost>,
}

impl Outcome {
    /// Largest distance to another course, as far as both go \[m\].
    fn max_distance_m(&self, other: &Self) -> f64 {
        let apart =
            |(one, other): (&[f64; 3], &[f64; 3])| length_m(std::array::from_fn(|axis| one[axis] - other[axis]));
        self.course_m.iter().zip(&other.course_m).map(apart).fold(0.0, f64::max)
    }

    fn of(
        scenario: &Scenario,
        fly: impl FnOnce(&mut dyn FnMut(&Record)) -> anyhow::Result<()>,
    ) -> anyhow::Result<Self> {
        let (mut summary, trajectory) = (Summary::new(scenario), Trajectory::new(&scenario.mission));
        let (mut worst_tilt, mut error_m, mut course_m) = (0.0_f64, vec![], vec![]);
        fly(&mut |record| {
            summary.observe(record);
            if let Record::State(state) = record
                && state.stamp.is_delivered() | state.stamp.is_faulted()
                && record.is_intact()
                && error_m.len() as u64 <= state.stamp.tick
            {
                worst_tilt = worst_tilt.max(state.actual.tilt_rad());
                let wanted_m = trajectory.at(state.stamp.tick as f64 * scenario.sample_s()).position_m;
                error_m.resize(state.stamp.tick as usize + 1, length_m(position_error_m(wanted_m, state)));
                course_m.resize(state.stamp.tick as usize + 1, state.actual.position_m);
            }
        })?;
        let (metrics, state_hash) = (summary.metrics(), summary.state_hash());
        Ok(Self { metrics, worst_tilt_deg: worst_tilt.to_degrees(), error_m, course_m, state_hash })
    }

    /// A flight as `recording` has it.
    ///
    /// # Errors
    /// It cannot be flown to its end.
    pub fn flown(recording: &Recording) -> anyhow::Result<Self> {
        Self::of(&recording.scenario, |each| {
            let replayed = replay(recording, &Plan::default(), each)?;
            if let Some(why) = replayed.stopped {
                bail!("the flight cannot be flown again to its end: {why}");
            }
            Ok(())
        })
    }
}

/// Flies `recording` again without its disturbed ticks: with `each` without every one of them too, else only without all.
/// `progress` is told how many flights are done, and of how many.
///
/// # Errors
/// A flight cannot be flown to its end.
pub fn explain(
    recording: &Recording,
    work: &Work,
    each: bool,
    progress: impl Fn(usize, usize) + Sync,
) -> anyhow::Result<Explained> {
    let scenario = &recording.scenario;
    let Work { disturbed, last_tick, .. } = work;
    let flight = Outcome::flown(recording)?;
    let bursts: Vec<&[Disturbed]> = bursts(disturbed).collect();
    let all: BTreeSet<u64> = disturbed.iter().map(|one| one.tick).collect();
    let wanted: Vec<&[Disturbed]> =
        if each { disturbed.chunks(1).chain(bursts.iter().copied()).collect() } else { vec![] };
    let costs = in_parallel(&wanted, progress, |ticks| {
        let without = Outcome::flown(&without(recording, &ticks.iter().map(|one| one.tick).collect()))?;
        Ok(Cost::new(ticks, scenario.sample_s(), &flight, &without))
    })?;
    let (mut ticks, mut burst_costs): (Vec<Cost>, Vec<Cost>) =
        costs.into_iter().partition(|cost| cost.ticks.0 == cost.ticks.1);
    for costs in [&mut ticks, &mut burst_costs] {
        costs.sort_by(|a, b| b.error_integral_ms.total_cmp(&a.error_integral_ms));
    }
    let mut alone = Scenario { fault: vec![], swap: vec![], ..scenario.clone() };
    alone.run.mode = Mode::Inprocess;
    let undisturbed = Outcome::of(&alone, |each| {
        inprocess::fly(&alone, |record| {
            let is_known = record.stamp().tick <= *last_tick;
            if is_known {
                each(record);
            }
            is_known
        });
        Ok(())
    })?;
    let without_any = Outcome::flown(&without(recording, &all))?;
    Ok(Explained {
        name: scenario.name.clone(),
        sample_s: scenario.sample_s(),
        flight,
        without_any,
        undisturbed,
        disturbed: disturbed.len(),
        bursts_found: bursts.len(),
        ticks,
        bursts: burst_costs,
    })
}

/// What `work` makes of each item, on all processors, in the order of the items.
fn in_parallel<T: Sync, R: Send>(
    items: &[T],
    progress: impl Fn(usize, usize) + Sync,
    work: impl Fn(&T) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let next = AtomicUsize::new(0);
    let worker = || {
        let mut done = vec![];
        loop {
            let i = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(i) else { return Ok::<_, anyhow::Error>(done) };
            done.push((i, work(item)?));
            progress(i + 1, items.len());
        }
    };
    let threads = processors().min(items.len().max(1));
    let results = std::thread::scope(|scope| {
        let started: Vec<_> = (0..threads).map(|_| scope.spawn(worker)).collect();
        let join = |thread: std::thread::ScopedJoinHandle<'_, _>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        started.into_iter().map(join).collect::<anyhow::Result<Vec<_>>>()
    })?;
    let mut all: Vec<(usize, R)> = results.into_iter().flatten().collect();
    all.sort_by_key(|(i, _)| *i);
    Ok(all.into_iter().map(|(_, result)| result).collect())
}

impl Cost {
    fn new(ticks: &[Disturbed], sample_s: f64, flight: &Outcome, without: &Outcome) -> Self {
        let (first, last) = (&ticks[0], &ticks[ticks.len() - 1]);
        let at_s = first.tick as f64 * sample_s;
        let cost = |figure: fn(&Metrics) -> f64| figure(&flight.metrics) - figure(&without.metrics);
        Self {
            ticks: (first.tick, last.tick),
            at_s,
            node: first.node,
            what: first.what.clone(),
            max_error_m: cost(|metrics| metrics.max_position_error_m),
            max_distance_m: flight.max_distance_m(without),
            error_integral_ms: cost(|metrics| metrics.position_error_integral_ms),
            worst_tilt_deg: flight.worst_tilt_deg - without.worst_tilt_deg,
            without_m: without.error_around(at_s, sample_s),
        }
    }
}
