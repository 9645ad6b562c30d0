//! Course of each fault, of the scenario or given in flight: the `faults` section of run.json.
//!
//! ```text
//! injected    first tick on which the fault acted
//! detected    first tick from then on that shows harm
//! recovered   first tick, after the fault's end and the detection, by which all harm has ceased; process: see below
//! ```
//!
//! Topics are followed independently, so the order of messages between topics does not matter.
//!
//! | target | struck | witnesses | harm |
//! |---|---|---|---|
//! | process | ticks while the fault acts | its own topic, the launcher | a tick without a message, an event of the process's end |
//! | STATE | marked messages of the topic | REFERENCE, CONTROLS, ACTUATORS | an input that was old, missing or bad |
//! | REFERENCE | marked messages of the topic | CONTROLS, ACTUATORS | an input that was old, missing or bad |
//! | CONTROLS | marked messages of the topic | ACTUATORS | an input that was old, missing or bad |
//! | ACTUATORS | marked messages of the topic | STATE | still under the command of the sample before |
//! | sensor | ticks while the fault acts | REFERENCE, CONTROLS, ACTUATORS | an input that was old, missing or bad |
//! | actuator | ticks while the fault acts | ACTUATORS | the flight is terminated, or yaw is given up |
//! | wind, payload | ticks while the fault acts | | |
//! | mpc | ticks while the fault acts | CONTROLS | no optimum |
//! | clock, host | ticks while the fault acts | | |
//!
//! A struck process has recovered when its topic has a message again, or when the next process takes over before any
//! message is missing. Its recovery time counts from the detection; all other recovery times count from the end of the
//! fault. In real time, if the next process takes over before any message is missing, only the launcher has seen the
//! end of the process before it.

use contract::message::{Controls, SolveStatus, Stamp, guidance_flags, mixer_flags};
use contract::topic::Topic;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Fault, FaultKind, FaultTarget};

use flight::event::{Event, What, name, size_in_words};
use flight::log::Record;

/// Number of unanswered samples after which a silent process counts as harmed.
const UNANSWERED: u64 = 3;
/// Longest time after the end of a fault in which harm is still ascribed to it \[s\]; chosen, not measured.
const GRACE_S: f64 = 0.5;

/// One fault in the `faults` section of run.json. Times are simulated \[s\].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FaultRecord {
    /// Part of the stack that has the fault.
    pub target: FaultTarget,
    /// Kind of the fault.
    pub kind: FaultKind,
    /// Size in words, where one was given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size: Option<String>,
    /// Beginning, as asked for \[s\].
    pub at_s: f64,
    /// Duration, as asked for \[s\]; null = until the end of the flight.
    pub for_s: Option<f64>,
    /// First sample on which the fault acted \[s\]; null if it never did.
    pub injected_at_s: Option<f64>,
    /// End of the fault \[s\]; null if the flight ended first.
    pub ended_at_s: Option<f64>,
    /// Time from the injection to the detection \[s\]; null if it was not detected.
    pub detected_after_s: Option<f64>,
    /// Time from the end of the fault, or for a process fault from the detection, to the recovery \[s\]; null if there
    /// was none.
    pub recovered_after_s: Option<f64>,
}

impl FaultRecord {
    /// Makes the record of a fault that did not act.
    pub fn of(fault: &Fault) -> Self {
        let Fault { target, kind, at_s, for_s, .. } = *fault;
        let (injected_at_s, ended_at_s, detected_after_s, recovered_after_s) = Default::default();
        let size = size_in_words(fault);
        Self { target, kind, size, at_s, for_s, injected_at_s, ended_at_s, detected_after_s, recovered_after_s }
    }

    /// Returns target, kind and size in words.
    pub fn what(&self) -> String {
        let size = self.size.as_ref().map_or(String::new(), |size| format!(" {size}"));
        format!("{} {}{size}", self.target.name(), name(self.kind))
    }

