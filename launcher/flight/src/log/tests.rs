//! Logs return what was written; torn and damaged logs are recognised.

use std::{
    fs,
    path::{Path, PathBuf},
    thread::sleep,
    time::Duration,
};

use contract::{
    Topic,
    message::{Actuators, Controls, Message, Payload, Reference, Stamp, State, Truth},
};
use mcap::{WriteOptions, io::MessageReader};
use proptest::prelude::*;
use rustix::fs::{MemfdFlags, SealFlags, fcntl_add_seals, memfd_create};
use tempfile::TempDir;

use super::{Log, LogWriter, Lz4, Record, read};
use crate::event::{Event, Sender, What};

mod damage;
mod index;
mod join;

const SCENARIO: &str = "name = \"hover \u{3bc}\"\n";

/// Returns a path for a log, in a temporary folder that is removed when its handle is dropped.
fn place() -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("flight.mcap");
    (folder, path)
}

/// Returns all words of a message as bits, so that NaNs can be compared.
fn bits(record: &Record) -> Vec<u64> {
    record.words().to_vec()
}

/// Generates a message of any kind and any bits, with many values that a lossy format would change.
fn any_record() -> impl Strategy<Value = Record> {
    fn of<M: Payload>(words: &[u64]) -> M {
        *bytemuck::from_bytes(&bytemuck::cast_slice(words)[..size_of::<M>()])
    }
    let odd = [0, 1, 1 << 63, u64::MAX, f64::INFINITY.to_bits(), 0x7ff0_0000_0000_0001, 0xfff8_0000_dead_beef];
    let word = prop_oneof![any::<u64>(), proptest::sample::select(odd.to_vec()), 0..10_u64];
    (0..Record::KINDS, proptest::collection::vec(word, size_of::<State>() / 8)).prop_map(|(kind, words)| {
        match Topic::ALL.get(kind) {
            Some(Topic::State) => of::<State>(&words).into(),
            Some(Topic::Reference) => of::<Reference>(&words).into(),
            Some(Topic::Controls) => of::<Controls>(&words).into(),
            Some(Topic::Actuators) => of::<Actuators>(&words).into(),
            None => of::<Truth>(&words).into(),
        }
    })
}

/// Returns the messages of a log as MCAP's own reader reads them.
fn messages(log: &[u8]) -> Vec<mcap::Message<'static>> {
    let mut reader = MessageReader::new(log);
    reader.add_decompressor(Lz4::default()).unwrap();
    reader.map(Result::unwrap).collect()
}

/// Returns a STATE whose measured position is its tick.
fn state(tick: u64) -> State {
    let mut state = State { stamp: Stamp { tick, sequence: tick + 1, ..Default::default() }, ..Default::default() };
    state.measured.position_m[0] = tick as f64;
    state
}

/// Writes the states of `ticks`.
fn write_states(log: &mut LogWriter, ticks: std::ops::Range<u64>) {
    ticks.for_each(|tick| log.write(&state(tick).into()).unwrap());
}

proptest! {
    #[test]
    fn messages_return_bit_for_bit(records in proptest::collection::vec(any_record(), 0..20)) {
        let (_folder, path) = place();
        let mut writer = LogWriter::create(&path, SCENARIO, 10_000_000).unwrap();
        for record in &records {
            writer.write(record).unwrap();
        }
        writer.finish().unwrap();
        let log = read(&path).unwrap();
        prop_assert!(log.complete(), "{:?}", log.defect);
        prop_assert_eq!(&log.scenario_toml, SCENARIO, 10_000_000);
        let written = |kind| records.iter().filter(move |r| r.kind() == kind).map(bits).collect::<Vec<_>>();
        let states: Vec<_> = log.states.iter().map(|m| bits(&(*m).into())).collect();
        prop_assert_eq!(states, written(0));
        let references: Vec<_> = log.references.iter().map(|m| bits(&(*m).into())).collect();
        prop_assert_eq!(references, written(1));
        let controls: Vec<_> = log.controls.iter().map(|m| bits(&(*m).into())).collect();
        prop_assert_eq!(controls, written(2));
        let actuators: Vec<_> = log.actuators.iter().map(|m| bits(&(*m).into())).collect();
        prop_assert_eq!(actuators, written(3));
        let truths: Vec<_> = log.truths.iter().map(|m| bits(&(*m).into())).collect();
        prop_assert_eq!(truths, written(Topic::COUNT));
    }
}

#[test]
fn a_file_that_is_no_flight_log_is_refused() {
    let (_folder, path) = place();
    assert!(read(&path).unwrap_err().to_string().contains("cannot read"), "a missing file");

    let mut foreign = WriteOptions::new().create(fs::File::create(&path).unwrap()).unwrap();
    foreign.finish().unwrap();
    let error = read(&path).unwrap_err().to_string();
    assert!(error.contains("flight.mcap is not a flight log: it holds no scenario"), "{error}");
}

