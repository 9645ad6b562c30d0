//! Whether a log is all of its flight: closed, without gaps, and with what run.json tells of it.
//!
//! A log alone cannot tell that: one that was cut and closed again, or thinned at its end, is well-formed. run.json
//! was written by the launcher, which counted the records and hashed the states itself.

use std::path::Path;

use contract::Scenario;
use flight::log::Log;
use serde_json::Value;

use crate::summary::Summary;

/// For people: why the `log` at `path` is not all of the flight; `None` if it is. `run` is run.json, if there is one.
pub fn missing(path: &Path, log: &Log, scenario: &Scenario, run: Option<&Value>) -> Option<String> {
    let summary = Summary::of(log, scenario);
    let unlike = match run {
        Some(run) => unlike_summary(log, run, &summary),
        None => vec!["there is no run.json to say where the flight ended".into()],
    };
    let why: Vec<String> = log.defect.iter().cloned().chain(unlike).collect();
    let lost = summary.missed();
    if why.is_empty() && lost == 0 {
        return None;
    }
    let why = if why.is_empty() { "there are gaps in it".into() } else { why.join("; ") };
    let read = match log.states.last() {
        None => "it has no message of the plant".into(),
        Some(last) => {
            let last_s = last.stamp.tick as f64 * scenario.sample_s();
            let flown = run.and_then(|run| run["flown_s"].as_f64());
            let of = flown.map_or(String::new(), |flown_s| format!(" of {flown_s:.2} s"));
            format!("what was read ends at {last_s:.2} s{of}, {lost} messages before that are missing")
        }
    };
    Some(format!("the log {} is not whole ({why}): {read}", path.display()))
}

/// What run.json tells and the log does not have.
fn unlike_summary(log: &Log, run: &Value, summary: &Summary) -> Vec<String> {
    let messages = log.states.len() + log.references.len() + log.controls.len() + log.actuators.len();
    let records = (messages + log.events.len()) as u64;
    let mut why = vec![];
    match run["log"]["records"].as_u64() {
        Some(written) if written == records => {}
        Some(written) => why.push(format!("it has {records} records, and run.json tells of {written}")),
        None => why.push("run.json tells of no log".into()),
    }
    match run["log"]["dropped"].as_u64() {
        Some(0) | None => {}
        Some(dropped) => why.push(format!("{dropped} records were lost before they could be written")),
    }
    why.extend(run["log"]["error"].as_str().map(str::to_owned));
    let hash = run["state_hash"].as_str();
    if hash.is_some() && summary.state_hash().as_deref() != hash {
        why.push("its states have another hash than run.json's".into());
    }
    why
}
