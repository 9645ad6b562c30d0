//! Reads a run back, with settings, summary and events, and tells whether its log covers the whole flight.
//!
//! A log alone does not show whether it is complete: a log that was cut and closed again, or thinned at its end, is
//! well-formed. So the launcher counts the records and hashes the states itself, and writes both into run.json.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow};
use contract::Topic;
use flight::log::{self, Log, LogOutcome, LogSpan, Record};
use flight::stack::Ended;
use settings::Scenario;

use crate::judge::{Circumstances, Verdict};
use crate::run_record::{Account, RunRecord};
use crate::summary::Summary;

/// A run read from its folder. Its messages stay in the log.
pub struct Recorded {
    /// Path of the log; of the first log if several recorders wrote.
    pub path: PathBuf,
    /// Log without the messages.
    pub log: Log,
    /// Number of messages in the log, by topic.
    pub messages: [u64; Topic::COUNT],
    /// Summary gathered from the messages.
    pub summary: Summary,
    pub scenario: Scenario,
    /// Content of run.json, or a record made from the log: a run whose launcher was killed has a log and no run.json.
    pub run: RunRecord,
    /// `true` if there is a run.json.
    pub has_summary: bool,
    /// Ticks that were read.
    ticks: RangeInclusive<u64>,
}

/// The part of a flight that is read, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimeSpan {
    pub from_s: f64,
    pub to_s: f64,
}

impl TimeSpan {
    /// The whole flight.
    pub const ALL: Self = Self { from_s: 0.0, to_s: f64::INFINITY };
    /// Time around the part in which messages are counted, so that a gap at its beginning is found \[s\].
    const BEFORE_S: f64 = 1.0;

    /// Returns the ticks of the part.
    pub fn ticks(&self, sample_s: f64) -> RangeInclusive<u64> {
        let tick = |time_s: f64| (time_s / sample_s).round() as u64;
        tick(self.from_s)..=tick(self.to_s)
    }

    /// Returns the span of the log that is read.
    fn span(&self) -> LogSpan {
        let ns = |time_s: f64| (time_s * 1e9) as u64;
        ns(self.from_s - Self::BEFORE_S)..=ns(self.to_s + Self::BEFORE_S)
    }
}

impl Recorded {
    /// Reads a run from its folder, or its `flight.mcap`.
    ///
    /// # Errors
    /// There is no log to read, or its messages, its settings or run.json are of another version.
    pub fn read(run: &Path) -> anyhow::Result<Self> {
        Self::read_each(run, TimeSpan::ALL, |_, _| {})
    }

