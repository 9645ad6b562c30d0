//! One `trefoil fly` with its kills.

use std::fs;
use std::path::Path;

use contract::message::State;
use flight::log;
use rustix::process::Signal;
use serde::Serialize;
use serde_json::Value;

use super::logged::{Kill, holes, sent_ns};
use super::plan::{Moment, PlannedKill, Victim};
use crate::killer::{Launcher, Process, left, said};

/// Duration of every flight \[s\].
pub const DURATION_S: f64 = 3.0;
/// Interval between two samples \[s\].
const SAMPLE_S: f64 = 0.01;

#[derive(Debug, Clone, Default, Serialize)]
pub struct KillFlight {
    /// Number of the flight; with the seed it determines the plan.
    pub flight: u64,
    /// Kills that reached a process, in order.
    pub kills: Vec<Kill>,
    /// Exit code of the launcher; `None` if it was killed.
    pub code: Option<i32>,
    /// Standard error of the launcher.
    pub said: String,
    /// Simulated time \[s\]; `None` if there is no run.json.
    pub flown_s: Option<f64>,
    pub diverged: bool,
    /// Largest distance from the trajectory \[m\].
    pub position_error_m: Option<f64>,
    /// Nodes given up because they died too often.
    pub given_up: Vec<String>,
    #[serde(skip)]
    pub end_ns: u64,
    /// Reason why the log cannot be read to its end.
    pub log_defect: Option<String>,
    /// Number of messages that are missing from the log, as run.json counts them.
    pub dropped: u64,
    /// Number of spans in which the log lacks states.
    pub holes: usize,
    /// Launcher killed: time until its last process was gone \[ms\].
    pub gone_ms: Option<f64>,
    /// Launcher killed: exit code of the next flight.
    pub next_code: Option<i32>,
    /// Shared memory and processes left in the end.
    pub left: Vec<String>,
}

impl KillFlight {
    /// Flies flight `number` with the kills of its `plan`.
    pub fn fly(number: u64, plan: &[PlannedKill], namespace: &str) -> anyhow::Result<Self> {
        let folder = tempfile::Builder::new().prefix(namespace).tempdir()?;
        let folder = folder.path();
        let start = |folder: &Path, duration_s: f64| {
            Launcher::start(namespace, folder, &["--set", &format!("run.duration_s={duration_s:?}")])
        };
        let mut launcher = start(folder, DURATION_S)?;
        let kills = kill_all(&mut launcher, plan);
        let mut row = Self { flight: number, ..Self::default() };
        match kills.last() {
            Some(kill) if kill.victim == Victim::Launcher => {
                row.gone_ms = launcher.until_gone(kill.at_ns)?;
                row.next_code = start(&folder.join("next"), 0.3)?.end();
            }
            _ => row.code = launcher.end(),
        }
        row.left = left(namespace);
        row.said = said(folder);
        row.read(&folder.join("run"), kills);
        Ok(row)
    }

    /// Reads run.json and the log; a flight that did not begin has neither.
    fn read(&mut self, run: &Path, kills: Vec<Kill>) {
        let text = fs::read_to_string(run.join("run.json")).unwrap_or_default();
        let json: Value = serde_json::from_str(&text).unwrap_or_default();
        self.flown_s = json["flown_s"].as_f64();
        self.diverged = json["diverged"] == true;
        self.position_error_m = json["metrics"]["max_position_error_m"].as_f64();
        let events = json["events"].as_array().into_iter().flatten();
        let given_up = events.filter(|event| event["what"] == "given-up").filter_map(|event| event["node"].as_str());
        self.given_up = given_up.map(str::to_owned).collect();
        let log = log::read(&run.join("flight.mcap"));
        self.log_defect = log.as_ref().map_or_else(|error| Some(format!("{error:#}")), |log| log.defect.clone());
        let log = log.unwrap_or_default();
        let unrecorded_s =
            |state: &State| self.flown_s.map_or(0.0, |flown_s| flown_s - state.stamp.tick as f64 * SAMPLE_S);
        let end_ns = |state: &State| sent_ns(state) + (unrecorded_s(state) * 1e9).round() as u64;
        self.end_ns = log.states.last().map_or(0, end_ns);
        let holes = holes(&log, self.end_ns);
        self.dropped = json["log"]["dropped"].as_u64().unwrap_or(0);
        self.holes = holes.len();
        self.kills = kills.into_iter().map(|kill| kill.completed(&log, &holes)).collect();
    }
}

/// Kills as planned until the flight ends, by itself or by the kill of a process without replacement.
fn kill_all(launcher: &mut Launcher, plan: &[PlannedKill]) -> Vec<Kill> {
    let mut kills: Vec<Kill> = vec![];
    for planned in plan {
        let last = kills.iter().rev().find(|kill| kill.victim == planned.victim).copied();
        kills.extend(kill(launcher, *planned, last));
        if launcher.has_ended() || kills.last().is_some_and(|kill| !kill.victim.is_replaced()) {
            break;
        }
    }
    kills
}

/// Kills the victim at its moment; `None` if it is not there. `last` is the last kill of the same node.
fn kill(launcher: &mut Launcher, planned: PlannedKill, last: Option<Kill>) -> Option<Kill> {
    let PlannedKill { victim, moment, after } = planned;
    let newest = |namespace: &str| Process::newest(namespace, &victim.name());
    let wait = match (moment, last) {
        (Moment::Starting, _) => after.saturating_sub(launcher.started.elapsed()),
        (Moment::Candidate, Some(last)) => {
            launcher.wait_for(|namespace| newest(namespace).filter(|process| process.epoch > last.epoch))?;
            after
        }
        _ => {
            launcher.wait_for_flight()?;
            after
        }
    };
    std::thread::sleep(wait);
    let process = launcher.wait_for(newest)?;
    let at_ns = process.signal(&launcher.namespace, Signal::KILL)?;
    Some(Kill::new(victim, process.epoch, moment, at_ns))
}
