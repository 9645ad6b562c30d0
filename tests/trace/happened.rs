//! Events and faults of a flight in its trace, and its errors.

use flight::event::{Event, TimedEvent, What};
use outcome::faults::FaultRecord;
use settings::{Fault, FaultKind, FaultTarget};

use super::*;

#[test]
fn faults_are_slices_and_events_are_marks_in_lanes_of_their_own() {
    let acted = |target, kind, from_s, ended_at_s| FaultRecord {
        injected_at_s: Some(from_s),
        ended_at_s,
        ..FaultRecord::of(&Fault::new(target, kind, from_s, None))
    };
    let faults = [
        acted(FaultTarget::Wind, FaultKind::Gust, 0.01, Some(0.05)),
        acted(FaultTarget::Mixer, FaultKind::Kill, 0.02, None),
        acted(FaultTarget::Tilt, FaultKind::Off, 7.0, None),
    ];
    let all = [
        Event::new(2, "mixer", 1, What::Died).because("signal 9"),
        Event::new(6, "mixer", 2, What::TookOver),
        Event::new(7, "recorder", 2, What::TookOver),
        Event::new(6000, "plant", 1, What::Died),
    ];
    let trace = traced_with(&ring(10), &Happenings::new(&faults, &TimedEvent::all(&all, 100)));
    let slices = events(&trace, "X").into_iter().filter(|slice| lane(slice) > 5);
    let spans: Vec<_> = slices.map(|e| (lane(e), e["name"].as_str(), ns(&e["ts"]), ns(&e["dur"]))).collect();
    let ms = 1_000_000;
    let expected = [
        (6, Some("wind gust"), 10 * ms, 40 * ms),
        (6, Some("mixer kill"), 20 * ms, 0),
        (7, Some("mixer was down"), 20 * ms, 40 * ms),
    ];
    assert_eq!(spans, expected);
    let marks: Vec<_> = events(&trace, "i").into_iter().map(|e| (&e["name"], ns(&e["ts"]), &e["tid"])).collect();
    let texts: Vec<_> = marks.iter().map(|(name, at, thread)| format!("{name} {at} {thread}")).collect();
    let expected = ["\"mixer died\" 20000000 1", "\"mixer took over\" 60000000 1", "\"recorder took over\" 70000000 2"];
    assert_eq!(texts, expected);
}

#[test]
fn the_position_error_is_that_of_run_json() {
    let log = ring(10);
    let reference = |error_m| {
        let mut log = log.clone();
        log.references.iter_mut().for_each(|reference| reference.position_m[0] = error_m);
        let errors = traced(&log);
        events(&errors, "C").into_iter().filter_map(|event| event["args"]["m"].as_f64()).collect::<Vec<_>>()
    };
    assert_eq!(reference(5.0), reference(0.0), "what guidance says it was asked for plays no part");
}

#[test]
fn an_arrow_passes_only_nodes_that_received_the_sample() {
    let mut log = ring(4);
    log.states[2].stamp.start_ns += 600_000; // the other nodes no longer waited for it
    log.states[2].stamp.publish_ns[0] += 600_000;
    let trace = traced(&log);
    assert!(events(&trace, "s").into_iter().all(|arrow| arrow["id"] != 3));
    assert_eq!(events(&trace, "s").len(), 3);
}
