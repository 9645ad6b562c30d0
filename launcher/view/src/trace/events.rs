//! The events of the trace, in Chrome's Trace Event Format, which Perfetto reads too.
//!
//! | event | phase | shows |
//! |---|---|---|
//! | slice | `X` | a node's cycle from start to publication; in the last lane, a command in force |
//! | arrow | `s` `t` `f` | one sample's way from the plant to the actuators, joined by its number |
//! | mark | `i` | deadlines missed and periods skipped since the message before |
//! | counter | `C` | position error; age at the actuator |
//! | name | `M` | what a lane is |
//!
//! Below those lanes stand the faults, as slices, and the events of the flight, as marks ([`super::happened`]).
//!
//! Viewers count in microseconds, with a fraction. An arrow is tied to the slice that is open where its event lies, of
//! two at one instant the one that stands first: so slices come before arrows, and arrows before marks.

use std::collections::HashMap;

use contract::Topic;
use contract::message::{Actuators, Message, SolveStatus, Stamp};
use contract::topic::NODES;
use serde_json::{Map, Value, json};

use super::acted::Acted;
use super::window::Window;
use crate::report::Row;
use flight::log::{Log, Record, counted};

/// The lane below those of the nodes: which command the actuators obey.
const ACTUATORS: usize = NODES.len();
/// Viewers round: a command's slice ends so long before the next one begins \[ns\].
const APART_NS: u64 = 10;

/// Events in the making.
pub struct Trace {
    origin_ns: u64,
    ticks: std::ops::Range<u64>,
    /// With their instants \[ns\].
    events: Vec<(u64, Value)>,
    /// Those that stand behind others of the same instant.
    marks: Vec<(u64, Value)>,
    /// Names of the lanes that only some flights have.
    pub(super) names: Vec<Value>,
}

impl Trace {
    /// An empty trace of the ticks in `window`; time zero is `origin_ns`.
    pub fn new(origin_ns: u64, window: &Window) -> Self {
        let ticks = window.ticks(usize::MAX);
        Self { origin_ns, ticks: ticks.start as u64..ticks.end as u64, events: vec![], marks: vec![], names: vec![] }
    }

    /// A slice for every message of who was active, in the lane of its node, and marks for what its counters say.
    pub fn nodes(&mut self, log: &Log) {
        self.node(&log.states, |state| json!({ "applied_sequence": state.applied_sequence }));
        self.node(&log.references, |_| json!({}));
        self.node(&log.controls, |controls| {
            json!({
                "status": solve_status(controls.status),
                "iterations": controls.iterations,
                "solve_us": micros(controls.solve_ns),
                "active_constraints": controls.active_constraints,
            })
        });
        self.node(&log.actuators, |actuators| json!({ "flags": actuators.flags }));
    }

    /// A slice for every command while it was in force.
    pub fn commands(&mut self, acted: &[Acted]) {
        for acted in acted {
            let Stamp { tick, sequence, .. } = acted.command.stamp;
            if self.ticks.contains(&tick) {
                let end_ns = acted.until_ns.saturating_sub(APART_NS).max(acted.from_ns);
                let args = json!({ "tick": tick, "sequence": sequence, "age_us": micros(acted.age_ns) });
                self.slice(ACTUATORS, &format!("command {tick}"), acted.from_ns, end_ns, &args);
            }
        }
    }

    /// An arrow for every sample, through the messages that descend from it to the moment its command took effect; past
    /// those that a fault struck on their way.
    pub fn flows(&mut self, rows: &[Row], acted: &[Acted]) {
        // By tick and number: a restarted mixer may send a second command for a tick, or use a number again.
        let key = |command: &Actuators| (command.stamp.tick, command.stamp.sequence);
        let acted: HashMap<_, _> = acted.iter().map(|acted| (key(acted.command), acted)).collect();
        for row in rows {
            let stamps = [
                row.state.map(Message::stamp),
                row.reference.map(Message::stamp),
                row.controls.map(Message::stamp),
                row.actuators.map(Message::stamp),
            ];
            let heard = stamps.map(|stamp| stamp.filter(|stamp| stamp.is_delivered()));
            let nodes = heard.into_iter().enumerate().filter_map(|(lane, stamp)| Some((lane, stamp?.start_ns)));
            let command = row.actuators.and_then(|command| acted.get(&key(command)));
            let mut stations: Vec<(usize, u64)> = vec![];
            for station in nodes.chain(command.map(|acted| (ACTUATORS, acted.from_ns))) {
                // Who ran out of patience and began before the one before it has not heard it.
                if stations.last().is_none_or(|before| before.1 <= station.1) {
                    stations.push(station);
                }
            }
            let tick = stamps.into_iter().flatten().map(|stamp| stamp.tick).next().unwrap_or_default();
            self.flow(tick, &stations);
        }
    }

    /// The position error at every sample, and every command's age where it took effect.
    pub fn counters(&mut self, rows: &[Row], acted: &[Acted]) {
        for row in rows {
            if let (Some(state), Some(error)) = (row.state, row.position_error_m()) {
                let error_m = error.iter().map(|e| e * e).sum::<f64>().sqrt();
                self.counter(0, "position error", state.stamp.sample_ns, &json!({ "m": error_m }));
            }
        }
        for acted in acted {
            if self.ticks.contains(&acted.command.stamp.tick) {
                let age_ms = acted.age_ns as f64 / 1e6;
                self.counter(ACTUATORS, "age at the actuator", acted.from_ns, &json!({ "ms": age_ms }));
            }
        }
    }

