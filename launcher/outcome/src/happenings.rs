//! Happenings of a flight: its faults, its events, and times when a node was without a process. Read from
//! `faults` and `events` of run.json; what cannot be read is left out.

use contract::Topic;
use contract::scenario::{FaultKind, FaultTarget};
use contract::topic::NODES;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use flight::event::What;

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

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    pub at_s: f64,
    pub node: String,
    pub what: String,
    pub why: Option<String>,
}

impl Happenings {
    pub fn new(faults: &Value, events: &Value) -> Self {
        let list = |value: &Value| value.as_array().cloned().unwrap_or_default();
        let mut marks: Vec<Mark> = list(events).iter().filter_map(|event| Mark::deserialize(event).ok()).collect();
        for mark in &mut marks {
            mark.what = mark.what.replace('-', " ");
        }
        marks.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Self {
            faults: list(faults).iter().zip(1..).filter_map(|(fault, number)| Span::of_fault(fault, number)).collect(),
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

    fn of_fault(fault: &Value, number: usize) -> Option<Self> {
        let target = fault["target"].as_str()?.to_owned();
        Some(Self {
            number,
            what: format!("{target} {}", fault["kind"].as_str()?),
            target,
            from_s: fault["injected_at_s"].as_f64()?,
            to_s: fault["ended_at_s"].as_f64(),
            delays: delays(
                FaultTarget::deserialize(&fault["target"]).ok(),
                FaultKind::deserialize(&fault["kind"]).ok(),
            ),
        })
    }
}

impl Mark {
    pub fn describe(&self) -> String {
        let why = self.why.as_ref().map_or(String::new(), |why| format!(" ({why})"));
        format!("{} {} at {:.2} s{why}", self.node, self.what, self.at_s)
    }
}

/// Which nodes' cycles a fault can delay. A process fault: those of its node, a hog all. A fault of a topic: those of
/// the nodes that wait for it. A fault of the solver: those of attitude-mpc. Clock and host: all. What acts on the
/// vehicle: none.
fn delays(target: Option<FaultTarget>, kind: Option<FaultKind>) -> [bool; Topic::COUNT] {
    use FaultTarget as T;
    Topic::ALL.map(|topic| match target {
        None => false,
        Some(T::State) => topic != Topic::State,
        Some(T::Mpc) => topic == Topic::Controls,
        Some(T::Clock | T::Host) => true,
        Some(target) => match (target.process(), target.topic()) {
            (Some(process), _) => topic == process || kind == Some(FaultKind::Hog),
            (None, Some(sent)) => topic as usize == (sent as usize + 1) % Topic::COUNT,
            (None, None) => false,
        },
    })
}

/// Finds the times when the node of `topic` had no active process.
fn absences(topic: Topic, events: &Value) -> Vec<Span> {
    let node = topic.publisher();
    let of_node = events.as_array().into_iter().flatten().filter(|event| event["node"] == node);
    let mut spans: Vec<Span> = vec![];
    let mut active_epochs = vec![1];
    for event in of_node {
        let (Some(at_s), Some(epoch)) = (event["at_s"].as_f64(), event["epoch"].as_u64()) else { continue };
        let open = spans.last_mut().filter(|span| span.to_s.is_none());
        match What::deserialize(&event["what"]) {
            Ok(What::TookOver) => {
                active_epochs.push(epoch);
                if let Some(span) = open {
                    span.to_s = Some(at_s);
                }
            }
            Ok(What::Returned) => {
                active_epochs.pop();
            }
            Ok(What::Died | What::Hung) if open.is_none() && active_epochs.last() == Some(&epoch) => {
                let what = format!("{node} was down");
                let target = node.to_owned();
                spans.push(Span { number: 0, target, what, from_s: at_s, to_s: None, delays: [true; Topic::COUNT] });
            }
            _ => {}
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn flown() -> Happenings {
        let faults = json!([
            { "target": "wind", "kind": "gust", "injected_at_s": 1.0, "ended_at_s": 9.0 },
            { "target": "controls", "kind": "drop", "injected_at_s": 1.5, "ended_at_s": 2.5 },
            { "target": "mixer", "kind": "kill", "injected_at_s": 2.0, "ended_at_s": null },
            { "target": "tilt", "kind": "off", "injected_at_s": null },
            { "target": 3 },
        ]);
        let events = json!([
            { "at_s": 2.0, "node": "mixer", "epoch": 1, "what": "died" },
            { "at_s": 2.0, "node": "mixer", "epoch": 2, "what": "started" },
            { "at_s": 2.03, "node": "mixer", "epoch": 2, "what": "took-over", "why": "it was next" },
            { "at_s": 4.0, "node": "mixer", "epoch": 3, "what": "died" },
            { "at_s": 5.0, "node": "guidance", "epoch": 1, "what": "hung" },
            "nonsense", { "what": "died" },
        ]);
        Happenings::new(&faults, &events)
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
