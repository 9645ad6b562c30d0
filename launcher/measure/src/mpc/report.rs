//! Tables and targets of `measure mpc`.

use super::MpcResults;
use super::compare::Comparison;
use super::steps::{ALL, Path, StepTimes};
use crate::findings::Target;
use crate::table::{Table, cell};

/// Steps per second of the controller.
const RATE_HZ: f64 = 100.0;
/// Limit of every step of the default solver \[us\].
const LONGEST_US: f64 = 2000.0;
/// Objectives that differ by no more than this share are the same.
const AGREES: f64 = 1e-6;

pub fn text(results: &MpcResults) -> String {
    let MpcResults { rounds, floor_us, clock_us, longest_stall_us, .. } = results;
    let steps = Table::new(
        &format!(
            "A step of the controller [us], median of {rounds} rounds, steps back to back; longest: of all rounds"
        ),
        &["flight", "solver", "path", "n", "p50", "p90", "p99", "p99.9", "max", "longest", "iter", "max", "alloc"],
        results.rows.iter().map(step_row).collect(),
    );
    let rivals = Table::new(
        "The same problems with the disc as a polygon, limits of the moves only [us]",
        &["solver", "n", "mean", "p50", "p90", "p99", "max", "p50 active", "p99", "differs", "unsolved", "timed"],
        results.rivals.iter().map(rival_row).collect(),
    );
    format!(
        "{}floor, the bare matrix-vector product: {floor_us:.3} us\nclock, part of every time: {clock_us:.3} us\n\
         longest stall of an idle loop: {longest_stall_us:.1} us\n\n{}",
        steps.text(),
        rivals.text()
    )
}

fn step_row(row: &StepTimes) -> Vec<String> {
    let path = match row.path {
        Path::Explicit => "explicit",
        Path::Solver => "solver",
        Path::All => "all",
    };
    let d = row.step;
    let mut cells = vec![row.sequence.clone(), row.solver.to_owned(), path.to_owned(), d.n.to_string()];
    cells.extend([d.p50_us, d.p90_us, d.p99_us, d.p999_us, d.max_us].map(|us| format!("{us:.2}")));
    cells.extend([row.longest_us, row.iterations_mean].map(|value| format!("{value:.1}")));
    cells.extend([row.iterations_max.to_string(), cell(row.allocations_max.map(|n| n as f64), 0)]);
    cells
}

fn rival_row(rival: &Comparison) -> Vec<String> {
    let (all, active) = (rival.all_us, rival.constrained_us);
    let mut cells = vec![rival.solver.clone(), all.map_or(0, |d| d.n).to_string(), format!("{:.2}", rival.mean_us)];
    cells.extend(
        [all.map(|d| d.p50_us), all.map(|d| d.p90_us), all.map(|d| d.p99_us), all.map(|d| d.max_us)]
            .map(|us| cell(us, 2)),
    );
    cells.extend([active.map(|d| d.p50_us), active.map(|d| d.p99_us)].map(|us| cell(us, 1)));
    cells.push(rival.worst_difference.map_or("-".to_owned(), |difference| format!("{difference:.0e}")));
    cells.extend([rival.unsolved.to_string(), rival.timed.clone()]);
    cells
}

