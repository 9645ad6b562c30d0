//! Logs with forged memories: a replay that begins with a forged memory is refused or flown, and never crashes the
//! launcher.
//!
//! `PROPTEST_CASES=1000 cargo test --workspace --test stack fuzz::memories` tries more cases.

use std::fs;
use std::sync::LazyLock;
use std::time::{Duration, Instant};

use contract::exit;
use flight::log::{self, Log, LogWriter, Memory};
use outcome::recorded::{Recorded, TimeSpan};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use replay::verdict::replay_and_judge;
use replay::{Recording, ReplayPlan};
use tempfile::TempDir;

use super::cases;
use crate::harness::fly;

/// A flight through gusts with noise and a delaying link: its log after 9 s without memories, the memories of its nodes
/// at 10 s, and its run.json.
struct Flown {
    log: Log,
    memories: Vec<Memory>,
    run: String,
}

static FLOWN: LazyLock<Flown> = LazyLock::new(|| {
    let delay = "fault=[{ at_s = 9.0, for_s = 2.0, target = \"controls\", kind = \"delay\", ms = 15.0 }]";
    let sets = ["--set", "run.duration_s=10.4", "--set", delay];
    let outcome = fly(&[&["scenarios/typical-sensors.toml", "--mode", "inprocess"], &sets[..]].concat());
    let path = outcome.out.join("flight.mcap");
    let mut log = log::read(&path).expect("a whole log");
    log.states.retain(|message| message.stamp.tick > 900);
    log.references.retain(|message| message.stamp.tick > 900);
    log.controls.retain(|message| message.stamp.tick > 900);
    log.actuators.retain(|message| message.stamp.tick > 900);
    log.truths.retain(|truth| truth.tick > 900);
    let memories = log::memories(&path, u64::MAX).expect("memories");
    assert_eq!(memories.len(), 4, "of every node");
    Flown { log, memories, run: fs::read_to_string(outcome.out.join("run.json")).expect("run.json") }
});

/// Change of one of the memories.
#[derive(Debug, Clone)]
enum Forgery {
    Word(Index, Index, u64),
    Flip(Index, Index, u32),
    Length(Index, usize),
    Tick(Index, u64),
    Epoch(Index, u64),
    Done(Index, u64),
    Swap(Index, Index),
    Leave(Index),
}

fn number() -> impl Strategy<Value = u64> {
    let odd =
        [0, 1, 2, 1000, 1 << 31, 1 << 63, u64::MAX, f64::INFINITY.to_bits(), f64::NAN.to_bits(), 1e300_f64.to_bits()];
    prop_oneof![select(odd.to_vec()), any::<u64>(), 0..100_u64]
}

fn forgery() -> impl Strategy<Value = Forgery> {
    let which = any::<Index>;
    prop_oneof![
        6 => (which(), which(), number()).prop_map(|(memory, word, value)| Forgery::Word(memory, word, value)),
        6 => (which(), which(), 0..64_u32).prop_map(|(memory, word, bit)| Forgery::Flip(memory, word, bit)),
        1 => (which(), 0..5000_usize).prop_map(|(memory, length)| Forgery::Length(memory, length)),
        1 => (which(), number()).prop_map(|(memory, tick)| Forgery::Tick(memory, tick)),
        1 => (which(), number()).prop_map(|(memory, epoch)| Forgery::Epoch(memory, epoch)),
        1 => (which(), number()).prop_map(|(memory, done)| Forgery::Done(memory, done)),
        1 => (which(), which()).prop_map(|(one, other)| Forgery::Swap(one, other)),
        1 => which().prop_map(Forgery::Leave),
    ]
}

fn forge(memories: &mut Vec<Memory>, forgery: &Forgery) {
    let count = memories.len();
    if count == 0 {
        return;
    }
    let at = |index: &Index| index.index(count);
    match forgery {
        Forgery::Word(memory, word, value) => {
            let words = &mut memories[at(memory)].words;
            if !words.is_empty() {
                *word.get_mut(words) = *value;
            }
        }
        Forgery::Flip(memory, word, bit) => {
            let words = &mut memories[at(memory)].words;
            if !words.is_empty() {
                *word.get_mut(words) ^= 1 << bit;
            }
        }
        Forgery::Length(memory, length) => memories[at(memory)].words.resize(*length, 7),
        Forgery::Tick(memory, tick) => memories[at(memory)].tick = *tick,
        Forgery::Epoch(memory, epoch) => memories[at(memory)].origin.epoch = *epoch,
        Forgery::Done(memory, done) => memories[at(memory)].origin.done = *done,
        Forgery::Swap(one, other) => {
            let words = memories[at(one)].words.clone();
            memories[at(other)].words = words;
        }
        Forgery::Leave(memory) => {
            memories.remove(at(memory));
        }
    }
}

/// Makes a folder with the flight and these memories.
fn folder(memories: &[Memory]) -> TempDir {
    let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
    let log = &FLOWN.log;
    let mut writer =
        LogWriter::create(&folder.path().join("flight.mcap"), &log.scenario_toml, 10_000_000).expect("can be created");
    log.tick_by_tick().for_each(|record| writer.write(&record).expect("can be written"));
    for memory in memories {
        writer.write_memory(memory).expect("can be written");
    }
    log.events.iter().for_each(|event| writer.write_event(event).expect("can be written"));
    writer.finish().expect("can be finished");
    fs::write(folder.path().join("run.json"), &FLOWN.run).expect("can be written");
    folder
}

/// Returns exit code and message of a replay of the flight from 10.2 s on.
fn replayed(memories: &[Memory]) -> anyhow::Result<(u8, String)> {
    let folder = folder(memories);
    let part = TimeSpan { from_s: 10.2, ..TimeSpan::ALL };
    let recorded = Recorded::read_each(folder.path(), part, |_, _| {})?;
    let recording = Recording::of(&recorded)?;
    let verdict =
        replay_and_judge(&recorded, &recording, &ReplayPlan { from: 1020, ..ReplayPlan::default() }, |_, _| {})?;
    Ok((verdict.exit_code, verdict.text))
}

#[test]
fn what_was_remembered_flies_on() {
    let (code, text) = replayed(&FLOWN.memories).expect("flown again");
    assert!(code == 0 && text.contains("begun with the snapshots at 10.00 s"), "{text}");
}

proptest! {
    #![proptest_config(cases(64))]

    #[test]
    fn a_forged_memory_is_refused_or_flown(forgeries in vec(forgery(), 1..4)) {
        let mut memories = FLOWN.memories.clone();
        for forgery in &forgeries {
            forge(&mut memories, forgery);
        }
        let began = Instant::now();
        // A word that nothing depends on may be anything.
        if let Ok((exit::FLOWN, text)) = replayed(&memories) {
            prop_assert!(text.starts_with("no difference in what was compared\n"), "{text}");
        }
        prop_assert!(began.elapsed() < Duration::from_secs(10));
    }
}
