//! The events of the trace, in Chrome's Trace Event Format, which Perfetto reads too.
//!
//! | event | phase | shows |
//! |---|---|---|
//! | slice | `X` | a node's cycle from start to publication; in the last lane, a command in force |
//! | arrow | `s` `t` `f` | path of one sample from the plant to the actuators, joined by its number |
//! | mark | `i` | deadlines missed and periods skipped since the message before |
//! | counter | `C` | position error; age at the actuator |
//! | name | `M` | name of a lane |
//!
//! Two more lanes below show what happened in the flight:
//!
//! | lane | holds |
//! |---|---|
//! | faults | one thread for each fault that acts in the window, with a slice while it acts |
//! | events | one thread for each process to which something happened: a slice while its node was down, a mark for each event |
//!
//! Viewers count in fractional microseconds. A viewer ties an arrow to the slice that is open at its instant. Of
//! several events at one instant the first in the file counts, so slices come before arrows, and arrows before marks.

use std::ops::Range;

use contract::message::Message;
use contract::topic::NODES;
use flight::log::{Log, Record, counted, status_name};
use serde_json::{Value, json};

use crate::cycle::{CycleTimes, micros};
use outcome::happenings::{Happenings, Span};
use outcome::ticks::{InForce, LoggedTick};

/// Lane below those of the nodes: the commands in force.
const ACTUATORS: usize = NODES.len();
const FAULTS: usize = NODES.len() + 1;
const EVENTS: usize = NODES.len() + 2;
/// Gap between a command's slice and the next one, because viewers round \[ns\].
const APART_NS: u64 = 10;

pub struct Trace {
    origin_ns: u64,
    /// The ticks of the window.
    ticks: Range<u64>,
    /// Instant \[ns\], whether the event is sorted behind others of that instant, and the event.
    events: Vec<(u64, bool, Value)>,
    /// Names of the lanes that only some flights have.
    names: Vec<Value>,
}

impl Trace {
    /// Makes an empty trace of `ticks`; time zero is `origin_ns`.
    pub fn new(origin_ns: u64, ticks: Range<u64>) -> Self {
        Self { origin_ns, ticks, events: vec![], names: vec![] }
    }

    /// Adds a slice for every message of an active process in the lane of its node, and marks for its misses and slips.
    pub fn nodes(&mut self, log: &Log) {
        self.node(&log.states, |state| json!({ "applied_sequence": state.applied_sequence }));
        self.node(&log.references, |_| json!({}));
        self.node(&log.controls, |controls| {
            json!({
                "status": status_name(&(*controls).into()),
                "iterations": controls.iterations,
                "solve_us": micros(controls.solve_ns),
                "active_constraints": controls.active_constraints,
            })
        });
        self.node(&log.actuators, |actuators| json!({ "flags": actuators.flags }));
    }

    /// Adds a slice for every command while it was in force, and its age at the instant it took effect.
    pub fn commands(&mut self, commands: &[InForce]) {
        let ticks = self.ticks.clone();
        for command in commands.iter().filter(|command| ticks.contains(&command.tick)) {
            let InForce { tick, sequence, from_ns, until_ns, age_ns } = *command;
            let end_ns = until_ns.saturating_sub(APART_NS).max(from_ns);
            let args = json!({ "tick": tick, "sequence": sequence, "age_us": micros(age_ns) });
            self.slice(ACTUATORS, &format!("command {tick}"), [from_ns, end_ns], &args);
            self.counter(ACTUATORS, "age at the actuator", from_ns, "ms", age_ns as f64 / 1e6);
        }
    }

