//! Some ticks of a recorded flight as a trace that the viewer Perfetto opens (<https://ui.perfetto.dev>).
//!
//! A flight in process has no times, and so no trace. In lockstep the ring runs as fast as it can, so the trace shows
//! which process waited for which, not how late a process was.

mod events;

use std::ops::Range;
use std::path::Path;

use anyhow::{Context, bail, ensure};
use contract::message::{Stamp, State};
use serde_json::{Value, json};
use settings::{Mode, Scenario};

use self::events::Trace;
use flight::log::{self, Log, Record};
use folder::files::{named_file, write_whole};
use outcome::happenings::Happenings;
use outcome::recorded::Recorded;
use outcome::ticks::{in_force, logged};
use outcome::timing::WorstTick;
use runtime::console::{eprint_line, print};

const LOCKSTEP: &str = "a lockstep flight: the times show which process waited for which, not how late any of them was";

/// Length of a trace around the worst tick if `for_s` is infinite \[s\].
const AROUND_WORST_S: f64 = 1.0;

/// Writes the trace of the run at `path`, its `flight.mcap`, to `out`, by default `trace.json` beside it, and prints
/// the path. The trace begins at `from_s` and lasts `for_s` \[s\], or to the end if `for_s` is infinite. Without
/// `from_s` it is around the worst tick, or at the beginning in lockstep, where no tick is late; an infinite `for_s` is
/// then 1 s.
pub fn write(path: &Path, from_s: Option<f64>, for_s: f64, out: Option<&Path>) -> anyhow::Result<()> {
    let out = out.map_or_else(|| Ok(path.with_file_name("trace.json")), |out| named_file(out, "json"))?;
    let recorded = Recorded::read(path)?;
    if let Some(missing) = recorded.missing() {
        eprint_line(&format!("note: {missing}"));
    }
    let scenario = &recorded.scenario;
    if scenario.run.mode == Mode::Inprocess {
        bail!(
            "{} is of a flight in process, where there is no clock and so nothing to trace; \
             fly it with --mode realtime",
            path.display()
        );
    }
    let records = |each: &mut dyn FnMut(&Record)| log::stream(path, log::ALL, |_, record| each(record)).map(drop);
    let worst = recorded.run.timing.as_ref().and_then(|timing| timing.worst_ticks.first());
    let for_s = match from_s {
        _ if for_s.is_finite() => for_s,
        Some(from_s) => (recorded.summary.time_s() + scenario.sample_s() - from_s).max(0.0),
        None => AROUND_WORST_S,
    };
    let window = Window::new(from_s, for_s, scenario.sample_s(), worst);
    let document = document(records, scenario, &recorded.run.happenings(), &window)?;
    if scenario.run.mode == Mode::Lockstep {
        eprint_line(&format!("note: {LOCKSTEP}"));
    }
    write_whole(&out, document.to_string().as_bytes()).context("choose another file with --out")?;
    print(&format!("{}\nwritten to {} (open it in ui.perfetto.dev)\n", window.describe(), out.display()));
    Ok(())
}

/// Largest number of ticks in a trace: each makes about ten events.
const MOST_TICKS: usize = 20_000;
/// Number of ticks before and after the window that are read too: counters are compared with those of the message
/// before, and a command acts until the next one.
const AROUND_TICKS: u64 = 1_000;

