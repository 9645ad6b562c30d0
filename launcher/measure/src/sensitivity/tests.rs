//! Tests of cells, point and page with invented flights.

use super::map::{GridFlight, Place};
use super::*;

fn flight(controller: &str, [delay_ms, jitter_ms, miss_probability]: [f64; 3], seed: u64) -> GridFlight {
    let max = 0.05 + seed as f64;
    GridFlight {
        at: Place { controller: controller.into(), delay_ms, jitter_ms, miss_probability },
        seed,
        failed_at_s: None,
        max_position_error_m: max,
        rms_position_error_m: max / 2.0,
    }
}

#[test]
fn the_worst_flight_of_a_cell_counts() {
    let at = |delay, seed| flight("paper", [delay, 2.0, 0.1], seed);
    let mut flights = vec![at(0.0, 0), at(0.0, 1), at(1.0, 0), at(1.0, 2)];
    let cells = map::gather(&flights);
    assert_eq!(
        cells.iter().map(|c| (c.at.delay_ms, c.flights, c.lost)).collect::<Vec<_>>(),
        [(0.0, 2, 0), (1.0, 2, 0)]
    );
    assert_eq!(cells[1].max_position_error_m, Some(2.05));
    assert_eq!(cells[1].rms_position_error_m, Some(1.025));
    flights[2].failed_at_s = Some(5.8);
    let cells = map::gather(&flights);
    assert_eq!((cells[1].lost, cells[1].max_position_error_m, cells[1].rms_position_error_m), (1, None, None));
}

#[test]
fn a_flight_is_one_line_of_csv() {
    let mut lost = flight("robust", [58.0, 0.0, 0.4], 7);
    lost.failed_at_s = Some(5.8);
    let csv = map::to_csv(&[flight("paper", [4.0, 2.0, 0.0], 0), lost]);
    let lines: Vec<&str> = csv.lines().skip(1).collect();
    assert_eq!(lines, ["paper,4,2,0,0,,0.05,0.025", "robust,58,0,0.4,7,5.8,7.05,3.525"]);
    let columns = |line: &str| line.split(',').count();
    assert!(csv.lines().all(|line| columns(line) == columns(lines[0])));
}

/// Flights of both profiles, one of which was lost.
fn flown() -> Vec<GridFlight> {
    let mut flights = vec![
        flight("paper", [4.0, 0.0, 0.0], 0),
        flight("paper", [10.0, 0.0, 0.0], 0),
        flight("robust", [58.0, 0.0, 0.0], 0),
        flight("robust", [0.0, 0.0, 0.4], 0),
    ];
    flights[1].failed_at_s = Some(5.8);
    flights
}

#[test]
fn the_table_tells_the_last_delay_before_a_loss() {
    let at = |delay, failed_at_s| GridFlight { failed_at_s, ..flight("paper", [delay, 0.0, 0.0], 0) };
    let flights = [at(0.0, None), at(4.0, None), at(6.0, Some(46.0)), at(8.0, None)];
    let table = table(&map::gather(&flights), None, Path::new("out"));
    assert!(table.contains("4 ms, 0.050 m") && !table.contains("8 ms"), "{table}");
    assert!(table.contains("no operating point"), "{table}");
    let lost = super::table(&map::gather(&[at(0.0, Some(1.0))]), None, Path::new("out"));
    assert!(lost.contains("never"), "{lost}");
}

#[test]
fn the_table_says_that_a_limit_is_outside_of_the_flown_delays() {
    let at = |delay, failed_at_s| GridFlight { failed_at_s, ..flight("robust", [delay, 0.0, 0.0], 0) };
    let table = |flights: &[GridFlight]| table(&map::gather(flights), None, Path::new("out"));
    let above = table(&[at(60.0, None), at(64.0, None)]);
    assert!(above.contains("64 ms or more, 0.050 m"), "{above}");
    let below = table(&[at(2.0, Some(1.0)), at(4.0, None)]);
    assert!(below.contains("less than 2 ms") && !below.contains("never"), "{below}");
    let inside = table(&[at(60.0, None), at(64.0, Some(1.0))]);
    assert!(inside.contains("60 ms, 0.050 m") && !inside.contains("or more"), "{inside}");
}

#[test]
fn the_page_has_a_map_for_each_probability_and_the_point_in_the_nearest() {
    let mut flights = flown();
    flights.push(flight("robust", [5.0, 2.0, 0.4], 0));
    let point = Point { age_p50_ms: 0.5, age_p99_ms: 1.5, miss_probability: 0.01 };
    let page = picture::page("a <b> & c", &map::gather(&flights), Some(&point));
    assert!(page.contains("a &lt;b&gt; &amp; c") && !page.contains("<b>"));
    assert_eq!(page.matches("% missed</text>").count(), 3, "one of paper, two of robust");
    assert_eq!(page.matches("class=\"point\"").count(), 2, "one for each profile");
    assert_eq!(page.matches("1 of 1 lost").count(), 1);
    for tag in ["svg", "g", "text", "section", "div", "main", "p"] {
        let opened = page.matches(&format!("<{tag} ")).count() + page.matches(&format!("<{tag}>")).count();
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
    let without = picture::page("x", &map::gather(&flights), None);
    assert!(!without.contains("class=\"point\"") && without.contains("No operating point"));
}

#[test]
fn a_run_of_other_software_has_no_point() {
    let folder = tempfile::tempdir().unwrap();
    let read = |text: &str| {
        std::fs::write(folder.path().join("run.json"), text).unwrap();
        format!("{:#}", Point::read(folder.path()).unwrap_err())
    };
    assert!(read("{").contains("is not JSON"));
    assert!(read("{}").contains("is no run.json of this program"));
}
