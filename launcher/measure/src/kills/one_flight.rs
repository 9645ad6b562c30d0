//! One `launcher fly` through its kills, and what was seen of it.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::Topic;
use contract::message::State;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::Signal;
use serde::Serialize;
use serde_json::Value;

use super::draw::{Blow, Moment, Victim};
use super::logged::{contains, holes, sent_ns};
use crate::processes::{Process, left};
use flight::log;
use flight::own_program;

/// How long every flight is \[s\].
pub const DURATION_S: f64 = 3.0;
/// Between two samples \[s\].
const SAMPLE_S: f64 = 0.01;
/// For a process to be there that is to be killed: longer than any wait before a new start.
const PATIENCE: Duration = Duration::from_secs(1);
/// A flight that takes longer on the wall clock does not end by itself.
const WATCHDOG: Duration = Duration::from_secs(30);
/// Between two looks.
const LOOK: Duration = Duration::from_millis(1);

/// One flight, flown.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Row {
    /// Its number: with the seed, its plan.
    pub flight: u64,
    /// The kills that reached somebody, in order.
    pub kills: Vec<Kill>,
    /// Exit code of the launcher; nothing when it was killed.
    pub code: Option<i32>,
    /// What the launcher said.
    pub said: String,
    /// How far it flew \[s\]; nothing when it left no run.json.
    pub flown_s: Option<f64>,
    /// Whether the vehicle was lost.
    pub diverged: bool,
    /// Largest distance from the trajectory \[m\].
    pub position_error_m: Option<f64>,
    /// Nodes that died too often.
    pub given_up: Vec<String>,
    /// When the flight ended \[ns\].
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
    /// What was left in the end, in shared memory and of processes.
    pub left: Vec<String>,
}

/// One process killed.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Kill {
    /// Who.
    pub victim: Victim,
    /// Which incarnation.
    pub epoch: u32,
    /// When it was to be.
    pub moment: Moment,
    /// When it was \[ns\].
    #[serde(skip)]
    pub at_ns: u64,
    /// Until the first message of the next incarnation, or the first that it recorded \[ms\]; nothing when that was killed
    /// before, or the log ends before.
    pub successor_ms: Option<f64>,
    /// Whether the log has a hole where that message may have been.
    #[serde(skip)]
    pub unseen: bool,
    /// A recorder: what it had not brought into safety yet \[ms\]; nothing when nobody can tell since when it recorded.
    pub lost_ms: Option<f64>,
}

impl Row {
    /// Flies flight `number` through `blows`.
    pub fn fly(number: u64, blows: &[Blow], namespace: &str) -> anyhow::Result<Self> {
        let folder = Folder(std::env::temp_dir().join(format!("{namespace}-flight")));
        let mut flight = Flight::start(namespace, &folder.0, DURATION_S)?;
        let kills = flight.strike_all(blows);
        let mut row = Self { flight: number, ..Self::default() };
        if kills.last().is_some_and(|kill| kill.victim == Victim::Launcher) {
            flight.child.wait()?;
            row.gone_ms = flight.until_gone(kills.last().map_or(0, |kill| kill.at_ns));
            row.next_code =
                Flight::start(namespace, &folder.0.join("next"), 0.3)?.end().and_then(|status| status.code());
        } else {
            row.code = flight.end().and_then(|status| status.code());
        }
        row.left = left(namespace);
        row.said = fs::read_to_string(folder.0.join("stderr")).unwrap_or_default();
        row.read(&folder.0.join("run"), kills);
        Ok(row)
    }

    /// Takes what the flight wrote; a flight that did not begin wrote nothing.
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
        self.kills = kills.into_iter().map(|kill| kill.told(&log, &holes, &deaths_ns)).collect();
    }
}

/// A launcher that flies.
struct Flight<'a> {
    namespace: &'a str,
    child: Child,
    started: Instant,
}

