//! The problems as every solver of quadratic programmes takes them: limits as rows only.
//!
//! The disc of each move becomes 16 chords over the half circle that the tilt wedge leaves of it, inscribed: they give
//! up 0.48 % of the radius at most. Soft limits of predicted states are left out. What remains is
//!
//! ```text
//! minimise 1/2 x'H x + f'x   so that   rows x + offsets >= 0,   f = -H U*
//! ```
//!
//! with the same rows on every tick of a sequence: only `f` changes.

use std::f64::consts::PI;

use airframe::DemandSet;
use nalgebra::{DMatrix, DVector, RowDVector, Vector4};
use qp::{ActiveSet, Verdict};
use runtime::timed;
use serde_json::{Value, json};

use super::matrices::Problems;

/// Chords of the half circle.
const CHORDS: u32 = 16;

/// The problems of one sequence.
pub struct Polygon {
    /// Name of the sequence.
    pub name: String,
    hessian: DMatrix<f64>,
    rows: DMatrix<f64>,
    offsets: Vec<f64>,
    ticks: Vec<u64>,
    centres: Vec<DVector<f64>>,
}

/// What our active-set solver makes of them.
#[derive(Debug, Clone, Default)]
pub struct Solved {
    /// Objective of each tick; `None` where it failed.
    pub objectives: Vec<Option<f64>>,
    /// Whether the unconstrained plan was outside.
    pub constrained: Vec<bool>,
    /// Time of each solve in each round, from the working set of the tick before \[ns\].
    pub warm_ns: Vec<Vec<u64>>,
    /// The same, from nothing \[ns\].
    pub cold_ns: Vec<Vec<u64>>,
}

impl Polygon {
    /// The problems of a sequence; `None` where it has no constraints.
    pub fn of(name: &str, problems: &Problems) -> Option<Self> {
        let (rows, offsets) = rows(&problems.set.as_ref()?.moves, problems.hessian.nrows());
        Some(Self {
            name: name.to_owned(),
            hessian: problems.hessian.clone(),
            rows,
            offsets,
            ticks: problems.ticks.iter().map(|problem| problem.tick).collect(),
            centres: problems.ticks.iter().map(|problem| problem.centre.clone()).collect(),
        })
    }

    /// Solves every tick in turn, `rounds` times, warm and cold.
    pub fn solve(&self, rounds: u32, max_iterations: u32) -> Solved {
        let mut solved = Solved {
            warm_ns: vec![vec![]; self.ticks.len()],
            cold_ns: vec![vec![]; self.ticks.len()],
            ..Solved::default()
        };
        for round in 0..rounds {
            let mut warm = self.solver(max_iterations);
            let mut cold = self.solver(max_iterations);
            let mut x = DVector::zeros(self.hessian.nrows());
            for (i, centre) in self.centres.iter().enumerate() {
                let (outcome, ns) = timed(|| warm.solve(centre.as_slice(), &self.offsets, x.as_mut_slice()));
                solved.warm_ns[i].push(ns);
                if round == 0 {
                    solved.objectives.push((outcome.verdict == Verdict::Optimal).then(|| self.objective(centre, &x)));
                    solved.constrained.push(outcome.active > 0);
                }
                cold.forget();
                let (_, ns) = timed(|| cold.solve(centre.as_slice(), &self.offsets, x.as_mut_slice()));
                solved.cold_ns[i].push(ns);
            }
        }
        solved
    }

    /// The problems for others, with our objectives.
    pub fn to_json(&self, solved: &Solved) -> Value {
        let matrix = |of: &DMatrix<f64>| of.row_iter().map(|row| row.iter().copied().collect()).collect();
        let (hessian, rows): (Vec<Vec<f64>>, Vec<Vec<f64>>) = (matrix(&self.hessian), matrix(&self.rows));
        let f: Vec<Vec<f64>> =
            self.centres.iter().map(|centre| (-&self.hessian * centre).as_slice().to_vec()).collect();
        json!({
            "problem": "minimise 1/2 x'Hx + f'x so that rows x + offsets >= 0; one f per tick",
            "name": self.name,
            "H": hessian,
            "rows": rows,
            "offsets": self.offsets,
            "tick": self.ticks,
            "f": f,
            "constrained": solved.constrained,
            "objective": solved.objectives,
        })
    }

    fn solver(&self, max_iterations: u32) -> ActiveSet {
        let hard = vec![0.0; self.offsets.len()];
        ActiveSet::new(&self.hessian, &self.rows, &hard, &DMatrix::zeros(0, self.hessian.nrows()), max_iterations)
    }

    fn objective(&self, centre: &DVector<f64>, x: &DVector<f64>) -> f64 {
        (&self.hessian * x).dot(&(x * 0.5 - centre))
    }
}

/// The limits of every move as rows of the plan: slopes, m x n, and offsets, m.
fn rows(set: &DemandSet, variables: usize) -> (DMatrix<f64>, Vec<f64>) {
    let mut of_move: Vec<(Vector4<f64>, f64)> = set.linear.iter().map(|row| (row.slope, row.offset)).collect();
    if let Some([side, ahead]) = &set.disc {
        let half = PI / f64::from(2 * CHORDS);
        for chord in 0..CHORDS {
            let (sin, cos) = (f64::from(2 * chord + 1) * half - PI / 2.0).sin_cos();
            let slope = -(side.slope * sin + ahead.slope * cos);
            of_move.push((slope, half.cos() - side.offset * sin - ahead.offset * cos));
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

#[cfg(test)]
mod tests {
    use airframe::envelope::Envelope;
    use contract::Scenario;
    use proptest::prelude::*;

    use super::*;

    fn exact() -> DemandSet {
        let scenario = Scenario::default();
        DemandSet::exact(&Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits()))
    }

    fn slack(set: &DemandSet, u: &Vector4<f64>) -> f64 {
        let (rows, offsets) = rows(set, 4);
        (rows * u + DVector::from_vec(offsets)).min()
    }

    proptest! {
        #[test]
        fn the_polygon_is_inside_the_set_and_almost_fills_it(u in prop::array::uniform4(-40.0..40.0_f64)) {
            let (set, u) = (exact(), Vector4::from(u));
            // The border of the set on the way to u, and what the polygon leaves of it.
            let border = u * set.reach(&Vector4::zeros(), &u);
            prop_assert!(slack(&set, &(border * 1.0001)) <= 0.0 || border == u, "nothing outside is inside the polygon");
            prop_assert!(slack(&set, &border) > -0.0049, "half a per cent of the radius");
        }
    }
}
