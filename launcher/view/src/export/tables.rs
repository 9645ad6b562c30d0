//! The tables of a run: one for each topic, `events`, and `cycles`.
//!
//! A topic's table has a row for each message in the log, damaged ones and those of a process on standby too, with
//! `time_s` first, then every field by its name in the log's schema, nested ones with dots. `status_name` follows for
//! STATE and CONTROLS; `is_intact`, which tells whether the checksum fits, is last. The table of STATE also has
//! `actual` and `actuators` of the TRUTH of its tick, NaN if that was lost.

use contract::Topic;
use contract::message::{Stamp, Truth};
use flight::event::{Event, name};
use flight::log::{Record, columns, status_name, words};
use folder::dir::Dir;
use serde_json::json;
use settings::Scenario;

use super::sink::Sink;
use crate::cells::{Cell, ColumnType};
use crate::cycle::CycleTimes;

/// Name and type of each column of a table.
pub type ColumnTypes = Vec<(String, ColumnType)>;

/// Writer of the rows of one table.
pub trait Rows<'a>: Sized {
    /// Begins the table `name` in `folder`.
    fn begin(folder: &'a Dir, name: &str, columns: &ColumnTypes) -> anyhow::Result<Self>;
    /// Adds a row: a cell for each column.
    fn row(&mut self, cells: Vec<Cell>) -> anyhow::Result<()>;
    /// Puts the file in its place.
    fn finish(self) -> anyhow::Result<()>;
}

/// All tables of a run.
pub struct Tables<W> {
    topics: [W; Topic::COUNT],
    events: W,
    cycles: W,
    /// Types of the words of each topic's messages.
    words: [Vec<ColumnType>; Topic::COUNT],
    sample_s: f64,
}

impl<'a, W: Rows<'a>> Tables<W> {
    pub fn begin(folder: &'a Dir, scenario: &Scenario) -> anyhow::Result<Self> {
        let topic = |topic: Topic| W::begin(folder, topic.name(), &topic_columns(topic));
        let [state, reference, controls, actuators] = Topic::ALL.map(topic);
        Ok(Self {
            topics: [state?, reference?, controls?, actuators?],
            events: W::begin(folder, "events", &timed(&EVENT))?,
            cycles: W::begin(folder, "cycles", &timed(&CYCLE))?,
            words: Topic::ALL.map(|topic| columns(topic).iter().map(|column| kind(column.is_count)).collect()),
            sample_s: scenario.sample_s(),
        })
    }

    fn time(&self, tick: u64) -> Cell {
        Cell::Real(tick as f64 * self.sample_s)
    }
}