impl<'a> Flight<'a> {
    /// Starts one that writes into `folder`: to `run`, and to `stderr` what it says.
    fn start(namespace: &'a str, folder: &Path, duration_s: f64) -> anyhow::Result<Self> {
        let cannot = || format!("cannot write to {}", folder.display());
        fs::create_dir_all(folder).with_context(cannot)?;
        let stderr = File::create(folder.join("stderr")).with_context(cannot)?;
        let mut command = own_program();
        command.args(["fly", "--namespace", namespace, "--set", &format!("run.duration_s={duration_s:?}")]);
        command.arg("--out").arg(folder.join("run")).stdin(Stdio::null()).stdout(Stdio::null()).stderr(stderr);
        Ok(Self { namespace, started: Instant::now(), child: command.spawn().context("cannot start a flight")? })
    }

    /// Strikes as planned until the flight ends, of itself or because somebody was killed whom nobody replaces.
    fn strike_all(&mut self, blows: &[Blow]) -> Vec<Kill> {
        let mut kills: Vec<Kill> = vec![];
        for blow in blows {
            let last = kills.iter().rev().find(|kill| kill.victim == blow.victim).copied();
            kills.extend(self.strike(*blow, last));
            if self.has_ended() || kills.last().is_some_and(|kill| !kill.victim.is_replaced()) {
                break;
            }
        }
        kills
    }

    /// Strikes when the moment has come, if the victim is there; `last` is the last kill of the same node.
    fn strike(&mut self, blow: Blow, last: Option<Kill>) -> Option<Kill> {
        let (namespace, name) = (self.namespace, blow.victim.name());
        match (blow.moment, last) {
            (Moment::Starting, _) => std::thread::sleep(blow.after.saturating_sub(self.started.elapsed())),
            (Moment::Candidate, Some(last)) => {
                self.wait_for(|| Process::newest(namespace, name).filter(|process| process.epoch > last.epoch))?;
                std::thread::sleep(blow.after);
            }
            _ => {
                self.wait_for(|| flies(namespace).then_some(()))?;
                std::thread::sleep(blow.after);
            }
        }
        let process = self.wait_for(|| Process::newest(namespace, name))?;
        let at_ns = now_ns();
        let kill = Kill {
            victim: blow.victim,
            epoch: process.epoch,
            moment: blow.moment,
            at_ns,
            successor_ms: None,
            unseen: false,
            lost_ms: None,
        };
        process.signal(namespace, Signal::KILL).then_some(kill)
    }

    /// What `look` finds, as soon as it finds something; nothing when the flight ends first, or patience.
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

    /// How it ended by itself; nothing when it had to be killed.
    fn end(mut self) -> Option<ExitStatus> {
        while self.started.elapsed() < WATCHDOG {
            if let Ok(Some(status)) = self.child.try_wait() {
                return Some(status);
            }
            std::thread::sleep(LOOK);
        }
        None
    }

    /// Time from `since_ns` until nobody of the namespace is there any more \[ms\]; nothing when somebody stays.
    fn until_gone(&self, since_ns: u64) -> Option<f64> {
        let deadline = Instant::now() + PATIENCE * 5;
        while !Process::all(self.namespace).is_empty() {
            if Instant::now() > deadline {
                return None;
            }
            std::thread::sleep(LOOK);
        }
        Some((now_ns() - since_ns) as f64 / 1e6)
    }
}

impl Drop for Flight<'_> {
    fn drop(&mut self) {
        // Has ended already, except where something went wrong; its processes end with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A folder that is removed when it is no longer needed.
struct Folder(PathBuf);

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0); // what cannot be removed stays in the system's folder for such things
    }
}

/// Whether the plant of `namespace` has sampled.
fn flies(namespace: &str) -> bool {
    let page = Domain::find(namespace).ok().and_then(|domain| ControlPage::open(&domain.file("page")).ok());
    page.is_some_and(|page| page.role(Topic::State).done(1).get() > 0)
}