    /// Reads a part of a run, while `each` gets the settings and every message, tick by tick. No message is kept,
    /// because a log may be longer than the memory. Events and settings are those of the whole flight.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn read_each(run: &Path, part: TimeSpan, mut each: impl FnMut(&Scenario, &Record)) -> anyhow::Result<Self> {
        let path = if run.is_dir() { run.join("flight.mcap") } else { run.to_owned() };
        let file = path.with_file_name("run.json");
        let run = RunRecord::read(&file)?;
        let begin = |log: &Log| {
            settings(log, &path).map(|scenario| {
                let summary = Summary::new(&scenario);
                let ticks = part.ticks(scenario.sample_s());
                (scenario, summary, ticks)
            })
        };
        let (mut messages, mut gathered) = ([0; Topic::COUNT], None);
        let log = log::stream(&path, part.span(), |log, record| {
            let Ok((scenario, summary, ticks)) = gathered.get_or_insert_with(|| begin(log)) else { return };
            if ticks.contains(&record.tick()) {
                messages[record.stamped().map_or(Topic::State, |(topic, _)| topic) as usize] += 1;
                summary.observe(record);
                each(scenario, record);
            } else {
                summary.pass(record);
            }
        })?;
        let (scenario, summary, ticks) = gathered.unwrap_or_else(|| begin(&log))?;
        let has_summary = run.is_some();
        let run = run.unwrap_or_else(|| summary_of(&log, messages.iter().sum(), &summary, &scenario));
        Ok(Self { path, log, messages, summary, scenario, run, has_summary, ticks })
    }

    /// Returns the settings of the flight, with the orders given in flight if run.json has them.
    pub fn flown(&self) -> Scenario {
        self.run.scenario().unwrap_or_else(|| self.scenario.clone())
    }

    /// Text for people on why the log does not cover the flight, or the part that was read; `None` if it does.
    pub fn missing(&self) -> Option<String> {
        let Self { path, log, summary, .. } = self;
        let run = self.has_summary.then_some(&self.run);
        let is_to_end = summary.last.state.stamp.tick < *self.ticks.end();
        let unlike = match run {
            Some(run) if self.ticks == TimeSpan::ALL.ticks(self.scenario.sample_s()) => self.unlike_summary(run),
            Some(run) if is_to_end => self.ends_early(run).into_iter().collect(),
            None if is_to_end => vec!["there is no run.json to say where the flight ended".into()],
            _ => vec![],
        };
        let why: Vec<String> = log.defect.iter().cloned().chain(unlike).collect();
        let lost = summary.missed;
        if why.is_empty() && lost == 0 {
            return None;
        }
        let why = if why.is_empty() { "there are gaps in it".into() } else { why.join("; ") };
        let read = if summary.last.state.stamp.sequence == 0 {
            "it has no message of the plant".into()
        } else {
            let last_s = summary.time_s();
            let of = run.map_or(String::new(), |run| format!(" of {:.2} s", run.flown_s));
            format!("what was read ends at {last_s:.2} s{of}, {lost} messages before that are missing")
        };
        Some(format!("the log {} is not whole ({why}): {read}", path.display()))
    }

    /// Text for people if the log ends before both the flight and the part; else `None`.
    fn ends_early(&self, run: &RunRecord) -> Option<String> {
        let flown = (run.flown_s / self.scenario.sample_s()).round() as u64;
        (self.summary.last.state.stamp.tick < flown.min(*self.ticks.end()))
            .then(|| "it ends before the flight did".into())
    }

    /// Lists the differences between the log and run.json.
    fn unlike_summary(&self, run: &RunRecord) -> Vec<String> {
        let records = self.messages.iter().sum::<u64>() + self.log.events.len() as u64;
        let mut why = vec![];
        match &run.log {
            Some(LogOutcome { records: written, dropped, error }) => {
                if *written != records {
                    why.push(format!("it has {records} records, and run.json tells of {written}"));
                }
                if *dropped > 0 {
                    why.push(format!("{dropped} records were lost before they could be written"));
                }
                why.extend(error.clone());
            }
            None => why.push("run.json tells of no log".into()),
        }
        if run.state_hash.is_some() && self.summary.state_hash() != run.state_hash {
            why.push("its states have another hash than run.json's".into());
        }
        why
    }
}

/// Returns the settings of a log; an error if its messages are not laid out as in this program.
fn settings(log: &Log, path: &Path) -> anyhow::Result<Scenario> {
    let written_by = &log.written_by;
    written_by.check_layout().with_context(|| format!("cannot read {}", path.display()))?;
    let scenario = settings::from_merged(&log.scenario_toml, &format!("the settings in {}", path.display()));
    scenario.map_err(|error| match written_by.other_program() {
        Some(other) => anyhow!("{error}\n{other}: read the log with that program"),
        None => error.into(),
    })
}

/// Makes the record of a log with this number of `messages`.
fn summary_of(log: &Log, messages: u64, summary: &Summary, scenario: &Scenario) -> RunRecord {
    let records = messages + log.events.len() as u64;
    let outcome = LogOutcome { records, dropped: summary.missed, error: log.defect.clone() };
    let how = Circumstances {
        ended: Ended::Lost("the launcher (no run.json; this summary is made from the log)".into()),
        log: Some(outcome),
        events: log.events.clone(),
        refused: vec![],
        port_failures: vec![],
        observers: vec![],
    };
    let verdict = &Verdict::of(summary, scenario, &how);
    let wall_s = f64::NAN; // unknown, and shown as such
    RunRecord::of(Account { summary, scenario, how: &how, verdict, wall_s, provenance: None })
}