/// Column of the events or cycles: name, type, and function that makes its cell. The column of the time comes before
/// these.
type Of<T> = (&'static str, ColumnType, fn(&T) -> Cell);

const EVENT: [Of<Event>; 11] = [
    ("tick", ColumnType::Count, |event| count(event.tick)),
    ("node", ColumnType::Text, |event| text(&event.node)),
    ("epoch", ColumnType::Count, |event| count(event.epoch.into())),
    ("what", ColumnType::Text, |event| text(&name(event.what))),
    ("why", ColumnType::Text, |event| event.why.as_deref().map_or(Cell::None, text)),
    ("swap", ColumnType::Count, |event| index(event.swap)),
    ("origin", ColumnType::Count, |event| index(event.origin)),
    ("by.pid", ColumnType::Count, |event| event.by.map_or(Cell::None, |by| count(by.pid as u64))),
    ("by.user", ColumnType::Count, |event| event.by.map_or(Cell::None, |by| count(by.user.into()))),
    ("fault_number", ColumnType::Count, |event| index(event.fault.as_ref().map(|fault| fault.0))),
    ("fault", ColumnType::Text, |event| {
        event.fault.as_ref().map_or(Cell::None, |fault| text(&json!(fault.1).to_string()))
    }),
];

const CYCLE: [Of<(Topic, Stamp, CycleTimes)>; 12] = [
    ("node", ColumnType::Text, |(topic, ..)| text(topic.publisher())),
    ("tick", ColumnType::Count, |(_, stamp, _)| count(stamp.tick)),
    ("sequence", ColumnType::Count, |(_, stamp, _)| count(stamp.sequence)),
    ("epoch", ColumnType::Count, |(_, stamp, _)| count(stamp.epoch)),
    ("delivery", ColumnType::Count, |(_, stamp, _)| count(stamp.delivery)),
    ("release_us", ColumnType::Real, |(.., cycle)| Cell::Real(cycle.release_us)),
    ("wake_us", ColumnType::Real, |(.., cycle)| Cell::Real(cycle.wake_us)),
    ("execution_us", ColumnType::Real, |(.., cycle)| Cell::Real(cycle.execution_us)),
    ("response_us", ColumnType::Real, |(.., cycle)| Cell::Real(cycle.response_us)),
    ("cpu_us", ColumnType::Real, |(.., cycle)| cycle.cpu_us.map_or(Cell::None, Cell::Real)),
    ("slips", ColumnType::Count, |(.., cycle)| count(cycle.slips)),
    ("late", ColumnType::Count, |(.., cycle)| count(cycle.late)),
];

const TIME: (&str, ColumnType) = ("time_s", ColumnType::Real);

fn named(columns: impl IntoIterator<Item = (&'static str, ColumnType)>) -> ColumnTypes {
    columns.into_iter().map(|(name, kind)| (name.to_owned(), kind)).collect()
}

/// Returns the time and the columns of `all`.
fn timed<T>(all: &[Of<T>]) -> ColumnTypes {
    named([TIME].into_iter().chain(all.iter().map(|(name, kind, _)| (*name, *kind))))
}

fn count(number: u64) -> Cell {
    Cell::Int(number.cast_signed())
}

fn text(text: &str) -> Cell {
    Cell::Text(text.to_owned())
}

fn index(index: Option<usize>) -> Cell {
    index.map_or(Cell::None, |index| count(index as u64))
}

fn kind(is_count: bool) -> ColumnType {
    if is_count { ColumnType::Count } else { ColumnType::Real }
}

/// Returns the columns of a topic's table.
fn topic_columns(topic: Topic) -> ColumnTypes {
    let mut all = named([TIME]);
    all.extend(columns(topic).into_iter().map(|column| (column.name, kind(column.is_count))));
    let status = matches!(topic, Topic::State | Topic::Controls).then_some(("status_name", ColumnType::Text));
    all.extend(named(status.into_iter().chain([("is_intact", ColumnType::Count)])));
    all
}

impl<'a, W: Rows<'a>> Sink for Tables<W> {
    fn message(&mut self, record: &Record, truth: Option<&Truth>) -> anyhow::Result<()> {
        let Some((topic, stamp)) = record.stamped() else { return Ok(()) };
        let mut row = vec![self.time(stamp.tick)];
        row.extend(words(record, truth).iter().zip(&self.words[topic as usize]).map(|(word, kind)| match kind {
            ColumnType::Real => Cell::Real(f64::from_bits(*word)),
            _ => count(*word),
        }));
        if matches!(topic, Topic::State | Topic::Controls) {
            row.push(status_name(record).map_or(Cell::None, text));
        }
        row.push(count(record.is_intact().into()));
        self.topics[topic as usize].row(row)
    }

    fn cycle(&mut self, topic: Topic, stamp: &Stamp, cycle: &CycleTimes) -> anyhow::Result<()> {
        let of = (topic, *stamp, *cycle);
        let time = self.time(stamp.tick);
        self.cycles.row([time].into_iter().chain(CYCLE.iter().map(|(.., cell)| cell(&of))).collect())
    }

    fn event(&mut self, event: &Event) -> anyhow::Result<()> {
        let time = self.time(event.tick);
        self.events.row([time].into_iter().chain(EVENT.iter().map(|(.., cell)| cell(event))).collect())
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>> {
        let Self { topics, events, cycles, .. } = *self;
        topics.into_iter().chain([events, cycles]).try_for_each(W::finish)?;
        Ok(None)
    }
}
