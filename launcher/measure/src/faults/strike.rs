//! Processes killed and stopped in real time, against the clock.
//!
//! ```text
//! signal -> role vacant -> another holds it -> its first message
//!           noticed                              restarted
//!        -> first command that is not from a fresh demand
//!           fallback
//! ```
//!
//! The signal comes from outside, at any phase of the period. Every flight strikes each node once, so that every restart
//! is one without a wait.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use anyhow::bail;
use contract::scenario::Mode;
use contract::topic::Topic;
use runtime::realtime::{ControlPage, now_ns};
use runtime::session::NodeSession;
use rustix::process::Signal;
use serde::Serialize;

use crate::processes::Process;
use crate::timing::canary::{Canary, Verdict};
use crate::timing::rings::namespace;
use flight::log::Record;
use flight::stack::{Ended, Stack, StartError};
use view::faults::reacts;

/// Between two strikes: the phases of the period are met in turn.
const APART: Duration = Duration::from_micros(703_700);
/// After which a strike has had no effect \[ns\].
const LIMIT_NS: u64 = 1_500_000_000;
/// Who is struck, in turn.
const VICTIMS: [Topic; 3] = [Topic::Controls, Topic::Reference, Topic::Actuators];

/// All strikes, and whether the host let time be told.
#[derive(Debug, Serialize)]
pub struct Strikes {
    /// SIGKILL.
    pub kills: Vec<Strike>,
    /// SIGSTOP.
    pub hangs: Vec<Strike>,
    /// The canaries' word.
    pub canary: Verdict,
}

/// One process struck, and how long everything took.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Strike {
    /// Which node.
    pub node: &'static str,
    /// When \[ns\].
    #[serde(skip)]
    at_ns: u64,
    /// Which epoch came after it.
    #[serde(skip)]
    successor: u32,
    /// Until its role was vacant \[ms\].
    pub noticed_ms: Option<f64>,
    /// attitude-mpc: until the first command without it \[ms\].
    pub fallback_ms: Option<f64>,
    /// Until its successor's first message \[ms\].
    pub restarted_ms: Option<f64>,
}

/// When messages came that tell of a strike \[ns\].
#[derive(Default)]
struct Heard {
    /// The first message of each epoch, by topic.
    firsts: Vec<(Topic, u32, u64)>,
    /// Commands that were not from a fresh demand.
    fallbacks: Vec<u64>,
}

impl Strikes {
    /// Strikes every node in so many flights with either signal.
    pub fn measure(flights: usize, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let canary = Canary::start()?;
        let all = |signal| -> anyhow::Result<Vec<Strike>> {
            let each = (0..flights).map(|_| strikes(signal, interrupts));
            Ok(each.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
        };
        let (kills, hangs) = (all(Signal::KILL), all(Signal::STOP));
        let canary = canary.stop()?.verdict();
        Ok(Self { kills: kills?, hangs: hangs?, canary })
    }
}

fn strikes(signal: Signal, interrupts: &AtomicU32) -> anyhow::Result<Vec<Strike>> {
    let mut scenario = super::hover_in_gusts()?;
    scenario.run.mode = Mode::Realtime;
    scenario.run.duration_s = (APART * 4).as_secs_f64().ceil() + 1.0;
    let namespace = namespace();
    let stack = Stack::start(&namespace, &scenario, None, interrupts)?;
    let page = NodeSession::join(&namespace, "launcher", 1)?.page;
    let heard = Mutex::new(Heard::default());
    let over = AtomicBool::new(false);
    let (flown, mut strikes) = std::thread::scope(|scope| {
        let striker = scope.spawn(|| strike_all(signal, &namespace, &page, &over));
        let watch = |record: Record| heard.lock().expect("nobody panics with it").observe(&record);
        let flown = stack.fly(interrupts, watch, |_| {});
        over.store(true, Ordering::Relaxed);
        (flown, striker.join().expect("striking does not panic"))
    });
    match flown.ended {
        Ended::Flown => {}
        Ended::Interrupted => bail!(StartError::Interrupted),
        Ended::Lost(name) | Ended::Late(name) => bail!(StartError::Lost(format!("lost {name}"))),
        Ended::Unseen(what) => bail!(StartError::Lost(what)),
    }
    let heard = heard.into_inner().expect("nobody panics with it");
    for strike in &mut strikes {
        heard.complete(strike);
    }
    Ok(strikes)
}

fn strike_all(signal: Signal, namespace: &str, page: &ControlPage, over: &AtomicBool) -> Vec<Strike> {
    let one = |topic| {
        std::thread::sleep(APART);
        if over.load(Ordering::Relaxed) { None } else { strike(signal, topic, namespace, page) }
    };
    VICTIMS.into_iter().filter_map(one).collect()
}

/// Strikes the process that speaks on `topic`, and looks on until its role is vacant.
fn strike(signal: Signal, topic: Topic, namespace: &str, page: &ControlPage) -> Option<Strike> {
    let role = page.role(topic);
    let epoch = role.active();
    let is_holder = |process: &Process| (process.name.as_str(), process.epoch) == (topic.publisher(), epoch);
    let active = Process::all(namespace).into_iter().find(is_holder)?;
    let at_ns = now_ns();
    active.signal(namespace, signal).then_some(())?;
    let noticed_ns = loop {
        if role.active() != epoch {
            break Some(now_ns());
        }
        if now_ns() > at_ns + LIMIT_NS {
            break None;
        }
        std::thread::sleep(Duration::from_micros(100));
    };
    let noticed_ms = noticed_ns.map(|ns| milliseconds(ns - at_ns));
    let node = topic.publisher();
    Some(Strike { node, at_ns, successor: epoch + 1, noticed_ms, fallback_ms: None, restarted_ms: None })
}

impl Heard {
    fn observe(&mut self, record: &Record) {
        let (topic, stamp) = (record.topic(), record.stamp());
        let (epoch, publish_ns) = (stamp.epoch as u32, stamp.publish_ns[topic as usize]);
        if stamp.delivery == 0 && !self.firsts.iter().any(|first| (first.0, first.1) == (topic, epoch)) {
            self.firsts.push((topic, epoch, publish_ns));
        }
        if matches!(record, Record::Actuators(_)) && reacts(record) {
            self.fallbacks.push(publish_ns);
        }
    }

    fn complete(&self, strike: &mut Strike) {
        let since = |ns: u64| milliseconds(ns - strike.at_ns);
        let successor = |first: &&(Topic, u32, u64)| (first.0.publisher(), first.1) == (strike.node, strike.successor);
        let restarted_ms = self.firsts.iter().find(successor).map(|first| since(first.2));
        let in_force = |ns: &&u64| (strike.at_ns..strike.at_ns + LIMIT_NS).contains(*ns);
        let fallback_ms = self.fallbacks.iter().find(in_force).map(|ns| since(*ns));
        strike.restarted_ms = restarted_ms;
        strike.fallback_ms = fallback_ms.filter(|_| strike.node == Topic::Controls.publisher());
    }
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 / 1e6
}
