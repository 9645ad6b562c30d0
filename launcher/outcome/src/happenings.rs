//! Happenings of a flight: its faults, its events, and times when a node was without a process.

use contract::Topic;
use contract::scenario::{FaultKind, FaultTarget};
use contract::topic::NODES;
use flight::event::{TimedEvent, What, name};
use serde::Serialize;

use crate::faults::FaultRecord;

/// Faults, events and absences of one flight. Times are simulated \[s\].
#[derive(Debug, Clone, Default, Serialize)]
pub struct Happenings {
    pub faults: Vec<Span>,
    pub events: Vec<Mark>,
    /// Spans from the death of an active process until the next one took over.
    pub absences: Vec<Span>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Span {
    /// Number of a fault in run.json, counted from 1; 0 for an absence.
    pub number: usize,
    /// Target of a fault, or node of an absence.
    #[serde(skip)]
    pub target: String,
    pub what: String,
    pub from_s: f64,
    /// End of the span; `None` if the flight ended first.
    pub to_s: Option<f64>,
    /// `true` for each node whose cycles it can delay, by topic.
    #[serde(skip)]
    delays: [bool; Topic::COUNT],
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mark {
    pub at_s: f64,
    pub node: String,
    pub what: String,
    pub why: Option<String>,
}

impl Happenings {
    pub fn new(faults: &[FaultRecord], events: &[TimedEvent]) -> Self {
        let mut marks: Vec<Mark> = events.iter().map(Mark::of).collect();
        marks.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Self {
            faults: faults.iter().zip(1..).filter_map(|(fault, number)| Span::of_fault(fault, number)).collect(),
            events: marks,
            absences: Topic::ALL.into_iter().flat_map(|topic| absences(topic, events)).collect(),
        }
    }

    /// Finds what can have delayed `topic` between two instants: faults, absences and events of that time.
    pub fn causes(&self, topic: Topic, from_s: f64, to_s: f64) -> [Vec<String>; 3] {
        let spans = |all: &[Span]| -> Vec<String> {
            let during = |span: &&Span| span.from_s <= to_s && span.to_s.is_none_or(|end_s| end_s > from_s);
            all.iter().filter(|span| span.delays[topic as usize]).filter(during).map(Span::describe).collect()
        };
        // Deaths, starts and take-overs of a node's processes count; orders given by hand are among the faults.
        let concerns_a_node = |mark: &&Mark| {
            NODES.contains(&mark.node.as_str()) && !["injected", "cleared"].contains(&mark.what.as_str())
        };
        let then = self.events.iter().filter(|mark| mark.at_s >= from_s && mark.at_s <= to_s);
        [spans(&self.faults), spans(&self.absences), then.filter(concerns_a_node).map(Mark::describe).collect()]
    }
}

impl Span {
    pub fn describe(&self) -> String {
        match self.to_s {
            Some(to_s) => format!("{}, {:.2} to {to_s:.2} s", self.what, self.from_s),
            None => format!("{}, from {:.2} s", self.what, self.from_s),
        }
    }

    /// Returns the span in which a fault acted; `None` if it never did.
    fn of_fault(fault: &FaultRecord, number: usize) -> Option<Self> {
        let FaultRecord { target, kind, injected_at_s, ended_at_s, .. } = *fault;
        Some(Self {
            number,
            target: target.name().into(),
            what: format!("{} {}", target.name(), name(kind)),
            from_s: injected_at_s?,
            to_s: ended_at_s,
            delays: delays(target, kind),
        })
    }
}

impl Mark {
    fn of(timed: &TimedEvent) -> Self {
        let TimedEvent { at_s, event, .. } = timed;
        Self { at_s: *at_s, node: event.node.clone(), what: timed.what(), why: event.why.clone() }
    }

    pub fn describe(&self) -> String {
        let why = self.why.as_ref().map_or(String::new(), |why| format!(" ({why})"));
        format!("{} {} at {:.2} s{why}", self.node, self.what, self.at_s)
    }
}

/// Returns which nodes' cycles a fault can delay. A process fault delays its own node, a hog all nodes. A topic fault
/// delays the nodes that wait for the topic, a solver fault attitude-mpc. Faults of clock and host delay all nodes,
/// faults of sensors, vehicle and surroundings none.
fn delays(target: FaultTarget, kind: FaultKind) -> [bool; Topic::COUNT] {
    use FaultTarget as T;
    Topic::ALL.map(|topic| match target {
        T::State => topic != Topic::State,
        T::Mpc => topic == Topic::Controls,
        T::Clock | T::Host => true,
        target => match (target.process(), target.topic()) {
            (Some(process), _) => topic == process || kind == FaultKind::Hog,
            (None, Some(sent)) => topic as usize == (sent as usize + 1) % Topic::COUNT,
            (None, None) => false,
        },
    })
}

/// Finds the times when the node of `topic` had no active process.
fn absences(topic: Topic, events: &[TimedEvent]) -> Vec<Span> {
    let node = topic.publisher();
    let mut spans: Vec<Span> = vec![];
    let mut active_epochs = vec![1];
    for TimedEvent { at_s, event, .. } in events.iter().filter(|timed| timed.event.node == node) {
        let open = spans.last_mut().filter(|span| span.to_s.is_none());
        match event.what {
            What::TookOver => {
                active_epochs.push(event.epoch);
                if let Some(span) = open {
                    span.to_s = Some(*at_s);
                }
            }
            What::Returned => {
                active_epochs.pop();
            }
            What::Died | What::Hung if open.is_none() && active_epochs.last() == Some(&event.epoch) => {
                let what = format!("{node} was down");
                let target = node.to_owned();
                spans.push(Span { number: 0, target, what, from_s: *at_s, to_s: None, delays: [true; Topic::COUNT] });
            }
            _ => {}
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::scenario::Fault;
    use flight::event::Event;

    fn flown() -> Happenings {
        use {FaultKind as K, FaultTarget as T};
        let fault = |target, kind, injected_at_s, ended_at_s| FaultRecord {
            injected_at_s,
            ended_at_s,
            ..FaultRecord::of(&Fault::new(target, kind, 0.0, None))
        };
        let faults = [
            fault(T::Wind, K::Gust, Some(1.0), Some(9.0)),
            fault(T::Controls, K::Drop, Some(1.5), Some(2.5)),
            fault(T::Mixer, K::Kill, Some(2.0), None),
            fault(T::Tilt, K::Off, None, None),
        ];
        let events = [
            Event::new(200, "mixer", 1, What::Died),
            Event::new(200, "mixer", 2, What::Started),
            Event::new(203, "mixer", 2, What::TookOver).because("it was next"),
            Event::new(400, "mixer", 3, What::Died),
            Event::new(500, "guidance", 1, What::Hung),
        ];
        Happenings::new(&faults, &TimedEvent::all(&events, 100))
    }

    #[test]
    fn faults_come_first_then_absences_then_events() {
        let [faults, absences, events] = flown().causes(Topic::Actuators, 1.99, 2.04);
        assert_eq!(faults, ["controls drop, 1.50 to 2.50 s", "mixer kill, from 2.00 s"]);
        assert_eq!(absences, ["mixer was down, 2.00 to 2.03 s"]);
        assert_eq!([&events[0], &events[2]], ["mixer died at 2.00 s", "mixer took over at 2.03 s (it was next)"]);
    }

    #[test]
    fn a_fault_of_the_vehicle_or_of_another_node_delays_no_cycle() {
        assert_eq!(flown().causes(Topic::Reference, 1.6, 1.9).concat(), Vec::<String>::new());
    }

    #[test]
    fn the_death_of_a_candidate_is_no_absence() {
        let told: Vec<_> = flown().absences.iter().map(Span::describe).collect();
        assert_eq!(told, ["guidance was down, from 5.00 s", "mixer was down, 2.00 to 2.03 s"]);
    }
}