/// Makes the trace of a `window` of a flight through processes; `records` hands out the messages of its log, tick by
/// tick.
///
/// Time zero is the first sample, so that in real time the viewer's axis is simulated time.
pub fn document(
    records: impl FnOnce(&mut dyn FnMut(&Record)) -> anyhow::Result<()>,
    scenario: &Scenario,
    happened: &Happenings,
    window: &Window,
) -> anyhow::Result<Value> {
    let windowed = window.ticks(scenario.ticks() as usize + 1);
    ensure!(
        windowed.len() <= MOST_TICKS,
        "a trace of {} ticks is more than a viewer opens: choose at most {MOST_TICKS} with --from and --for",
        windowed.len()
    );
    let windowed = windowed.start as u64..windowed.end as u64;
    let around = windowed.start.saturating_sub(AROUND_TICKS)..windowed.end.saturating_add(AROUND_TICKS);
    let mut log = Log::default();
    let mut ends: Option<[Stamp; 2]> = None;
    records(&mut |record| {
        if let Record::State(State { stamp, .. }) = record {
            ends.get_or_insert([*stamp; 2])[1] = *stamp;
        }
        if around.contains(&record.tick()) {
            log.push(record);
        }
    })?;
    let ticks = logged(&log, scenario, around.start);
    let commands = in_force(&ticks, scenario.run.mode);
    let traced: Vec<_> = ticks.into_iter().filter(|tick| windowed.contains(&tick.number)).collect();
    let Some([first, _]) = ends.filter(|_| traced.iter().any(|tick| tick.of.state.is_some())) else {
        bail!(
            "no tick in {}: the log covers {:.2} s; choose another window with --from and --for",
            window.describe(),
            ends.map_or(0.0, |[_, last]| last.tick as f64 * scenario.sample_s())
        );
    };
    let origin_ns = match scenario.run.mode {
        Mode::Realtime => first.sample_ns.saturating_sub(first.tick.saturating_mul(scenario.sample_ns())),
        // The plant of a lockstep flight begins its first cycle before its first tick.
        Mode::Lockstep | Mode::Inprocess => first.sample_ns.min(first.start_ns),
    };
    let mut trace = Trace::new(origin_ns, windowed);
    trace.nodes(&log);
    trace.commands(&commands);
    trace.flows(&traced, &commands);
    trace.happened(happened, &traced);
    let about = json!({
        "flight": scenario.name,
        "mode": scenario.run.mode,
        "window": window.describe(),
        "note": if scenario.run.mode == Mode::Lockstep { LOCKSTEP } else { "" },
    });
    Ok(trace.document(&about))
}

/// Stretch of a flight that is traced.
#[derive(Debug, Clone, PartialEq)]
pub struct Window {
    from_s: f64,
    for_s: f64,
    sample_s: f64,
    /// Words on the worst tick if the window was chosen around it; else empty.
    why: String,
}

impl Window {
    /// The window that begins at `from_s`, or else has the `worst` tick of the flight in its middle; the beginning if
    /// no tick was late.
    pub fn new(from_s: Option<f64>, for_s: f64, sample_s: f64, worst: Option<&WorstTick>) -> Self {
        let (from_s, why) = match (from_s, worst) {
            (None, Some(WorstTick { tick, late_us, in_words, .. })) => {
                let why = format!(", around the worst tick, {tick}: {:.2} ms late; {in_words}", late_us / 1e3);
                ((*tick as f64 * sample_s - for_s / 2.0).max(0.0), why)
            }
            (from_s, _) => (from_s.unwrap_or(0.0), String::new()),
        };
        Self { from_s, for_s, sample_s, why }
    }

    /// Returns the ticks of the window, all below `flown`.
    fn ticks(&self, flown: usize) -> Range<usize> {
        // The cast saturates, and turns NaN into 0.
        let tick = |t_s: f64| ((t_s / self.sample_s - 1e-6).ceil() as usize).min(flown);
        let first = tick(self.from_s);
        first..tick(self.from_s + self.for_s).max(first)
    }

    pub fn describe(&self) -> String {
        format!("{:.2} to {:.2} s{}", self.from_s, self.from_s + self.for_s, self.why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn window(from_s: f64, for_s: f64) -> Window {
        Window::new(Some(from_s), for_s, 0.01, None)
    }

    #[test]
    fn a_window_takes_the_ticks_that_begin_in_it() {
        assert_eq!(window(0.5, 0.1).ticks(1_000), 50..60);
        assert_eq!(window(0.501, 0.1).ticks(1_000), 51..61);
        assert_eq!(window(-1.0, 1.05).ticks(1_000), 0..5);
        assert_eq!(window(9.95, 1.0).ticks(1_000), 995..1_000);
        for (from_s, for_s) in [(70.0, 1.0), (1.0, 0.0), (1.0, -5.0), (f64::NAN, 1.0), (f64::INFINITY, 1.0)] {
            assert!(window(from_s, for_s).ticks(1_000).is_empty(), "{from_s} {for_s}");
        }
    }

    #[test]
    fn the_worst_tick_is_that_of_the_summary() {
        let worst = |tick: u64| WorstTick { tick, late_us: 9_830.0, in_words: "why".into(), ..WorstTick::default() };
        let window = Window::new(None, 1.0, 0.01, Some(&worst(300)));
        assert_eq!(window.ticks(500), 250..350);
        assert!(window.why.contains("the worst tick, 300: 9.83 ms late; why"), "{}", window.why);
        assert_eq!(
            Window::new(None, 1.0, 0.01, Some(&worst(30))).ticks(500),
            0..100,
            "no window begins before the flight"
        );
        assert_eq!(Window::new(None, 2.0, 0.01, None).ticks(500), 0..200);
    }
}