    /// The whole trace, in the order of time; `about` says what of.
    pub fn document(mut self, about: &Value) -> Value {
        self.events.append(&mut self.marks);
        self.events.sort_by_key(|(ns, _)| *ns); // stable: what was pushed first stays first
        let names = NODES
            .into_iter()
            .chain(["actuators"])
            .enumerate()
            .flat_map(|(lane, name)| lane_names(lane, lane, name, name));
        let events: Vec<Value> =
            names.chain(self.names).chain(self.events.into_iter().map(|(_, event)| event)).collect();
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
            let after = cycles.peek().map(|(after, _)| after.stamp()).filter(|after| after.epoch == stamp.epoch);
            let mut args = timing(M::TOPIC, stamp, after);
            if let Value::Object(details) = details(message) {
                args.extend(details);
            }
            let end_ns = stamp.publish_ns[lane];
            self.slice(lane, &format!("{} {}", M::TOPIC.name(), stamp.tick), stamp.start_ns, end_ns, &args.into());
            // Skipped periods are found on waking and count as misses too; a late message is known when it is sent.
            let slips = stamp.slips.saturating_sub(before.slips);
            let late = stamp.misses.saturating_sub(before.misses).saturating_sub(slips);
            self.mark(lane, "slip", stamp.start_ns, slips);
            self.mark(lane, "miss", end_ns, late);
        }
    }

    fn slice(&mut self, lane: usize, name: &str, start_ns: u64, end_ns: u64, args: &Value) {
        let duration_us = micros(end_ns.saturating_sub(start_ns));
        let more = json!({ "cat": "cycle", "dur": duration_us, "args": args });
        self.events.push(self.event("X", lane, name, start_ns, more));
    }

    fn flow(&mut self, tick: u64, stations: &[(usize, u64)]) {
        let last = stations.len().saturating_sub(1);
        if last == 0 {
            return; // an arrow needs two ends
        }
        for (i, (lane, at_ns)) in stations.iter().enumerate() {
            let phase = if i == 0 {
                "s"
            } else if i == last {
                "f"
            } else {
                "t"
            };
            let more = json!({ "cat": "chain", "id": tick + 1, "bp": "e" });
            self.events.push(self.event(phase, *lane, "sample", *at_ns, more));
        }
    }

    /// Adds an event that stands behind others of the same instant.
    pub(super) fn add(&mut self, event: (u64, Value)) {
        self.marks.push(event);
    }

    fn mark(&mut self, lane: usize, name: &str, at_ns: u64, count: u64) {
        if count > 0 {
            let more = json!({ "cat": "deadline", "s": "t", "args": { "count": count } });
            self.marks.push(self.event("i", lane, name, at_ns, more));
        }
    }

    fn counter(&mut self, lane: usize, name: &str, at_ns: u64, args: &Value) {
        self.events.push(self.event("C", lane, name, at_ns, json!({ "args": args })));
    }

    /// An event of a lane with what is particular to it.
    pub(super) fn event(&self, phase: &str, lane: usize, name: &str, at_ns: u64, more: Value) -> (u64, Value) {
        let ts = micros(at_ns.saturating_sub(self.origin_ns));
        let mut event = json!({ "ph": phase, "pid": lane + 1, "tid": lane + 1, "name": name, "ts": ts });
        if let (Some(event), Value::Object(more)) = (event.as_object_mut(), more) {
            event.extend(more);
        }
        (at_ns, event)
    }
}

/// The timing that a stamp tells of; `after` is the next one of the same process, which knows this cycle's CPU time.
fn timing(topic: Topic, stamp: &Stamp, after: Option<&Stamp>) -> Map<String, Value> {
    let publish_ns = stamp.publish_ns[topic as usize];
    let since = |from_ns: u64, to_ns: u64| micros(to_ns.saturating_sub(from_ns));
    Map::from_iter([
        ("tick".to_owned(), json!(stamp.tick)),
        ("sequence".to_owned(), json!(stamp.sequence)),
        ("heard".to_owned(), json!(stamp.is_delivered())),
        ("release_us".to_owned(), json!(since(stamp.sample_ns, stamp.release_ns))),
        ("wake_us".to_owned(), json!(since(stamp.release_ns, stamp.start_ns))),
        ("execution_us".to_owned(), json!(since(stamp.start_ns, publish_ns))),
        ("response_us".to_owned(), json!(since(stamp.sample_ns, publish_ns))),
        ("cpu_us".to_owned(), json!(after.map(|after| micros(after.cpu_ns)))),
    ])
}

fn solve_status(wire: u64) -> String {
    use SolveStatus::{BadInput, Explicit, Fallback, LimitReached, NoReference, Solved, Stale};
    let all = [Explicit, Solved, LimitReached, Fallback, BadInput, Stale, NoReference];
    let known = all.into_iter().find(|s| *s as u64 == wire);
    known.map_or_else(|| wire.to_string(), |status| format!("{status:?}"))
}

/// What a lane is called: a process of the viewer, and in it a thread.
pub(super) fn lane_names(process: usize, thread: usize, name: &str, thread_name: &str) -> [Value; 3] {
    let named = |what: &str, args: Value| json!({ "ph": "M", "name": what, "pid": process + 1, "tid": thread + 1, "args": args });
    [
        named("process_name", json!({ "name": name })),
        named("process_sort_index", json!({ "sort_index": process })),
        named("thread_name", json!({ "name": thread_name })),
    ]
}

pub(super) fn micros(ns: u64) -> f64 {
    ns as f64 / 1e3
}
