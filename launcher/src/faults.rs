//! What came of each `[[fault]]`: the `faults` section of run.json.
//!
//! ```text
//! injected    the first tick it struck
//! detected    the first tick from then on whose message shows the harm
//! recovered   the first tick after the fault's end, and after the detection, whose message shows none
//! ```
//!
//! Only messages are looked at, of each fault those that its target sends: their order between topics does not matter.
//! A tick that nobody saw counts as the next one seen.

use contract::message::SolveStatus;
use contract::scenario::{Fault, FaultTarget};
use serde::Serialize;
use serde_json::{Value, json};

use crate::log::Record;

/// All faults of a flight.
pub struct Faults(Vec<Watched>);

/// One fault, and the ticks on which something became of it.
struct Watched {
    rate_hz: u32,
    fault: Fault,
    injected: Option<u64>,
    ended: Option<u64>,
    detected: Option<u64>,
    recovered: Option<u64>,
}

/// What a message shows of its sender.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Condition {
    Sound,
    Harmed,
}

impl Faults {
    /// The faults of a scenario, none of which has struck yet.
    pub fn new(faults: &[Fault], rate_hz: u32) -> Self {
        let watch = |fault: &Fault| Watched {
            rate_hz,
            fault: fault.clone(),
            injected: None,
            ended: None,
            detected: None,
            recovered: None,
        };
        Self(faults.iter().map(watch).collect())
    }

    /// Takes one message in.
    pub fn observe(&mut self, record: &Record) {
        for watched in &mut self.0 {
            if let Some(condition) = condition(watched.fault.target, record) {
                watched.observe(record.stamp().tick, condition);
            }
        }
    }

    /// The `faults` array of run.json.
    pub fn to_json(&self) -> Value {
        self.0.iter().map(Watched::to_json).collect()
    }

    /// One line for people on each.
    pub fn describe(&self) -> Vec<String> {
        self.0.iter().map(Watched::describe).collect()
    }
}

/// What `record` says of `target`; nothing when another node sent it.
fn condition(target: FaultTarget, record: &Record) -> Option<Condition> {
    match (target, record) {
        (FaultTarget::Mpc, Record::Controls(controls)) => {
            Some(if [SolveStatus::Explicit, SolveStatus::Solved].iter().any(|sound| *sound as u64 == controls.status) {
                Condition::Sound
            } else {
                Condition::Harmed
            })
        }
        _ => None,
    }
}

impl Watched {
    fn observe(&mut self, tick: u64, condition: Condition) {
        let strikes = self.fault.strikes(tick, 1.0 / f64::from(self.rate_hz));
        if strikes {
            self.injected.get_or_insert(tick);
        }
        if self.injected.is_none() {
            return;
        }
        if !strikes {
            self.ended.get_or_insert(tick);
        }
        match condition {
            Condition::Harmed => {
                self.detected.get_or_insert(tick);
            }
            Condition::Sound if self.ended.is_some() && self.detected.is_some() => {
                self.recovered.get_or_insert(tick);
            }
            Condition::Sound => {}
        }
    }

    /// Ticks as time \[s\], to the nearest number, so that it prints as short as it is.
    fn seconds(&self, ticks: u64) -> f64 {
        ticks as f64 / f64::from(self.rate_hz)
    }

    fn detected_after_s(&self) -> Option<f64> {
        Some(self.seconds(self.detected?.saturating_sub(self.injected?)))
    }

    fn recovered_after_s(&self) -> Option<f64> {
        Some(self.seconds(self.recovered?.saturating_sub(self.ended?)))
    }

    fn to_json(&self) -> Value {
        json!({
            "target": self.fault.target,
            "kind": self.fault.kind,
            "at_s": self.fault.at_s,
            "for_s": self.fault.for_s,
            "injected_at_s": self.injected.map(|tick| self.seconds(tick)),
            "detected_after_s": self.detected_after_s(),
            "recovered_after_s": self.recovered_after_s(),
        })
    }

    fn describe(&self) -> String {
        let what = format!("{} {}", name(self.fault.target), name(self.fault.kind));
        let Some(injected) = self.injected else {
            return format!("{what} at {} s: never struck", self.fault.at_s);
        };
        let lasts = self.fault.for_s.map_or("to the end".into(), |for_s| format!("for {for_s} s"));
        let after = |what: &str, time_s: Option<f64>| {
            time_s.map_or(format!("not {what}"), |time_s| format!("{what} after {time_s:.2} s"))
        };
        format!(
            "{what} from {:.2} s {lasts}: {}, {}",
            self.seconds(injected),
            after("detected", self.detected_after_s()),
            after("recovered", self.recovered_after_s()),
        )
    }
}

