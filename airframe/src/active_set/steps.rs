//! The steps of the ascent, but for the turning of the cuts.

use super::basis::Combination;
use super::{ActiveSet, Member, TOLERANCE};

/// A constraint depends on others when they leave no more than this share of its diagonal entry.
const INDEPENDENT: f64 = 1e-10;
/// A share in a composition below this, in lengths, is rounding.
const NO_SHARE: f64 = 1e-10;

impl ActiveSet {
    /// Takes up the working set of the last solve, with no force on any of its members yet.
    pub(super) fn resume(&mut self) {
        self.held.clear();
        self.multipliers.clear();
        self.factor.truncate(0);
        self.is_held.fill(false);
        let mut next = 0;
        while let Some(&member) = self.working_set.members.get(next) {
            let place = self.basis.place(member).filter(|place| !self.is_held[*place]);
            let constraint = place.map(|_| self.basis.constraint(member));
            match (place, constraint) {
                (Some(place), Some(constraint)) if self.extend_factor(&constraint) => {
                    self.is_held[place] = true;
                    self.held.push(constraint);
                    self.multipliers.push(0.0);
                    next += 1;
                }
                _ => drop(self.working_set.members.remove(next)),
            }
        }
    }

    /// Goes to where all members have no slack. False when a multiplier vanished on the way: its member was dropped.
    pub(super) fn step(&mut self) -> bool {
        self.aim();
        let mut stop: Option<(f64, usize)> = None;
        for (j, (multiplier, step)) in self.multipliers.iter().zip(self.step.as_flattened()).enumerate() {
            if multiplier + step <= 0.0 {
                let share = if *step < 0.0 { multiplier / -step } else { 0.0 };
                // Of several that cannot even start, the one that pulls hardest goes first.
                if stop.is_none_or(|(s, k)| share < s || share == s && *step < self.step.as_flattened()[k]) {
                    stop = Some((share, j));
                }
            }
        }
        let before = cfg!(debug_assertions).then(|| self.objective());
        let share = stop.map_or(1.0, |(share, _)| share);
        self.advance(share);
        self.multipliers.iter_mut().for_each(|multiplier| *multiplier = multiplier.max(0.0));
        if let Some((_, member)) = stop {
            self.release(member);
        }
        if share > 0.0 {
            self.observe();
        }
        debug_assert!(
            before.is_none_or(|before| {
                let fell = before - self.objective();
                fell.is_nan() || fell <= self.rounding()
            }),
            "the dual objective fell"
        );
        stop.is_none()
    }

    /// Adds a constraint to the working set, with the `multiplier` it brings along. One that is violated and depends on
    /// members replaces one of them; false when none can give way, for then no point obeys them all.
    pub(super) fn join(&mut self, member: Member, mut multiplier: f64) -> bool {
        let (Some(place), constraint) = (self.basis.place(member), self.basis.constraint(member)) else { return true };
        let mut moved = false;
        while !self.extend_factor(&constraint) {
            if constraint.slack(&self.slacks) >= -TOLERANCE {
                self.basis.push(&mut self.x, &constraint, -multiplier);
                self.observe();
                return true;
            }
            let Some((exchange, gives_way)) = self.exchange(&constraint) else { return false };
            self.advance(-exchange);
            self.basis.push(&mut self.x, &constraint, exchange);
            multiplier += exchange;
            self.release(gives_way);
            moved = true;
        }
        self.is_held[place] = true;
        self.working_set.members.push(member);
        self.held.push(constraint);
        self.multipliers.push(multiplier);
        if moved {
            self.observe();
        }
        true
    }

    /// How much force `constraint` can take over from the members it is composed of until the first of them has none
    /// left, and which that is. `None` when it is composed against all of them.
    fn exchange(&mut self, constraint: &Combination) -> Option<(f64, usize)> {
        self.factor.composition(&mut self.step);
        let size = self.basis.diagonal(constraint);
        let mut first: Option<(f64, usize)> = None;
        for (j, share) in self.step.as_flattened()[..self.held.len()].iter().enumerate() {
            if *share > 0.0 && share * share * self.basis.diagonal(&self.held[j]) > NO_SHARE * NO_SHARE * size {
                let exchange = self.multipliers[j] / share;
                if first.is_none_or(|(least, _)| exchange < least) {
                    first = Some((exchange, j));
                }
            }
        }
        first
    }

