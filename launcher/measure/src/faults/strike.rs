//! Kills and stops processes from outside, in real time.
//!
//! ```text
//! signal -> role vacant -> first message of the successor
//!           noticed        restarted
//!        -> first command that is not from a fresh demand
//!           fallback
//! ```
//!
//! The signal comes at any phase of the period. Every flight strikes each node once: a first restart has no delay.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use anyhow::bail;
use contract::exit;
use contract::scenario::Mode;
use contract::topic::Topic;
use flight::log::{self, Log, Record};
use flight::stack::StartError;
use outcome::faults::reacts;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::Signal;
use serde::Serialize;

use super::case::hover_in_gusts;
use crate::flights::namespace;
use crate::killer::{Launcher, Process, first_message_ns, milliseconds, said};
use crate::timing::canary::{Canary, CanarySummary, LONGEST};

/// Interval between two strikes, chosen so that all phases of the period occur.
const APART: Duration = Duration::from_micros(703_700);
/// Time after which a strike counts as without effect \[ns\].
const LIMIT_NS: u64 = 1_500_000_000;
/// Number of flights with each signal.
const FLIGHTS: usize = 5;
/// Topics of the nodes, in the order of their strikes.
const VICTIMS: [Topic; 3] = [Topic::Controls, Topic::Reference, Topic::Actuators];

#[derive(Debug, Serialize)]
pub struct Strikes {
    /// Strikes with SIGKILL.
    pub kills: Vec<Strike>,
    /// Strikes with SIGSTOP.
    pub hangs: Vec<Strike>,
    pub canary: CanarySummary,
}

/// Signal to one process, and the delays that followed.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Strike {
    pub node: &'static str,
    #[serde(skip)]
    epoch: u32,
    #[serde(skip)]
    at_ns: u64,
    /// Time until its role was vacant \[ms\].
    pub noticed_ms: Option<f64>,
    /// Time until the first command without it \[ms\]; attitude-mpc only.
    pub fallback_ms: Option<f64>,
    /// Time until its successor's first message \[ms\].
    pub restarted_ms: Option<f64>,
}

impl Strikes {
    /// Strikes every node once in each flight, in [`FLIGHTS`] flights with each signal.
    pub fn measure(interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let canary = Canary::start(LONGEST)?;
        let all = |signal| -> anyhow::Result<Vec<Strike>> {
            let each = (0..FLIGHTS).map(|_| fly(signal, interrupts));
            Ok(each.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
        };
        let (kills, hangs) = (all(Signal::KILL), all(Signal::STOP));
        let canary = canary.stop()?.summary();
        Ok(Self { kills: kills?, hangs: hangs?, canary })
    }
}

fn fly(signal: Signal, interrupts: &AtomicU32) -> anyhow::Result<Vec<Strike>> {
    let mut scenario = hover_in_gusts()?;
    scenario.run.mode = Mode::Realtime;
    scenario.run.duration_s = (APART * 4).as_secs_f64().ceil() + 1.0;
    let namespace = namespace();
    let folder = tempfile::Builder::new().prefix(&namespace).tempdir()?;
    let mut launcher = Launcher::start(&scenario, &namespace, folder.path())?;
    let mut strikes = vec![];
    if let Some(page) = launcher.wait_for_flight() {
        for topic in VICTIMS {
            std::thread::sleep(APART);
            strikes.extend(strike(signal, topic, &namespace, &page));
        }
    }
    let code = launcher.end();
    if interrupts.load(Ordering::Relaxed) > 0 {
        bail!(StartError::Interrupted);
    }
    if ![exit::FLOWN, exit::OUT_OF_BOUNDS].map(|code| Some(code.into())).contains(&code) {
        bail!(StartError::Lost(said(folder.path()).trim().to_owned()));
    }
    let log = log::read(&folder.path().join("run/flight.mcap"))?;
    for strike in &mut strikes {
        strike.complete(&log);
    }
    Ok(strikes)
}

/// Strikes the active process of a role, and waits until it is active no longer, at most
/// [`LIMIT_NS`].
fn strike(signal: Signal, topic: Topic, namespace: &str, page: &ControlPage) -> Option<Strike> {
    let (role, node) = (page.role(topic), topic.publisher());
    let epoch = role.active();
    let is_active = |process: &Process| (process.name.as_str(), process.epoch) == (node, epoch);
    let at_ns = Process::all(namespace).into_iter().find(is_active)?.signal(namespace, signal)?;
    let mut noticed_ms = None;
    while noticed_ms.is_none() && now_ns() < at_ns + LIMIT_NS {
        std::thread::sleep(Duration::from_micros(100));
        noticed_ms = (role.active() != epoch).then(|| milliseconds(now_ns() - at_ns));
    }
    Some(Strike { node, epoch, at_ns, noticed_ms, fallback_ms: None, restarted_ms: None })
}

impl Strike {
    /// Adds the delays that the `log` of the flight shows.
    fn complete(&mut self, log: &Log) {
        let since_ms = |ns: u64| milliseconds(ns - self.at_ns);
        self.restarted_ms = first_message_ns(log, self.node, self.epoch + 1).map(since_ms);
        let in_time = self.at_ns..self.at_ns + LIMIT_NS;
        let commands = log.actuators.iter().filter(|_| self.node == Topic::Controls.publisher());
        let fallbacks = commands.filter(|command| reacts(&Record::from(**command)));
        let mut sent_ns = fallbacks.map(|command| command.stamp.publish_ns[Topic::Actuators as usize]);
        self.fallback_ms = sent_ns.find(|ns| in_time.contains(ns)).map(since_ms);
    }
}
