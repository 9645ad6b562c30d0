//! One `trefoil fly` through kills, swaps, live faults or load, flown again from its log.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use contract::exit;
use contract::message::{Stamp, State};
use contract::topic::Topic;
use flight::control::{ControlRequest, ask};
use flight::event::What;
use flight::log::{self, Log};
use flight::stack::StartError;
use outcome::faults::reacts;
use outcome::recorded::Recorded;
use outcome::run_record::RunRecord;
use replay::verdict::replay_and_judge;
use replay::{Recording, ReplayPlan};
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::Signal;
use serde::Serialize;

use super::logged::{Kill, holes, sent_ns};
use super::orders::{Conditions, FlightOrder, orders};
use super::plan::{Moment, PlannedKill, Victim};
use crate::flights::{lean_deg, namespace};
use crate::launched::{Launcher, StackProcess, left, milliseconds, said};
use crate::timing::canary::{Canary, CanaryWatch, LONGEST};
use crate::timing::machine::Stress;

/// Duration of a short flight \[s\].
pub const DURATION_S: f64 = 3.0;
/// Duration of the flight that follows a killed launcher \[s\].
const NEXT_S: f64 = 0.3;
/// Longest wait until the stack notices the end of a killed process.
const NOTICED: Duration = Duration::from_millis(50);
/// Longest time for start, report and end of a flight on a loaded machine.
const AROUND: Duration = Duration::from_secs(60);

/// Flight and its outcome.
#[derive(Debug, Clone, Default, Serialize)]
pub struct StressFlight {
    /// Number among the short or the long flights; determines, with the seed, the kills, and with the duration, the
    /// orders.
    pub flight: u64,
    pub kind: Conditions,
    /// Kills that reached a process of a short flight, in order.
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
    /// Largest true roll or pitch \[deg\].
    pub tilt_deg: f64,
    /// Number of ticks of a flight with candidates on which a node lacked an input or did not send exactly one message,
    /// although no canary was delayed.
    pub lost_ticks: usize,
    /// Number of ticks lost in the same way while a canary was delayed.
    pub explained_ticks: usize,
    /// Reason why a candidate that was late cannot be judged.
    pub doubt: Option<String>,
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
    /// Time from a kill of the launcher until its last process was gone \[ms\].
    pub gone_ms: Option<f64>,
    /// Exit code of the flight that followed a killed launcher.
    pub next_code: Option<i32>,
    /// Shared memory and processes left in the end.
    pub left: Vec<String>,
    /// Replay of the flight; `None` for a short flight that did not end with exit code 0.
    pub again: Option<Again>,
}

/// Content of the log of a flight, and the result of its replay.
#[derive(Debug, Clone, Default, Serialize)]
pub struct Again {
    pub flown_s: f64,
    pub messages: u64,
    /// Deadlines missed by all nodes.
    pub misses: u64,
    /// Number of faults given in flight.
    pub faults: usize,
    /// Number of processes that died or hung.
    pub deaths: usize,
    /// Candidates that were kept: node and time.
    pub kept: Vec<String>,
    /// Wall time to replay the log \[s\].
    pub replay_s: f64,
    /// State hash that the flight recorded.
    pub state_hash: Option<String>,
    /// Difference between flight and replay; `None` if they are equal.
    pub differs: Option<String>,
}

impl StressFlight {
    /// Flies short flight `number` with the kills of its `plan`.
    pub fn short(number: u64, plan: &[PlannedKill], namespace: &str) -> anyhow::Result<Self> {
        let folder = tempfile::Builder::new().prefix(namespace).tempdir()?;
        let mut launcher = Launcher::start(&Conditions::Killed.scenario(DURATION_S)?, namespace, folder.path())?;
        let kills = kill_all(&mut launcher, plan);
        let mut row = Self { flight: number, ..Self::default() };
        match kills.last() {
            Some(kill) if kill.victim == Victim::Launcher => {
                row.gone_ms = launcher.until_gone(kill.at_ns)?;
                row.next_code =
                    Launcher::start(&Conditions::Killed.scenario(NEXT_S)?, namespace, &folder.path().join("next"))?
                        .end();
            }
            _ => row.code = launcher.end(),
        }
        row.left = left(namespace);
        row.said = said(folder.path());
        row.read(&folder.path().join("run"), kills, None);
        if row.code == Some(exit::FLOWN.into()) {
            row.fly_again(folder);
        }
        Ok(row)
    }

