//! The steps of an ascent: step, join, turn.

use super::basis::Combination;
use super::{ActiveSet, Member};

/// A constraint depends on the others when they leave no more than this share of its square.
const INDEPENDENT: f64 = 1e-11;
/// Squared share of a dependent constraint, in its own size, that is rounding.
const ROUNDING: f64 = 1e-20;
/// Share of the promised ascent that a turn must keep.
const ARMIJO: f64 = 0.1;
/// Times a turn is shortened at most.
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
        self.aim();
        let steps = self.step.as_flattened();
        let mut first: Option<(f64, usize)> = None;
        for (j, (multiplier, step)) in self.multipliers.iter().zip(steps).enumerate() {
            if multiplier + step <= 0.0 {
                let share = if *step < 0.0 { -multiplier / step } else { 0.0 };
                if first.is_none_or(|(s, i)| share < s || (share == s && *step < steps[i])) {
                    first = Some((share, j));
                }
            }
        }
        let (share, blocking) = first.map_or((1.0, None), |(share, j)| (share, Some(j)));
        if share > 0.0 {
            self.advance(share);
        }
        if let Some(j) = blocking {
            self.remove(j);
            self.rebuild(j);
        }
        if share > 0.0 {
            self.observe(offsets);
        }
        blocking.is_none()
    }

    /// Writes the step that brings every held slack to zero; returns how steeply the dual rises along it.
    fn aim(&mut self) -> f64 {
        for (right, held) in self.step.as_flattened_mut().iter_mut().zip(&self.held) {
            *right = -held.slack(self.slacks.as_flattened());
        }
        self.factor.solve(&mut self.step)
    }

    /// Moves the multipliers, and `x` with them, by a share of the step.
    fn advance(&mut self, share: f64) {
        for ((held, multiplier), step) in self.held.iter().zip(&mut self.multipliers).zip(self.step.as_flattened()) {
            self.basis.push(&mut self.x, held, share * step);
            *multiplier = (*multiplier + share * step).max(0.0);
        }
    }

    /// Takes a look at the slacks at `x`; a held soft row is where its excess puts it.
    fn observe(&mut self, offsets: &[f64]) {
        self.basis.slacks(&self.x, offsets, &mut self.slacks);
        for ((member, held), multiplier) in self.working_set.members.iter().zip(&self.held).zip(&self.multipliers) {
            if let Member::Row(row) = member {
                self.slacks.as_flattened_mut()[*row] += held.softness * multiplier;
            }
        }
    }

    /// Adds a constraint that does not hold, with the multiplier it has; false when no point obeys it and those it depends on.
    ///
    /// One that depends on those held takes their place: its own force grows at their expense until the first of them has
    /// none left and drops out. If it holds, its force goes over to them likewise: taken off, the dual would fall.
    pub(super) fn join(&mut self, member: Member, mut multiplier: f64, offsets: &[f64]) -> bool {
        let constraint = self.basis.constraint(member);
        let size = self.basis.square(&constraint);
        let mut moved = false;
        while !self.extend(&constraint) {
            self.factor.composition(&mut self.step);
            let sign = if constraint.slack(self.slacks.as_flattened()) < -super::TOLERANCE { 1.0 } else { -1.0 };
            let first = self.first_exhausted(size, sign);
            if sign < 0.0 && first.is_none_or(|(step, _)| step >= multiplier) {
                self.advance(multiplier);
                self.basis.push(&mut self.x, &constraint, -multiplier);
                self.observe(offsets);
                return true;
            }
            let Some((step, blocking)) = first else { return false };
            self.advance(-sign * step);
            self.basis.push(&mut self.x, &constraint, sign * step);
            multiplier += sign * step;
            moved = true;
            self.remove(blocking);
            self.rebuild(blocking);
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

    /// Of the members whose force goes over to the joining constraint as that grows (`sign` 1) or shrinks (-1), the one that
    /// is exhausted first, and by how much the joining one has changed by then. `size` is the square of the joining
    /// constraint: shares that are rounding to it do not count.
    fn first_exhausted(&self, size: f64, sign: f64) -> Option<(f64, usize)> {
        let mut first: Option<(f64, usize)> = None;
        for (j, (share, held)) in self.step.as_flattened().iter().zip(&self.held).enumerate() {
            let share = sign * share;
            if share > 0.0 && share * share * self.basis.square(held) > ROUNDING * size {
                let step = self.multipliers[j] / share;
                if first.is_none_or(|(s, _)| step < s) {
                    first = Some((step, j));
                }
            }
        }
        first
    }

    /// Drops a member, and takes its force off `x`.
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

    /// Computes the factor anew from a member on; one that has come to depend on those before it is dropped.
    fn rebuild(&mut self, from: usize) {
        self.factor.truncate(from);
        let mut next = from;
        while next < self.held.len() {
            let constraint = self.held[next];
            if self.extend_at(next, &constraint) {
                next += 1;
            } else {
                self.remove(next);
            }
        }
    }

    /// Lets the factor grow by a constraint; false when that depends on the members, or there are as many as variables.
    fn extend(&mut self, constraint: &Combination) -> bool {
        self.extend_at(self.held.len(), constraint)
    }

    /// The same behind the first `count` members.
    fn extend_at(&mut self, count: usize, constraint: &Combination) -> bool {
        let Self { factor, basis, held, .. } = self;
        let entry = basis.entries(constraint);
        let diagonal = entry(constraint) + constraint.softness;
        let full = constraint.softness == 0.0
            && held[..count].iter().filter(|held| held.softness == 0.0).count() >= basis.variables;
        let floor = if full { f64::INFINITY } else { INDEPENDENT * diagonal };
        let left = factor.reduce(|j| entry(&held[j]), diagonal);
        let independent = left > floor;
        if independent {
            factor.append(left);
        }
        independent
    }

    /// Where a member stands in `is_held`.
    fn place(&self, member: Member) -> usize {
        match member {
            Member::Row(row) => row,
            Member::Cut { disc, .. } => self.basis.rows + disc,
        }
    }

    /// One Newton step on the multipliers and the angles of all held tangents; false when no point is inside.
    pub(super) fn turn(&mut self, offsets: &[f64]) -> bool {
        let count = self.held.len();
        self.hold_angles();
        let slope = self.aim();
        let (share, mut blocking) = self.search(count, slope);
        for ((held, multiplier), step) in self.held.iter().zip(&mut self.multipliers).zip(self.step.as_flattened()) {
            self.basis.push(&mut self.x, held, share * step);
            *multiplier += share * step;
        }
        self.read_angles(count);
        self.held.truncate(count);
        self.multipliers.truncate(count);

        let mut from = self.turning.first().copied().unwrap_or(count);
        self.turned.clear();
        for t in (0..self.turning.len()).rev() {
            let j = self.turning[t];
            let member = self.working_set.members.remove(j);
            let place = self.place(member);
            self.is_held[place] = false;
            self.held.remove(j);
            self.turned.push((member, self.multipliers.remove(j)));
            blocking = blocking.map(|b| if b > j { b - 1 } else { b });
        }
        if let Some(j) = blocking {
            self.remove(j);
            from = from.min(j);
        }
        self.rebuild(from);
        self.observe(offsets);
        let possible = (0..self.turned.len()).all(|t| {
            let (member, multiplier) = self.turned[t];
            self.join(member, multiplier, offsets)
        });
        self.restore();
        self.observe(offsets);
        possible
    }

    /// Adds, behind the members, one row for the angle of each held tangent.
    fn hold_angles(&mut self) {
        self.turning.clear();
        for j in 0..self.held.len() {
            if let Member::Cut { disc, towards } = self.working_set.members[j] {
                let row = self.basis.turning(disc, towards, self.multipliers[j]);
                let Self { factor, basis, held, .. } = self;
                let entry = basis.entries(&row);
                let left = factor.reduce(|j| entry(&held[j]), entry(&row) + row.softness);
                factor.append(left.max(row.softness));
                self.held.push(row);
                self.multipliers.push(0.0);
                self.turning.push(j);
            }
        }
    }

    /// How far to go along the step, and the row whose multiplier ends it: no row beyond its multiplier, and no farther
    /// than the dual rises by its share. Where a tangent's force would turn over, the dual has a kink: looked at too.
    fn search(&self, count: usize, slope: f64) -> (f64, Option<usize>) {
        let steps = self.step.as_flattened();
        let (mut share, mut blocking) = (1.0, None);
        for (j, member) in self.working_set.members[..count].iter().enumerate() {
            if matches!(member, Member::Row(_)) && self.multipliers[j] + share * steps[j] < 0.0 {
                (share, blocking) = (-self.multipliers[j] / steps[j], Some(j));
            }
        }
        for _ in 0..HALVINGS {
            // The dual is concave: what rises more steeply than at first is rounding.
            if (ARMIJO * share * slope..=share * slope).contains(&self.rise(share, slope)) {
                break;
            }
            let kinks = self.turning.iter().map(|cut| -self.multipliers[*cut] / steps[*cut]);
            (share, blocking) = (kinks.filter(|kink| *kink < share).fold(0.5 * share, f64::max), None);
        }
        (share, blocking)
    }

    /// Gives the tangents the angle and the multiplier that their two rows come to.
    fn read_angles(&mut self, count: usize) {
        for (sideways, cut) in (count..).zip(&self.turning) {
            let (along, across) = (self.multipliers[*cut], self.multipliers[sideways]);
            let Member::Cut { disc, towards: [cos, sin] } = self.working_set.members[*cut] else { continue };
            let length = (along * along + across * across).sqrt();
            if length > 0.0 {
                let towards = [(along * cos - across * sin) / length, (along * sin + across * cos) / length];
                self.multipliers[*cut] = length;
                self.working_set.members[*cut] = Member::Cut { disc, towards };
            }
        }
    }
}
