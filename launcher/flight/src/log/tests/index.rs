//! Parts of a log, found by its index.

use runtime::shared_role::Origin;

use super::super::index::{Parts, WantedRecords};
use super::super::{ALL, LogSpan, Memory, memories, stream};
use super::*;

const SAMPLE_NS: u64 = 10_000_000;
const TICKS: u64 = 6_000;

/// Writes a log of a minute: snapshots every ten seconds, four events, a late message, and a message with a wrong time.
fn write(path: &Path) {
    let mut log = LogWriter::create(path, SCENARIO, SAMPLE_NS).unwrap();
    for tick in 0..TICKS {
        log.write(&state(tick).with_checksum().into()).unwrap();
        if tick % 1000 == 0 {
            for topic in [Topic::State, Topic::Controls] {
                let origin = Origin { epoch: 1, done: tick + 1 };
                log.write_memory(&Memory::new(tick, topic, origin, &[tick, 1])).unwrap();
            }
        }
        if tick % 1700 == 3 {
            log.write_event(&Event::new(tick, "mixer", 1, What::Died)).unwrap();
        }
    }
    log.write(&state(7).with_checksum().into()).unwrap();
    log.write(&state(1 << 60).with_checksum().into()).unwrap();
    log.finish().unwrap();
}

/// Returns the ticks of the messages in a span, the events, and the defect.
fn read_part(path: &Path, span: LogSpan) -> (Vec<u64>, Vec<Event>, Option<String>) {
    let mut ticks = vec![];
    let log = stream(path, span, |_, record| ticks.push(record.tick())).unwrap();
    (ticks, log.events, log.defect)
}

fn seconds(from: u64, to: u64) -> LogSpan {
    from * 1_000_000_000..=to * 1_000_000_000
}

#[test]
fn a_part_is_the_same_with_the_index_and_without() {
    let (folder, whole) = place();
    write(&whole);
    let torn = folder.path().join("torn.mcap");
    let bytes = fs::read(&whole).unwrap();
    fs::write(&torn, &bytes[..bytes.len() - 1]).unwrap();
    for span in [ALL, seconds(0, 1), seconds(31, 33), seconds(59, 70), seconds(70, 80)] {
        let (by_index, without) = (read_part(&whole, span.clone()), read_part(&torn, span.clone()));
        assert!(by_index.2.is_none() && without.2.is_some());
        assert_eq!((&by_index.0, &by_index.1), (&without.0, &without.1), "{span:?}");
        assert_eq!(by_index.1.len(), 4, "every event, whenever it was");
        let expected = (0..TICKS).chain([7, 1 << 60]).filter(|tick| span.contains(&tick.saturating_mul(SAMPLE_NS)));
        assert_eq!(by_index.0.iter().sum::<u64>(), expected.sum::<u64>(), "{span:?}");
    }
    for until_s in [0, 9, 10, 35, 3000] {
        let remembered = memories(&whole, until_s * 1_000_000_000).unwrap();
        assert_eq!(remembered, memories(&torn, until_s * 1_000_000_000).unwrap());
        let tick = (until_s / 10 * 1000).min(TICKS - 1000);
        assert_eq!(remembered.iter().map(|memory| memory.tick).collect::<Vec<_>>(), [tick, tick], "{until_s} s");
    }
}

#[test]
fn chunks_outside_the_span_are_not_read() {
    let (_folder, path) = place();
    write(&path);
    let count = |wanted: WantedRecords| {
        let file = fs::File::open(&path).unwrap();
        let size = file.metadata().unwrap().len();
        let mut bytes = vec![];
        std::io::Read::read_to_end(&mut Parts::of(file, size, &wanted).unwrap(), &mut bytes).unwrap();
        bytes.len() as f64 / size as f64
    };
    assert_eq!(count(WantedRecords::Messages(ALL)), 1.0);
    assert!(count(WantedRecords::Messages(seconds(31, 33))) < 0.4);
    assert!(count(WantedRecords::Memories(seconds(31, 41))) < 0.2);
}

#[test]
fn a_damaged_index_is_reported_or_changes_nothing() {
    let (folder, path) = place();
    write(&path);
    let mut bytes = fs::read(&path).unwrap();
    let damaged = folder.path().join("damaged.mcap");
    let index = bytes.len() - 4_000;
    for at in (index..bytes.len()).step_by(13) {
        let kept = std::mem::replace(&mut bytes[at], 0xff);
        fs::write(&damaged, &bytes).unwrap();
        let mut ticks = vec![];
        let read = stream(&damaged, seconds(31, 33), |_, record| ticks.push(record.tick()));
        assert!(ticks.iter().all(|tick| (3100..=3300).contains(tick)), "byte {at}");
        assert!(ticks.len() == 201 || read.is_err() || read.is_ok_and(|log| log.defect.is_some()), "byte {at}");
        bytes[at] = kept;
    }
}
