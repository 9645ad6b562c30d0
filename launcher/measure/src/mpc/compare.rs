//! The polygon problems solved by others, on this machine and in this run.
//!
//! `tests/python/compare_solvers.py` is part of the program: a Python that has the solvers reads it from its input.

use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, bail};
use serde::{Deserialize, Serialize};

use super::distribution::{Distribution, median};
use super::polygon::Solved;

/// The script that solves exported problems with DAQP, PIQP and OSQP.
const SCRIPT: &str = include_str!("../../../../tests/python/compare_solvers.py");

/// One solver's way through all problems, as the script tells it.
#[derive(Debug, Clone, Deserialize)]
struct Told {
    solver: String,
    timed: String,
    worst_difference: f64,
    unsolved: usize,
    /// Median over the rounds, problem by problem, sequences one after another \[ns\].
    times_ns: Vec<u64>,
}

/// One row of the comparison.
#[derive(Debug, Clone, Serialize)]
pub struct Rival {
    /// Name and version.
    pub solver: String,
    /// What its times contain.
    pub timed: String,
    /// All problems.
    pub all_us: Option<Distribution>,
    /// Those with an active constraint.
    pub constrained_us: Option<Distribution>,
    /// The largest difference of its objectives from ours, as a share; nothing for our own.
    pub worst_difference: Option<f64>,
    /// Problems it did not solve.
    pub unsolved: usize,
}

/// Our own rows: warm and cold.
pub fn ours(solved: &[Solved]) -> Vec<Rival> {
    let row = |how: &str, times: fn(&Solved) -> &Vec<Vec<u64>>| {
        let times: Vec<u64> = solved.iter().flat_map(|s| times(s).iter().map(|rounds| median(rounds))).collect();
        let unsolved = solved.iter().flat_map(|s| &s.objectives).filter(|objective| objective.is_none()).count();
        rival(format!("active-set, {how}"), "the whole call".to_owned(), &times, solved, None, unsolved)
    };
    vec![row("warm", |s| &s.warm_ns), row("cold", |s| &s.cold_ns)]
}

/// What the solvers of `python` make of the problems exported to `folder`.
pub fn others(python: &Path, folder: &Path, rounds: u32, solved: &[Solved]) -> anyhow::Result<Vec<Rival>> {
    let cannot = || format!("cannot run {} to compare solvers", python.display());
    let mut child = Command::new(python)
        .args(["-", "--json", "--rounds", &rounds.to_string()])
        .arg(folder)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .with_context(cannot)?;
    let written = child.stdin.take().map_or(Ok(()), |mut input| input.write_all(SCRIPT.as_bytes()));
    let output = child.wait_with_output().with_context(cannot)?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.trim_end().lines().last().unwrap_or("nothing");
        bail!("{} did not compare solvers, it said: {last}", python.display());
    }
    written.with_context(cannot)?;
    let told: Vec<Told> = serde_json::from_slice(&output.stdout).context("the comparing script printed no table")?;
    let problems: usize = solved.iter().map(|s| s.objectives.len()).sum();
    if told.iter().any(|told| told.times_ns.len() != problems) {
        bail!("{} holds problems of another export too; choose another folder", folder.display());
    }
    let row = |t: Told| rival(t.solver, t.timed, &t.times_ns, solved, Some(t.worst_difference), t.unsolved);
    Ok(told.into_iter().map(row).collect())
}

fn rival(
    solver: String,
    timed: String,
    times_ns: &[u64],
    solved: &[Solved],
    worst_difference: Option<f64>,
    unsolved: usize,
) -> Rival {
    let constrained = solved.iter().flat_map(|s| &s.constrained);
    let constrained = times_ns.iter().zip(constrained).filter_map(|(ns, constrained)| constrained.then_some(*ns));
    Rival {
        solver,
        timed,
        all_us: Distribution::of(times_ns.iter().copied()),
        constrained_us: Distribution::of(constrained),
        worst_difference,
        unsolved,
    }
}
