//! The matrix for people.

use std::fmt::Write;

use super::Results;
use super::case::Promise;
use super::one_flight::Row;

/// The rows of the matrix.
pub fn table(results: &Results) -> String {
    let head = ["fault", "detected", "recovered", "tilt", "error", "after 5 s", "verdict"];
    let mut text = String::from(
        "detected and recovered [s], worst roll or pitch [deg], worst and remaining position error [m]\n\n",
    );
    for (title, rows) in [("", &results.rows), ("\nprofile paper, in calm\n\n", &results.paper)] {
        if !rows.is_empty() {
            text += title;
            line(&mut text, &head.map(str::to_owned));
            for row in rows {
                line(&mut text, &cells(row));
            }
        }
    }
    text
}

fn line(text: &mut String, [fault, detected, recovered, tilt, error, back, verdict]: &[String; 7]) {
    // A String takes everything.
    let _ = writeln!(text, "{fault:<24}{detected:>9}{recovered:>11}{tilt:>9}{error:>9}{back:>11}  {verdict}");
}

fn cells(row: &Row) -> [String; 7] {
    let time = |time_s: Option<f64>| time_s.map_or_else(|| "-".to_owned(), |time_s| format!("{time_s:.2}"));
    let course = &row.course;
    [
        row.fault.clone(),
        time(course.detected_after_s),
        time(course.recovered_after_s),
        if course.tilt_deg > 90.0 { "over 90".into() } else { format!("{:.1}", course.tilt_deg) },
        format!("{:.2}", course.position_error_m),
        time(course.back_m),
        verdict(row),
    ]
}

/// What came of it, and where nothing was promised, why.
fn verdict(row: &Row) -> String {
    let fate = if row.course.lost { "lost" } else { "flew on" };
    match (row.promise, row.kept()) {
        (Promise::Recover, Some(true)) => "ok".into(),
        (Promise::Recover, _) => format!("SHORT: {fate}"),
        (Promise::Terminate, Some(true)) => {
            format!("terminated after {:.2} s", row.course.terminated_after_s.unwrap_or_default())
        }
        (Promise::Terminate, _) => format!("SHORT: {fate}, not terminated"),
        (Promise::NoPlant, _) => "lost: no plant".into(),
        (Promise::NoActuator, _) => format!("{fate}: an actuator that does not obey"),
        (Promise::Lie, _) => format!("{fate}: a sensor that lies"),
        (Promise::Error, _) => format!("{fate}: a node that errs"),
        (Promise::Late, _) => format!("{fate}: a sensor that is late"),
        (Promise::Fall, _) => format!("{fate}: no thrust for a while"),
        (Promise::Blind, _) => format!("{fate}: state unknown for {:.2} s", row.course.blind_s),
    }
}