    /// Returns the end of the fault \[s\], which is the beginning of a momentary fault; `None` if the flight ended
    /// first.
    pub fn until_s(&self) -> Option<f64> {
        let is_moment = self.for_s.is_none() && Fault::new(self.target, self.kind, self.at_s, None).is_momentary();
        self.ended_at_s.or(self.injected_at_s.filter(|_| is_moment))
    }

    /// Describes the fault, its detection and its recovery in one line for people.
    pub fn describe(&self) -> String {
        let Self { target, kind, at_s, for_s, .. } = *self;
        let Some(injected_at_s) = self.injected_at_s else {
            return format!("{} at {at_s} s: never struck", self.what());
        };
        let when = when(&Fault::new(target, kind, at_s, for_s), injected_at_s);
        let course = format!("{} {when}", self.what());
        match [self.detected_after_s, self.recovered_after_s] {
            // Wind, or a fault that the flight tolerates: there is nothing to recover from.
            [None, _] => format!("{course}: not detected"),
            [Some(detected_s), None] => format!("{course}: detected after {detected_s:.2} s, not recovered"),
            [Some(detected_s), Some(recovered_s)] => {
                format!("{course}: detected after {detected_s:.2} s, recovered after {recovered_s:.2} s")
            }
        }
    }
}

pub struct Faults {
    watched: Vec<Watched>,
    rate_hz: u32,
}

/// One fault, and the harm that the messages have shown.
struct Watched {
    rate_hz: u32,
    fault: Fault,
    newest: u64,
    /// Ticks of the first and the last marked message of the topic.
    marked: Option<(u64, u64)>,
    /// Sequence number of the command in force at the newest STATE.
    obeyed: u64,
    /// Harm that each topic shows.
    courses: [Course; Topic::COUNT],
}

/// Course of one topic, tick by tick.
#[derive(Default)]
struct Course {
    /// Ticks on which the harm began (`true`) or ceased (`false`).
    changes: Vec<(u64, bool)>,
    last: Option<u64>,
}

impl Faults {
    /// Begins to follow the faults of a scenario.
    pub fn new(faults: &[Fault], rate_hz: u32) -> Self {
        Self { watched: faults.iter().map(|fault| Watched::new(*fault, rate_hz)).collect(), rate_hz }
    }

    /// Updates the faults to the present ones: some may end at another time than before, and more may have been given.
    pub fn follow(&mut self, faults: &[Fault]) {
        for (watched, fault) in self.watched.iter_mut().zip(faults) {
            watched.fault = *fault;
        }
        let more = faults.iter().skip(self.watched.len()).map(|fault| Watched::new(*fault, self.rate_hz));
        self.watched.extend(more.collect::<Vec<_>>());
    }

    pub fn observe(&mut self, record: &Record) {
        self.watched.iter_mut().for_each(|watched| watched.observe(record));
    }

    /// Returns the `faults` section of run.json for a flight with these `events`.
    pub fn records(&self, events: &[Event]) -> Vec<FaultRecord> {
        self.watched.iter().map(|watched| watched.record(events)).collect()
    }
}

impl Course {
    /// Notes whether the topic shows harm on `tick`.
    fn note(&mut self, tick: u64, harmed: bool) {
        if self.changes.last().is_some_and(|change| change.1) != harmed {
            self.changes.push((tick, harmed));
        }
        self.last = Some(tick);
    }

    /// Notes a message of `tick`: the ticks between the message before and this one show harm.
    fn sent(&mut self, tick: u64) {
        let expected = self.last.map_or(tick, |last| last.saturating_add(1));
        if tick > expected {
            self.note(expected, true);
        }
        self.note(tick, false);
    }

    /// First tick from `from` on whose harm equals `harmed`; `None` if there is none.
    fn first(&self, from: u64, harmed: bool) -> Option<u64> {
        let so_far = self.changes.iter().take_while(|change| change.0 <= from).last().is_some_and(|change| change.1);
        if so_far == harmed {
            return self.last.filter(|last| *last >= from).map(|_| from);
        }
        self.changes.iter().find(|change| change.0 > from && change.1 == harmed).map(|change| change.0)
    }
}

