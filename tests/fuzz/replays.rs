//! Logs that were cut, thinned or mixed: a replay reports the same flight only if it compared the whole flight.
//!
//! `PROPTEST_CASES=1000 cargo test --workspace --test stack fuzz::replays` tries more cases.

use std::fs;
use std::sync::LazyLock;

use contract::exit;
use contract::message::{Actuators, Arrival, Controls, Reference, Stamp, State, Truth};
use flight::log::{self, Log, LogWriter, Record};
use outcome::recorded::Recorded;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::Index;
use replay::verdict::{ReplayVerdict, replay_and_judge};
use replay::{Recording, ReplayPlan};

use super::cases;
use crate::harness::{PATIENT, fly};

/// A flight, with the files of its folder.
struct Flown {
    log: Log,
    bytes: Vec<u8>,
    run: String,
    settings: String,
}

/// Short missions in every mode, with a killed node, one also with flipped bits. Each has its own seed, since a seed
/// gives the same flight in process and in lockstep.
static FLOWN: LazyLock<Vec<Flown>> = LazyLock::new(|| {
    let broken = "{ at_s = 0.1, for_s = 0.1, target = \"guidance\", kind = \"kill\" }, { at_s = 0.2, for_s = 0.3, target = \
                  \"rates\", kind = \"noise\" }";
    let flips = ", { at_s = 0.3, for_s = 0.1, target = \"controls\", kind = \"corrupt\" }";
    let flights = [("inprocess", 0, ""), ("lockstep", 1, flips), ("realtime", 2, ""), ("inprocess", 3, "")];
    let flown = flights.map(|(mode, seed, flips)| {
        let faults = format!("fault=[{broken}{flips}]");
        let seed = format!("run.seed={seed}");
        let outcome =
            fly(&["--mode", mode, "--set", "run.duration_s=0.5", "--set", &faults, "--set", &seed, "--set", PATIENT]);
        let read = |name: &str| fs::read_to_string(outcome.out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"));
        let path = outcome.out.join("flight.mcap");
        Flown {
            log: log::read(&path).expect("a whole log"),
            bytes: fs::read(&path).expect("a log"),
            run: read("run.json"),
            settings: read("scenario.toml"),
        }
    });
    flown.into()
});

/// Some records of one topic, or of every topic: every n-th record of a span, whose ends are shares of all records.
#[derive(Debug, Clone, Copy)]
struct Span {
    topic: Option<usize>,
    ends: (f64, f64),
    every: usize,
}

impl Span {
    fn has(&self, topic: usize, i: usize, all: usize) -> bool {
        let share = i as f64 / all as f64;
        self.topic.is_none_or(|only| only == topic)
            && self.ends.0 <= share
            && share < self.ends.1
            && i.is_multiple_of(self.every)
    }

    fn thin<M>(&self, topic: usize, messages: &mut Vec<M>) {
        let all = messages.len();
        let mut i = 0..all;
        messages.retain(|_| !i.next().is_some_and(|i| self.has(topic, i, all)));
    }

    fn mix<M: Copy>(&self, topic: usize, messages: &mut [M], other: &[M]) {
        let all = messages.len();
        let pairs = messages.iter_mut().zip(other).enumerate();
        pairs.filter(|(i, _)| self.has(topic, *i, all)).for_each(|(_, (message, other))| *message = *other);
    }
}

/// Damage done to a log.
#[derive(Debug, Clone)]
enum Damage {
    Thin(Span),
    Mix(Index, Span),
    /// Loss of this share of the events, from the last on.
    Forget(f64),
}

fn span() -> impl Strategy<Value = Span> {
    let topic = prop::option::of(0..4_usize);
    let ends = prop_oneof![(0.0..1.0_f64, 0.0..0.3_f64), (0.9..1.0_f64, Just(1.0)), (Just(0.0), 0.0..0.1_f64)];
    let every = prop_oneof![Just(1), 1..60_usize];
    (topic, ends, every).prop_map(|(topic, (from, length), every)| Span { topic, ends: (from, from + length), every })
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        3 => span().prop_map(Damage::Thin),
        2 => (any::<Index>(), span()).prop_map(|(other, span)| Damage::Mix(other, span)),
        1 => (0.0..1.0_f64).prop_map(Damage::Forget),
    ]
}

/// Returns the log after all `damages`.
fn damaged(log: &Log, damages: &[Damage]) -> Log {
    let mut log = log.clone();
    for damage in damages {
        let Log { states, references, controls, actuators, truths, events, .. } = &mut log;
        match damage {
            Damage::Thin(span) => {
                span.thin(0, states);
                span.thin(1, references);
                span.thin(2, controls);
                span.thin(3, actuators);
                span.thin(4, truths);
            }
            Damage::Mix(other, span) => {
                let other = &other.get(&FLOWN).log;
                span.mix(0, states, &other.states);
                span.mix(1, references, &other.references);
                span.mix(2, controls, &other.controls);
                span.mix(3, actuators, &other.actuators);
                span.mix(4, truths, &other.truths);
            }
            Damage::Forget(share) => events.truncate((events.len() as f64 * (1.0 - share)) as usize),
        }
    }
    log
}

