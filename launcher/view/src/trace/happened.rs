//! Faults and events of the flight in the trace: below the nodes, in lanes of their own.
//!
//! | lane | holds |
//! |---|---|
//! | faults | one thread for each fault that acts in the window, with a slice while it acts |
//! | events | one thread for each process to which something happened: a slice while its node was down, a mark for each event |

use contract::message::State;
use contract::topic::NODES;
use serde_json::json;

use super::events::{Trace, lane_names, micros};
use crate::happenings::{Happenings, Mark, Span};
use crate::report::Row;

/// The lanes below that of the actuators.
const FAULTS: usize = NODES.len() + 1;
const EVENTS: usize = NODES.len() + 2;

impl Trace {
    /// What happened in the window, whose ticks are `rows`.
    pub fn happened(&mut self, happened: &Happenings, rows: &[Row], sample_s: f64) {
        let Some(window) = Window::of(rows, sample_s) else { return };
        let acting = happened.faults.iter().filter_map(|fault| Some((fault, window.clip(fault)?)));
        for (thread, (fault, ns)) in acting.enumerate() {
            self.names.extend(lane_names(FAULTS, thread, "faults", &fault.what));
            self.span(FAULTS, thread, fault, ns);
        }
        let mut threads: Vec<&str> = vec![];
        let mut thread_of = |node| {
            let known = threads.iter().position(|known| *known == node);
            known.unwrap_or_else(|| {
                threads.push(node);
                threads.len() - 1
            })
        };
        for (absence, ns) in happened.absences.iter().filter_map(|absence| Some((absence, window.clip(absence)?))) {
            let thread = thread_of(absence.what.split(' ').next().unwrap_or_default());
            self.span(EVENTS, thread, absence, ns);
        }
        for mark in &happened.events {
            if let Some(ns) = window.instant(mark.at_s) {
                let thread = thread_of(mark.node.as_str());
                self.happening(thread, mark, ns);
            }
        }
        self.names.extend(threads.iter().enumerate().flat_map(|(i, node)| lane_names(EVENTS, i, "events", node)));
    }

    fn span(&mut self, lane: usize, thread: usize, span: &Span, [from_ns, to_ns]: [u64; 2]) {
        let args = json!({ "from_s": span.from_s, "to_s": span.to_s });
        let more = json!({ "cat": "fault", "dur": micros(to_ns - from_ns), "tid": thread + 1, "args": args });
        let event = self.event("X", lane, &span.what, from_ns, more);
        self.add(event);
    }

    fn happening(&mut self, thread: usize, mark: &Mark, at_ns: u64) {
        let args = json!({ "at_s": mark.at_s, "why": mark.why });
        let more = json!({ "cat": "event", "s": "t", "tid": thread + 1, "args": args });
        let event = self.event("i", EVENTS, &format!("{} {}", mark.node, mark.what), at_ns, more);
        self.add(event);
    }
}

/// The ticks traced: time of the flight \[s\] and instant of each sample \[ns\].
struct Window {
    samples: Vec<(f64, u64)>,
    until_s: f64,
}

impl Window {
    /// None without a sample.
    fn of(rows: &[Row], sample_s: f64) -> Option<Self> {
        let sampled = rows.iter().filter_map(|row| row.state);
        let sample = |state: &State| (state.stamp.tick as f64 * sample_s, state.stamp.sample_ns);
        let samples: Vec<(f64, u64)> = sampled.map(sample).collect();
        let until_s = samples.last()?.0 + sample_s;
        Some(Self { samples, until_s })
    }

    /// The instant of the newest sample at that time; none outside the window.
    fn instant(&self, at_s: f64) -> Option<u64> {
        const ROUNDING_S: f64 = 1e-6;
        let newest = self.samples.partition_point(|(sampled_s, _)| *sampled_s <= at_s + ROUNDING_S).checked_sub(1)?;
        (at_s < self.until_s).then(|| self.samples[newest].1)
    }

    /// The part of `span` that lies inside, if any.
    fn clip(&self, span: &Span) -> Option<[u64; 2]> {
        let (first, last) = (self.samples.first()?, self.samples.last()?);
        let from_ns = self.instant(span.from_s.max(first.0))?;
        let to_s = span.to_s.unwrap_or(f64::INFINITY);
        (to_s > first.0).then(|| [from_ns, self.instant(to_s).unwrap_or(last.1).max(from_ns)])
    }
}
