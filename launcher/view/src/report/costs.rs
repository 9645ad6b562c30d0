//! What the disturbed ticks of a flight cost: a section of the page for a flight that has few of them.

use contract::Topic;
use flight::replay::{Recording, Script};

use crate::draw::escape;
use crate::explain::{Work, explain};
use outcome::recorded::Recorded;

/// With more disturbed ticks the page only says how they are looked into: a flight is flown again for each.
const MOST_TICKS: usize = 50;
/// Samples flown again for all of them, at most: ten flights of a minute at 100 Hz, which take a second or two.
const MOST_SAMPLES: usize = 6_001 * 10;

/// Messages of a log that is flown again for the page, at most: its script is held in memory, with about 1 kB a tick.
const MOST_MESSAGES: u64 = 80_000;

/// The section of the page; empty where no tick was disturbed. Where the run cannot be flown again it says why.
pub fn section(recorded: &Recorded) -> String {
    let told = match recorded.messages.iter().sum() {
        0..=MOST_MESSAGES => {
            recorded.recording().and_then(|recording| told(&recording, &recording.script(0, u64::MAX)?))
        }
        _ => Ok("<p>Of a flight of this length <code>launcher explain RUN</code> says it.</p>".into()),
    };
    let told = match told {
        Ok(told) if told.is_empty() => return told,
        Ok(told) => told,
        Err(why) => {
            let why = escape(&format!("{why:#}"));
            format!("<p>Not known, because the flight cannot be flown again: {why}.</p>")
        }
    };
    format!("<section id=\"costs\"><h2>What disturbed ticks cost</h2>{told}</section>")
}

fn told(recording: &Recording, script: &Script) -> anyhow::Result<String> {
    let ticks = flight::replay::disturbed(recording, script).len();
    let plant = script.process(Topic::State, 1).map(|plant| &script.processes[plant]);
    let samples = ticks * plant.map_or(0, |plant| plant.cycles.len());
    match ticks {
        0 => Ok(String::new()),
        1..=MOST_TICKS if samples <= MOST_SAMPLES => {
            Ok(explain(recording, script, &Work::of(recording, script, None)?, true, |_, _| {})?.section())
        }
        _ => Ok(format!(
            "<p>{ticks} ticks were disturbed: <code>launcher explain RUN</code> says what each of them cost, and writes \
             explain.html into the run’s folder.</p>"
        )),
    }
}
