//! One `launcher fly` through its kills.

use std::fs::{self, File};
use std::path::Path;
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Topic;
use contract::message::State;
use flight::log;
use flight::own_program;
use runtime::realtime::now_ns;
use rustix::process::Signal;
use serde::Serialize;
use serde_json::Value;

use super::logged::{Kill, contains, holes, sent_ns};
use super::plan::{Moment, PlannedKill, Victim};
use crate::killer::{Process, left, milliseconds, page};

/// How long every flight is \[s\].
pub const DURATION_S: f64 = 3.0;
/// Between two samples \[s\].
const SAMPLE_S: f64 = 0.01;
/// Longest wait for a victim to be there: longer than any delay of a restart.
const PATIENCE: Duration = Duration::from_secs(1);
/// A flight that takes longer on the wall clock is killed.
const WATCHDOG: Duration = Duration::from_secs(30);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(1);

#[derive(Debug, Clone, Default, Serialize)]
pub struct KillFlight {
    /// Number of the flight: with the seed it gives the plan.
    pub flight: u64,
    /// The kills that reached a process, in order.
    pub kills: Vec<Kill>,
    /// Exit code of the launcher; `None` when it was killed.
    pub code: Option<i32>,
    /// The standard error of the launcher.
    pub said: String,
    /// Simulated time \[s\]; `None` when there is no run.json.
    pub flown_s: Option<f64>,
    pub diverged: bool,
    /// Largest distance from the trajectory \[m\].
    pub position_error_m: Option<f64>,
    /// Nodes that died too often.
    pub given_up: Vec<String>,
    #[serde(skip)]
    pub end_ns: u64,
    /// Why the log cannot be read to its end.
    pub log_defect: Option<String>,
    /// Holes in the log that no killed recorder explains.
    pub holes: usize,
    /// Launcher killed: until its last process was gone \[ms\].
    pub gone_ms: Option<f64>,
    /// Launcher killed: exit code of the next flight.
    pub next_code: Option<i32>,
    /// What was left in the end: shared memory and processes.
    pub left: Vec<String>,
}

impl KillFlight {
    /// Flies flight `number` with the kills of its `plan`.
    pub fn fly(number: u64, plan: &[PlannedKill], namespace: &str) -> anyhow::Result<Self> {
        let folder = tempfile::Builder::new().prefix(namespace).tempdir()?;
        let folder = folder.path();
        let mut launcher = Launcher::start(namespace, folder, DURATION_S)?;
        let kills = launcher.kill_all(plan);
        let mut row = Self { flight: number, ..Self::default() };
        if kills.last().is_some_and(|kill| kill.victim == Victim::Launcher) {
            launcher.child.wait()?;
            row.gone_ms = launcher.until_gone(kills.last().map_or(0, |kill| kill.at_ns));
            row.next_code =
                Launcher::start(namespace, &folder.join("next"), 0.3)?.end().and_then(|status| status.code());
        } else {
            row.code = launcher.end().and_then(|status| status.code());
        }
        row.left = left(namespace);
        row.said = fs::read_to_string(folder.join("stderr")).unwrap_or_default();
        row.read(&folder.join("run"), kills);
        Ok(row)
    }

    /// Reads what the flight wrote; a flight that did not begin wrote nothing.
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
        let recorders = kills.iter().filter(|kill| kill.victim == Victim::Recorder);
        let deaths_ns: Vec<u64> = recorders.map(|kill| kill.at_ns).collect();
        let holes = holes(&log, self.end_ns);
        let unexplained = |hole: &&(u64, u64)| !deaths_ns.iter().any(|at_ns| contains(hole, *at_ns));
        self.holes = holes.iter().filter(unexplained).count();
        self.kills = kills.into_iter().map(|kill| kill.completed(&log, &holes, &deaths_ns)).collect();
    }
}

/// A launcher that flies.
struct Launcher<'a> {
    namespace: &'a str,
    child: Child,
    started: Instant,
}

impl<'a> Launcher<'a> {
    /// The run is written to `run` in `folder`, standard error to `stderr`.
    fn start(namespace: &'a str, folder: &Path, duration_s: f64) -> anyhow::Result<Self> {
        let cannot = || format!("cannot write to {}", folder.display());
        fs::create_dir_all(folder).with_context(cannot)?;
        let stderr = File::create(folder.join("stderr")).with_context(cannot)?;
        let mut command = own_program();
        command.args(["fly", "--namespace", namespace, "--set", &format!("run.duration_s={duration_s:?}")]);
        command.arg("--out").arg(folder.join("run")).stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        Ok(Self { namespace, started: Instant::now(), child: command.spawn().context("cannot start a flight")? })
    }

    /// Kills as planned until the flight ends, by itself or because a process was killed that is not replaced.
    fn kill_all(&mut self, plan: &[PlannedKill]) -> Vec<Kill> {
        let mut kills: Vec<Kill> = vec![];
        for planned in plan {
            let last = kills.iter().rev().find(|kill| kill.victim == planned.victim).copied();
            kills.extend(self.kill(*planned, last));
            if self.has_ended() || kills.last().is_some_and(|kill| !kill.victim.is_replaced()) {
                break;
            }
        }
        kills
    }

    /// Kills the victim at its moment, if it is there; `last` is the last kill of the same node.
    fn kill(&mut self, PlannedKill { victim, moment, after }: PlannedKill, last: Option<Kill>) -> Option<Kill> {
        let (namespace, name) = (self.namespace, victim.name());
        match (moment, last) {
            (Moment::Starting, _) => std::thread::sleep(after.saturating_sub(self.started.elapsed())),
            (Moment::Candidate, Some(last)) => {
                self.wait_for(|| Process::newest(namespace, name).filter(|process| process.epoch > last.epoch))?;
                std::thread::sleep(after);
            }
            _ => {
                self.wait_for(|| flies(namespace).then_some(()))?;
                std::thread::sleep(after);
            }
        }
        let process = self.wait_for(|| Process::newest(namespace, name))?;
        let at_ns = process.signal(namespace, Signal::KILL)?;
        Some(Kill::new(victim, process.epoch, moment, at_ns))
    }

    /// Calls `look` until it finds something, the flight ends, or [`PATIENCE`] is over.
    fn wait_for<T>(&mut self, look: impl Fn() -> Option<T>) -> Option<T> {
        let deadline = Instant::now() + PATIENCE;
        loop {
            let found = look();
            if found.is_some() || self.has_ended() || Instant::now() > deadline {
                return found;
            }
            std::thread::sleep(LOOK);
        }
    }

    fn has_ended(&mut self) -> bool {
        self.child.try_wait().is_ok_and(|status| status.is_some())
    }

    /// How it ended by itself; `None` when it had to be killed.
    fn end(mut self) -> Option<ExitStatus> {
        while self.started.elapsed() < WATCHDOG {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    /// Time from `since_ns` until the last process of the namespace is gone \[ms\]; `None` when one stays.
    fn until_gone(&self, since_ns: u64) -> Option<f64> {
        let deadline = Instant::now() + PATIENCE * 5;
        while !Process::all(self.namespace).is_empty() {
            if Instant::now() > deadline {
                return None;
            }
            std::thread::sleep(LOOK);
        }
        Some(milliseconds(now_ns() - since_ns))
    }
}

impl Drop for Launcher<'_> {
    fn drop(&mut self) {
        // It has ended already, except after an error. Its processes end with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Whether the plant of `namespace` has sent a sample.
fn flies(namespace: &str) -> bool {
    page(namespace).is_some_and(|page| page.role(Topic::State).done(1).get() > 0)
}
