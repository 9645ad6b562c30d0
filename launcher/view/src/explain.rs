//! `explain`: what each late, lost or missing message of a flight cost.
//!
//! Every disturbed tick ([`flight::replay::Disturbed`]) is undone in a flight of its own, every burst of ticks one after another
//! in one more, and all of them in a last one. The cost is the figure of the flight less that of the flight without. Costs of
//! single ticks do not add up to that of all: the vehicle recovers from one before the next, or does not.

use std::collections::BTreeSet;
use std::num::NonZero;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::bail;
use contract::scenario::{Mode, Scenario};
use flight::inprocess;
use flight::log::Record;
use flight::replay::{Disturbed, Plan, Recording, disturbed, replay, without};
use guidance::Trajectory;
use serde::Serialize;

use crate::draw::{self, Line, STYLE, escape};
use crate::metrics::Metrics;
use crate::summary::Summary;
use crate::table::Table;
use crate::ticks::{length_m, position_error_m};

/// What a flight came to, as far as costs are told of.
#[derive(Debug, Clone, Default)]
pub struct Outcome {
    pub metrics: Metrics,
    /// Largest angle between the body's z axis and the vertical \[deg\].
    pub worst_tilt_deg: f64,
    /// Position error at each sample \[m\].
    pub error_m: Vec<f64>,
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
    /// Of the largest position error \[m\].
    pub max_error_m: f64,
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
    /// In process, without any fault and swap of the scenario.
    pub clean: Outcome,
    /// Single ticks, and bursts of more than one; the costliest first.
    pub ticks: Vec<Cost>,
    pub bursts: Vec<Cost>,
}

impl Outcome {
    /// The position error around an instant: time \[s\], error \[m\].
    fn error_around(&self, at_s: f64, sample_s: f64) -> Vec<(f64, f64)> {
        let timed = self.error_m.iter().enumerate().map(|(tick, error_m)| (tick as f64 * sample_s, *error_m));
        timed.filter(|(time_s, _)| (at_s - BEFORE_S..=at_s + AFTER_S).contains(time_s)).collect()
    }

    fn of(
        scenario: &Scenario,
        fly: impl FnOnce(&mut dyn FnMut(&Record)) -> anyhow::Result<()>,
    ) -> anyhow::Result<Self> {
        let (mut summary, trajectory) = (Summary::new(scenario), Trajectory::new(&scenario.mission));
        let (mut worst_tilt, mut error_m) = (0.0_f64, vec![]);
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
            }
        })?;
        let (metrics, state_hash) = (summary.metrics(), summary.state_hash());
        Ok(Self { metrics, worst_tilt_deg: worst_tilt.to_degrees(), error_m, state_hash })
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

/// Flies `recording` again without its disturbed ticks. `progress` is told how many flights are done, and of how many.
///
/// # Errors
/// The flight does not repeat bit for bit.
pub fn explain(recording: &Recording, progress: impl Fn(usize, usize) + Sync) -> anyhow::Result<Explained> {
    let scenario = &recording.scenario;
    let replayed = replay(recording, &Plan::default(), |_| {})?;
    if let Some(first) = replayed.first {
        let (field, tick) = (first.differs.field, first.tick);
        bail!(
            "the flight does not repeat: {} differs at tick {tick} ({field}); see `launcher replay`",
            first.topic.name()
        );
    }
    let flight = Outcome::flown(recording)?;
    let disturbed = disturbed(recording);
    let bursts = bursts(&disturbed);
    let all: BTreeSet<u64> = disturbed.iter().map(|one| one.tick).collect();
    let wanted: Vec<&[Disturbed]> =
        disturbed.chunks(1).chain(bursts.iter().copied().filter(|burst| burst.len() > 1)).collect();
    let costs = in_parallel(&wanted, progress, |ticks| {
        let without = Outcome::flown(&without(recording, &ticks.iter().map(|one| one.tick).collect()))?;
        Ok(Cost::new(ticks, scenario.sample_s(), &flight, &without))
    })?;
    let (mut ticks, mut bursts): (Vec<Cost>, Vec<Cost>) =
        costs.into_iter().partition(|cost| cost.ticks.0 == cost.ticks.1);
    for costs in [&mut ticks, &mut bursts] {
        costs.sort_by(|a, b| b.error_integral_ms.total_cmp(&a.error_integral_ms));
    }
    let mut undisturbed = Scenario { fault: vec![], swap: vec![], ..scenario.clone() };
    undisturbed.run.mode = Mode::Inprocess;
    let clean = Outcome::of(&undisturbed, |each| {
        inprocess::fly(&undisturbed, |record| {
            each(record);
            true
        });
        Ok(())
    })?;
    let without_any = Outcome::flown(&without(recording, &all))?;
    Ok(Explained {
        name: scenario.name.clone(),
        sample_s: scenario.sample_s(),
        flight,
        without_any,
        clean,
        ticks,
        bursts,
    })
}

