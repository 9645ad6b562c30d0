//! The steps of an ascent.

use super::basis::Combination;
use super::{ActiveSet, Member};

/// A constraint depends on the others when they leave no more than this share of its square.
const INDEPENDENT: f64 = 1e-11;
/// Share of the promised ascent that a turn must keep.
const ARMIJO: f64 = 0.1;
/// Halvings.
const HALVINGS: u32 = 40;

impl ActiveSet {
    /// Takes up the working set that the last solve left.
    pub(super) fn resume(&mut self) {
        self.held.clear();
        self.multipliers.clear();
        self.factor.truncate(0);
        self.is_held.fill(false);
        let mut next = 0;
        while let Some(member) = self.working_set.members.get(next).copied() {
            let constraint = self.basis.constraint(member);
            if self.extend(&constraint) {
                let place = self.place(member);
                self.is_held[place] = true;
                self.held.push(constraint);
                self.multipliers.push(0.0);
                next += 1;
            } else {
                self.working_set.members.remove(next);
            }
        }
    }

    /// Goes to the optimum of the working set; false when a multiplier vanished on the way, and its member was dropped.
    pub(super) fn step(&mut self, offsets: &[f64]) -> bool {
        let count = self.held.len();
        for (right, held) in self.step.as_flattened_mut().iter_mut().zip(&self.held) {
            *right = -held.slack(self.slacks.as_flattened());
        }
        self.factor.solve(&mut self.step);
        let mut first: Option<(f64, usize)> = None;
        for (j, (multiplier, step)) in self.multipliers.iter().zip(self.step.as_flattened()).enumerate() {
            if multiplier + step <= 0.0 {
                let share = if *step < 0.0 { -multiplier / step } else { 0.0 };
                if first.is_none_or(|(s, i)| share < s || (share == s && *step < self.step.as_flattened()[i])) {
                    first = Some((share, j));
                }
            }
        }
        let (share, blocking) = first.map_or((1.0, None), |(share, j)| (share, Some(j)));
        if share > 0.0 {
            self.advance(share, count);
        }
        if let Some(j) = blocking {
            self.stats[0] += 1;
            self.release(j);
        }
        if share > 0.0 {
            self.observe(offsets);
        }
        blocking.is_none()
    }

    /// Moves multipliers and x along the step.
    fn advance(&mut self, share: f64, count: usize) {
        for j in 0..count {
            self.basis.push(&mut self.x, &self.held[j], share * self.step.as_flattened()[j]);
            self.multipliers[j] = (self.multipliers[j] + share * self.step.as_flattened()[j]).max(0.0);
        }
    }

    fn observe(&mut self, offsets: &[f64]) {
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        for ((member, held), multiplier) in self.working_set.members.iter().zip(&self.held).zip(&self.multipliers) {
            if let Member::Row(row) = member {
                self.slacks.as_flattened_mut()[*row] += held.softness * multiplier;
            }
        }
    }

    /// Adds a violated constraint to the working set. False when that is infeasible.
    pub(super) fn hold(&mut self, member: Member, offsets: &[f64]) -> bool {
        self.join(member, 0.0, offsets)
    }

    fn join(&mut self, member: Member, mut multiplier: f64, offsets: &[f64]) -> bool {
        let constraint = self.basis.constraint(member);
        let size = self.basis.square(&constraint);
        let mut moved = false;
        while !self.extend(&constraint) {
            self.stats[4] += 1;
            if constraint.slack(self.slacks.as_flattened()) >= -super::TOLERANCE {
                self.stats[3] += 1;
                self.basis.push(&mut self.x, &constraint, -multiplier);
                self.observe(offsets);
                return true;
            }
            self.factor.composition(&mut self.step);
            let mut first: Option<(f64, usize)> = None;
            for (j, share) in self.step.as_flattened()[..self.held.len()].iter().enumerate() {
                let of = self.basis.square(&self.held[j]);
                if *share > 0.0 && share * share * of > 1e-20 * size {
                    let step = self.multipliers[j] / share;
                    if first.is_none_or(|(s, _)| step < s) {
                        first = Some((step, j));
                    }
                }
            }
            let Some((step, blocking)) = first else { return false };
            self.advance(-step, self.held.len());
            self.basis.push(&mut self.x, &constraint, step);
            multiplier += step;
            moved = true;
            self.release(blocking);
        }
        let place = self.place(member);
        self.is_held[place] = true;
        self.working_set.members.push(member);
        self.held.push(constraint);
        self.multipliers.push(multiplier);
        if moved {
            self.observe(offsets);
        }
        true
    }

    /// Drops a member.
    fn release(&mut self, member: usize) {
        self.remove(member);
        self.rebuild(member);
    }

    fn remove(&mut self, j: usize) {
        let member = self.working_set.members.remove(j);
        let place = self.place(member);
        self.is_held[place] = false;
        let constraint = self.held.remove(j);
        let multiplier = self.multipliers.remove(j);
        if multiplier != 0.0 {
            self.basis.push(&mut self.x, &constraint, -multiplier);
        }
    }

