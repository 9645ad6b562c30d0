//! Amount of work to undo every disturbed tick of a flight: one flight for each tick, as long as the recorded flight.

use std::time::Instant;

use crate::again::replay;
use crate::counterfactual::{Disturbed, disturbed};
use crate::plan::ReplayPlan;
use crate::recording::Recording;
use crate::script::Script;
use anyhow::bail;

/// Largest number of samples that are flown unless the user asks for more: 500 flights of a minute at 100 Hz, about a
/// minute on two processors.
const MOST_SAMPLES: u64 = 3_000_000;

/// Flights that are to be flown, and the time that one flight took.
#[derive(Debug, Clone)]
pub struct Work {
    pub disturbed: Vec<Disturbed>,
    /// First and last tick of the part of the flight that is explained.
    pub first_tick: u64,
    pub last_tick: u64,
    /// Number of flights, each without a tick or a burst of ticks.
    pub flights: u64,
    replay_s: f64,
    sample_s: f64,
}

impl Work {
    /// Flies `recording` once, as it was, over the ticks of `script`, which ends at the tick `until`.
    ///
    /// # Errors
    /// The flight does not repeat bit for bit, or nothing of it can be compared.
    pub fn of(recording: &Recording, script: &Script, until: Option<u64>) -> anyhow::Result<Self> {
        let started = Instant::now();
        let from = if script.begun_at() > 0 { script.begun_at() + 1 } else { 0 };
        let replayed = replay(recording, &ReplayPlan { from, until, ..ReplayPlan::default() }, |_| {})?;
        let replay_s = started.elapsed().as_secs_f64();
        if let Some(first) = &replayed.first {
            let (field, tick) = (&first.differs.field, first.tick);
            bail!(
                "the flight does not repeat: {} differs at tick {tick} ({field}); see `trefoil replay`",
                first.topic.name()
            );
        }
        if replayed.compared() == 0 {
            bail!("the flight does not repeat: no message of it could be compared; see `trefoil replay`");
        }
        let disturbed = disturbed(recording, script);
        let flights = (disturbed.len() + bursts(&disturbed).count()) as u64;
        let sample_s = recording.scenario.sample_s();
        Ok(Self {
            disturbed,
            first_tick: script.begun_at(),
            last_tick: replayed.last_tick,
            flights,
            replay_s,
            sample_s,
        })
    }

    /// Returns whether the flights are few enough to be flown without asking the user.
    pub fn is_little(&self) -> bool {
        self.flights * (self.last_tick - self.first_tick + 1) <= MOST_SAMPLES
    }

    /// Describes for people how many flights there are, and how long they take.
    pub fn describe(&self) -> String {
        let Self { disturbed, flights, replay_s, sample_s, first_tick, last_tick } = self;
        let (ticks, length_s) = (disturbed.len(), (last_tick - first_tick) as f64 * sample_s);
        let wall_s = *flights as f64 * replay_s / rayon::current_num_threads() as f64;
        format!("{ticks} disturbed ticks: {flights} flights of {length_s:.2} s, about {wall_s:.0} s of work here")
    }
}

/// Returns each run of several consecutive disturbed ticks.
pub fn bursts(disturbed: &[Disturbed]) -> impl Iterator<Item = &[Disturbed]> {
    disturbed.chunk_by(|one, next| one.tick + 1 == next.tick).filter(|burst| burst.len() > 1)
}
