//! Happenings of a flight: its faults, its events, times when a node was without a process, and its phases.

use contract::Topic;
use contract::topic::NODES;
use flight::event::{TimedEvent, What};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{FaultKind, FaultTarget};

use crate::faults::FaultRecord;

/// Faults, events, absences and phases of one flight. Times are simulated \[s\].
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Happenings {
    pub faults: Vec<Span>,
    pub events: Vec<Mark>,
    /// Spans from the death of an active process until the next one took over.
    pub absences: Vec<Span>,
    /// Take-off, flight and landing; empty without a ground.
    pub phases: Vec<Span>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Span {
    /// Number of a fault in run.json, counted from 1; 0 for an absence or a phase.
    pub number: usize,
    /// Target of a fault, or node of an absence.
    #[serde(skip)]
    pub target: String,
    pub what: String,
    pub from_s: f64,
    /// End of the span, equal to `from_s` for a moment; `None` if the flight ended first.
    pub to_s: Option<f64>,
    /// `true` for each node whose cycles the span can delay, by topic.
    #[serde(skip)]
    delays: [bool; Topic::COUNT],
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Mark {
    pub at_s: f64,
    pub node: String,
    pub what: String,
    pub why: Option<String>,
    /// `true` for an order given in flight, which is among the faults too.
    #[serde(skip)]
    is_order: bool,
}

/// Phase of take-off or landing, and the time of its first sample.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Phase {
    /// Time of its first sample \[s\].
    pub at_s: f64,
    /// Name of the phase.
    pub phase: String,
}

impl Happenings {
    pub fn new(faults: &[FaultRecord], events: &[TimedEvent]) -> Self {
        let mut marks: Vec<Mark> = events.iter().map(Mark::of).collect();
        marks.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
        Self {
            faults: faults.iter().zip(1..).filter_map(|(fault, number)| Span::of_fault(fault, number)).collect(),
            events: marks,
            absences: Topic::ALL.into_iter().flat_map(|topic| absences(topic, events)).collect(),
            phases: vec![],
        }
    }

    /// Adds the phases of take-off and landing.
    #[must_use]
    pub fn with_phases(self, phases: &[Phase]) -> Self {
        let span = |(i, phase): (usize, &Phase)| Span {
            what: phase.phase.clone(),
            to_s: phases.get(i + 1).map(|next| next.at_s),
            ..Span::at(phase.at_s)
        };
        Self { phases: phases.iter().enumerate().map(span).collect(), ..self }
    }

    /// Returns what had happened by `time_s`: a span that ends later has no end.
    #[must_use]
    pub fn until(&self, time_s: f64) -> Self {
        let begun = |spans: &[Span]| {
            let spans = spans.iter().filter(|span| span.from_s <= time_s).cloned();
            spans.map(|span| Span { to_s: span.to_s.filter(|end_s| *end_s <= time_s), ..span }).collect()
        };
        let events = self.events.iter().filter(|mark| mark.at_s <= time_s).cloned().collect();
        Self { faults: begun(&self.faults), events, absences: begun(&self.absences), phases: begun(&self.phases) }
    }

    /// Returns the times at which something began or ended, in order \[s\].
    pub fn times_s(&self) -> Vec<f64> {
        let spans = self.faults.iter().chain(&self.absences).chain(&self.phases);
        let spans = spans.flat_map(|span| [Some(span.from_s), span.to_s]).flatten();
        let mut all: Vec<f64> = self.events.iter().map(|mark| mark.at_s).chain(spans).collect();
        all.sort_by(f64::total_cmp);
        all
    }

    /// Returns the time until which a span can delay cycles \[s\]: its end, or for a moment that took a node down, the
    /// end of that absence. `None` if there is no such end.
    fn acts_until_s(&self, span: &Span) -> Option<f64> {
        let is_consequence =
            |absence: &&Span| absence.target == span.target && absence.from_s >= span.from_s && span.is_moment();
        self.absences.iter().find(is_consequence).map_or(span.to_s.filter(|_| !span.is_moment()), |down| down.to_s)
    }

    /// Finds the possible causes of a delay of `topic` between two times \[s\]: faults, absences and events.
    pub fn causes(&self, topic: Topic, from_s: f64, to_s: f64) -> [Vec<String>; 3] {
        let spans = |all: &[Span]| -> Vec<String> {
            let during =
                |span: &&Span| span.from_s <= to_s && self.acts_until_s(span).is_none_or(|end_s| end_s > from_s);
            all.iter().filter(|span| span.delays[topic as usize]).filter(during).map(Span::describe).collect()
        };
        // Deaths, starts and take-overs of a node's processes count; orders given by hand are among the faults.
        let concerns_a_node = |mark: &&Mark| NODES.contains(&mark.node.as_str()) && !mark.is_order;
        let then = self.events.iter().filter(|mark| mark.at_s >= from_s && mark.at_s <= to_s);
        [spans(&self.faults), spans(&self.absences), then.filter(concerns_a_node).map(Mark::describe).collect()]
    }
}

impl Span {
    /// Makes a nameless span that begins at `from_s` and has no end.
    pub fn at(from_s: f64) -> Self {
        let (number, target, what, to_s, delays) = Default::default();
        Self { number, target, what, from_s, to_s, delays }
    }

    /// Returns whether the span is a moment, as the kill of a process is.
    pub fn is_moment(&self) -> bool {
        self.to_s == Some(self.from_s)
    }

    pub fn describe(&self) -> String {
        match self.to_s {
            Some(_) if self.is_moment() => format!("{} at {:.2} s", self.what, self.from_s),
            Some(to_s) => format!("{}, {:.2} to {to_s:.2} s", self.what, self.from_s),
            None => format!("{}, from {:.2} s", self.what, self.from_s),
        }
    }

    /// Returns the span in which a fault acted; `None` if it never did.
    fn of_fault(fault: &FaultRecord, number: usize) -> Option<Self> {
        let FaultRecord { target, kind, injected_at_s, .. } = *fault;
        Some(Self {
            number,
            target: target.name().into(),
            what: fault.what(),
            from_s: injected_at_s?,
            to_s: fault.until_s(),
            delays: delays(target, kind),
        })
    }
}

impl Mark {
    fn of(timed: &TimedEvent) -> Self {
        let TimedEvent { at_s, event, .. } = timed;
        let is_order = matches!(event.what, What::Injected | What::Cleared);
        Self { at_s: *at_s, node: event.node.clone(), what: timed.what(), why: event.why.clone(), is_order }
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
        T::Mpc => topic == Topic::Controls,
        T::Clock | T::Host => true,
        target => match (target.process(), target.topic()) {
            (Some(process), _) => topic == process || kind == FaultKind::Hog,
            (None, Some(sent)) => sent.listeners().contains(&topic),
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
                spans.push(Span { target, what, delays: [true; Topic::COUNT], ..Span::at(*at_s) });
            }
            _ => {}
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;
    use flight::event::Event;
    use settings::Fault;

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
        assert_eq!(faults, ["controls drop, 1.50 to 2.50 s", "mixer kill at 2.00 s"]);
        assert_eq!(absences, ["mixer was down, 2.00 to 2.03 s"]);
        assert_eq!([&events[0], &events[2]], ["mixer died at 2.00 s", "mixer took over at 2.03 s (it was next)"]);
    }

    #[test]
    fn a_fault_of_the_vehicle_or_of_another_node_delays_no_cycle() {
        assert_eq!(flown().causes(Topic::Reference, 1.6, 1.9).concat(), Vec::<String>::new());
    }

    #[test]
    fn a_kill_is_a_moment_that_delays_cycles_until_the_next_process_is_active() {
        assert!(flown().faults[2].is_moment());
        assert_eq!(flown().causes(Topic::Actuators, 2.01, 2.02)[0].len(), 2);
        assert_eq!(flown().causes(Topic::Actuators, 2.6, 2.9).concat(), Vec::<String>::new());
    }

    #[test]
    fn by_a_time_a_span_that_goes_on_has_no_end() {
        let all = flown();
        let told = |time_s: f64| {
            let by = all.until(time_s);
            let spans = by.faults.iter().chain(&by.absences).map(Span::describe).collect::<Vec<_>>();
            (spans, by.events.len())
        };
        assert_eq!(told(0.5), (vec![], 0));
        assert_eq!(
            told(2.0),
            (
                vec![
                    "wind gust, from 1.00 s".into(),
                    "controls drop, from 1.50 s".into(),
                    "mixer kill at 2.00 s".into(),
                    "mixer was down, from 2.00 s".into(),
                ],
                2
            )
        );
        assert_eq!(all.until(f64::INFINITY), all);
        let times_s = all.times_s();
        assert!(times_s.is_sorted() && times_s.first() == Some(&1.0) && times_s.last() == Some(&9.0), "{times_s:?}");
    }

    #[test]
    fn a_phase_lasts_until_the_next_one() {
        let phase = |at_s, phase: &str| Phase { at_s, phase: phase.into() };
        let phases = Happenings::default().with_phases(&[phase(0.0, "standing"), phase(1.5, "in flight")]).phases;
        assert_eq!(
            [&phases[0], &phases[1]].map(Span::describe),
            ["standing, 0.00 to 1.50 s", "in flight, from 1.50 s"]
        );
    }

    #[test]
    fn the_death_of_a_candidate_is_no_absence() {
        let told: Vec<_> = flown().absences.iter().map(Span::describe).collect();
        assert_eq!(told, ["guidance was down, from 5.00 s", "mixer was down, 2.00 to 2.03 s"]);
    }
}