impl Watched {
    fn new(fault: Fault, rate_hz: u32) -> Self {
        Self { rate_hz, fault, newest: 0, marked: None, obeyed: 0, courses: Default::default() }
    }

    fn observe(&mut self, record: &Record) {
        let Some((topic, Stamp { tick, .. })) = record.stamped() else { return };
        let (tick, course) = (*tick, &mut self.courses[topic as usize]);
        self.newest = self.newest.max(tick);
        if self.fault.target.process() == Some(topic) {
            course.sent(tick);
        } else if let Some(harmed) = harm(self.fault.target, record, self.obeyed) {
            course.note(tick, harmed);
        }
        if struck(&self.fault, record) && self.ticks().contains(&tick) {
            self.marked = Some((self.marked.map_or(tick, |(first, _)| first), tick));
        }
        if let Record::State(state) = record {
            self.obeyed = state.applied_sequence;
        }
    }

    fn ticks(&self) -> std::ops::Range<u64> {
        self.fault.ticks(1.0 / f64::from(self.rate_hz))
    }

    /// Returns the course of the topic whose process is struck; `None` if no process is.
    fn process(&self) -> Option<&Course> {
        self.fault.target.process().map(|topic| &self.courses[topic as usize])
    }

    fn injected(&self) -> Option<u64> {
        if self.fault.target.topic().is_some() {
            return self.marked.map(|(first, _)| first);
        }
        let ticks = self.ticks();
        (!ticks.is_empty() && ticks.start <= self.newest).then_some(ticks.start)
    }

    /// First tick after the fault; `None` while the fault has no end.
    fn ended(&self) -> Option<u64> {
        let ends = self.fault.for_s.is_some() || self.fault.kind == FaultKind::Burst;
        match self.marked {
            Some((_, last)) => ends.then(|| last.saturating_add(1)),
            None => self.fault.for_s.map(|_| self.ticks().end),
        }
    }

    fn detected(&self, events: &[Event]) -> Option<u64> {
        let injected = self.injected()?;
        if let Some(course) = self.process() {
            let silent = course.last.filter(|last| self.newest.saturating_sub(*last) >= UNANSWERED);
            let missing = course.first(injected, true).or(silent.map(|last| last + 1));
            return [missing, self.first_event(injected, &[What::Died, What::Hung], events)]
                .into_iter()
                .flatten()
                .min();
        }
        let first = self.courses.iter().filter_map(|course| course.first(injected, true)).min();
        let grace = (GRACE_S * f64::from(self.rate_hz)) as u64;
        first.filter(|first| self.ended().is_none_or(|ended| *first < ended.saturating_add(grace)))
    }

    fn recovered(&self, events: &[Event]) -> Option<u64> {
        let (injected, detected) = (self.injected()?, self.detected(events)?);
        if let Some(course) = self.process() {
            let is_missing = course.first(detected, true) == Some(detected);
            let next = || self.first_event(detected, &[What::TookOver], events);
            return if is_missing { course.first(detected, false) } else { next() };
        }
        let from = self.ended()?.max(detected);
        let mut harmed = self.courses.iter().filter(|course| course.first(injected, true).is_some());
        harmed.try_fold(from, |latest, course| Some(latest.max(course.first(from, false)?)))
    }

    /// Returns the tick of the first event of a kind in `what`, from `tick` on, of a process of the struck node that
    /// had been active by then.
    fn first_event(&self, tick: u64, what: &[What], events: &[Event]) -> Option<u64> {
        let node = self.fault.target.process()?.publisher();
        let mut active_epochs = vec![1];
        events.iter().filter(|event| event.node == node).find_map(|event| {
            if event.what == What::TookOver {
                active_epochs.push(event.epoch);
            }
            let is_it = event.tick >= tick && what.contains(&event.what) && active_epochs.contains(&event.epoch);
            is_it.then_some(event.tick)
        })
    }

    /// Converts ticks to time \[s\] by a division, which rounds to the nearest number and so prints in few digits.
    fn seconds(&self, ticks: u64) -> f64 {
        ticks as f64 / f64::from(self.rate_hz)
    }

