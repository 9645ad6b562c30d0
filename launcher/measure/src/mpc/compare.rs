//! Recorded problems for other solvers, which accept linear rows only.
//!
//! The disc of each move becomes 16 inscribed chords over the half circle that the tilt wedge leaves of it. They reduce
//! the radius by at most 0.48 %. Soft limits of predicted states are left out. What remains is
//!
//! ```text
//! minimise 1/2 x'H x + f'x   so that   rows x + offsets >= 0,   f = -H U*
//! ```
//!
//! with the same rows on every tick of a sequence: only `f` changes. `U*` is the controller's own unconstrained plan.
//!
//! The other solvers run in the same measurement on this machine: a Python that has them gets
//! `tests/python/compare_solvers.py`, which is part of the program, as its input.

use std::f64::consts::PI;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};

use airframe::DemandSet;
use anyhow::{Context, bail};
use attitude_mpc::AttitudeMpc;
use attitude_mpc::law::mpc::condensed::Condensed;
use attitude_mpc::law::mpc::constraints::PlanSet;
use attitude_mpc::model::PredictionModel;
use contract::message::Controls;
use nalgebra::{DMatrix, DVector, RowDVector, Vector4};
use outcome::percentiles::{Percentiles, median_ns};
use qp::{ActiveSet, Termination};
use runtime::timed;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use settings::ScenarioError;

use super::problems::Sequence;

/// Script that solves exported problems with DAQP, PIQP and OSQP.
const SCRIPT: &str = include_str!("../../../../tests/python/compare_solvers.py");
/// Number of chords of the half circle.
const CHORDS: u32 = 16;

/// Problems of one sequence.
pub struct Polygons {
    pub name: String,
    hessian: DMatrix<f64>,
    rows: DMatrix<f64>,
    offsets: Vec<f64>,
    /// Tick and unconstrained plan `U*` of each problem.
    centres: Vec<(u64, DVector<f64>)>,
}

/// Result of our active-set solver on one problem.
#[derive(Debug, Clone, Default)]
pub struct Solved {
    /// Objective; `None` if the solver failed.
    objective: Option<f64>,
    /// `true` if a constraint was active at the optimum.
    constrained: bool,
    /// Time of each round with a warm start, from the working set of the tick before \[ns\].
    warm_ns: Vec<u64>,
    /// Time of each round with a cold start \[ns\].
    cold_ns: Vec<u64>,
}

/// Figures of one solver over all problems. The script prints them except those of the times.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub struct Comparison {
    /// Name and version.
    pub solver: String,
    /// Part of the work that the times contain.
    pub timed: String,
    #[serde(skip_deserializing)]
    pub mean_us: f64,
    #[serde(skip_deserializing)]
    pub all_us: Option<Percentiles>,
    /// Problems with an active constraint.
    #[serde(skip_deserializing)]
    pub constrained_us: Option<Percentiles>,
    /// Largest relative difference of its objectives from ours; `None` for our own solver.
    pub worst_difference: Option<f64>,
    pub unsolved: usize,
    /// Median time over the rounds, by problem, sequences one after another \[ns\].
    #[serde(skip_serializing)]
    times_ns: Vec<u64>,
}

impl Polygons {
    /// Makes the problems of a sequence; `None` if the flight had no constraints.
    pub fn of(sequence: &Sequence) -> Result<Option<Self>, ScenarioError> {
        let scenario = sequence.scenario_for_mpc();
        let model = PredictionModel::new(&scenario);
        let Condensed { hessian, course, .. } = Condensed::new(&model, &scenario)?;
        let Some(set) = PlanSet::new(&scenario, &course, model.trim.roll_rad) else { return Ok(None) };
        let (rows, offsets) = rows(&set.moves, hessian.nrows());
        let centres = centres(sequence).map(|(controls, centre)| (controls.stamp.tick, centre)).collect();
        Ok(Some(Self { name: sequence.name.clone(), centres, hessian, rows, offsets }))
    }

