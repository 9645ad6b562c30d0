//! draft
mod basis;
mod factor;
pub mod random;
mod steps;
mod working_set;

use basis::{Basis, Combination};
use factor::Factor;
use nalgebra::DMatrix;
pub use working_set::{Member, WorkingSet};

/// Violation that is left alone, in units of the slacks.
const TOLERANCE: f64 = 5e-10;

/// The solver of one set-up.
pub struct ActiveSet {
    /// Iterations granted to a solve.
    pub max_iterations: u32,
    basis: Basis,
    working_set: WorkingSet,
    /// The constraints its members stand for.
    held: Vec<Combination>,
    /// Their multipliers, never negative.
    multipliers: Vec<f64>,
    /// Factor of their Gram matrix.
    factor: Factor,
    /// Where the multipliers go.
    step: Vec<[f64; 4]>,
    /// Which rows, and then which discs, are held.
    is_held: Vec<bool>,
    /// The variables under the multipliers.
    x: Vec<[f64; 4]>,
    /// The basis rows at `x`.
    slacks: Vec<[f64; 4]>,
    at_centre: Vec<[f64; 4]>,
    first: f64,
    left: f64,
    /// Held cuts that turn.
    turning: Vec<usize>,
    turned: Vec<(Member, f64)>,
    #[allow(missing_docs)]
    pub stats: [u64; 8],
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// What was found.
    pub verdict: Verdict,
    /// Steps taken: each solves the equations of one working set.
    pub iterations: u32,
    /// Constraints held at the end.
    pub active: u32,
}

/// What a solve found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// `x` is the optimum.
    Optimal,
    /// `x` is the last iterate: not feasible.
    IterationLimit,
    /// No `x` obeys all hard constraints.
    Infeasible,
    /// A number given is none, or so large that the solution overflows.
    NotFinite,
}

impl ActiveSet {
    /// new
    pub fn new(
        hessian: &DMatrix<f64>,
        rows: &DMatrix<f64>,
        softness: &[f64],
        discs: &DMatrix<f64>,
        max_iterations: u32,
    ) -> Self {
        let basis = Basis::new(hessian, rows, softness, discs);
        // Hard members are independent; a soft row needs no such thing.
        let soft = softness.iter().filter(|softness| **softness > 0.0).count();
        let members = (basis.variables + soft).min(basis.rows + basis.discs);
        let capacity = members + basis.discs;
        Self {
            max_iterations,
            working_set: WorkingSet { members: Vec::with_capacity(members) },
            held: Vec::with_capacity(capacity),
            multipliers: Vec::with_capacity(capacity),
            factor: Factor::new(capacity),
            step: vec![[0.0; 4]; capacity.div_ceil(4)],
            is_held: vec![false; basis.rows + basis.discs],
            x: vec![[0.0; 4]; basis.blocks],
            slacks: vec![[0.0; 4]; basis.len().div_ceil(4)],
            at_centre: vec![[0.0; 4]; basis.len().div_ceil(4)],
            first: 0.0,
            left: 0.0,
            turning: Vec::with_capacity(basis.discs),
            turned: Vec::with_capacity(basis.discs),
            stats: [0; 8],
            basis,
        }
    }

    /// W
    pub fn working_set(&self) -> &WorkingSet {
        &self.working_set
    }

    /// W
    pub fn warm_start(&mut self, from: &WorkingSet) {
        self.working_set.members.clear();
        self.working_set.members.extend_from_slice(&from.members);
    }

    /// W
    pub fn forget(&mut self) {
        self.working_set.members.clear();
    }

    /// Solve
    pub fn solve(&mut self, centre: &[f64], offsets: &[f64], x: &mut [f64]) -> Outcome {
        let is_finite = |numbers: &[f64]| numbers.iter().all(|number| number.is_finite());
        let mut outcome = Outcome { verdict: Verdict::NotFinite, iterations: 0, active: 0 };
        if !is_finite(centre) || !is_finite(offsets) {
            return outcome;
        }
        self.x.as_flattened_mut()[..centre.len()].copy_from_slice(centre);
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        if self.worst().is_none() {
            self.forget();
            outcome.verdict = Verdict::Optimal;
        } else {
            self.at_centre.copy_from_slice(&self.slacks);
            self.first = 0.5 * self.worst_size().powi(2);
            self.resume();
            (outcome.verdict, outcome.iterations) = self.ascend(offsets);
            outcome.active = self.held.len() as u32;
        }
        if !is_finite(self.x.as_flattened()) {
            self.forget();
            outcome.verdict = Verdict::NotFinite;
        }
        if matches!(outcome.verdict, Verdict::Optimal | Verdict::IterationLimit) {
            x.copy_from_slice(&self.x.as_flattened()[..x.len()]);
        }
        outcome
    }

    fn ascend(&mut self, offsets: &[f64]) -> (Verdict, u32) {
        for iteration in 1..=self.max_iterations {
            let arrived = self.step(offsets);

            if std::env::var("TRACE").is_ok() { println!("{iteration} held {} arrived {arrived} D/D1 {:e} {:?} stats {:?}", self.held.len(), self.value() / self.first, self.worst(), self.stats); }
            if !arrived {
                continue;
            }
            if self.value() > 1e12 * self.first { return (Verdict::Infeasible, iteration) }
            { let v = (self.value() / self.first).log10() as i32; if v > self.stats[7] as i32 { self.stats[7] = v as u64; } }
            match self.worst() {
                None => return (Verdict::Optimal, iteration),
                Some(Member::Cut { disc, .. }) if self.is_held[self.basis.rows + disc] => { if !self.turn(offsets) { return (Verdict::Infeasible, iteration); } }
                Some(Member::Row(row)) if self.is_held[row] => { self.stats[1] += 1; }
                Some(member) => {
                    
                    if !self.hold(member, offsets) {
                        return (Verdict::Infeasible, iteration);
                    }
                }
            }
        }
        (Verdict::IterationLimit, self.max_iterations)
    }

    /// The constraint violated most. A disc is told by its tangent towards the present point.
    fn worst(&self) -> Option<Member> { self.worst2().0 }
    fn worst_size(&self) -> f64 { self.worst2().1 }
    fn value(&self) -> f64 { -0.5 * self.held.iter().zip(&self.multipliers).map(|(h, l)| l * (h.slack(self.at_centre.as_flattened()) + h.slack(self.slacks.as_flattened()))).sum::<f64>() }
    fn worst2(&self) -> (Option<Member>, f64) {
        let (rows, pairs) = self.slacks.as_flattened()[..self.basis.len()].split_at(self.basis.rows);
        let (mut worst, mut most) = (None, 0.0);
        for (row, (slack, scale)) in rows.iter().zip(&self.basis.scale).enumerate() {
            if *slack < -TOLERANCE && -slack * scale > most {
                (worst, most) = (Some(Member::Row(row)), -slack * scale);
            }
        }
        for (disc, pair) in pairs.chunks_exact(2).enumerate() {
            let length = (pair[0] * pair[0] + pair[1] * pair[1]).sqrt();
            if length - 1.0 > TOLERANCE {
                let towards = [pair[0] / length, pair[1] / length];
                let member = Member::Cut { disc, towards };
                let c = self.basis.constraint(member);
                let size = (length - 1.0) / self.basis.square(&c).sqrt();
                if size > most {
                    (worst, most) = (Some(member), size);
                }
            }
        }
        (worst, most)
    }
}
#[cfg(test)]
mod tests;