/// Returns the bytes of the file of `log`, closed as if it were whole.
fn file_of(log: &Log) -> Vec<u8> {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
    let path = folder.path().join("flight.mcap");
    let mut writer = LogWriter::create(&path, &log.scenario_toml, 10_000_000).expect("can be created");
    let states = log.states.iter().map(|m| Record::from(*m)).chain(log.references.iter().map(|m| Record::from(*m)));
    let all = states.chain(log.controls.iter().map(|m| Record::from(*m)));
    let all = all.chain(log.actuators.iter().map(|m| Record::from(*m)));
    let all = all.chain(log.truths.iter().map(|m| Record::from(*m)));
    all.for_each(|record| writer.write(&record).expect("can be written"));
    log.events.iter().for_each(|event| writer.write_event(event).expect("can be written"));
    writer.finish().expect("can be finished");
    fs::read(&path).expect("can be read")
}

/// Judges a folder with this log, run.json and settings. Returns the log as it is read, and the verdict; `None` if the
/// folder is refused.
fn judged(log: &[u8], run: Option<&str>, settings: &str) -> Option<(Log, ReplayVerdict)> {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
    fs::write(folder.path().join("flight.mcap"), log).expect("can be written");
    fs::write(folder.path().join("scenario.toml"), settings).expect("can be written");
    if let Some(run) = run {
        fs::write(folder.path().join("run.json"), run).expect("can be written");
    }
    let recorded = Recorded::read(folder.path()).ok()?;
    let recording = Recording::of(&recorded).ok()?;
    let verdict = replay_and_judge(&recorded, &recording, &ReplayPlan::default(), |_, _| {}).ok()?;
    Some((log::read_parts(&recorded.path).ok()?, verdict))
}

/// Returns the record without the times of the clock. A replay has times of its own, and takes the age of a command
/// from the log, as an input (at trim, another age gives the same flight).
fn timeless(record: &Record) -> Record {
    let without = |stamp: Stamp| {
        let Stamp {
            tick, sequence, epoch, inputs, input_epochs, restored_epoch, restored_ticks, faults, delivery, ..
        } = stamp;
        Stamp {
            tick,
            sequence,
            epoch,
            inputs,
            input_epochs,
            restored_epoch,
            restored_ticks,
            faults,
            delivery,
            ..Stamp::default()
        }
    };
    match *record {
        Record::State(state) => {
            let arrivals = state.arrivals.map(|arrival| Arrival { after_ns: 0, ..arrival });
            State { stamp: without(state.stamp), applied_age_ns: 0, arrivals, ..state }.into()
        }
        Record::Reference(reference) => Reference { stamp: without(reference.stamp), ..reference }.into(),
        Record::Controls(controls) => Controls { stamp: without(controls.stamp), solve_ns: 0, ..controls }.into(),
        Record::Actuators(actuators) => Actuators { stamp: without(actuators.stamp), ..actuators }.into(),
        Record::Truth(truth) => Truth { checksum: 0, ..truth }.into(),
    }
}

/// Checks that a verdict is "the same bits" only if the log has the whole flight of run.json. The exit code may be 0
/// only if the log lacks no messages but those whose bits a fault flipped, and then the verdict names these.
fn check(log: &[u8], flown: &Flown, with_run: bool) {
    let Some((log, verdict)) = judged(log, with_run.then_some(flown.run.as_str()), &flown.settings) else { return };
    let has = |records: &dyn Fn(&Log) -> Vec<Record>| records(&log) == records(&flown.log);
    let is_intact = has(&|log| log.tick_by_tick().filter(Record::is_intact).map(|record| timeless(&record)).collect());
    let is_intact = is_intact && log.events == flown.log.events;
    let is_all = has(&|log| log.tick_by_tick().map(|record| timeless(&record)).collect());
    let is_same = verdict.text.starts_with("the same bits: state hash");
    assert!(verdict.exit_code != exit::FLOWN || with_run && is_intact, "{}", verdict.text);
    assert!(!is_same || is_all && verdict.exit_code == exit::FLOWN, "{}", verdict.text);
    assert!(
        is_same || verdict.exit_code != exit::FLOWN || verdict.text.contains("a fault flipped"),
        "{}",
        verdict.text
    );
}

#[test]
fn an_undamaged_log_is_the_same() {
    for flown in FLOWN.iter() {
        for log in [&flown.bytes, &file_of(&flown.log)] {
            let (_, verdict) = judged(log, Some(&flown.run), &flown.settings).expect("it is flown again");
            assert_eq!(verdict.exit_code, exit::FLOWN, "{}", verdict.text);
        }
    }
}

proptest! {
    #![proptest_config(cases(32))]

    #[test]
    fn a_log_cut_thinned_or_mixed_is_never_the_same(
        which in any::<Index>(),
        damages in vec(damage(), 0..4),
        cut in prop::option::weighted(0.3, 0.0..1.0_f64),
        with_run in prop::bool::weighted(0.9),
    ) {
        let flown = which.get(&FLOWN);
        let mut bytes = if damages.is_empty() { flown.bytes.clone() } else { file_of(&damaged(&flown.log, &damages)) };
        bytes.truncate((bytes.len() as f64 * cut.unwrap_or(1.0)) as usize);
        check(&bytes, flown, with_run);
    }

    #[test]
    fn a_log_beside_the_run_json_of_another_flight_is_never_the_same(one in any::<Index>(), other in any::<Index>()) {
        let (one, other) = (one.get(&FLOWN), other.get(&FLOWN));
        check(&one.bytes, other, true);
    }
}
