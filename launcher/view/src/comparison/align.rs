//! Instants of flights that lie on each other on the time axis of a comparison.

use std::str::FromStr;

use anyhow::{Context, ensure};
use flight::duration::signed_seconds;
use flight::event::name;
use outcome::run_record::RunRecord;

/// Choice of the instant of each flight.
#[derive(Debug, Clone, PartialEq)]
pub enum Align {
    /// First event or fault of this kind at this node or target.
    Event { what: String, target: String },
    /// A time of each flight \[s\].
    Times(Vec<f64>),
}

impl FromStr for Align {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Some((what, target)) = text.split_once(':') {
            return Ok(Self::Event { what: what.into(), target: target.into() });
        }
        let times: Result<Vec<f64>, _> = text.split(',').map(signed_seconds).collect();
        times.map(Self::Times).map_err(|why| {
            format!(
                "give an event as WHAT:NODE, for example died:mixer, or a time of each run, for example 8s,12.5s: {why}"
            )
        })
    }
}

impl Align {
    /// Returns the instant of each flight \[s\].
    ///
    /// # Errors
    /// A flight has no such event, or the number of times is not that of the flights.
    pub fn zeros_s(&self, titles: &[String], runs: &[&RunRecord]) -> anyhow::Result<Vec<f64>> {
        match self {
            Self::Times(times) => {
                let (given, needed) = (times.len(), runs.len());
                ensure!(given == needed, "--align has {given} times for {needed} runs: give one for each");
                Ok(times.clone())
            }
            Self::Event { what, target } => {
                let first = |(title, run): (&String, &&RunRecord)| {
                    let instants = instants(run);
                    let same = instants.iter().filter(|(kind, of, _)| kind == what && of == target);
                    same.map(|(.., at_s)| *at_s).min_by(f64::total_cmp).with_context(|| {
                        format!("{title} has no {what}:{target} to align; it has {}", in_words(&instants))
                    })
                };
                titles.iter().zip(runs).map(first).collect()
            }
        }
    }

    /// Names the instant for people.
    pub fn describe(&self) -> String {
        match self {
            Self::Event { what, target } => format!("the first {what}:{target} of each flight"),
            Self::Times(times) => {
                let times: Vec<_> = times.iter().map(|time_s| format!("{time_s} s")).collect();
                format!("{} of the flights, in their order", times.join(", "))
            }
        }
    }
}

/// Kind, target and time \[s\] of every event and fault of a flight.
fn instants(run: &RunRecord) -> Vec<(String, String, f64)> {
    let events = run.events.iter().map(|timed| (name(timed.event.what), timed.event.node.clone(), timed.at_s));
    let faults = run.faults.iter();
    let faults = faults.filter_map(|fault| Some((name(fault.kind), fault.target.name().into(), fault.injected_at_s?)));
    events.chain(faults).collect()
}

fn in_words(instants: &[(String, String, f64)]) -> String {
    let mut all: Vec<String> = instants.iter().map(|(what, target, _)| format!("{what}:{target}")).collect();
    all.sort();
    all.dedup();
    if all.is_empty() { "no event and no fault: give a time of each run".into() } else { all.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_alignment_is_an_event_or_a_time_of_each_run() {
        assert_eq!("died:mixer".parse(), Ok(Align::Event { what: "died".into(), target: "mixer".into() }));
        assert_eq!("8s, 12.5s".parse(), Ok(Align::Times(vec![8.0, 12.5])));
        for text in ["died", "", "1s,x", "inf", "1"] {
            assert!(text.parse::<Align>().unwrap_err().contains("died:mixer"), "{text}");
        }
    }
}
