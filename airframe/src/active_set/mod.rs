//! draft
mod dual;
mod factor;
pub mod random;
mod working_set;

pub use working_set::{Member, WorkingSet};

use dual::{Combination, Dual};
use factor::Factor;
use nalgebra::DMatrix;

/// Violation that is left alone, in units of the slacks.
const TOLERANCE: f64 = 1e-10;

/// The solver of one set-up.
pub struct ActiveSet {
    dual: Dual,
    /// Iterations granted to a solve.
    pub max_iterations: u32,
    kept: WorkingSet,
    held: Vec<Combination>,
    multipliers: Vec<f64>,
    target: Vec<f64>,
    factor: Factor,
    start: Vec<f64>,
    slack: Vec<f64>,
    /// per basis row: whether a row is held; discs: member index+1
    places: Vec<usize>,
    variables: usize,
    value: f64,
    #[allow(missing_docs)]
    pub stats: [u64; 8],
}

/// How a solve went.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Outcome {
    /// What `x` is.
    pub verdict: Verdict,
    /// Iterations.
    pub iterations: u32,
    /// Members.
    pub active: u32,
}

/// What `x` is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// Optimum.
    Optimal,
    /// The last iterate: not feasible.
    IterationLimit,
    /// No point.
    Infeasible,
    /// Bad numbers.
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
        let dual = Dual::new(hessian, rows, softness, discs);
        let soft = softness.iter().filter(|s| **s != 0.0).count();
        let members = (hessian.nrows() + soft).min(dual.rows + dual.discs()) + 1;
        let capacity = members + dual.discs();
        Self {
            max_iterations,
            kept: WorkingSet { members: Vec::with_capacity(members) },
            held: Vec::with_capacity(capacity),
            multipliers: Vec::with_capacity(capacity),
            target: vec![0.0; capacity],
            factor: Factor::new(capacity),
            start: vec![0.0; dual.basis],
            slack: vec![0.0; dual.basis],
            places: vec![0; dual.basis],
            variables: hessian.nrows(),
            value: 0.0,
            stats: [0; 8],
            dual,
        }
    }

    /// W
    pub fn working_set(&self) -> &WorkingSet {
        &self.kept
    }

    /// W
    pub fn warm_start(&mut self, from: &WorkingSet) {
        self.kept.members.clear();
        self.kept.members.extend_from_slice(&from.members);
    }

    /// W
    pub fn forget(&mut self) {
        self.kept.members.clear();
    }

    /// Grants solves from now on another number of iterations.
    pub fn grant(&mut self, max_iterations: u32) {
        self.max_iterations = max_iterations;
    }

    /// Solve
    pub fn solve(&mut self, centre: &[f64], offsets: &[f64], x: &mut [f64]) -> Outcome {
        self.dual.start(centre, offsets, &mut self.start);
        if !centre.iter().chain(&self.start).all(|v| v.is_finite()) {
            return Outcome { verdict: Verdict::NotFinite, iterations: 0, active: 0 };
        }
        self.slack.copy_from_slice(&self.start);
        self.places.fill(0);
        self.held.clear();
        self.multipliers.clear();
        self.factor.truncate(0);
        let (verdict, iterations) = if self.worst().is_none() {
            self.kept.members.clear();
            (Verdict::Optimal, 0)
        } else {
            self.resume();
            self.ascend()
        };
        if matches!(verdict, Verdict::Optimal | Verdict::IterationLimit) {
            self.dual.variables(centre, &self.held, &self.multipliers, x);
        }
        Outcome { verdict, iterations, active: self.held.len() as u32 }
    }

    fn resume(&mut self) {
        let mut i = 0;
        while i < self.kept.members.len() {
            if self.append(self.kept.members[i], 0.0) {
                i += 1;
            } else {
                self.kept.members.remove(i);
            }
        }
    }

    fn place(&self, member: Member) -> usize {
        match member {
            Member::Row(row) => row,
            Member::Cut { disc, .. } => self.dual.rows + disc,
        }
    }

    fn append(&mut self, member: Member, multiplier: f64) -> bool {
        let combination = self.dual.combination(member);
        if !self.factor_in(&combination) {
            return false;
        }
        self.held.push(combination);
        self.multipliers.push(multiplier);
        let place = self.place(member);
        self.places[place] = self.held.len();
        true
    }

    fn factor_in(&mut self, combination: &Combination) -> bool {
        let Self { factor, dual, held, start, .. } = self;
        factor.append(|j| dual.entry(&held[j], combination), dual.diagonal(combination), -combination.slack(start))
    }

    fn ascend(&mut self) -> (Verdict, u32) {
        self.value = 0.0;
        for iteration in 1..=self.max_iterations {
            self.factor.solve(&mut self.target);
            if let Some((share, blocking)) = self.blocking() {
                for (multiplier, target) in self.multipliers.iter_mut().zip(&self.target) {
                    *multiplier += share * (target - *multiplier);
                }
                self.stats[0] += 1;
                self.release(blocking);
                continue;
            }
            self.multipliers.copy_from_slice(&self.target[..self.held.len()]);
            let value = self.factor.square();
            if value < self.value * (1.0 - 1e-9) {
                self.stats[1] += 1;
            }
            self.value = value;
            self.dual.slacks(&self.start, &self.held, &self.multipliers, &mut self.slack);
            match self.worst() {
                None => return (Verdict::Optimal, iteration),
                Some(member) => {
                    let turned = matches!(member, Member::Cut { disc, .. } if self.places[self.dual.rows + disc] > 0);
                    if turned {
                        self.stats[2] += 1;
                        self.turn();
                    } else if !self.hold(member) {
                        return (Verdict::Infeasible, iteration);
                    }
                }
            }
        }
        (Verdict::IterationLimit, self.max_iterations)
    }

    fn blocking(&self) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for (j, (multiplier, target)) in self.multipliers.iter().zip(&self.target).enumerate() {
            if *target <= 0.0 {
                let share = if *multiplier > 0.0 { multiplier / (multiplier - target) } else { 0.0 };
                if first.is_none_or(|(s, i)| share < s || (share == s && *target < self.target[i])) {
                    first = Some((share, j));
                }
            }
        }
        first
    }

    fn release(&mut self, member: usize) {
        let place = self.place(self.kept.members[member]);
        self.places[place] = 0;
        self.kept.members.remove(member);
        self.held.remove(member);
        self.multipliers.remove(member);
        self.rebuild(member);
    }

    fn rebuild(&mut self, from: usize) {
        self.factor.truncate(from);
        let mut i = from;
        while i < self.held.len() {
            let combination = self.held[i];
            if self.factor_in(&combination) {
                let place = self.place(self.kept.members[i]);
                self.places[place] = i + 1;
                i += 1;
            } else {
                self.stats[3] += 1;
                let place = self.place(self.kept.members[i]);
                self.places[place] = 0;
                self.kept.members.remove(i);
                self.held.remove(i);
                self.multipliers.remove(i);
            }
        }
    }

    fn hold(&mut self, member: Member) -> bool {
        let mut multiplier = 0.0;
        while self.hard() >= self.variables && self.dual.combination(member).is_hard() && {
            let c = self.dual.combination(member);
            self.factor_in(&c);
            self.factor.truncate(self.held.len());
            true
        } || !self.append(member, multiplier)
        {
            self.stats[4] += 1;
            self.factor.composition(&mut self.target);
            let mut first: Option<(f64, usize)> = None;
            for (j, (multiplier, share)) in self.multipliers.iter().zip(&self.target).enumerate() {
                if *share
                    > 1e-9
                        * (self.dual.diagonal(&self.dual.combination(member)) / self.dual.diagonal(&self.held[j]))
                            .sqrt()
                {
                    let step = multiplier / share;
                    if first.is_none_or(|(s, _)| step < s) {
                        first = Some((step, j));
                    }
                }
            }
            let Some((step, blocking)) = first else { return false };
            for (multiplier, share) in self.multipliers.iter_mut().zip(&self.target) {
                *multiplier -= step * share;
            }
            multiplier += step;
            self.release(blocking);
        }
        self.kept.members.push(member);
        true
    }

    fn hard(&self) -> usize {
        self.held.iter().filter(|h| h.is_hard()).count()
    }

    fn turn(&mut self) {
        let count = self.held.len();
        let mut first_cut = count;
        for i in (0..count).rev() {
            if let Member::Cut { disc, towards } = self.kept.members[i] {
                let tangent = self.dual.tangent(disc, towards, self.multipliers[i]);
                if self.factor_in(&tangent) {
                    self.held.push(tangent);
                    first_cut = i;
                } else {
                    self.stats[5] += 1;
                    return;
                }
            }
        }
        self.factor.solve(&mut self.target);
        // direction, slope and curvature
        let mut limit = 1.0_f64;
        let mut blocking = None;
        for i in 0..count {
            let target = self.target[i];
            if target <= 0.0 {
                let share = self.multipliers[i] / (self.multipliers[i] - target);
                match self.kept.members[i] {
                    Member::Row(_) if share < limit => {
                        limit = share;
                        blocking = Some(i);
                    }
                    Member::Cut { .. } if 0.9 * share < limit => {
                        limit = 0.9 * share;
                        blocking = None;
                    }
                    _ => {}
                }
            }
        }
        let mut slope = 0.0;
        let mut spring = 0.0;
        for j in count..self.held.len() {
            let beta = self.target[j];
            slope -= self.held[j].slack(&self.slack) * beta;
            spring += beta * beta * self.held[j].softness();
        }
        let cuts = || (0..count).rev().filter(|i| matches!(self.kept.members[*i], Member::Cut { .. }));
        let mut share = limit;
        loop {
            let mut rise = share * slope - 0.5 * share * share * (slope - spring);
            for (j, i) in (count..).zip(cuts()) {
                let beta = share * self.target[j];
                let along = self.multipliers[i] + share * (self.target[i] - self.multipliers[i]);
                rise -= beta * beta / (along.hypot(beta) + along);
            }
            if rise >= 0.1 * share * slope || share < 1e-9 {
                break;
            }
            self.stats[6] += 1;
            share *= 0.5;
            blocking = None;
        }
        let mut j = count;
        for i in (0..count).rev() {
            let along = self.multipliers[i] + share * (self.target[i] - self.multipliers[i]);
            self.multipliers[i] = along;
            if let Member::Cut { disc, towards: [cos, sin] } = self.kept.members[i] {
                let beta = share * self.target[j];
                j += 1;
                let length = (along * along + beta * beta).sqrt();
                // -(length) u' = -along u + beta (sin, -cos)
                let towards = [(along * cos - beta * sin) / length, (along * sin + beta * cos) / length];
                self.multipliers[i] = length;
                self.kept.members[i] = Member::Cut { disc, towards };
                self.held[i] = self.dual.combination(self.kept.members[i]);
            }
        }
        self.held.truncate(count);
        self.factor.truncate(first_cut);
        if let Some(blocking) = blocking {
            let place = self.place(self.kept.members[blocking]);
            self.places[place] = 0;
            self.kept.members.remove(blocking);
            self.held.remove(blocking);
            self.multipliers.remove(blocking);
            first_cut = first_cut.min(blocking);
        }
        self.rebuild(first_cut);
    }

    /// The most violated.
    fn worst(&self) -> Option<Member> {
        let mut worst = TOLERANCE;
        let mut found = None;
        let rows = self.dual.rows;
        for (i, (slack, place)) in self.slack[..rows].iter().zip(&self.places).enumerate() {
            if -slack > worst && *place == 0 {
                worst = -slack;
                found = Some(Member::Row(i));
            }
        }
        for (disc, pair) in self.slack[rows..].chunks_exact(2).enumerate() {
            let length = (pair[0] * pair[0] + pair[1] * pair[1]).sqrt();
            if length - 1.0 > worst {
                worst = length - 1.0;
                found = Some(Member::Cut { disc, towards: [pair[0] / length, pair[1] / length] });
            }
        }
        found
    }
}
#[cfg(test)]
mod tests;