    /// Writes the step that takes the slack from all constraints held: `M step = -s`. Returns `-s . step`.
    pub(super) fn aim(&mut self) -> f64 {
        for (step, held) in self.step.as_flattened_mut().iter_mut().zip(&self.held) {
            *step = -held.slack(&self.slacks);
        }
        self.factor.solve(&mut self.step)
    }

    /// Moves multipliers and `x` by a share of the step.
    pub(super) fn advance(&mut self, share: f64) {
        if share != 0.0 {
            for ((held, multiplier), step) in self.held.iter().zip(&mut self.multipliers).zip(self.step.as_flattened())
            {
                *multiplier += share * step;
                self.basis.push(&mut self.x, held, share * step);
            }
        }
    }

    /// Works out the slacks at `x`, with what soft members have given way.
    pub(super) fn observe(&mut self) {
        self.basis.slacks(&self.x, &self.offsets, &mut self.slacks);
        for ((member, held), multiplier) in self.working_set.members.iter().zip(&self.held).zip(&self.multipliers) {
            if let Member::Row(row) = member {
                self.slacks.as_flattened_mut()[*row] += held.softness * multiplier;
            }
        }
    }

    /// Drops a member, and what force it has.
    fn release(&mut self, member: usize) {
        self.remove(member);
        self.renew_factor(member);
    }

    /// The same, but for the factor.
    pub(super) fn remove(&mut self, member: usize) {
        let constraint = self.held[member];
        let (_, multiplier) = self.take(member);
        self.basis.push(&mut self.x, &constraint, -multiplier);
    }

    /// Takes a member out of the working set, with its force still on `x`.
    pub(super) fn take(&mut self, member: usize) -> (Member, f64) {
        self.held.remove(member);
        let (member, multiplier) = (self.working_set.members.remove(member), self.multipliers.remove(member));
        if let Some(place) = self.basis.place(member) {
            self.is_held[place] = false;
        }
        (member, multiplier)
    }

    /// Brings the factor up to date when members changed `from` here on.
    pub(super) fn renew_factor(&mut self, from: usize) {
        self.factor.truncate(from);
        while let Some(&constraint) = self.held.get(self.factor.len()) {
            if !self.extend_factor(&constraint) {
                self.remove(self.factor.len());
            }
        }
    }

    /// Appends a constraint to the factor; false when it depends on those there, and then it stays out.
    fn extend_factor(&mut self, constraint: &Combination) -> bool {
        let Self { factor, basis, held, .. } = self;
        let entry = basis.entries(constraint);
        let diagonal = basis.diagonal(constraint);
        let left = factor.reduce(|j| entry(&held[j]), diagonal);
        let hard = held[..factor.len()].iter().filter(|held| held.is_hard()).count();
        let full = constraint.is_hard() && hard == basis.variables;
        if full || left.is_nan() || left <= INDEPENDENT * diagonal {
            return false;
        }
        factor.append(left);
        debug_assert!(
            (0..factor.len() - 1).all(|j| {
                let miss = factor.product(factor.len() - 1, j) - entry(&held[j]);
                miss.abs() <= 1e-9 * (diagonal * basis.diagonal(&held[j])).sqrt()
            }),
            "the factor is not that of the Gram matrix"
        );
        true
    }

    /// The dual objective: what the constraints have cost so far.
    fn objective(&self) -> f64 {
        let pairs = self.held.iter().zip(&self.multipliers);
        -0.5 * pairs.map(|(held, l)| l * (held.slack(&self.slacks_at_centre) + held.slack(&self.slacks))).sum::<f64>()
    }

    /// What rounding may do to it.
    fn rounding(&self) -> f64 {
        let pairs = self.held.iter().zip(&self.multipliers);
        1e-9 * pairs.map(|(held, l)| (l * held.slack(&self.slacks_at_centre)).abs()).sum::<f64>()
    }
}