    /// Flies long flight `number`; `None` if a program that its kind needs is not installed.
    pub fn long(number: u64, duration_s: f64, interrupts: &AtomicU32) -> anyhow::Result<Option<Self>> {
        let kind = Conditions::of(number);
        let namespace = namespace();
        let folder = tempfile::Builder::new().prefix(&namespace).tempdir()?;
        let load = (kind == Conditions::Loaded).then(|| Stress::start(duration_s + AROUND.as_secs_f64()));
        if let Some(None) = load {
            return Ok(None);
        }
        let mut launcher = Launcher::start(&kind.scenario(duration_s)?, &namespace, folder.path())?;
        let canary = kind.has_candidates().then(|| Canary::start(LONGEST)).transpose()?;
        if launcher.wait_for_flight().is_some() && kind == Conditions::Disturbed {
            disturb(number, duration_s, &namespace);
        }
        let code = launcher.end_within(Duration::from_secs_f64(duration_s) + AROUND);
        drop(load);
        if interrupts.load(Ordering::Relaxed) > 0 {
            bail!(StartError::Interrupted);
        }
        let code = Some(code.context("a flight did not end, and was killed")?);
        let host = canary.map(Canary::stop).transpose()?;
        let doubt = host.as_ref().and_then(|host| host.summary().doubt);
        let (left, said) = (left(&namespace), said(folder.path()));
        let mut row = Self { flight: number, kind, code, said, left, doubt, ..Self::default() };
        row.read(&folder.path().join("run"), vec![], host.as_ref());
        row.fly_again(folder);
        Ok(Some(row))
    }

    /// Reads run.json and the log; a flight that did not begin has neither. `host` has the canaries' wake-ups, which
    /// are watched only in a flight with candidates.
    fn read(&mut self, run: &Path, kills: Vec<Kill>, host: Option<&CanaryWatch>) {
        let record = RunRecord::read(&run.join("run.json")).ok().flatten();
        self.flown_s = record.as_ref().map(|record| record.flown_s);
        self.diverged = record.as_ref().is_some_and(|record| record.diverged);
        self.position_error_m = record.as_ref().map(|record| record.metrics.max_position_error_m);
        self.dropped = record.as_ref().and_then(|record| record.log.as_ref()).map_or(0, |log| log.dropped);
        let log = log::read(&run.join("flight.mcap"));
        self.log_defect = log.as_ref().map_or_else(|error| Some(format!("{error:#}")), |log| log.defect.clone());
        let log = log.unwrap_or_default();
        let given_up = log.events.iter().filter(|event| event.what == What::GivenUp);
        self.given_up = given_up.map(|event| event.node.clone()).collect();
        self.tilt_deg = log.truths.iter().map(lean_deg).fold(0.0, f64::max);
        let sample_s = 1.0 / f64::from(self.kind.rate_hz());
        if let Some(host) = host {
            let (lost, two_ns) = (lost_ticks(&log), (2e9 * sample_s) as u64);
            let explained = lost.iter().filter(|stamp| host.explains(stamp.sample_ns, stamp.sample_ns + two_ns));
            self.explained_ticks = explained.count();
            self.lost_ticks = lost.len() - self.explained_ticks;
        }
        let unrecorded_s =
            |state: &State| self.flown_s.map_or(0.0, |flown_s| flown_s - state.stamp.tick as f64 * sample_s);
        let end_ns = |state: &State| sent_ns(state) + (unrecorded_s(state) * 1e9).round() as u64;
        self.end_ns = log.states.last().map_or(0, end_ns);
        let holes = holes(&log, self.end_ns);
        self.holes = holes.len();
        self.kills = kills.into_iter().map(|kill| kill.completed(&log, &holes)).collect();
    }

    /// Flies the run in `folder` again. If the replay differs or fails, keeps the folder and names it in the result.
    fn fly_again(&mut self, folder: tempfile::TempDir) {
        let mut again = Again::of(&folder.path().join("run"))
            .unwrap_or_else(|error| Again { differs: Some(format!("{error:#}")), ..Again::default() });
        if let Some(differs) = &mut again.differs {
            *differs = format!("{differs} (kept in {})", folder.keep().display());
        }
        self.again = Some(again);
    }
}