    /// Solves every tick in turn, `rounds` times, warm and cold.
    pub fn solve(&self, rounds: u32, max_iterations: u32) -> Vec<Solved> {
        let mut all = vec![Solved::default(); self.centres.len()];
        let n = self.hessian.nrows();
        let hard = vec![0.0; self.offsets.len()];
        let solver = || ActiveSet::new(&self.hessian, &self.rows, &hard, &DMatrix::zeros(0, n), max_iterations);
        for _ in 0..rounds {
            let (mut warm, mut cold, mut x) = (solver(), solver(), DVector::zeros(n));
            for ((_, centre), solved) in self.centres.iter().zip(&mut all) {
                let (outcome, ns) = timed(|| warm.solve(centre.as_slice(), &self.offsets, x.as_mut_slice()));
                solved.warm_ns.push(ns);
                let is_optimal = outcome.termination == Termination::Optimal;
                solved.objective = is_optimal.then(|| (&self.hessian * &x).dot(&(&x * 0.5 - centre)));
                solved.constrained = outcome.active > 0;
                cold.forget();
                let (_, ns) = timed(|| cold.solve(centre.as_slice(), &self.offsets, x.as_mut_slice()));
                solved.cold_ns.push(ns);
            }
        }
        all
    }

    /// Returns the problems with our objectives.
    pub fn to_json(&self, solved: &[Solved]) -> Value {
        let matrix =
            |of: &DMatrix<f64>| -> Vec<Vec<f64>> { of.row_iter().map(|row| row.iter().copied().collect()).collect() };
        let linear = |(_, centre): &(u64, DVector<f64>)| (-&self.hessian * centre).as_slice().to_vec();
        json!({
            "problem": "minimise 1/2 x'Hx + f'x so that rows x + offsets >= 0; one f per tick",
            "name": self.name,
            "H": matrix(&self.hessian),
            "rows": matrix(&self.rows),
            "offsets": self.offsets,
            "tick": self.centres.iter().map(|(tick, _)| *tick).collect::<Vec<_>>(),
            "f": self.centres.iter().map(linear).collect::<Vec<_>>(),
            "constrained": solved.iter().map(|solved| solved.constrained).collect::<Vec<_>>(),
            "objective": solved.iter().map(|solved| solved.objective).collect::<Vec<_>>(),
        })
    }
}

/// Returns the controller's answer on each tick, and the unconstrained plan `U*` there.
fn centres(sequence: &Sequence) -> impl Iterator<Item = (Controls, DVector<f64>)> {
    let mut mpc = AttitudeMpc::new(&sequence.scenario_for_mpc());
    sequence.samples.iter().map(move |(state, reference)| {
        let mut controls = mpc.step(state.stamp.tick, state, reference);
        controls.stamp.tick = state.stamp.tick;
        let [unconstrained, _] = mpc.plans().expect("it plans ahead");
        (controls, unconstrained.clone())
    })
}

/// Returns the limits of every move as rows of the plan: slopes, m x n, and offsets, m.
fn rows(set: &DemandSet, variables: usize) -> (DMatrix<f64>, Vec<f64>) {
    let mut of_move: Vec<(Vector4<f64>, f64)> = set.linear.iter().map(|row| (row.slope, row.offset)).collect();
    if let Some([side, ahead]) = &set.disc {
        let half = PI / f64::from(2 * CHORDS);
        for chord in 0..CHORDS {
            let (sin, cos) = libm::sincos(f64::from(2 * chord + 1) * half - PI / 2.0);
            let slope = -(side.slope * sin + ahead.slope * cos);
            of_move.push((slope, libm::cos(half) - side.offset * sin - ahead.offset * cos));
        }
    }
    let (mut rows, mut offsets) = (vec![], vec![]);
    for first in (0..variables).step_by(4) {
        for (slope, offset) in &of_move {
            let mut row = RowDVector::zeros(variables);
            row.fixed_columns_mut::<4>(first).copy_from(&slope.transpose());
            rows.push(row);
            offsets.push(*offset);
        }
    }
    (DMatrix::from_rows(&rows), offsets)
}

