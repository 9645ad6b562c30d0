//! The tables of a run: one for each topic, `events`, and `cycles`.
//!
//! A topic's table has a row for each message in the log, damaged ones and those of a process on standby too, with
//! `time_s` first, then every field by its name in the log's schema, nested ones with dots. `status_name` is last where
//! there is a status, and `is_intact` tells whether the checksum fits. The table of STATE also has `actual` and
//! `actuators` of the TRUTH of its tick, NaN if that was lost.

use contract::Topic;
use contract::message::{Stamp, Truth};
use flight::event::{Event, name};
use flight::log::{Record, columns, status_name, words};
use folder::dir::Dir;
use serde_json::json;
use settings::Scenario;

use super::sink::Sink;
use crate::cells::{Cell, Kind};
use crate::cycle::Cycle;

/// Name and type of each column of a table.
pub type Columns = Vec<(String, Kind)>;

/// Writer of the rows of one table.
pub trait Rows<'a>: Sized {
    /// Begins the table `name` in `folder`.
    fn begin(folder: &'a Dir, name: &str, columns: &Columns) -> anyhow::Result<Self>;
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
    /// Kinds of the words of each topic.
    words: [Vec<Kind>; Topic::COUNT],
    sample_s: f64,
}

impl<'a, W: Rows<'a>> Tables<W> {
    pub fn begin(folder: &'a Dir, scenario: &Scenario) -> anyhow::Result<Self> {
        let topic = |topic: Topic| W::begin(folder, topic.name(), &topic_columns(topic));
        let [state, reference, controls, actuators] = Topic::ALL.map(topic);
        Ok(Self {
            topics: [state?, reference?, controls?, actuators?],
            events: W::begin(folder, "events", &named(&EVENT))?,
            cycles: W::begin(folder, "cycles", &named(&CYCLE))?,
            words: Topic::ALL.map(|topic| columns(topic).iter().map(|column| kind(column.is_count)).collect()),
            sample_s: scenario.sample_s(),
        })
    }

    fn time(&self, tick: u64) -> Cell {
        Cell::Real(tick as f64 * self.sample_s)
    }
}

const EVENT: [(&str, Kind); 12] = [
    ("time_s", Kind::Real),
    ("tick", Kind::Count),
    ("node", Kind::Text),
    ("epoch", Kind::Count),
    ("what", Kind::Text),
    ("why", Kind::Text),
    ("swap", Kind::Count),
    ("origin", Kind::Count),
    ("by.pid", Kind::Count),
    ("by.user", Kind::Count),
    ("fault_number", Kind::Count),
    ("fault", Kind::Text),
];

const CYCLE: [(&str, Kind); 13] = [
    ("time_s", Kind::Real),
    ("node", Kind::Text),
    ("tick", Kind::Count),
    ("sequence", Kind::Count),
    ("epoch", Kind::Count),
    ("delivery", Kind::Count),
    ("release_us", Kind::Real),
    ("wake_us", Kind::Real),
    ("execution_us", Kind::Real),
    ("response_us", Kind::Real),
    ("cpu_us", Kind::Real),
    ("slips", Kind::Count),
    ("late", Kind::Count),
];

fn named(columns: &[(&str, Kind)]) -> Columns {
    columns.iter().map(|(name, kind)| ((*name).to_owned(), *kind)).collect()
}

fn count(number: u64) -> Cell {
    Cell::Int(number.cast_signed())
}

fn kind(is_count: bool) -> Kind {
    if is_count { Kind::Count } else { Kind::Real }
}

/// Returns the columns of a topic's table.
fn topic_columns(topic: Topic) -> Columns {
    let mut all = named(&[("time_s", Kind::Real)]);
    all.extend(columns(topic).into_iter().map(|column| (column.name, kind(column.is_count))));
    let status = matches!(topic, Topic::State | Topic::Controls).then_some(("status_name", Kind::Text));
    all.extend(named(&status.into_iter().chain([("is_intact", Kind::Count)]).collect::<Vec<_>>()));
    all
}

impl<'a, W: Rows<'a>> Sink for Tables<W> {
    fn message(&mut self, record: &Record, truth: Option<&Truth>) -> anyhow::Result<()> {
        let Some((topic, stamp)) = record.stamped() else { return Ok(()) };
        let mut row = vec![self.time(stamp.tick)];
        row.extend(words(record, truth).iter().zip(&self.words[topic as usize]).map(|(word, kind)| match kind {
            Kind::Real => Cell::Real(f64::from_bits(*word)),
            _ => count(*word),
        }));
        if matches!(topic, Topic::State | Topic::Controls) {
            row.push(status_name(record).map_or(Cell::None, |name| Cell::Text(name.into())));
        }
        row.push(count(record.is_intact().into()));
        self.topics[topic as usize].row(row)
    }

    fn cycle(&mut self, topic: Topic, stamp: &Stamp, cycle: &Cycle) -> anyhow::Result<()> {
        let Cycle { release_us, wake_us, execution_us, response_us, cpu_us, slips, late } = *cycle;
        let time = self.time(stamp.tick);
        self.cycles.row(vec![
            time,
            Cell::Text(topic.publisher().into()),
            count(stamp.tick),
            count(stamp.sequence),
            count(stamp.epoch),
            count(stamp.delivery),
            Cell::Real(release_us),
            Cell::Real(wake_us),
            Cell::Real(execution_us),
            Cell::Real(response_us),
            cpu_us.map_or(Cell::None, Cell::Real),
            count(slips),
            count(late),
        ])
    }

    fn event(&mut self, event: &Event) -> anyhow::Result<()> {
        let optional = |number: Option<u64>| number.map_or(Cell::None, count);
        let index = |index: Option<usize>| optional(index.map(|index| index as u64));
        let text = |text: &str| Cell::Text(text.to_owned());
        let time = self.time(event.tick);
        self.events.row(vec![
            time,
            count(event.tick),
            text(&event.node),
            count(event.epoch.into()),
            text(&name(event.what)),
            event.why.as_deref().map_or(Cell::None, text),
            index(event.swap),
            index(event.origin),
            optional(event.by.map(|by| by.pid as u64)),
            optional(event.by.map(|by| by.user.into())),
            index(event.fault.as_ref().map(|fault| fault.0)),
            event.fault.as_ref().map_or(Cell::None, |fault| text(&json!(fault.1).to_string())),
        ])
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>> {
        let Self { topics, events, cycles, .. } = *self;
        topics.into_iter().chain([events, cycles]).try_for_each(W::finish)?;
        Ok(None)
    }
}
