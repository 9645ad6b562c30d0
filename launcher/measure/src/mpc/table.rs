//! The table: every row, the floor, and what the times contain.

use std::fmt::Write;

use super::Results;
use super::compare::Rival;
use super::distribution::Distribution;
use super::figures::{Path, Row};

/// All results as text.
pub fn table(results: &Results) -> String {
    let Results { rounds, floor: (rows, columns, floor_us), clock_us, longest_stall_us, .. } = results;
    let mut text = format!(
        "A step of the controller [us], the median of {rounds} rounds of each, steps back to back; longest: of all rounds.\n\
         {:<10}{:<12}{:<10}{:>6}{:>9}{:>9}{:>9}{:>9}{:>9}{:>10}{:>8}{:>6}{:>7}\n",
        "flight", "solver", "path", "n", "p50", "p90", "p99", "p99.9", "max", "longest", "iter", "max", "alloc"
    );
    for row in &results.rows {
        push(&mut text, &row_line(row));
    }
    push(&mut text, &format!("{:<32}{:>15.3}", format!("floor: bare {rows} x {columns} product"), floor_us));
    push(&mut text, &format!("{:<32}{clock_us:>15.3}", "clock, part of every time"));
    push(&mut text, &format!("{:<32}{longest_stall_us:>15.1}", "longest stall of an idle loop"));
    push(
        &mut text,
        &format!(
            "\nThe same problems with the disc as a polygon, limits of the moves only [us].\n{:<26}{:>6}{:>9}{:>9}{:>9}{:>9}{:>9}{:>15}{:>10}{:>10}   timed",
            "solver", "n", "mean", "p50", "p90", "p99", "max", "p50/p99 active", "differs", "unsolved"
        ),
    );
    for rival in &results.rivals {
        push(&mut text, &rival_line(rival));
    }
    text
}

fn row_line(row: &Row) -> String {
    let Distribution { n, p50_us, p90_us, p99_us, p999_us, max_us, .. } = row.step;
    let path = match row.path {
        Path::Explicit => "explicit",
        Path::Solver => "solver",
        Path::All => "all",
    };
    let allocations = row.allocations_max.map_or("-".to_owned(), |count| count.to_string());
    format!(
        "{:<10}{:<12}{path:<10}{n:>6}{p50_us:>9.2}{p90_us:>9.2}{p99_us:>9.2}{p999_us:>9.2}{max_us:>9.2}{:>10.1}{:>8.1}{:>6}{allocations:>7}",
        row.sequence, row.solver, row.longest_us, row.iterations_mean, row.iterations_max
    )
}

fn rival_line(rival: &Rival) -> String {
    let (Some(all), Some(active)) = (rival.all_us, rival.constrained_us) else {
        return format!("{:<26}nothing to solve", rival.solver);
    };
    let differs = rival.worst_difference.map_or("-".to_owned(), |difference| format!("{difference:.0e}"));
    format!(
        "{:<26}{:>6}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>9.2}{:>15}{differs:>10}{:>10}   {}",
        rival.solver,
        all.n,
        all.mean_us,
        all.p50_us,
        all.p90_us,
        all.p99_us,
        all.max_us,
        format!("{:.1}/{:.1}", active.p50_us, active.p99_us),
        rival.unsolved,
        rival.timed
    )
}

fn push(text: &mut String, line: &str) {
    let _ = writeln!(text, "{}", line.trim_end()); // a String takes everything
}