    /// Returns the time from the injection to the detection, and the time to the recovery: from the detection of a
    /// process fault, from the end of any other \[s\].
    fn delays_s(&self, events: &[Event]) -> [Option<f64>; 2] {
        let (injected, ended, detected) = (self.injected(), self.ended(), self.detected(events));
        let since = if self.process().is_some() { detected } else { ended };
        [(detected, injected), (self.recovered(events), since)]
            .map(|(to, from)| Some(self.seconds(to?.saturating_sub(from?))))
    }

    fn record(&self, events: &[Event]) -> FaultRecord {
        let [detected_after_s, recovered_after_s] = self.delays_s(events);
        let [injected_at_s, ended_at_s] = [self.injected(), self.ended()].map(|tick| Some(self.seconds(tick?)));
        let acted = FaultRecord::of(&self.fault);
        FaultRecord { injected_at_s, ended_at_s, detected_after_s, recovered_after_s, ..acted }
    }
}

/// Describes a fault for people: target, kind, size, begin \[s\] and duration.
pub fn course(fault: &Fault, from_s: f64) -> String {
    format!("{} {}", FaultRecord::of(fault).what(), when(fault, from_s))
}

fn when(fault: &Fault, from_s: f64) -> String {
    match fault.for_s {
        Some(for_s) => format!("from {from_s:.2} s for {for_s} s"),
        None if fault.is_momentary() => format!("at {from_s:.2} s"),
        None => format!("from {from_s:.2} s to the end"),
    }
}

/// Flags of ACTUATORS that tell of something wrong, other than a limit.
const REACTIONS: u64 = mixer_flags::BAD_INPUT
    | mixer_flags::HELD
    | mixer_flags::LEVELLED
    | mixer_flags::DESCENDING
    | mixer_flags::TRIM_ONLY
    | mixer_flags::CUT
    | mixer_flags::TERMINATED;

/// Returns whether `fault` took effect on the topic of `record` in this message. Duplicated messages bear no mark, so
/// with that kind of fault every message of the topic counts.
fn struck(fault: &Fault, record: &Record) -> bool {
    let Some((topic, stamp)) = record.stamped() else { return false };
    let marked = stamp.is_faulted() || fault.kind == FaultKind::Duplicate;
    marked && fault.target.topic() == Some(topic)
}

/// Returns whether `record` shows harm done by a fault of `target`; `None` if it is no witness. `obeyed` is the
/// sequence number of the command in force at the STATE before.
fn harm(target: FaultTarget, record: &Record, obeyed: u64) -> Option<bool> {
    use FaultTarget as T;
    match (target, record) {
        (T::Mpc, Record::Controls(controls)) => Some(controls.status > SolveStatus::Solved as u64),
        (T::Rotor1 | T::Rotor2 | T::Rotor3 | T::Tilt, Record::Actuators(actuators)) => {
            Some(actuators.flags & (mixer_flags::TERMINATED | mixer_flags::YAW_GIVEN_UP) != 0)
        }
        (T::Actuators, Record::State(state)) => Some(state.applied_sequence == obeyed),
        _ if target.is_a_sensor() || matches!(target, T::State | T::Reference | T::Controls) => {
            let first = target.topic().unwrap_or(Topic::State); // sensor values travel in STATE
            record.stamped().filter(|(topic, _)| *topic as usize > first as usize).map(|_| reacts(record))
        }
        _ => None,
    }
}

/// Returns whether the sender of `record` worked without the input it should have had.
pub fn reacts(record: &Record) -> bool {
    match record {
        Record::State(_) | Record::Truth(_) => false,
        Record::Reference(reference) => guidance_flags::repeated(reference.flags),
        Record::Controls(Controls { status, .. }) => {
            SolveStatus::repeated(*status) || *status == SolveStatus::NoReference as u64
        }
        Record::Actuators(actuators) => actuators.flags & REACTIONS != 0,
    }
}

#[cfg(test)]
mod tests;