/// A target or kind as the scenario file spells it.
fn name(word: impl Serialize) -> String {
    json!(word).as_str().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::message::{Controls, Message, State};
    use contract::scenario::FaultKind;

    /// A solver fault at 0.1 s, after CONTROLS of these statuses, one per tick from 0 on.
    fn flown(for_s: Option<f64>, statuses: &[SolveStatus]) -> Faults {
        let fault = Fault::new(FaultTarget::Mpc, FaultKind::IterationCap, 0.1, for_s);
        let mut faults = Faults::new(&[fault], 100);
        for (tick, status) in statuses.iter().enumerate() {
            faults.observe(&at(tick as u64, State::default()).into());
            faults.observe(&at(tick as u64, Controls { status: *status as u64, ..Controls::default() }).into());
        }
        faults
    }

    fn at<M: Message>(tick: u64, mut message: M) -> M {
        message.stamp_mut().tick = tick;
        message
    }

    /// Statuses in runs: so many ticks of each.
    fn runs(runs: &[(usize, SolveStatus)]) -> Vec<SolveStatus> {
        runs.iter().flat_map(|(count, status)| std::iter::repeat_n(*status, *count)).collect()
    }

    #[test]
    fn a_fault_is_followed_from_its_first_tick_to_the_recovery() {
        use SolveStatus::{Explicit, Fallback, LimitReached, Solved};
        // Struck on ticks 10 to 12, seen from 11, healthy again on 15.
        let statuses = runs(&[(10, Explicit), (1, Solved), (2, LimitReached), (2, Fallback), (20, Explicit)]);
        let faults = flown(Some(0.03), &statuses);
        let expected = json!([{
            "target": "mpc", "kind": "iteration cap", "at_s": 0.1, "for_s": 0.03,
            "injected_at_s": 0.1, "detected_after_s": 0.01, "recovered_after_s": 0.02,
        }]);
        assert_eq!(faults.to_json(), expected);
        let line = "mpc iteration cap from 0.10 s for 0.03 s: detected after 0.01 s, recovered after 0.02 s";
        assert_eq!(faults.describe(), [line]);
    }

    #[test]
    fn harm_before_the_fault_is_not_its_doing() {
        use SolveStatus::{BadInput, Explicit, Fallback};
        let faults = flown(Some(0.02), &runs(&[(5, BadInput), (5, Explicit), (2, Fallback), (5, Explicit)]));
        let json = &faults.to_json()[0];
        assert_eq!([&json["detected_after_s"], &json["recovered_after_s"]], [0.0, 0.0]);
    }

    #[test]
    fn a_good_tick_within_the_fault_is_no_recovery() {
        use SolveStatus::{Explicit, Fallback, Solved};
        let faults =
            flown(Some(0.03), &runs(&[(10, Explicit), (1, Fallback), (1, Solved), (2, Fallback), (1, Solved)]));
        assert_eq!(faults.to_json()[0]["recovered_after_s"], 0.01);
    }

    #[test]
    fn what_is_detected_after_the_end_recovers_after_the_detection() {
        use SolveStatus::{Explicit, Fallback};
        let faults = flown(Some(0.01), &runs(&[(13, Explicit), (1, Fallback), (3, Explicit)]));
        let json = &faults.to_json()[0];
        assert_eq!([&json["detected_after_s"], &json["recovered_after_s"]], [0.03, 0.03]);
    }

    #[test]
    fn what_never_happened_is_null() {
        use SolveStatus::{Explicit, Fallback};
        let keys = ["injected_at_s", "detected_after_s", "recovered_after_s"];
        let of = |faults: &Faults| keys.map(|key| faults.to_json()[0][key].as_f64());
        let early_end = flown(Some(0.01), &runs(&[(10, Explicit)]));
        assert_eq!(of(&early_end), [None; 3]);
        assert_eq!(early_end.describe(), ["mpc iteration cap at 0.1 s: never struck"]);
        let endless = flown(None, &runs(&[(10, Explicit), (20, Fallback), (20, Explicit)]));
        assert_eq!(of(&endless), [Some(0.1), Some(0.0), None]);
        let line = "mpc iteration cap from 0.10 s to the end: detected after 0.00 s, not recovered";
        assert_eq!(endless.describe(), [line]);
        let harmless = flown(Some(0.05), &runs(&[(30, Explicit)]));
        assert_eq!(of(&harmless), [Some(0.1), None, None]);
        let empty = flown(Some(0.0), &runs(&[(30, Fallback)]));
        assert_eq!(of(&empty), [None; 3]);
    }

    #[test]
    fn missed_ticks_count_as_the_next_one_seen() {
        let fault = Fault::new(FaultTarget::Mpc, FaultKind::Nan, 0.1, Some(0.05));
        let mut faults = Faults::new(&[fault], 100);
        for (tick, status) in [(9, SolveStatus::Explicit), (12, SolveStatus::Fallback), (20, SolveStatus::Solved)] {
            faults.observe(&at(tick, Controls { status: status as u64, ..Controls::default() }).into());
        }
        let json = &faults.to_json()[0];
        assert_eq!([&json["injected_at_s"], &json["detected_after_s"], &json["recovered_after_s"]], [0.12, 0.0, 0.0]);
    }
}
