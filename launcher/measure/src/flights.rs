//! Flights that a measurement flies itself, by one thread or by processes.

use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::bail;
use contract::message::Truth;
use flight::guarded;
use flight::log::Record;
use flight::stack::{Ended, FlightResult, Stack, StartError};
use outcome::judge::Verdict;
use outcome::summary::Summary;
use settings::{Scenario, from_merged};

/// Flies `scenario` to its end by one thread; `watch` is given every message.
pub fn in_process(scenario: &Scenario, mut watch: impl FnMut(&Record)) -> (Summary, Verdict) {
    let mut summary = Summary::new(scenario);
    let watch = |record: &Record| {
        summary.observe(record);
        watch(record);
        true
    };
    let flown = guarded::fly(scenario, true, watch, |_| {});
    let flown = flown.unwrap_or_else(|error| panic!("cannot fly a checked scenario in process: {error}"));
    let verdict = Verdict::of(&summary, scenario, &flown.into());
    (summary, verdict)
}

/// Flies `scenario` by processes and gives `watch` every message. A lost process is no error.
pub fn through_processes(
    scenario: &Scenario,
    interrupts: &AtomicU32,
    watch: impl FnMut(&Record),
) -> anyhow::Result<(Summary, FlightResult)> {
    Started::new(scenario, interrupts)?.fly(interrupts, watch, || {})
}

/// Started stack of processes that waits to fly, in a namespace of its own.
pub struct Started<'a> {
    pub namespace: String,
    scenario: &'a Scenario,
    stack: Stack,
}

impl<'a> Started<'a> {
    pub fn new(scenario: &'a Scenario, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let namespace = namespace();
        let stack = Stack::start(&namespace, scenario, None, interrupts)?;
        Ok(Self { namespace, scenario, stack })
    }

    /// Flies, gives `watch` every message, and calls `tick` in every pass of the launcher's loop. A lost process is no
    /// error.
    pub fn fly(
        self,
        interrupts: &AtomicU32,
        mut watch: impl FnMut(&Record),
        mut tick: impl FnMut(),
    ) -> anyhow::Result<(Summary, FlightResult)> {
        let mut summary = Summary::new(self.scenario);
        let observe = |record: &Record| {
            summary.observe(record);
            watch(record);
        };
        let flown = self.stack.fly(interrupts, observe, |_| tick());
        match flown.how.ended {
            Ended::Interrupted => bail!(StartError::Interrupted),
            Ended::Unseen(what) => bail!(StartError::LostInFlight(what)),
            Ended::Flown | Ended::Lost(_) | Ended::Late(_) => Ok((summary, flown)),
        }
    }

    /// Flies as [`fly`](Self::fly) does, except that a lost process is an error.
    pub fn fly_to_the_end(
        self,
        interrupts: &AtomicU32,
        watch: impl FnMut(&Record),
        tick: impl FnMut(),
    ) -> anyhow::Result<(Summary, FlightResult)> {
        let (summary, flown) = self.fly(interrupts, watch, tick)?;
        match flown.how.ended {
            Ended::Lost(name) => bail!(StartError::LostInFlight(name)),
            Ended::Late(name) => bail!(StartError::LostInFlight(format!("{name} missed its deadline"))),
            _ => Ok((summary, flown)),
        }
    }
}

/// Returns the hover to which faults and wrong candidates are added. The file is compiled in, so that the command works
/// in any folder.
pub fn hover_in_gusts() -> anyhow::Result<Scenario> {
    let text = include_str!("../../../scenarios/faults/hover-gusts.toml");
    Ok(from_merged(text, "scenarios/faults/hover-gusts.toml")?)
}

/// Returns the larger one of the magnitudes of the true roll and pitch \[deg\].
pub fn lean_deg(truth: &Truth) -> f64 {
    let [roll, pitch, _] = truth.actual.attitude_rad.map(|angle| angle.abs().to_degrees());
    roll.max(pitch)
}

/// Returns a namespace that no other run on this machine has.
pub fn namespace() -> String {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    format!("measure-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed))
}
