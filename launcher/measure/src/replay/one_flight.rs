//! One flight through processes, flown again from its log.

use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use contract::exit;
use contract::scenario::to_toml;
use flight::control::{Request, ask};
use flight::event::What;
use flight::files::write_whole;
use flight::replay::Plan;
use flight::stack::StartError;
use outcome::recorded::Recorded;
use outcome::replay_verdict::replay_and_judge;
use runtime::domain::Domain;
use rustix::process::Signal;
use serde::Serialize;

use super::plan::{Kind, Order, orders};
use crate::flights::namespace;
use crate::killer::{Launcher, Process, said};
use crate::timing::machine::Stress;

/// Longest time for start, report and end of a flight on a loaded machine.
const AROUND: Duration = Duration::from_secs(60);

/// Flight, and the result of its replay.
#[derive(Debug, Serialize)]
pub struct ReplayFlight {
    /// Number from 0; with the duration it determines the plan.
    pub flight: usize,
    pub kind: Kind,
    /// Exit code of the launcher.
    pub code: i32,
    pub flown_s: f64,
    pub messages: u64,
    /// Deadlines missed by all nodes.
    pub misses: u64,
    /// Number of faults given in flight.
    pub faults: usize,
    /// Number of processes that died or hung.
    pub deaths: usize,
    /// Number of swaps whose candidate was kept.
    pub swaps: usize,
    /// Wall time to read the log, and to replay it \[s\].
    pub read_s: f64,
    pub replay_s: f64,
    /// State hash that the flight recorded.
    pub state_hash: Option<String>,
    /// Difference between flight and replay; `None` if they are equal.
    pub differs: Option<String>,
}

impl ReplayFlight {
    /// Flies flight `number` and replays it; `None` if a program that its kind needs is not installed. The folder of a
    /// flight whose replay differs is kept and named.
    pub fn fly(number: usize, duration_s: f64, interrupts: &AtomicU32) -> anyhow::Result<Option<Self>> {
        let kind = Kind::of(number);
        let namespace = namespace();
        let folder = tempfile::Builder::new().prefix(&namespace).tempdir()?;
        let load = (kind == Kind::Loaded).then(|| Stress::start(duration_s + AROUND.as_secs_f64()));
        if let Some(None) = load {
            return Ok(None);
        }
        let code = fly(number, kind, duration_s, &namespace, folder.path())?;
        drop(load);
        if interrupts.load(Ordering::Relaxed) > 0 {
            bail!(StartError::Interrupted);
        }
        let row = Self::replay(number, kind, code, &folder.path().join("run"));
        let mut row =
            row.with_context(|| format!("flight {number} left nothing to replay: {}", said(folder.path()).trim()))?;
        if let Some(differs) = &mut row.differs {
            *differs = format!("{differs} (kept in {})", folder.keep().display());
        }
        Ok(Some(row))
    }

    fn replay(number: usize, kind: Kind, code: i32, run: &Path) -> anyhow::Result<Self> {
        let started = Instant::now();
        let recorded = Recorded::read(run)?;
        let read_s = started.elapsed().as_secs_f64();
        let started = Instant::now();
        let recording = recorded.recording()?;
        let (mut flown_s, mut messages, mut replay_s) = (0.0, 0, 0.0);
        let verdict = replay_and_judge(&recorded, &recording, &Plan::default(), |replayed, summary| {
            (flown_s, messages, replay_s) = (summary.time_s(), replayed.compared(), started.elapsed().as_secs_f64());
        })?;

        let (log, run) = (&recorded.log, &recorded.run);
        let count = |of: &[What]| log.events.iter().filter(|event| of.contains(&event.what)).count();
        let differs = (verdict.exit_code != exit::FLOWN).then(|| verdict.text.trim_end().replace('\n', "; "));
        let nodes = run.timing.iter().flat_map(|timing| timing.nodes.values());
        Ok(Self {
            flight: number,
            kind,
            code,
            flown_s,
            messages,
            misses: nodes.map(|node| node.counts.misses).sum(),
            faults: count(&[What::Injected]),
            deaths: count(&[What::Died, What::Hung]),
            swaps: count(&[What::Kept]),
            read_s,
            replay_s,
            state_hash: run.state_hash.clone(),
            differs,
        })
    }

    /// Returns the wall time to replay one minute of the flight \[s\].
    pub fn minute_s(&self) -> f64 {
        self.replay_s * 60.0 / self.flown_s
    }
}

/// Flies a flight by the command and returns its exit code.
fn fly(number: usize, kind: Kind, duration_s: f64, namespace: &str, folder: &Path) -> anyhow::Result<i32> {
    let file = folder.join("scenario.toml");
    write_whole(&file, to_toml(&kind.scenario(duration_s)).as_bytes())?;
    let mut launcher = Launcher::start(namespace, folder, &[&file.display().to_string()])?;
    while launcher.wait_for_flight().is_none() && !launcher.has_ended() {} // on a loaded machine a stack takes seconds to start
    if kind == Kind::Disturbed {
        let started = Instant::now();
        for (share, order) in orders(number, duration_s) {
            let at = Duration::from_secs_f64(share * duration_s);
            std::thread::sleep(at.saturating_sub(started.elapsed()));
            give(namespace, order);
        }
    }
    let code = launcher.end_within(Duration::from_secs_f64(duration_s) + AROUND);
    code.context("a flight did not end, and was killed")
}

/// Gives an order to the flight. A flight that is ending refuses it; the log shows which orders took effect.
fn give(namespace: &str, order: Order) {
    let request = match order {
        Order::Kill(node) => {
            let _ = Process::newest(namespace, node).and_then(|process| process.signal(namespace, Signal::KILL));
            return;
        }
        Order::Swap(swap) => Request::Swap(*swap),
        Order::Inject(fault) => Request::Inject { fault: *fault },
    };
    if let Ok(domain) = Domain::find(namespace) {
        let _ = ask(&domain, &request);
    }
}