    /// Adds an arrow for every sample, through the messages computed from it to the instant its command took effect,
    /// and the position error at every sample. An arrow skips messages that a fault struck on their way.
    pub fn flows(&mut self, ticks: &[LoggedTick], commands: &[InForce]) {
        for tick in ticks {
            let delivered = tick.of.stamps().map(|stamp| stamp.filter(|stamp| stamp.is_delivered()));
            let nodes = delivered.into_iter().enumerate().filter_map(|(lane, stamp)| Some((lane, stamp?.start_ns)));
            let command = commands.binary_search_by_key(&tick.number, |command| command.tick).ok();
            let acted = command.map(|found| (ACTUATORS, commands[found].from_ns));
            let mut ends: Vec<(usize, u64)> = vec![];
            for end in nodes.chain(acted) {
                // A node that began earlier than the one before it had stopped waiting for that message.
                if ends.last().is_none_or(|before| before.1 <= end.1) {
                    ends.push(end);
                }
            }
            let last = ends.len().saturating_sub(1);
            for (i, (lane, at_ns)) in ends.into_iter().enumerate().filter(|_| last > 0) {
                let phase = match i {
                    0 => "s",
                    _ if i == last => "f",
                    _ => "t",
                };
                self.event(phase, lane, "sample", at_ns, json!({ "cat": "chain", "id": tick.number + 1, "bp": "e" }));
            }
            if let Some(error_m) = tick.distance_m() {
                self.counter(0, "position error", tick.sample_ns, "m", error_m);
            }
        }
    }

    /// Adds what happened in the window, whose ticks are `ticks`.
    pub fn happened(&mut self, happened: &Happenings, ticks: &[LoggedTick]) {
        let Some(samples) = Samples::of(ticks) else { return };
        let acting = happened.faults.iter().filter_map(|fault| Some((fault, samples.clip(fault)?)));
        for (thread, (fault, ns)) in acting.enumerate() {
            self.names.extend(lane_names(FAULTS, thread, "faults", &fault.what));
            self.span(FAULTS, thread, fault, ns);
        }
        let mut threads: Vec<&str> = vec![];
        let mut thread_of = |process| {
            let known = threads.iter().position(|known| *known == process);
            known.unwrap_or_else(|| {
                threads.push(process);
                threads.len() - 1
            })
        };
        for (absence, ns) in happened.absences.iter().filter_map(|absence| Some((absence, samples.clip(absence)?))) {
            self.span(EVENTS, thread_of(absence.target.as_str()), absence, ns);
        }
        for mark in &happened.events {
            if let Some(ns) = samples.instant(mark.at_s) {
                let args = json!({ "at_s": mark.at_s, "why": mark.why });
                let more = json!({ "cat": "event", "s": "t", "tid": thread_of(mark.node.as_str()) + 1, "args": args });
                self.event("i", EVENTS, &format!("{} {}", mark.node, mark.what), ns, more);
            }
        }
        self.names.extend(threads.iter().enumerate().flat_map(|(i, node)| lane_names(EVENTS, i, "events", node)));
    }

    /// Returns the whole trace in the order of time, described by `about`.
    pub fn document(mut self, about: &Value) -> Value {
        self.events.sort_by_key(|(ns, behind, _)| (*ns, *behind)); // stable: what was pushed first stays first
        let lanes = NODES.into_iter().chain(["actuators"]).enumerate();
        let names = lanes.flat_map(|(lane, name)| lane_names(lane, lane, name, name)).chain(self.names);
        let events: Vec<Value> = names.chain(self.events.into_iter().map(|(.., event)| event)).collect();
        json!({ "traceEvents": events, "displayTimeUnit": "ns", "otherData": about })
    }

    fn node<M: Message>(&mut self, messages: &[M], details: impl Fn(&M) -> Value)
    where
        Record: From<M>,
    {
        let lane = M::TOPIC as usize;
        let mut cycles = counted(messages).peekable();
        while let Some((message, before)) = cycles.next() {
            let stamp = message.stamp();
            if !self.ticks.contains(&stamp.tick) {
                continue;
            }
            // The next message of the same process carries this cycle's CPU time.
            let after = cycles.peek().map(|(after, _)| after.stamp()).filter(|after| after.epoch == stamp.epoch);
            let publish_ns = stamp.publish_ns[lane];
            let cycle = CycleTimes::new(M::TOPIC, stamp, &before, after);
            let mut args = json!({
                "tick": stamp.tick,
                "sequence": stamp.sequence,
                "delivered": stamp.is_delivered(),
                "release_us": cycle.release_us,
                "wake_us": cycle.wake_us,
                "execution_us": cycle.execution_us,
                "response_us": cycle.response_us,
                "cpu_us": cycle.cpu_us,
            });
            extend(&mut args, details(message));
            self.slice(lane, &format!("{} {}", M::TOPIC.name(), stamp.tick), [stamp.start_ns, publish_ns], &args);
            // A skipped period is found on waking, a late message on sending.
            for (name, at_ns, count) in [("slip", stamp.start_ns, cycle.slips), ("miss", publish_ns, cycle.late)] {
                if count > 0 {
                    let more = json!({ "cat": "deadline", "s": "t", "args": { "count": count } });
                    self.event("i", lane, name, at_ns, more);
                }
            }
        }
    }