    fn rebuild(&mut self, from: usize) {
        self.factor.truncate(from);
        let mut next = from;
        while next < self.held.len() {
            let constraint = self.held[next];
            if self.extend_at(next, &constraint) {
                next += 1;
            } else {
                self.stats[3] += 1;
                self.remove(next);
            }
        }
    }

    fn extend(&mut self, constraint: &Combination) -> bool {
        self.extend_at(self.held.len(), constraint)
    }

    /// Appends to the factor.
    fn extend_at(&mut self, count: usize, constraint: &Combination) -> bool {
        let Self { factor, basis, held, .. } = self;
        let entry = basis.entries(constraint);
        let diagonal = entry(constraint) + constraint.softness;
        let full = constraint.softness == 0.0
            && held[..count].iter().filter(|held| held.softness == 0.0).count() >= basis.variables;
        let floor = if full { f64::INFINITY } else { INDEPENDENT * diagonal };
        let left = factor.reduce(|j| entry(&held[j]), diagonal);
        let independent = left > floor;
        if independent { factor.append(left); }
        independent
    }

    fn place(&self, member: Member) -> usize {
        match member {
            Member::Row(row) => row,
            Member::Cut { disc, .. } => self.basis.rows + disc,
        }
    }

    /// Turns the cuts.
    pub(super) fn turn(&mut self, offsets: &[f64]) -> bool {
        self.stats[2] += 1;
        let count = self.held.len();
        self.turning.clear();
        for j in 0..count {
            if let Member::Cut { disc, towards } = self.working_set.members[j] {
                let row = self.basis.turning(disc, towards, self.multipliers[j]);
                let Self { factor, basis, held, .. } = self;
                let entry = basis.entries(&row);
                let left = factor.reduce(|j| entry(&held[j]), entry(&row) + row.softness);
                if left < row.softness { self.stats[5] += 1; }
                factor.append(left.max(row.softness));
                self.held.push(row);
                self.multipliers.push(0.0);
                self.turning.push(j);
            }
        }
        for (right, held) in self.step.as_flattened_mut().iter_mut().zip(&self.held) {
            *right = -held.slack(self.slacks.as_flattened());
        }
        let slope = self.factor.solve(&mut self.step);
        // A row may only go as far as its multiplier lasts.
        let (mut share, mut blocking) = (1.0, None);
        for j in 0..count {
            if matches!(self.working_set.members[j], Member::Row(_)) && self.multipliers[j] + share * self.step.as_flattened()[j] < 0.0 {
                (share, blocking) = (-self.multipliers[j] / self.step.as_flattened()[j], Some(j));
            }
        }
        for _ in 0..HALVINGS {
            if self.rise(share, slope) >= ARMIJO * share * slope {
                break;
            }
            self.stats[6] += 1;
            let mut next = 0.5 * share;
            for cut in &self.turning {
                let kink = -self.multipliers[*cut] / self.step.as_flattened()[*cut];
                if kink < share && kink > next { next = kink; }
            }
            (share, blocking) = (next, None);
        }
        for j in 0..self.held.len() {
            self.basis.push(&mut self.x, &self.held[j], share * self.step.as_flattened()[j]);
            self.multipliers[j] += share * self.step.as_flattened()[j];
        }
        for (sideways, cut) in (count..).zip(&self.turning) {
            let (along, across) = (self.multipliers[*cut], self.multipliers[sideways]);
            let Member::Cut { disc, towards: [cos, sin] } = self.working_set.members[*cut] else { continue };
            let length = (along * along + across * across).sqrt();
            if length == 0.0 { continue; }
            let towards = [(along * cos - across * sin) / length, (along * sin + across * cos) / length];
            self.multipliers[*cut] = length;
            self.working_set.members[*cut] = Member::Cut { disc, towards };
        }
        self.held.truncate(count);
        self.multipliers.truncate(count);
        let mut from = self.turning.first().copied().unwrap_or(count);
        self.turned.clear();
        for t in (0..self.turning.len()).rev() {
            let j = self.turning[t];
            self.turned.push((self.working_set.members[j], self.multipliers[j]));
            let place = self.place(self.working_set.members[j]);
            self.is_held[place] = false;
            self.working_set.members.remove(j);
            self.held.remove(j);
            self.multipliers.remove(j);
            if let Some(b) = &mut blocking { if *b > j { *b -= 1; } }
        }
        if let Some(j) = blocking {
            self.remove(j);
            from = from.min(j);
        }
        self.rebuild(from);
        self.observe(offsets);
        for t in 0..self.turned.len() {
            let (member, multiplier) = self.turned[t];
            if !self.join(member, multiplier, offsets) { return false; }
        }
        true
    }

    /// Rise of the dual objective
    fn rise(&self, share: f64, slope: f64) -> f64 {
        let count = self.working_set.members.len();
        let mut rise = share * slope - 0.5 * share * share * slope;
        for (sideways, cut) in (count..).zip(&self.turning) {
            let across = share * self.step.as_flattened()[sideways];
            let along = self.multipliers[*cut] + share * self.step.as_flattened()[*cut];
            let length = along.hypot(across);
            rise += 0.5 * across * across * self.held[sideways].softness;
            rise -= if along > 0.0 { across * across / (length + along) } else { length - along };
        }
        rise
    }
}