pub fn targets(results: &MpcResults) -> Vec<Target> {
    let row = |solver, path| results.rows.iter().find(|r| r.sequence == ALL && r.solver == solver && r.path == path);
    let explicit = || ["clarabel", "active-set"].into_iter().filter_map(|solver| row(solver, Path::Explicit));
    // Times without a solve say nothing of the solver.
    let with_solves = |solver| row(solver, Path::Solver).and(row(solver, Path::All));
    let solves = |solver| match row(solver, Path::Solver) {
        Some(row) => format!("solves alone: p50 {:.1}, p99 {:.1} us", row.step.p50_us, row.step.p99_us),
        None => "no problem went to the solver".to_owned(),
    };
    let p99 = |row: Option<&StepTimes>| row.map(|r| r.step.p99_us);
    let (clarabel, active_set) = (with_solves("clarabel"), with_solves("active-set"));
    let explicit_p99_us = explicit().map(|r| r.step.p99_us).reduce(f64::max);
    let active_set_p50_us = active_set.map(|r| r.step.p50_us);
    let mut targets = vec![
        Target::at_most("explicit path, p99", explicit_p99_us, 5.0, "us"),
        Target::at_most("clarabel, p99", p99(clarabel), 300.0, "us").noting(solves("clarabel")),
        longest(clarabel, results.longest_stall_us),
        Target::at_most("active-set, p50", active_set_p50_us, 2.0, "us").noting(solves("active-set")),
        Target::at_most("active-set, p99", p99(active_set), 25.0, "us"),
        allocations("explicit path, allocations per step", explicit()),
        allocations("active-set, allocations per step", row("active-set", Path::All).into_iter()),
    ];
    for solver in ["clarabel", "active-set"] {
        let row = row(solver, Path::All);
        let share = row.map(|r| r.mean_us * 1e-6 * RATE_HZ * 100.0);
        let unsolved = row.map(|r| r.unsolved as f64);
        targets.push(Target::at_most(format!("{solver}, share of one core at 100 Hz"), share, 1.0, "%"));
        targets.push(Target::at_most(format!("{solver}, steps without an optimum"), unsolved, 0.0, ""));
    }
    targets.extend(against_daqp(&results.rivals));
    targets
}

/// A long step that a stall of the machine can explain is inconclusive.
fn longest(row: Option<&StepTimes>, longest_stall_us: f64) -> Target {
    let longest_us = row.map(|r| r.longest_us);
    let target = Target::at_most("clarabel, the longest step of all rounds", longest_us, LONGEST_US, "us");
    let median_us = row.map_or(0.0, |r| r.longest_median_us);
    let why = format!(
        "median {median_us:.0} us; the machine took up to {longest_stall_us:.0} us from a loop that does nothing"
    );
    if median_us <= LONGEST_US && median_us + longest_stall_us > LONGEST_US { target.in_doubt(why) } else { target }
}

fn allocations<'a>(figure: &str, rows: impl Iterator<Item = &'a StepTimes>) -> Target {
    let counts: Option<Vec<u64>> = rows.map(|row| row.allocations_max).collect();
    let most = counts.and_then(|counts| counts.into_iter().max());
    let target = Target::at_most(figure, most.map(|most| most as f64), 0.0, "");
    if most.is_none() { target.noting("not counted in this program") } else { target }
}

/// Our solver against DAQP, both warm, over all problems.
fn against_daqp(rivals: &[Comparison]) -> [Target; 3] {
    let find = |name: &str| rivals.iter().find(|rival| rival.solver.starts_with(name));
    let (ours, theirs) = (find("active-set, warm"), find("daqp"));
    let agrees = theirs.is_some_and(|rival| rival.unsolved == 0 && rival.worst_difference.is_some_and(|d| d <= AGREES));
    let mean: fn(&Comparison) -> Option<f64> = |rival| Some(rival.mean_us);
    let figures = [("mean", mean), ("p50", |r| Some(r.all_us?.p50_us)), ("p99", |r| Some(r.all_us?.p99_us))];
    figures.map(|(name, of)| {
        let ratio = ours.and_then(of).zip(theirs.and_then(of)).map(|(ours, theirs)| ours / theirs);
        let figure = format!("active-set over DAQP, same problems, {name}");
        let target = Target::at_most(figure, ratio.filter(|_| agrees), 1.0, "");
        match theirs {
            None => target.noting("needs --compare PYTHON, a Python with daqp, piqp, osqp, numpy and scipy"),
            Some(_) if !agrees => target.noting("it found other optima"),
            Some(_) => target,
        }
    })
}
