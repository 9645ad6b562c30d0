//! Several recorders of one flight.

use super::super::read::read_in_order;
use super::super::{ALL, Log, join, read_parts};
use super::*;

fn with_checksum(tick: u64) -> State {
    state(tick).with_checksum()
}

/// Writes `states` to a part of the log, and finishes it if `closed`.
fn part(path: &std::path::Path, states: impl IntoIterator<Item = State>, closed: bool) {
    let mut log = LogWriter::create_part(path, SCENARIO, 10_000_000, "this").unwrap();
    states.into_iter().for_each(|state| log.write(&state.into()).unwrap());
    log.flush().unwrap();
    if closed {
        log.finish().unwrap();
    } else {
        std::mem::forget(log); // as if the writer was killed
    }
}

#[test]
fn joined_parts_have_each_message_once_and_in_order() {
    let (folder, first) = place();
    let parts =
        [first.clone(), folder.path().join("2.mcap"), folder.path().join("3.mcap"), folder.path().join("4.mcap")];
    // Message 3 was sent twice; a stale message came after message 7, and a damaged message after the stale one.
    let stale = State { stamp: Stamp { tick: 2, sequence: 8, ..Stamp::default() }, ..State::default() }.with_checksum();
    let mut bent = with_checksum(8);
    bent.stamp.tick = u64::MAX;
    let odd = [stale, bent];
    part(&parts[0], (0..4).chain(3..6).map(with_checksum), false);
    part(&parts[1], (3..4).chain(3..8).map(with_checksum).chain(odd), true);
    part(&parts[2], odd.into_iter().chain((8..10).chain(15..20).map(with_checksum)), true);

    let event = Event::new(5, "recorder", 2, What::Started);
    let outcome = join(&parts, &settings::Scenario::default(), std::slice::from_ref(&event), 20).unwrap();
    let log = read(&first).unwrap();
    let expected = (0..4).chain(3..8).map(with_checksum).chain(odd).chain((8..10).chain(15..20).map(with_checksum));
    assert_eq!(log.states, expected.collect::<Vec<_>>());
    assert!(log.complete() && log.events == [event]);
    assert_eq!((outcome.records, outcome.dropped, outcome.error), (19, 5, None), "10 to 14 are missing");
    assert!(parts[1..].iter().all(|part| !part.exists()));
}

#[test]
fn joining_keeps_the_order_of_writing_across_topics() {
    let (folder, first) = place();
    let second = folder.path().join("2.mcap");
    let reference = |tick: u64| {
        let stamp = Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() };
        Record::from(Reference { stamp, ..Reference::default() }.with_checksum())
    };
    let bent = reference(1 << 60);
    let one = [with_checksum(0).into(), reference(0), with_checksum(1).into(), bent];
    let other = [one[2], bent, reference(2), with_checksum(2).into()];
    for (path, records) in [(&first, one), (&second, other)] {
        let mut log = LogWriter::create_part(path, SCENARIO, 10_000_000, "this").unwrap();
        for record in &records {
            log.write(record).unwrap();
        }
        log.finish().unwrap();
    }
    join(&[first.clone(), second], &settings::Scenario::default(), &[], 6).unwrap();
    let mut joined = vec![];
    read_in_order(&first, ALL, |_, record| joined.push(*record)).unwrap();
    assert_eq!(joined, [&one[..], &other[2..]].concat());
}

#[test]
fn parts_that_cannot_be_joined_stay_as_they_are() {
    let (folder, first) = place();
    let second = folder.path().join("2.mcap");
    part(&first, (0..4).map(with_checksum), false);
    part(&second, (4..8).map(with_checksum), true);
    std::fs::create_dir(first.with_extension("joined")).unwrap();
    let error = join(&[first.clone(), second.clone()], &settings::Scenario::default(), &[], 8).unwrap_err();
    assert!(format!("{error:#}").contains("joined"), "{error:#}");
    assert_eq!((read(&first).unwrap().states.len(), read(&second).unwrap().states.len()), (4, 4));
}

#[test]
fn parts_that_were_not_joined_are_read_as_one_log() {
    let (folder, first) = place();
    let third = folder.path().join("flight.3.mcap");
    part(&first, (0..4).map(with_checksum), false);
    part(&third, (3..8).map(with_checksum), false);
    std::fs::write(folder.path().join("flight.x.mcap"), "no part").unwrap();
    let log = read_parts(&first).unwrap();
    assert!(log.states.iter().copied().eq((0..8).map(with_checksum)));
    let defect = log.defect.unwrap();
    for told in ["flight.mcap: ", "flight.2.mcap is missing", "flight.3.mcap: "] {
        assert!(defect.contains(told), "{told}: {defect}");
    }
    assert!(first.exists() && third.exists(), "the folder stays as it is");
    std::fs::remove_file(&first).unwrap();
    assert_eq!(read_parts(&first).unwrap().scenario_toml, SCENARIO, "from a later part");
    std::fs::remove_file(&third).unwrap();
    assert!(format!("{:#}", read_parts(&first).unwrap_err()).contains("flight.mcap"));
}

/// The log of another flight has the name of a second recorder's part.
#[test]
fn a_log_of_another_run_is_not_mixed_into_this_one() {
    let (folder, first) = place();
    part(&first, (0..4).map(with_checksum), true);
    let write_stray = |name: &str| {
        let mut stray = LogWriter::create(&folder.path().join(name), SCENARIO, 10_000_000).unwrap();
        (0..9).for_each(|tick| stray.write(&with_checksum(tick).into()).unwrap());
        stray.finish().unwrap();
    };
    write_stray("flight.2.mcap");
    let log = read_parts(&first).unwrap();
    assert_eq!((log.states.len(), log.defect), (4, None));
    part(&folder.path().join("flight.3.mcap"), (4..6).map(with_checksum), true);
    let log = read_parts(&first).unwrap();
    assert_eq!((log.states.len(), log.defect.as_deref()), (6, Some("flight.2.mcap is of another run")));
}

#[test]
fn messages_come_tick_by_tick_and_each_topic_in_the_order_of_writing() {
    let stale = State { stamp: Stamp { tick: 0, sequence: 9, ..Stamp::default() }, ..State::default() }.with_checksum();
    let mut bent = with_checksum(1);
    bent.stamp.tick = u64::MAX;
    let reference = |tick| {
        let stamp = Stamp { tick, sequence: tick + 1, ..Stamp::default() };
        Reference { stamp, ..Reference::default() }.with_checksum()
    };
    let log = Log {
        states: vec![with_checksum(0), with_checksum(1), stale, bent, with_checksum(2)],
        references: (0..3).map(reference).collect(),
        truths: (0..3).map(|tick| Truth { tick, ..Truth::default() }.with_checksum()).collect(),
        ..Log::default()
    };
    let told: Vec<_> = log.tick_by_tick().map(|record| (record.kind(), record.tick())).collect();
    let truth = Topic::COUNT;
    let expected =
        [(truth, 0), (0, 0), (1, 0), (truth, 1), (0, 1), (0, 0), (0, u64::MAX), (1, 1), (truth, 2), (0, 2), (1, 2)];
    assert_eq!(told, expected);
}