/// Returns the figures of our own solver, warm and cold, on the problems of all sequences.
pub fn ours(solved: &[Solved]) -> Vec<Comparison> {
    let row = |how: &str, times_ns: fn(&Solved) -> &Vec<u64>| Comparison {
        solver: format!("active-set, {how}"),
        timed: "the whole call".to_owned(),
        unsolved: solved.iter().filter(|solved| solved.objective.is_none()).count(),
        times_ns: solved.iter().map(|solved| median_ns(times_ns(solved).iter().copied())).collect(),
        ..Comparison::default()
    };
    [row("warm", |solved| &solved.warm_ns), row("cold", |solved| &solved.cold_ns)].map(|row| row.over(solved)).into()
}

/// Runs the solvers of `python` on the problems exported to `folder`.
pub fn others(python: &Path, folder: &Path, rounds: u32, solved: &[Solved]) -> anyhow::Result<Vec<Comparison>> {
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
    let printed: Vec<Comparison> =
        serde_json::from_slice(&output.stdout).context("the comparing script printed no table")?;
    if printed.iter().any(|printed| printed.times_ns.len() != solved.len()) {
        bail!("{} holds problems of another export too; choose another folder", folder.display());
    }
    Ok(printed.into_iter().map(|printed| printed.over(solved)).collect())
}

impl Comparison {
    /// Computes the figures of the times over the problems in `solved`.
    fn over(mut self, solved: &[Solved]) -> Self {
        let times = self.times_ns.iter().zip(solved);
        self.constrained_us = Percentiles::of(times.filter_map(|(ns, solved)| solved.constrained.then_some(*ns)));
        self.all_us = Percentiles::of(self.times_ns.iter().copied());
        self.mean_us = self.times_ns.iter().sum::<u64>() as f64 / 1e3 / self.times_ns.len().max(1) as f64;
        self
    }
}

#[cfg(test)]
mod tests {
    use airframe::envelope::Envelope;
    use contract::message::SolveStatus;
    use proptest::prelude::*;
    use settings::Scenario;

    use super::*;
    use crate::mpc::problems;

    #[test]
    fn a_step_is_explicit_if_the_plan_is_inside_the_set() {
        let folder = tempfile::tempdir().unwrap();
        let mut all_solved = 0;
        for sequence in problems::shipped(folder.path()).unwrap() {
            let model = PredictionModel::new(&sequence.scenario);
            let Condensed { course, .. } = Condensed::new(&model, &sequence.scenario).unwrap();
            let set = PlanSet::new(&sequence.scenario, &course, model.trim.roll_rad).unwrap();
            let (mut explicit, mut solved) = (0, 0);
            for (controls, centre) in centres(&sequence) {
                let inside = set.violation(&centre) <= 0.0;
                let is_explicit = controls.status == SolveStatus::Explicit as u64;
                assert_eq!(inside, is_explicit, "{}", sequence.name);
                *if is_explicit { &mut explicit } else { &mut solved } += 1;
            }
            assert!(explicit > 50 && (solved > 0 || sequence.name == "survey"), "{explicit} {solved}");
            all_solved += solved;
        }
        assert!(all_solved > 100, "{all_solved}");
    }

    fn slack(set: &DemandSet, u: &Vector4<f64>) -> f64 {
        let (rows, offsets) = rows(set, 4);
        (rows * u + DVector::from_vec(offsets)).min()
    }

    proptest! {
        #[test]
        fn the_polygon_is_inside_the_set_and_almost_fills_it(u in prop::array::uniform4(-40.0..40.0_f64)) {
            let (scenario, u) = (Scenario::default(), Vector4::from(u));
            let envelope = Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits());
            let set = DemandSet::exact(&envelope);
            // Border of the set on the way to u; the polygon lies inside it.
            let border = u * set.reach(&Vector4::zeros(), &u);
            prop_assert!(slack(&set, &(border * 1.0001)) <= 0.0 || border == u, "nothing outside is inside the polygon");
            prop_assert!(slack(&set, &border) > -0.0049, "half a per cent of the radius");
        }
    }
}
