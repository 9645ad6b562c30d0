//! The flights for people: a line for every victim.

use std::fmt::Write;

use super::Results;
use super::draw::{Moment, Victim};
use super::one_flight::Row;
use super::targets::{farthest, median, times};

const HEAD: [&str; 13] = [
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

/// The table, with how long it took.
pub fn table(results: &Results) -> String {
    let at = |moment| results.kills().filter(|kill| kill.moment == moment).count();
    let mut text = format!(
        "{} kills in {} flights, {:.0} s: {} at start-up, {} within the first ticks, {} of candidates; {} given up\n\
         exit codes and worst error [m] are of the flights with such a kill; successor: until its first message [ms];\n\
         lost: of the log, before its recorder was killed, at most [ms];\n\
         gone: until the last process of a dead launcher was [ms]\n\n",
        results.kills().count(),
        results.rows.len(),
        results.wall_s,
        at(Moment::Starting),
        at(Moment::FirstTicks),
        at(Moment::Candidate),
        results.rows.iter().map(|row| row.given_up.len()).sum::<usize>(),
    );
    line(&mut text, &HEAD.map(str::to_owned));
    for victim in Victim::ALL {
        line(&mut text, &cells(results, victim));
    }
    text
}

fn line(text: &mut String, cells: &[String; 13]) {
    let _ = write!(text, "{:<14}", cells[0]); // a String takes everything
    for cell in &cells[1..] {
        let _ = write!(text, "{cell:>10}");
    }
    text.push('\n');
}

fn cells(results: &Results, victim: Victim) -> [String; 13] {
    let struck = |row: &&Row| row.kills.iter().any(|kill| kill.victim == victim);
    let flights: Vec<&Row> = results.rows.iter().filter(struck).collect();
    let coded = |code| flights.iter().filter(|row| row.code == Some(code)).count();
    let kills = || results.kills().filter(|kill| kill.victim == victim);
    let successors = times(kills().filter_map(|kill| kill.successor_ms));
    let lost = times(kills().filter_map(|kill| kill.lost_ms));
    let gone = times(flights.iter().filter(|_| victim == Victim::Launcher).filter_map(|row| row.gone_ms));
    let number = |value: Option<f64>, places: usize| value.map_or("-".to_owned(), |value| format!("{value:.places$}"));
    [
        victim.name().to_owned(),
        kills().count().to_string(),
        flights.len().to_string(),
        coded(0).to_string(),
        coded(3).to_string(),
        (flights.len() - coded(0) - coded(3)).to_string(),
        number(farthest(flights.iter().copied()), 3),
        number(median(&successors), 1),
        number(successors.last().copied(), 1),
        number(lost.last().copied(), 1),
        number(median(&gone), 1),
        number(gone.last().copied(), 1),
        flights.iter().map(|row| row.left.len()).sum::<usize>().to_string(),
    ]
}
