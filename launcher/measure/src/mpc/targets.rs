//! The promises about the controller's step, and what became of them.

use super::Results;
use super::agreement::Agreement;
use super::compare::Rival;
use super::distribution::Distribution;
use super::figures::{ALL, Path, Row};
use super::random::Random;
use crate::Target;

/// Steps per second of the controller.
const RATE_HZ: f64 = 100.0;
/// No step of the default solver may take longer \[us\].
const NEVER_OVER_US: f64 = 2000.0;

/// Objectives that differ by no more than this share are the same.
const AGREES: f64 = 1e-6;

/// One target per promise.
pub fn targets(results: &Results) -> Vec<Target> {
    let row = |solver, path| results.rows.iter().find(|r| r.sequence == ALL && r.solver == solver && r.path == path);
    let [clarabel, active_set] = ["clarabel", "active-set"].map(|solver| row(solver, Path::All));
    let explicit = || ["clarabel", "active-set"].into_iter().filter_map(|solver| row(solver, Path::Explicit));
    // A time that no solve is part of says nothing of the solver.
    let percentile = |solver, of: fn(&Row) -> f64| row(solver, Path::Solver).and(row(solver, Path::All)).map(of);
    let solves = |solver| match row(solver, Path::Solver) {
        Some(row) => format!("solves alone: p50 {:.1}, p99 {:.1} us", row.step.p50_us, row.step.p99_us),
        None => "no problem went to the solver".to_owned(),
    };
    let mut targets = vec![
        at_most("explicit path, p99", largest(explicit().map(|r| r.step.p99_us)), 5.0, "us"),
        at_most("clarabel, p99", percentile("clarabel", |r| r.step.p99_us), 300.0, "us").noting(solves("clarabel")),
        never_over(row("clarabel", Path::Solver).and(clarabel), results.longest_stall_us),
        at_most("active-set, p50", percentile("active-set", |r| r.step.p50_us), 2.0, "us").noting(solves("active-set")),
        at_most("active-set, p99", percentile("active-set", |r| r.step.p99_us), 25.0, "us"),
        allocations("explicit path, allocations per step", explicit()),
        allocations("active-set, allocations per step", active_set.into_iter()),
    ];
    for (solver, row) in [("clarabel", clarabel), ("active-set", active_set)] {
        let share = row.map(|r| r.step.mean_us * 1e-6 * RATE_HZ * 100.0);
        targets.push(at_most(&format!("{solver}, share of one core at 100 Hz"), share, 1.0, "%"));
        targets.push(at_most(&format!("{solver}, steps without an optimum"), row.map(|r| r.unsolved as f64), 0.0, ""));
    }
    targets.push(agreement(&results.agreement));
    targets.extend(random(results.random.as_ref()));
    targets.extend(rival(&results.rivals));
    targets
}

fn at_most(figure: &str, measured: Option<f64>, limit: f64, unit: &'static str) -> Target {
    Target::at_most(figure, measured, limit, unit)
}

fn largest(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// The longest step of every round: one that the machine itself can have made so long proves nothing.
fn never_over(row: Option<&Row>, longest_stall_us: f64) -> Target {
    let target = at_most("clarabel, the longest step of all rounds", row.map(|r| r.longest_us), NEVER_OVER_US, "us");
    let usual_us = row.map_or(0.0, |r| r.longest_as_a_rule_us);
    let why = format!(
        "{usual_us:.0} us as a rule; the machine took up to {longest_stall_us:.0} us from a loop that does nothing"
    );
    if usual_us <= NEVER_OVER_US && usual_us + longest_stall_us > NEVER_OVER_US { target.in_doubt(why) } else { target }
}

fn allocations<'a>(figure: &str, rows: impl Iterator<Item = &'a Row>) -> Target {
    let counts: Option<Vec<u64>> = rows.map(|row| row.allocations_max).collect();
    let most = counts.and_then(|counts| counts.into_iter().max());
    let target = at_most(figure, most.map(|most| most as f64), 0.0, "");
    if most.is_none() { target.noting("not counted in this program") } else { target }
}

fn agreement(agreement: &Agreement) -> Target {
    let measured = (agreement.problems > agreement.unsolved).then_some(agreement.worst_difference);
    let note = format!("{} problems", agreement.problems - agreement.unsolved);
    at_most("objectives of the two solvers, largest difference", measured, AGREES, "").noting(note)
}

fn random(random: Option<&Random>) -> [Target; 4] {
    let bound = random.map_or(0.0, |r| f64::from(r.iteration_bound));
    let note = random.map_or("left out with --random 0".to_owned(), |r| format!("of {} problems", r.problems));
    let checked = random.map_or(note.clone(), |r| format!("of {} optima checked", r.checked));
    [
        at_most("random problems, failures", random.map(|r| r.failures as f64), 0.0, "").noting(note.clone()),
        at_most("random problems, most iterations", random.map(|r| f64::from(r.most_iterations)), bound, "")
            .noting(note),
        at_most("random problems, cost above the optimum", random.map(|r| r.worst_gap), AGREES, "")
            .noting(checked.clone()),
        at_most("random problems, outside the limits", random.map(|r| r.worst_violation), AGREES, "").noting(checked),
    ]
}

/// Our solver against DAQP, both warm, over all problems.
fn rival(rivals: &[Rival]) -> [Target; 3] {
    let find = |name: &str| rivals.iter().find(|rival| rival.solver.starts_with(name));
    let (ours, theirs) = (find("active-set, warm"), find("daqp"));
    let agrees = theirs.is_some_and(|rival| rival.unsolved == 0 && rival.worst_difference.is_some_and(|d| d <= AGREES));
    let mean: fn(&Distribution) -> f64 = |all| all.mean_us;
    [("mean", mean), ("p50", |all| all.p50_us), ("p99", |all| all.p99_us)].map(|(name, of)| {
        let time = |rival: Option<&Rival>| rival?.all_us.as_ref().map(of);
        let ratio = time(ours).zip(time(theirs)).map(|(ours, theirs)| ours / theirs);
        let target =
            at_most(&format!("active-set over DAQP, same problems, {name}"), ratio.filter(|_| agrees), 1.0, "");
        match theirs {
            None => target.noting("needs --compare PYTHON, a Python with daqp, piqp, osqp, numpy and scipy"),
            Some(_) if !agrees => target.noting("it found other optima"),
            Some(_) => target,
        }
    })
}
