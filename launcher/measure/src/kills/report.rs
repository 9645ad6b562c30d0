//! Table and targets of `measure kills`.

use view::percentiles::median;

use super::KillResults;
use super::judge::{GONE_MS, LOST_MS, NEAR_M, complaint};
use super::one_flight::KillFlight;
use super::plan::{Moment, Victim};
use crate::findings::Target;
use crate::table::{Table, cell};

/// Flights that are listed by number when they went wrong.
const LISTED: usize = 5;
const HEADINGS: [&str; 13] = [
    "victim",
    "kills",
    "flights",
    "exit 0",
    "exit 3",
    "other",
    "error",
    "successor",
    "max",
    "lost",
    "gone",
    "max",
    "left",
];

pub fn text(results: &KillResults) -> String {
    let at = |moment| results.kills().filter(|kill| kill.moment == moment).count();
    let title = format!(
        "{} kills in {} flights, {:.0} s: {} at start-up, {} within the first ticks, {} of candidates; {} given up\n\
         exit codes and worst error [m] are of the flights with such a kill; successor: until its first message [ms];\n\
         lost: of the log, before its recorder was killed, at most [ms];\n\
         gone: until the last process of a dead launcher has ended [ms]\n",
        results.kills().count(),
        results.rows.len(),
        results.wall_s,
        at(Moment::Starting),
        at(Moment::FirstTicks),
        at(Moment::Candidate),
        results.rows.iter().map(|row| row.given_up.len()).sum::<usize>(),
    );
    Table::new(&title, &HEADINGS, Victim::ALL.map(|victim| cells(results, victim)).into()).text()
}

fn cells(results: &KillResults, victim: Victim) -> Vec<String> {
    let has_kill = |row: &&KillFlight| row.kills.iter().any(|kill| kill.victim == victim);
    let flights: Vec<&KillFlight> = results.rows.iter().filter(has_kill).collect();
    let coded = |code| flights.iter().filter(|row| row.code == Some(code)).count();
    let kills = || results.kills().filter(|kill| kill.victim == victim);
    let successors = || kills().filter_map(|kill| kill.successor_ms);
    let gone = || flights.iter().filter(|_| victim == Victim::Launcher).filter_map(|row| row.gone_ms);
    let counts = [kills().count(), flights.len(), coded(0), coded(3), flights.len() - coded(0) - coded(3)];
    let times = [
        median(successors()),
        most(successors()),
        most(kills().filter_map(|k| k.lost_ms)),
        median(gone()),
        most(gone()),
    ];
    let mut cells = vec![victim.name().to_owned()];
    cells.extend(counts.map(|count| count.to_string()));
    cells.push(cell(farthest(flights.iter().copied()), 3));
    cells.extend(times.map(|ms| cell(ms, 1)));
    cells.push(flights.iter().map(|row| row.left.len()).sum::<usize>().to_string());
    cells
}

pub fn targets(results: &KillResults) -> Vec<Target> {
    let rows = &results.rows;
    let kills = results.kills().count();
    let wrong: Vec<String> =
        rows.iter().filter_map(|row| Some(format!("flight {}: {}", row.flight, complaint(row)?))).collect();
    let left = rows.iter().map(|row| row.left.len()).sum::<usize>();
    let successor_ms = median(results.kills().filter_map(|kill| kill.successor_ms));
    let lost_ms = most(results.kills().filter_map(|kill| kill.lost_ms));
    let gone = || rows.iter().filter_map(|row| row.gone_ms);
    vec![
        Target::none(format!("flights of {} that did not go as they must", rows.len()), wrong.len())
            .noting(wrong[..wrong.len().min(LISTED)].join("; ")),
        Target::none(format!("left in memory or running after {kills} kills"), left),
        Target::at_most("farthest from the trajectory, flights that went on", farthest(rows), NEAR_M, "m"),
        Target::at_most("killed, until its successor's first message, median", successor_ms, 150.0, "ms"),
        Target::at_most("recorder killed, lost of the log before, max", lost_ms, LOST_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, median", median(gone()), GONE_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, max", most(gone()), GONE_MS, "ms"),
    ]
}

fn most(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// Largest error of the flights that flew to their end.
fn farthest<'a>(rows: impl IntoIterator<Item = &'a KillFlight>) -> Option<f64> {
    most(rows.into_iter().filter(|row| row.code == Some(0)).filter_map(|row| row.position_error_m))
}
