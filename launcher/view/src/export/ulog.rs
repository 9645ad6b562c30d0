//! A run as one `ULog` file (PX4's log format, version 1), for `PlotJuggler`, pyulog and tools of PX4.
//!
//! | topic | holds |
//! |---|---|
//! | `trefoil_state` `_reference` `_controls` `_actuators` | every intact message, its fields nested as in the log's schema; `actual` and `actuators` of TRUTH are in `trefoil_state` |
//! | `trefoil_cycles_NODE` | the times of a node's cycles |
//! | topics of [`super::px4`] | what fits a topic of PX4 |
//!
//! The numbers and switches of the settings are parameters; the whole settings are the information `trefoil_scenario`.
//! `timestamp` is simulated time \[us\]. Events are logged messages. A message whose checksum does not fit is left out,
//! because its time cannot be trusted either.

use std::io::{BufWriter, IntoInnerError, Write};

use anyhow::Context;
use contract::Topic;
use contract::message::{Stamp, Truth};
use flight::event::{Event, What, name};
use flight::log::{Record, columns, words};
use folder::dir::{Dir, NewFile};
use settings::{Scenario, to_toml};
use toml::{Table, Value};

use super::px4;
use super::sink::Sink;
use crate::cycle::CycleTimes;

pub struct Ulog<'a> {
    file: BufWriter<NewFile<'a>>,
    sample_ns: u64,
    damaged: u64,
}

/// Number of the first subscription of each group of topics.
const CYCLES: u16 = Topic::COUNT as u16;
const PX4: u16 = 2 * Topic::COUNT as u16;

impl<'a> Ulog<'a> {
    pub fn begin(folder: &'a Dir, name: &str, scenario: &Scenario) -> anyhow::Result<Self> {
        let file = BufWriter::new(folder.begin(name)?);
        let mut ulog = Self { file, sample_ns: scenario.sample_ns(), damaged: 0 };
        ulog.file.write_all(b"ULog\x01\x12\x35\x01")?;
        ulog.file.write_all(&0_u64.to_le_bytes())?; // time of the beginning
        ulog.message(b'B', &[&[0; 40]])?; // no flags, nothing appended
        ulog.info("sys_name", "Trefoil")?;
        let settings = to_toml(scenario);
        ulog.info("trefoil_scenario", &settings)?;
        ulog.parameters("", &Value::Table(settings.parse::<Table>()?))?;
        let mut topics = vec![];
        for topic in Topic::ALL {
            let name = format!("trefoil_{}", topic.name());
            let words: Vec<(String, bool)> =
                columns(topic).into_iter().map(|column| (column.name, column.is_count)).collect();
            for format in formats(&name, "uint64_t timestamp;", &words) {
                ulog.message(b'F', &[format.as_bytes()])?;
            }
            topics.push(name);
        }
        for topic in Topic::ALL {
            let name = format!("trefoil_cycles_{}", topic.publisher().replace('-', "_"));
            ulog.message(b'F', &[format!("{name}:{CYCLE}").as_bytes()])?;
            topics.push(name);
        }
        for (name, fields) in px4::TOPICS {
            ulog.message(b'F', &[format!("{name}:{fields}").as_bytes()])?;
            topics.push(name.into());
        }
        for (name, number) in topics.iter().zip(0_u16..) {
            ulog.message(b'A', &[&[0], &number.to_le_bytes(), name.as_bytes()])?;
        }
        Ok(ulog)
    }

    /// Writes a message of the format: its length, its kind, its bytes.
    fn message(&mut self, kind: u8, parts: &[&[u8]]) -> anyhow::Result<()> {
        let length: usize = parts.iter().map(|part| part.len()).sum();
        let length = u16::try_from(length).context("a message of a ULog has at most 65535 bytes")?;
        self.file.write_all(&length.to_le_bytes())?;
        self.file.write_all(&[kind])?;
        parts.iter().try_for_each(|part| Ok(self.file.write_all(part)?))
    }

    fn info(&mut self, key: &str, value: &str) -> anyhow::Result<()> {
        let key = format!("char[{}] {key}", value.len());
        self.message(b'I', &[&[key.len() as u8], key.as_bytes(), value.as_bytes()])
    }

    /// Writes each number and switch in `value` as a parameter, named by its key; a number in a key is a place in a
    /// list. Texts, whole numbers beyond 32 bits and very long keys are left out, because the format cannot hold them.
    fn parameters(&mut self, key: &str, value: &Value) -> anyhow::Result<()> {
        let below = |name: &str| if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
        let whole = |number: i64| Some(("int32_t", i32::try_from(number).ok()?.to_le_bytes()));
        let parameter = match value {
            Value::Table(fields) => {
                return fields.iter().try_for_each(|(name, value)| self.parameters(&below(name), value));
            }
            Value::Array(all) => {
                let mut places = (0..).zip(all);
                return places
                    .try_for_each(|(place, value): (usize, _)| self.parameters(&below(&place.to_string()), value));
            }
            Value::Boolean(is_on) => whole((*is_on).into()),
            Value::Integer(number) => whole(*number),
            Value::Float(number) => Some(("float", (*number as f32).to_le_bytes())),
            Value::String(_) | Value::Datetime(_) => None,
        };
        let Some((kind, bytes)) = parameter else { return Ok(()) };
        let key = format!("{kind} {key}");
        match u8::try_from(key.len()) {
            Ok(length) => self.message(b'P', &[&[length], key.as_bytes(), &bytes]),
            Err(_) => Ok(()),
        }
    }

