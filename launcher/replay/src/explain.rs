//! `explain`: cost of each late, lost or missing message of a flight.
//!
//! Every disturbed tick ([`crate::Disturbed`]) is undone in a flight of its own, every burst of consecutive disturbed
//! ticks in another, and all disturbed ticks together in a last one. The cost of a tick is each figure of the recorded
//! flight minus the same figure of the flight with the tick undone, and the largest distance between the two courses.
//! The costs of single ticks do not add up to the cost of all, because the vehicle may or may not recover between two
//! disturbed ticks.
//!
//! | module | holds |
//! |---|---|
//! | `work` | number of flights that `explain` flies, and their duration |
//! | `cost` | figures of a flight, and the cost: the difference of two flights |

mod cost;
mod work;

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicUsize, Ordering};

use contract::Topic;
use flight::guarded;
use flight::log::Record;
use settings::{Mode, Scenario};

use crate::counterfactual::{Disturbed, without};
use crate::recording::Recording;
use crate::script::Script;
use rayon::prelude::*;

pub use cost::{Cost, FlightCost};
use outcome::recorded::Recorded;
pub use work::Work;
use work::bursts;

/// Costs of the disturbed ticks of a flight.
#[derive(Debug, Clone)]
pub struct Explained {
    pub name: String,
    pub sample_s: f64,
    pub flight: FlightCost,
    /// The flight with every disturbed tick undone.
    pub without_any: FlightCost,
    /// A flight of the same scenario in process, with the controllers of this program and without its faults and swaps,
    /// not even faults of air, sensors and actuators. `None` for a part of a flight, or if a user's program flew.
    pub undisturbed: Option<FlightCost>,
    /// Number of disturbed ticks, and of bursts of more than one tick.
    pub disturbed: usize,
    pub bursts_found: usize,
    /// Costs of single ticks, and of bursts of more than one tick, the costliest first; empty if there are too many.
    pub ticks: Vec<Cost>,
    pub bursts: Vec<Cost>,
}

/// Costs of a flight for its report, which computes them if that takes only a second or two.
#[derive(Debug)]
pub enum Costs {
    /// No tick was disturbed.
    None,
    Known(Box<Explained>),
    /// Number of disturbed ticks, if there are more than a report examines.
    TooMany(usize),
    /// The flight has more messages than a report replays.
    TooLong,
    /// The flight cannot be flown again.
    Unknown(anyhow::Error),
}

/// Largest number of disturbed ticks for which the flight is flown again once per tick.
const MOST_TICKS: usize = 50;
/// Largest number of samples flown again for the single ticks: ten flights of a minute at 100 Hz, which take a
/// second or two.
const MOST_SAMPLES: usize = 6_001 * 10;
/// Largest number of messages of a log that is flown again: its script is held in memory, with about 1 kB per tick.
const MOST_MESSAGES: u64 = 100_000;

/// Finds the costs of a recorded flight, if few samples need to be flown.
pub fn costs(recorded: &Recorded) -> Costs {
    if recorded.messages.iter().sum::<u64>() > MOST_MESSAGES {
        return Costs::TooLong;
    }
    let find = || {
        let recording = Recording::of(recorded)?;
        let script = recording.script(0, u64::MAX)?;
        let ticks = crate::disturbed(&recording, &script).len();
        let plant = script.process(Topic::State, 1).map(|plant| &script.processes[plant]);
        let samples = ticks * plant.map_or(0, |plant| plant.cycles.len());
        if ticks == 0 {
            return Ok(Costs::None);
        }
        if ticks > MOST_TICKS || samples > MOST_SAMPLES {
            return Ok(Costs::TooMany(ticks));
        }
        let work = Work::of(&recording, &script, None)?;
        Ok(Costs::Known(Box::new(explain(&recording, &script, &work, true, |_, _| {})?)))
    };
    find().unwrap_or_else(Costs::Unknown)
}

/// Flies `recording` again with all its disturbed ticks undone; with `each` also with each single tick and each burst
/// undone. `progress` gets the number of these flights that are done, and the number of all.
///
/// # Errors
/// A flight cannot be flown to its end.
pub fn explain(
    recording: &Recording,
    script: &Script,
    work: &Work,
    each: bool,
    progress: impl Fn(usize, usize) + Sync,
) -> anyhow::Result<Explained> {
    let scenario = &recording.scenario;
    let Work { disturbed, last_tick, .. } = work;
    let foreign = Topic::ALL.into_iter().find(|topic| recording.is_foreign(*topic, 1));
    // If no tick is disturbed, the answers in the log are enough.
    if let Some(topic) = foreign.filter(|_| !disturbed.is_empty()) {
        let (name, exec) = (topic.publisher(), &scenario.node.of(topic).exec);
        anyhow::bail!(
            "{name} flew {exec}, and what it would have answered is not known: a library can be named to \
             `trefoil explain` with --program {name}=FILE"
        );
    }
    let flight = FlightCost::flown(recording, script.clone())?;
    let bursts: Vec<&[Disturbed]> = bursts(disturbed).collect();
    let all: BTreeSet<u64> = disturbed.iter().map(|one| one.tick).collect();
    let wanted: Vec<&[Disturbed]> =
        if each { disturbed.chunks(1).chain(bursts.iter().copied()).collect() } else { vec![] };
    let done = AtomicUsize::new(0);
    let cost = |ticks: &&[Disturbed]| {
        let ticks_undone = ticks.iter().map(|one| one.tick).collect();
        let without = FlightCost::flown(recording, without(recording, script, &ticks_undone))?;
        progress(done.fetch_add(1, Ordering::Relaxed) + 1, wanted.len());
        Ok(Cost::new(ticks, scenario.sample_s(), &flight, &without))
    };
    let costs = wanted.par_iter().map(cost).collect::<anyhow::Result<Vec<Cost>>>()?;
    let (mut ticks, mut burst_costs): (Vec<Cost>, Vec<Cost>) =
        costs.into_iter().partition(|cost| cost.ticks.0 == cost.ticks.1);
    for costs in [&mut ticks, &mut burst_costs] {
        costs.sort_by(|a, b| b.error_integral_ms.total_cmp(&a.error_integral_ms));
    }
    let mut alone = Scenario { fault: vec![], swap: vec![], ..scenario.clone() };
    alone.run.mode = Mode::Inprocess;
    let fly = |each: &mut dyn FnMut(&Record)| {
        let watch = |record: &Record| {
            let is_known = record.tick() <= *last_tick;
            if is_known {
                each(record);
            }
            is_known
        };
        guarded::fly(&alone, true, watch, |_| {})?;
        Ok(())
    };
    // This flight always begins at tick 0, so it cannot be compared with a part of the recorded flight.
    let can_fly = script.begun_at() == 0 && foreign.is_none();
    let undisturbed = can_fly.then(|| FlightCost::of(&alone, 0, fly)).transpose()?;
    let without_any = FlightCost::flown(recording, without(recording, script, &all))?;
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
