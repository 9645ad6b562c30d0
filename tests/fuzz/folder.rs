//! Folders of runs whose files were damaged or forged: `report` and `export` end with an error or a page.

use std::fs;
use std::sync::LazyLock;

use contract::message::Message;
use flight::log::{self, Log, LogWriter, Record};
use outcome::recorded::{Recorded, TimeSpan};
use proptest::collection::vec;
use proptest::prelude::*;
use serde_json::{Value, json};
use view::export::perfetto::{self, Window};
use view::report;

use super::{cases, edited, edits};
use crate::harness::fly;

/// flight.mcap and run.json of a short flight in real time in which guidance is killed.
static FLOWN: LazyLock<(Vec<u8>, String)> = LazyLock::new(|| {
    let kill = "fault=[{ at_s = 0.1, for_s = 0.1, target = \"guidance\", kind = \"kill\" }]";
    let outcome = fly(&["--mode", "realtime", "--set", "run.duration_s=0.4", "--set", kill]);
    let log = fs::read(outcome.out.join("flight.mcap")).unwrap_or_else(|e| panic!("{e}: {}", outcome.stderr));
    (log, outcome.run().to_string())
});

/// Writes these two files into a folder, and reads the folder in every way.
fn look(flight: &[u8], run: Option<&[u8]>) {
    // The folder is in memory, because a report is synced to the disk before it is finished.
    let folder = tempfile::tempdir_in("/dev/shm").expect("a temporary folder");
    let path = folder.path().join("flight.mcap");
    fs::write(&path, flight).expect("can be written");
    if let Some(run) = run {
        fs::write(folder.path().join("run.json"), run).expect("can be written");
    }
    let page = report::write(folder.path(), TimeSpan::ALL, replay::explain::costs);
    assert_eq!(page.is_ok(), folder.path().join("report.html").exists());
    let Ok(Recorded { scenario, run, .. }) = Recorded::read(&path) else { return };
    for (from_s, for_s) in [(None, 1.0), (Some(0.05), 1e300)] {
        let records = |each: &mut dyn FnMut(&Record)| log::stream(&path, log::ALL, |_, record| each(record)).map(drop);
        let worst = run.timing.as_ref().and_then(|timing| timing.worst_ticks.first());
        let window = Window::new(from_s, for_s, scenario.sample_s(), worst);
        let _ = perfetto::document(records, &scenario, &run.happenings(), &window);
    }
}

/// Returns the log of the flight with some words of some messages replaced, and with correct checksums of the file.
fn forged(words: &[(prop::sample::Index, usize, u64)]) -> Vec<u8> {
    fn forge<M: Message>(messages: &mut [M], which: prop::sample::Index, word: usize, bits: u64) {
        let message = &mut messages[which.index(messages.len())];
        let words: &mut [u64] = bytemuck::cast_slice_mut(bytemuck::bytes_of_mut(message));
        words[word % words.len()] = bits;
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("flight.mcap");
    fs::write(&path, &FLOWN.0).expect("can be written");
    let Log { scenario_toml, mut states, mut references, mut controls, mut actuators, events, .. } =
        log::read(&path).expect("a whole log");
    for (i, &(which, word, bits)) in words.iter().enumerate() {
        match i % 4 {
            0 => forge(&mut states, which, word, bits),
            1 => forge(&mut references, which, word, bits),
            2 => forge(&mut controls, which, word, bits),
            _ => forge(&mut actuators, which, word, bits),
        }
    }
    let mut writer = LogWriter::create(&path, &scenario_toml, 10_000_000).expect("can be created");
    let all = states.into_iter().map(Record::from).chain(references.into_iter().map(Record::from));
    let all = all.chain(controls.into_iter().map(Record::from)).chain(actuators.into_iter().map(Record::from));
    all.for_each(|record| writer.write(&record).expect("can be written"));
    for event in events {
        writer.write_event(&event).expect("can be written");
    }
    writer.finish().expect("can be finished");
    fs::read(&path).expect("can be read")
}

/// Replaces leaf number `which` of `value` by `odd`.
fn replace(value: &mut Value, which: &mut usize, odd: &Value) {
    match value {
        Value::Array(items) if !items.is_empty() => items.iter_mut().for_each(|item| replace(item, which, odd)),
        Value::Object(fields) if !fields.is_empty() => {
            fields.values_mut().for_each(|field| replace(field, which, odd));
        }
        leaf => {
            if *which == 0 {
                *leaf = odd.clone();
            }
            *which = which.wrapping_sub(1);
        }
    }
}

proptest! {
    #![proptest_config(cases(24))]

    #[test]
    fn a_damaged_log(edits in edits(), cut in prop::option::of(0.0..1.0_f64)) {
        let mut bytes = edited(FLOWN.0.clone(), &edits);
        bytes.truncate((bytes.len() as f64 * cut.unwrap_or(1.0)) as usize);
        look(&bytes, Some(FLOWN.1.as_bytes()));
        look(&bytes, None);
    }

    #[test]
    fn a_forged_log(
        words in vec((any::<prop::sample::Index>(), 0..100_usize, prop_oneof![
            any::<u64>(), 0..100_u64, Just(u64::MAX), Just(1 << 63), Just(f64::NAN.to_bits()), Just(1e300_f64.to_bits()),
        ]), 1..12),
    ) {
        look(&forged(&words), None);
    }

    #[test]
    fn a_damaged_summary(edits in edits()) {
        look(&FLOWN.0, Some(&edited(FLOWN.1.clone().into_bytes(), &edits)));
    }

    #[test]
    fn a_summary_with_odd_values(changes in vec((0..600_usize, 0..8_usize), 1..6)) {
        let odd = [json!(null), json!(-1), json!(1e308), json!(u64::MAX), json!("</td>"), json!([]), json!({}), json!([[1]])];
        let mut run: Value = serde_json::from_str(&FLOWN.1).expect("run.json is JSON");
        for (which, what) in changes {
            replace(&mut run, &mut which.clone(), &odd[what]);
        }
        look(&FLOWN.0, Some(run.to_string().as_bytes()));
    }
}