/// Ticks one after another.
fn bursts(disturbed: &[Disturbed]) -> Vec<&[Disturbed]> {
    disturbed.chunk_by(|one, next| one.tick + 1 == next.tick).collect()
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
    let threads = std::thread::available_parallelism().map_or(1, NonZero::get).min(items.len().max(1));
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
            error_integral_ms: cost(|metrics| metrics.position_error_integral_ms),
            worst_tilt_deg: flight.worst_tilt_deg - without.worst_tilt_deg,
            without_m: without.error_around(at_s, sample_s),
        }
    }

    fn ticks_in_words(&self) -> String {
        let (first, last) = self.ticks;
        if first == last { first.to_string() } else { format!("{first}-{last}") }
    }

    fn cells(&self) -> Vec<String> {
        let Self { at_s, node, what, max_error_m, error_integral_ms, worst_tilt_deg, .. } = self;
        vec![
            self.ticks_in_words(),
            format!("{at_s:.2}"),
            format!("{:+.3}", error_integral_ms * 1e3),
            format!("{:+.3}", max_error_m * 1e3),
            format!("{worst_tilt_deg:+.3}"),
            format!("{node} {what}"),
        ]
    }

    fn table(title: &str, costs: &[Self]) -> Table {
        Table::new(title, &COLUMNS, costs.iter().map(Self::cells).collect())
    }
}

const COLUMNS: [&str; 6] =
    ["tick", "at [s]", "error integral [mm s]", "largest error [mm]", "worst tilt [deg]", "what"];
/// Rows of a table in the terminal.
const ROWS: usize = 20;
/// Plots of a page, and how much of the flight each shows around its ticks \[s\].
const PLOTS: usize = 5;
const BEFORE_S: f64 = 0.5;
const AFTER_S: f64 = 4.5;

impl Explained {
    /// For people: the costliest ticks and bursts, and the flights side by side.
    pub fn text(&self) -> String {
        let (ticks, bursts) = (self.ticks.len(), self.bursts.len());
        let mut text = format!("{}: {ticks} disturbed ticks, {bursts} bursts of more than one\n", self.name);
        for (title, costs) in [("What single ticks cost", &self.ticks), ("What bursts cost", &self.bursts)] {
            if !costs.is_empty() {
                let left_out = costs.len().saturating_sub(ROWS);
                let more = if left_out > 0 {
                    format!(" (the {ROWS} costliest; {left_out} more in explain.html)")
                } else {
                    String::new()
                };
                let shown = &costs[..costs.len().min(ROWS)];
                text.push('\n');
                text.push_str(&Cost::table(&format!("{title}{more}"), shown).text());
            }
        }
        text + &format!("\n{}", self.side_by_side().text())
    }

    /// Largest error, integral and worst tilt of the flights, and what all and each tick cost.
    fn side_by_side(&self) -> Table {
        let row = |name: &str, scale: f64, of: &dyn Fn(&Outcome) -> f64, cost: fn(&Cost) -> f64| {
            let [flight, without, clean] = [&self.flight, &self.without_any, &self.clean].map(of);
            let sum: f64 = self.ticks.iter().map(cost).sum();
            let cells = [flight, without, clean, flight - without, sum].map(|value| format!("{:.3}", value * scale));
            std::iter::once(name.to_owned()).chain(cells).collect()
        };
        let headings = ["", "flight", "without any", "clean, in process", "all together cost", "sum of single ticks"];
        Table::new(
            "The flights",
            &headings,
            vec![
                row("error integral [mm s]", 1e3, &|of| of.metrics.position_error_integral_ms, |cost| {
                    cost.error_integral_ms
                }),
                row("largest error [mm]", 1e3, &|of| of.metrics.max_position_error_m, |cost| cost.max_error_m),
                row("worst tilt [deg]", 1.0, &|of| of.worst_tilt_deg, |cost| cost.worst_tilt_deg),
            ],
        )
    }

    /// The tables and plots, for a page of their own or a section of the report.
    pub fn section(&self) -> String {
        let mut html = format!(
            "<p>A tick is disturbed when a node answered late, not at all, or to old messages, when a fault lost or changed a \
             message, or when the command came after the next sample. Each is undone in a flight of its own; all else stays as it \
             was. {} ticks are disturbed. The cost is the flight less the flight without.</p>",
            self.ticks.len()
        );
        html += &self.side_by_side().html();
        for (title, costs) in
            [("Bursts, the costliest first", &self.bursts), ("Single ticks, the costliest first", &self.ticks)]
        {
            if !costs.is_empty() {
                html.extend(["<h3>", title, "</h3>", &Cost::table("", costs).html()]);
            }
        }
        let mut costliest: Vec<&Cost> = self.bursts.iter().chain(&self.ticks).collect();
        costliest.sort_by(|a, b| b.error_integral_ms.total_cmp(&a.error_integral_ms));
        for cost in costliest.iter().take(PLOTS) {
            let caption = format!("Tick {}, {} {}", cost.ticks_in_words(), cost.node, cost.what);
            html.extend(["<h3>", &escape(&caption), "</h3>", &self.plot(cost)]);
        }
        html
    }

    /// The position error with and without, around the ticks.
    fn plot(&self, cost: &Cost) -> String {
        draw::lines(
            &[
                Line { name: "the flight", points: self.flight.error_around(cost.at_s, self.sample_s) },
                Line { name: "without it", points: cost.without_m.clone() },
            ],
            "time [s]",
            "position error [m]",
        )
    }

    /// A page of its own.
    pub fn page(&self) -> String {
        let title = format!("What disturbed ticks cost: {}", self.name);
        draw::page(&title, STYLE, &format!("<h1>{}</h1>{}", escape(&title), self.section()))
    }
}