#[test]
fn log_time_is_simulated_and_publish_time_is_of_the_clock() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path, SCENARIO, 10_000_000).unwrap();
    let mut message = Controls::default();
    *message.stamp_mut() =
        Stamp { tick: 250, sequence: 7, publish_ns: [1, 2, 3_000_000_000_000, 4], ..Default::default() };
    log.write(&message.into()).unwrap();
    log.finish().unwrap();
    let bytes = fs::read(&path).unwrap();
    let logged = messages(&bytes);
    assert_eq!(logged.len(), 1);
    assert_eq!(logged[0].channel.topic, "/controls");
    assert_eq!(logged[0].log_time, 2_500_000_000);
    assert_eq!(logged[0].publish_time, 3_000_000_000_000);
    assert_eq!(logged[0].sequence, 7);
}

#[test]
fn events_stand_at_their_ticks_beside_the_messages() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path, SCENARIO, 2_000_000).unwrap();
    let mut events = [
        Event::new(3, "mixer", 1, What::Died),
        Event::new(5, "mixer", 2, What::TookOver).because("the \u{3bc} of \"it\"\n").begins(Some(0)),
    ];
    events[1].by = Some(Sender { pid: 7, user: 1000 });
    write_states(&mut log, 0..4);
    for event in &events {
        log.write_event(event).unwrap();
    }
    log.finish().unwrap();
    let returned = read(&path).unwrap();
    assert!(returned.complete());
    assert_eq!((returned.states.len(), &returned.events[..]), (4, &events[..]));

    let bytes = fs::read(&path).unwrap();
    assert!(String::from_utf8_lossy(&bytes).contains("stamp.tick times 2000000 ns"), "its rate is told");
    let logged = messages(&bytes);
    let schema = logged[4].channel.schema.clone().unwrap();
    assert_eq!((logged[4].channel.topic.as_str(), schema.encoding.as_str()), ("/events", "protobuf"));
    assert_eq!([logged[4].log_time, logged[5].log_time], [6_000_000, 10_000_000]);
}

#[test]
fn a_killed_writer_loses_at_most_a_second() {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path, SCENARIO, 10_000_000).unwrap();
    // A kill would leave what the file holds at that moment.
    let so_far = || read(&path).unwrap();
    assert_eq!(so_far().scenario_toml, SCENARIO, "from the first moment");
    write_states(&mut log, 0..5);
    sleep(Duration::from_millis(1001));
    write_states(&mut log, 5..6);
    let torn = so_far();
    assert_eq!(torn.states.len(), 6);
    assert!(!torn.complete());
    write_states(&mut log, 6..8);
    log.flush().unwrap();
    assert_eq!(so_far().states.len(), 8);
    log.finish().unwrap();
    assert!(so_far().complete());
}

#[test]
fn a_full_disk_costs_only_what_is_not_yet_written() {
    let begin = |path: &Path| {
        let file = fs::File::options().write(true).open(path).unwrap();
        LogWriter::begin(file, path, SCENARIO, 10_000_000, "")
    };
    let full = begin("/dev/full".as_ref()).err().unwrap();
    assert!(format!("{full:#}").contains("/dev/full") && format!("{full:#}").contains("No space left"), "{full:#}");

    // A file in memory, later sealed so that it cannot grow: a disk that is full in the middle of a chunk.
    let disk = memfd_create("flight", MemfdFlags::ALLOW_SEALING).unwrap();
    let path = PathBuf::from(format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&disk)));
    let mut log = begin(&path).unwrap();
    write_states(&mut log, 0..150);
    log.flush().unwrap();
    let whole_bytes = fs::metadata(&path).unwrap().len();
    rustix::fs::ftruncate(&disk, whole_bytes + 1000).unwrap();
    fcntl_add_seals(&disk, SealFlags::GROW).unwrap();

    let errors: Vec<_> = (150..2000).filter_map(|tick| log.write(&state(tick).into()).err()).collect();
    assert_eq!(errors.len(), 1, "told once");
    let told = format!("{:#}", errors[0]);
    assert!(told.contains("/proc/self/fd/") && told.contains("whole up to 1.49 s: "), "{told}");
    log.finish().unwrap();
    assert_eq!(fs::metadata(&path).unwrap().len(), whole_bytes, "cut back to the last whole chunk");
    let (_folder, copy) = place(); // `read` follows no link, and the path is a link
    fs::copy(&path, &copy).unwrap();
    let kept = read(&copy).unwrap();
    assert!(!kept.complete());
    assert!(kept.states.into_iter().eq((0..150).map(state)));
}