    /// Writes a row of the topic with this number.
    fn data(&mut self, number: u16, tick: u64, row: &[u8]) -> anyhow::Result<()> {
        let timestamp = self.timestamp(tick);
        self.message(b'D', &[&number.to_le_bytes(), &timestamp, row])
    }

    fn timestamp(&self, tick: u64) -> [u8; 8] {
        (tick.saturating_mul(self.sample_ns) / 1000).to_le_bytes()
    }
}

const CYCLE: &str = "uint64_t timestamp;double release_us;double wake_us;double execution_us;double response_us;\
                     double cpu_us;uint64_t slips;uint64_t late;";

impl Sink for Ulog<'_> {
    fn message(&mut self, record: &Record, truth: Option<&Truth>) -> anyhow::Result<()> {
        if !record.is_intact() {
            self.damaged += 1;
            return Ok(());
        }
        let Some((topic, stamp)) = record.stamped() else { return Ok(()) };
        let tick = stamp.tick;
        let row: Vec<u8> = words(record, truth).into_iter().flat_map(u64::to_le_bytes).collect();
        self.data(topic as u16, tick, &row)?;
        if !stamp.is_delivered() {
            return Ok(());
        }
        let timestamp = self.timestamp(tick);
        px4::rows(record, truth, timestamp, |number, row| self.data(PX4 + number as u16, tick, row))
    }

    fn cycle(&mut self, topic: Topic, stamp: &Stamp, cycle: &CycleTimes) -> anyhow::Result<()> {
        let CycleTimes { release_us, wake_us, execution_us, response_us, cpu_us, slips, late } = *cycle;
        let times = [release_us, wake_us, execution_us, response_us, cpu_us.unwrap_or(f64::NAN)];
        let words = times.map(f64::to_bits).into_iter().chain([slips, late]);
        let row: Vec<u8> = words.flat_map(u64::to_le_bytes).collect();
        self.data(CYCLES + topic as u16, stamp.tick, &row)
    }

    fn event(&mut self, event: &Event) -> anyhow::Result<()> {
        let level = match event.what {
            What::Died | What::Hung | What::NotStarted | What::GivenUp => b'3', // error
            What::Started | What::TookOver | What::OnStandby | What::Kept | What::Cleared => b'6', // information
            _ => b'4',                                                          // warning
        };
        let why = event.why.as_ref().map_or(String::new(), |why| format!(": {why}"));
        let text = format!("{} epoch {} {}{why}", event.node, event.epoch, name(event.what));
        let timestamp = self.timestamp(event.tick);
        self.message(b'L', &[&[level], &timestamp, text.as_bytes()])
    }

    fn finish(self: Box<Self>) -> anyhow::Result<Option<String>> {
        self.file.into_inner().map_err(IntoInnerError::into_error)?.finish()?;
        let damaged = self.damaged;
        Ok((damaged > 0).then(|| format!("{damaged} damaged messages were left out, whose times cannot be trusted")))
    }
}

/// Returns the formats of a topic and of the parts that it nests. `before` are its first fields; `words` the others, by
/// names with dots, and `true` for a count.
fn formats(name: &str, before: &str, words: &[(String, bool)]) -> Vec<String> {
    let (mut own, mut nested) = (format!("{name}:{before}"), vec![]);
    let head = |word: &(String, bool)| word.0.split('.').next().unwrap_or_default().to_owned();
    for group in words.chunk_by(|one, other| head(one) == head(other)) {
        let field = head(&group[0]);
        if group[0].0 == field {
            own = format!("{own}{} {field};", if group[0].1 { "uint64_t" } else { "double" });
            continue;
        }
        let part = format!("{name}_{field}");
        own = format!("{own}{part} {field};");
        let inner: Vec<_> = group.iter().map(|(word, count)| (word[field.len() + 1..].to_owned(), *count)).collect();
        nested.extend(formats(&part, "", &inner));
    }
    nested.push(own);
    nested
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_with_dots_become_nested_formats() {
        let words = [("a.x.u", true), ("a.x.v", false), ("a.y", false), ("b", true)];
        let words = words.map(|(name, count)| (name.to_owned(), count));
        let expected =
            ["t_a_x:uint64_t u;double v;", "t_a:t_a_x x;double y;", "t:uint64_t timestamp;t_a a;uint64_t b;"];
        assert_eq!(formats("t", "uint64_t timestamp;", &words), expected);
    }
}
