//! Processes killed and stopped from outside, in real time.
//!
//! ```text
//! signal -> role vacant -> first message of the successor
//!           noticed        restarted
//!        -> first command that is not from a fresh demand
//!           fallback
//! ```
//!
//! The signal comes at any phase of the period. Every flight strikes each node once, so that no restart is delayed.

use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use anyhow::Context;
use contract::message::Stamp;
use contract::scenario::Mode;
use contract::topic::Topic;
use flight::log::Record;
use runtime::realtime::{ControlPage, now_ns};
use rustix::process::Signal;
use serde::Serialize;
use view::faults::reacts;

use super::case::hover_in_gusts;
use crate::flights::Started;
use crate::killer::{Process, first_message_ns, milliseconds, page};
use crate::timing::canary::{Canary, CanarySummary};

/// Between two strikes: all phases of the period occur.
const APART: Duration = Duration::from_micros(703_700);
/// A strike that was not noticed by then has had no effect \[ns\].
const LIMIT_NS: u64 = 1_500_000_000;
/// The nodes in the order of their strikes, by topic.
const VICTIMS: [Topic; 3] = [Topic::Controls, Topic::Reference, Topic::Actuators];

#[derive(Debug, Serialize)]
pub struct Strikes {
    /// SIGKILL.
    pub kills: Vec<Strike>,
    /// SIGSTOP.
    pub hangs: Vec<Strike>,
    pub canary: CanarySummary,
}

/// One process struck, and the delays that followed.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Strike {
    pub node: &'static str,
    #[serde(skip)]
    topic: Topic,
    #[serde(skip)]
    epoch: u32,
    #[serde(skip)]
    at_ns: u64,
    /// Until its role was vacant \[ms\].
    pub noticed_ms: Option<f64>,
    /// attitude-mpc: until the first command without it \[ms\].
    pub fallback_ms: Option<f64>,
    /// Until its successor's first message \[ms\].
    pub restarted_ms: Option<f64>,
}

/// What the messages of a flight tell of its strikes.
#[derive(Default)]
struct Seen {
    stamps: [Vec<Stamp>; Topic::COUNT],
    /// When commands were sent that are not from a fresh demand \[ns\].
    fallbacks_ns: Vec<u64>,
}

impl Strikes {
    /// Strikes every node once in each of `flights` flights, with either signal.
    pub fn measure(flights: usize, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let canary = Canary::start()?;
        let all = |signal| -> anyhow::Result<Vec<Strike>> {
            let each = (0..flights).map(|_| fly(signal, interrupts));
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
    let stack = Started::new(&scenario, interrupts)?;
    let namespace = stack.namespace.clone();
    let page = page(&namespace).context("cannot open the page of the flight")?;
    let mut seen = Seen::default();
    let over = AtomicBool::new(false);
    let (flown, mut strikes) = std::thread::scope(|scope| {
        let striker = scope.spawn(|| strike_all(signal, &namespace, &page, &over));
        let flown = stack.fly_to_the_end(interrupts, |record| seen.observe(record), || {});
        over.store(true, Ordering::Relaxed);
        (flown, striker.join().expect("striking does not panic"))
    });
    flown?;
    for strike in &mut strikes {
        seen.complete(strike);
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

/// Strikes the active process of a role, and waits until the role is vacant.
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
    Some(Strike { node, topic, epoch, at_ns, noticed_ms, fallback_ms: None, restarted_ms: None })
}

impl Seen {
    fn observe(&mut self, record: &Record) {
        let (topic, stamp) = (record.topic(), record.stamp());
        self.stamps[topic as usize].push(*stamp);
        if topic == Topic::Actuators && reacts(record) {
            self.fallbacks_ns.push(stamp.publish_ns[topic as usize]);
        }
    }

    fn complete(&self, strike: &mut Strike) {
        let since = |ns: u64| milliseconds(ns - strike.at_ns);
        let first_ns = first_message_ns(&self.stamps[strike.topic as usize], strike.topic, strike.epoch + 1);
        let in_time = |ns: &&u64| (strike.at_ns..strike.at_ns + LIMIT_NS).contains(*ns);
        let fallback_ns = self.fallbacks_ns.iter().find(in_time).filter(|_| strike.topic == Topic::Controls);
        (strike.restarted_ms, strike.fallback_ms) = (first_ns.map(since), fallback_ns.map(|ns| since(*ns)));
    }
}