    fn slice(&mut self, lane: usize, name: &str, [start_ns, end_ns]: [u64; 2], args: &Value) {
        let duration_us = micros(end_ns.saturating_sub(start_ns));
        self.event("X", lane, name, start_ns, json!({ "cat": "cycle", "dur": duration_us, "args": args }));
    }

    fn counter(&mut self, lane: usize, name: &str, at_ns: u64, unit: &str, value: f64) {
        self.event("C", lane, name, at_ns, json!({ "args": { unit: value } }));
    }

    fn span(&mut self, lane: usize, thread: usize, span: &Span, [from_ns, to_ns]: [u64; 2]) {
        let args = json!({ "from_s": span.from_s, "to_s": span.to_s });
        let more = json!({ "cat": "fault", "dur": micros(to_ns - from_ns), "tid": thread + 1, "args": args });
        self.event("X", lane, &span.what, from_ns, more);
    }

    /// Adds an event to a lane; `more` holds the fields particular to it. Marks, and events of the lanes for faults and
    /// events, are sorted behind the other events of the same instant.
    fn event(&mut self, phase: &str, lane: usize, name: &str, at_ns: u64, more: Value) {
        let ts = micros(at_ns.saturating_sub(self.origin_ns));
        let mut event = json!({ "ph": phase, "pid": lane + 1, "tid": lane + 1, "name": name, "ts": ts });
        extend(&mut event, more);
        self.events.push((at_ns, phase == "i" || lane > ACTUATORS, event));
    }
}

/// Adds the fields of `more` to those of `event`.
fn extend(event: &mut Value, more: Value) {
    if let (Value::Object(event), Value::Object(more)) = (event, more) {
        event.extend(more);
    }
}

/// Samples of the window.
struct Samples {
    /// Flight time \[s\] and instant \[ns\] of each sample.
    at: Vec<(f64, u64)>,
    until_s: f64,
}

impl Samples {
    /// Collects the samples of `ticks`; `None` without a sample.
    fn of(ticks: &[LoggedTick]) -> Option<Self> {
        let sampled = ticks.iter().filter(|tick| tick.of.state.is_some());
        let samples: Vec<(f64, u64)> = sampled.map(|tick| (tick.time_s(), tick.sample_ns)).collect();
        let until_s = samples.last()?.0 + ticks.first()?.period_ns as f64 / 1e9;
        Some(Self { at: samples, until_s })
    }

    /// Returns the instant of the newest sample at the time `at_s` or before \[ns\]; `None` outside the window.
    fn instant(&self, at_s: f64) -> Option<u64> {
        const ROUNDING_S: f64 = 1e-6;
        let newest = self.at.partition_point(|(sampled_s, _)| *sampled_s <= at_s + ROUNDING_S).checked_sub(1)?;
        (at_s < self.until_s).then(|| self.at[newest].1)
    }

    /// Part of `span` inside the window \[ns\]; `None` if there is none.
    fn clip(&self, span: &Span) -> Option<[u64; 2]> {
        let (first, last) = (self.at.first()?, self.at.last()?);
        let from_ns = self.instant(span.from_s.max(first.0))?;
        let to_s = span.to_s.unwrap_or(f64::INFINITY);
        (to_s > first.0).then(|| [from_ns, self.instant(to_s).unwrap_or(last.1).max(from_ns)])
    }
}

/// Makes the events that name a lane: a process of the viewer, and a thread in it.
fn lane_names(process: usize, thread: usize, name: &str, thread_name: &str) -> [Value; 3] {
    let named = |what: &str, args: Value| json!({ "ph": "M", "name": what, "pid": process + 1, "tid": thread + 1, "args": args });
    [
        named("process_name", json!({ "name": name })),
        named("process_sort_index", json!({ "sort_index": process })),
        named("thread_name", json!({ "name": thread_name })),
    ]
}
