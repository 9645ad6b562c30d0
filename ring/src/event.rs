//! Events of the processes of a flight.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
pub use settings::word as name;
use settings::{Fault, FaultKind, FaultTarget};

use crate::limits::REASON_CHARS;

/// One event of a process, of a fault, or of the files around the processes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Event {
    /// Tick of the plant at the event; for the recorder, when the launcher noticed the event.
    #[serde(default)]
    pub tick: u64,
    /// Publisher of a topic, `recorder` or `launcher`; the target of a fault; `host` for files in shared memory.
    pub node: String,
    /// Epoch of the process, from 1; 0 if there is none.
    pub epoch: u32,
    /// Kind of the event.
    pub what: What,
    /// Reason, if one is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub why: Option<String>,
    /// Index of the swap that begins with this event, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swap: Option<usize>,
    /// Index of the swap whose program and settings the started process uses, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub origin: Option<usize>,
    /// Sender of the command, if a command in flight caused the event.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub by: Option<Sender>,
    /// Fault given or ended in flight: its number, and its settings from then on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<Box<(usize, Fault)>>,
}

/// Event with the time of the flight, as in run.json and in the answers of the launcher.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TimedEvent {
    /// Time of the tick \[s\].
    pub at_s: f64,
    /// `true` if the process that started had no memory of the process before it; known when the flight is over.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cold: bool,
    #[serde(flatten)]
    pub event: Event,
}

impl TimedEvent {
    /// Adds the time to `events` of a flight at `rate_hz`.
    pub fn all<'a>(events: impl IntoIterator<Item = &'a Event>, rate_hz: u32) -> Vec<Self> {
        let timed =
            |event: &Event| Self { at_s: event.tick as f64 / f64::from(rate_hz), cold: false, event: event.clone() };
        events.into_iter().map(timed).collect()
    }

    /// Describes the event in words; a fault given in flight with kind, size and duration.
    pub fn what(&self) -> String {
        let what = name(self.event.what).replace('-', " ");
        let fault = self.event.fault.as_ref().filter(|_| self.event.what == What::Injected);
        let fault = fault.map_or(String::new(), |fault| {
            let (_, fault) = &**fault;
            let size = size_in_words(fault).map_or(String::new(), |size| format!(" {size}"));
            let duration = fault.for_s.map_or(String::new(), |for_s| format!(" for {for_s} s"));
            format!(" {}{size}{duration}", name(fault.kind))
        });
        what + &fault + if self.cold { " cold" } else { "" }
    }
}

/// Process that sent a command to a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Sender {
    /// Process id; 0 if the launcher cannot see the process.
    pub pid: i32,
    /// User id.
    pub user: u32,
}

/// Kinds of events.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum What {
    /// The process ended without being asked to.
    Died,
    /// The process made no progress, or exchanged no messages, and is killed. A launcher without messages is not.
    Hung,
    /// The process was started.
    Started,
    /// The process could not be started.
    NotStarted,
    /// The process became active.
    TookOver,
    /// The node is not started again.
    GivenUp,
    /// The candidate works on standby.
    OnStandby,
    /// The candidate was ended before it became active.
    Rejected,
    /// The candidate stays active: its trial is over.
    Kept,
    /// The candidate was ended after it had become active; the process before it is active again.
    Returned,
    /// A fault was given to a node, a topic or a part of the vehicle.
    Injected,
    /// A fault given in flight was ended.
    Cleared,
    /// A file of a living process was removed from shared memory.
    ShmRemoved,
    /// A file of a living process in shared memory was cut short.
    ShmCutShort,
}

impl Event {
    pub fn new(tick: u64, node: &str, epoch: u32, what: What) -> Self {
        Self { tick, node: node.into(), epoch, what, why: None, swap: None, origin: None, by: None, fault: None }
    }

    #[must_use]
    pub fn because(self, why: impl AsRef<str>) -> Self {
        Self { why: Some(why.as_ref().chars().take(REASON_CHARS).collect()), ..self }
    }

    /// Marks the event as the beginning of swap number `swap`; `None` = no swap.
    #[must_use]
    pub fn begins(self, swap: Option<usize>) -> Self {
        Self { swap, ..self }
    }
}

/// Returns the size of a fault in words, with its unit; `None` if no size was given.
pub fn size_in_words(fault: &Fault) -> Option<String> {
    use FaultTarget as T;
    let unit = match fault.target {
        _ if fault.kind == FaultKind::Mass => " kg",
        T::Position | T::Height => " m",
        T::Velocity | T::Flow => " m/s",
        T::Acceleration => " m/s2",
        T::Attitude => " deg",
        T::Rates => " deg/s",
        _ => "",
    };
    let vector = |[north, east, down]: [f64; 3]| format!("({north}, {east}, {down}) m/s");
    let words = [
        fault.process.map(|process| process.name().to_owned()),
        fault.how.map(name),
        fault.value.map(|value| format!("{value}{unit}")),
        fault.vector.map(vector),
        fault.ms.map(|ms| format!("{ms} ms")),
        fault.probability.map(|share| format!("{} %", (share * 1e4).round() / 1e2)),
        fault.count.map(|count| format!("×{count}")),
    ];
    let words: Vec<String> = words.into_iter().flatten().collect();
    (!words.is_empty()).then(|| words.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_injection_says_what_was_injected() {
        let mut fault = Fault::new(FaultTarget::Controls, FaultKind::Drop, 2.0, Some(1.5));
        let injected = |fault| TimedEvent {
            at_s: 2.0,
            cold: false,
            event: Event { fault: Some(Box::new((0, fault))), ..Event::new(200, "controls", 0, What::Injected) },
        };
        assert_eq!(injected(fault).what(), "injected drop for 1.5 s");
        fault.probability = Some(0.3);
        assert_eq!(injected(fault).what(), "injected drop 30 % for 1.5 s");
        let gust =
            Fault { vector: Some([3.0, 0.0, -1.0]), ..Fault::new(FaultTarget::Wind, FaultKind::Gust, 0.0, None) };
        assert_eq!(size_in_words(&gust).as_deref(), Some("(3, 0, -1) m/s"));
        let noise = Fault { value: Some(0.1), ..Fault::new(FaultTarget::Position, FaultKind::Noise, 0.0, None) };
        assert_eq!(size_in_words(&noise).as_deref(), Some("0.1 m"));
    }

    #[test]
    fn an_event_without_a_reason_has_no_field_for_it() {
        let event = Event::new(5, "mixer", 2, What::TookOver);
        let plain = serde_json::to_string(&event).unwrap();
        assert_eq!(plain, r#"{"tick":5,"node":"mixer","epoch":2,"what":"took-over"}"#);
        let reasoned = serde_json::to_value(event.because("too slow")).unwrap();
        assert_eq!(reasoned["why"], "too slow");
    }
}