impl Again {
    fn of(run: &Path) -> anyhow::Result<Self> {
        let recorded = Recorded::read(run)?;
        let started = Instant::now();
        let recording = Recording::of(&recorded)?;
        let (mut flown_s, mut messages, mut replay_s) = (0.0, 0, 0.0);
        let verdict = replay_and_judge(&recorded, &recording, &ReplayPlan::default(), |replayed, summary| {
            (flown_s, messages, replay_s) = (summary.time_s(), replayed.compared(), started.elapsed().as_secs_f64());
        })?;
        let count = |of: &[What]| recorded.log.events.iter().filter(|event| of.contains(&event.what)).count();
        let sample_s = recorded.scenario.sample_s();
        let kept = recorded.log.events.iter().filter(|event| event.what == What::Kept);
        let nodes = recorded.run.timing.iter().flat_map(|timing| timing.nodes.values());
        Ok(Self {
            flown_s,
            messages,
            misses: nodes.map(|node| node.counts.misses).sum(),
            faults: count(&[What::Injected]),
            deaths: count(&[What::Died, What::Hung]),
            kept: kept.map(|event| format!("{} at {:.2} s", event.node, event.tick as f64 * sample_s)).collect(),
            replay_s,
            state_hash: recorded.run.state_hash.clone(),
            differs: (verdict.exit_code != exit::FLOWN).then(|| verdict.text.trim_end().replace('\n', "; ")),
        })
    }
}

/// Gives a disturbed flight its orders. A flight that is ending refuses them; the log shows which took effect.
fn disturb(number: u64, duration_s: f64, namespace: &str) {
    let started = Instant::now();
    for (share, order) in orders(number, duration_s) {
        let at = Duration::from_secs_f64(share * duration_s);
        std::thread::sleep(at.saturating_sub(started.elapsed()));
        let request = match order {
            FlightOrder::Kill(node) => {
                let _ =
                    StackProcess::newest(namespace, node).and_then(|process| process.signal(namespace, Signal::KILL));
                continue;
            }
            FlightOrder::Swap(swap) => ControlRequest::Swap(*swap),
            FlightOrder::Inject(fault) => ControlRequest::Inject { fault: *fault },
        };
        if let Ok(domain) = Domain::find(namespace) {
            let _ = ask(&domain, &request);
        }
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

/// Kills the victim at the planned moment; `None` if it does not run. `last` is the victim's previous kill.
fn kill(launcher: &mut Launcher, planned: PlannedKill, last: Option<Kill>) -> Option<Kill> {
    let PlannedKill { victim, moment, after } = planned;
    let newest = |namespace: &str| StackProcess::newest(namespace, &victim.name());
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
    let noticed_ms = (moment == Moment::Flying).then(|| noticed_ms(launcher, &process, at_ns)).flatten();
    Some(Kill { noticed_ms, ..Kill::new(victim, process.epoch, moment, at_ns) })
}

/// Waits until the role of `process`, which was killed at `at_ns`, is vacant; returns the time since the kill \[ms\].
/// `None` if the process was not active, or if the role is not vacant after [`NOTICED`].
fn noticed_ms(launcher: &Launcher, process: &StackProcess, at_ns: u64) -> Option<f64> {
    let topic = Topic::of_node(&process.name)?;
    let page = ControlPage::open(&Domain::find(&launcher.namespace).ok()?.file("page")).ok()?;
    let is_active = || page.role(topic).active() == process.epoch;
    if !is_active() {
        return None;
    }
    while is_active() && now_ns() < at_ns + NOTICED.as_nanos() as u64 {
        std::thread::sleep(Duration::from_micros(100));
    }
    (!is_active()).then(|| milliseconds(now_ns() - at_ns))
}

/// Finds the samples that a node answered without an input, or by none or several delivered messages. The first and the
/// last second are left out: they have no swap, and at the end the nodes leave.
fn lost_ticks(log: &Log) -> Vec<Stamp> {
    let mut ticks = vec![([0_u8; Topic::COUNT], false); log.states.len()];
    for record in log.tick_by_tick() {
        if let Some((topic, stamp)) = record.stamped().filter(|(_, stamp)| stamp.is_delivered())
            && let Some((sent, reacted)) = ticks.get_mut(stamp.tick as usize)
        {
            sent[topic as usize] += 1;
            *reacted |= reacts(&record);
        }
    }
    let is_lost = |state: &&State| {
        let tick = state.stamp.tick as usize;
        (100..ticks.len().saturating_sub(100)).contains(&tick) && ticks[tick] != ([1; Topic::COUNT], false)
    };
    log.states.iter().filter(is_lost).map(|state| state.stamp).collect()
}
