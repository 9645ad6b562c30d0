//! Logs that are torn, damaged, or of another program.

use super::super::write;
use super::*;

/// Returns the bytes of a finished log of 1000 states.
fn thousand_states() -> Vec<u8> {
    let (_folder, path) = place();
    let mut log = LogWriter::create(&path, SCENARIO, 10_000_000).unwrap();
    write_states(&mut log, 0..1000);
    log.finish().unwrap();
    fs::read(&path).unwrap()
}

fn read_bytes(bytes: &[u8]) -> anyhow::Result<Log> {
    let (_folder, path) = place();
    fs::write(&path, bytes).unwrap();
    read(&path)
}

#[test]
fn a_log_that_is_not_compressed_is_read() {
    let whole = thousand_states();
    let options = WriteOptions::new().compression(None).chunk_size(Some(64 << 10));
    let mut writer = options.create(std::io::Cursor::new(vec![])).unwrap();
    writer.write_metadata(&write::metadata(super::super::SCENARIO.0, &[(super::super::SCENARIO.1, SCENARIO)])).unwrap();
    for message in messages(&whole) {
        writer.write(&message).unwrap();
    }
    writer.finish().unwrap();
    let plain = writer.into_inner().into_inner();
    assert!(whole.len() < plain.len() / 4, "{} of {} bytes", whole.len(), plain.len());
    let log = read_bytes(&plain).unwrap();
    assert!(log.complete(), "{:?}", log.defect);
    assert!(log.states.into_iter().eq((0..1000).map(state)));
}

#[test]
fn a_log_of_another_compression_is_refused_by_its_name() {
    let mut log = thousand_states();
    while let Some(at) = log.windows(3).position(|bytes| bytes == b"lz4") {
        log[at..at + 3].copy_from_slice(b"xyz");
    }
    let error = read_bytes(&log).unwrap_err().to_string();
    assert!(error.contains("compressed it with xyz") && error.contains("mcap compress"), "{error}");
}

proptest! {
    #[test]
    fn a_torn_log_reads_to_the_tear(share in 0.0..1.0_f64) {
        let whole = thousand_states();
        let torn = &whole[..(whole.len() as f64 * share) as usize];
        let Ok(log) = read_bytes(torn) else {
            prop_assert!(torn.len() < 200, "the scenario comes first");
            return Ok(());
        };
        prop_assert!(!log.complete());
        prop_assert!(log.states.iter().copied().eq((0..log.states.len() as u64).map(state)));
        // Only the torn chunk is lost (64 KiB of messages of 350 bytes).
        let bytes_each = whole.len() as f64 / 1000.0;
        prop_assert!(log.states.len() as f64 > torn.len() as f64 / bytes_each - 300.0);
    }

    #[test]
    fn damage_never_passes_for_data(flips in proptest::collection::vec((0.0..1.0_f64, 0..8_u32), 1..4)) {
        let whole = thousand_states();
        let mut damaged = whole.clone();
        for (share, bit) in flips {
            damaged[(whole.len() as f64 * share) as usize] ^= 1 << bit;
        }
        let Ok(log) = read_bytes(&damaged) else { return Ok(()) };
        prop_assert!(!log.complete() || damaged == whole);
        let ticks: Vec<u64> = log.states.iter().map(|m| m.stamp.tick).collect();
        prop_assert!(ticks.is_sorted_by(|a, b| a < b));
        prop_assert!(log.states.iter().copied().eq(ticks.into_iter().map(state)));
    }

    #[test]
    fn garbage_is_refused_by_name(mut bytes in proptest::collection::vec(any::<u8>(), 0..2000), magic: bool) {
        if magic {
            bytes.splice(0..0, mcap::MAGIC.iter().copied());
        }
        let error = read_bytes(&bytes).unwrap_err().to_string();
        prop_assert!(error.contains("flight.mcap is not a flight log"), "{}", error);
    }
}
