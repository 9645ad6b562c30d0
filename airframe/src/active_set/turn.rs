//! The turning of the cuts: Newton's method on the angles at which the held discs are touched.
//!
//! The force of a cut is `mu = lambda (cos, sin)`, and the dual objective contains `-|mu|`. Along the tangent its second
//! derivative is `-1/lambda`: the same as that of a soft row of weight `lambda` along the tangent. With one such row for
//! each cut, `beta` its multiplier, the equations of the working set give Newton's step:
//!
//! ```text
//! [M  N] [d lambda]     [s  ]      s     slacks of the members
//! [N' T] [  beta  ] = - [tau],     tau   sin s_a - cos s_b of each cut;  T has 1/lambda on its diagonal
//!
//! mu = (lambda + alpha d lambda) (cos, sin) + alpha beta (-sin, cos)
//! ```
//!
//! The share `alpha` is 1 unless `-|mu|`, which Newton's method takes for a parabola, makes less of the ascent than
//! promised (Armijo 1966, *Pacific J. Math.* 16).

use super::{ActiveSet, Member};

/// Share of the promised ascent that a step must keep.
const KEPT: f64 = 0.1;
/// Times a step may be shortened.
const SHORTENINGS: u32 = 40;

impl ActiveSet {
    /// Turns all cuts held. False when they cannot be obeyed together.
    pub(super) fn turn(&mut self) -> bool {
        let members = self.held.len();
        self.append_turnings();
        let slope = self.aim();
        let (mut share, mut emptied) = self.reach_of_rows();
        for _ in 0..SHORTENINGS {
            if self.rise(share, slope) >= KEPT * share * slope {
                break;
            }
            (share, emptied) = (self.shorten(share), None);
        }
        self.advance(share);
        self.bend(members);

        // The cuts leave the working set as they were, and join it again as they are.
        let mut first = members;
        if let Some(row) = emptied {
            self.remove(row);
            first = row;
        }
        for j in (0..self.held.len()).rev() {
            if matches!(self.working_set.members[j], Member::Cut { .. }) {
                let turned = self.take(j);
                self.turned.push(turned);
                first = first.min(j);
            }
        }
        self.renew_factor(first);
        self.observe();
        while let Some((cut, multiplier)) = self.turned.pop() {
            if !self.join(cut, multiplier) {
                self.turned.clear();
                return false;
            }
        }
        true
    }

    /// Holds a turning row for each cut, behind the members and in their order.
    fn append_turnings(&mut self) {
        let Self { factor, basis, held, multipliers, working_set, .. } = self;
        for (j, member) in working_set.members.iter().enumerate() {
            if let Member::Cut { disc, towards } = *member {
                let turning = basis.turning(disc, towards, multipliers[j]);
                let entry = basis.entries(&turning);
                let left = factor.reduce(|j| entry(&held[j]), basis.diagonal(&turning));
                factor.append(left.max(turning.softness)); // less would be rounding
                held.push(turning);
                multipliers.push(0.0);
            }
        }
    }

    /// How much of the step the multipliers of the rows allow, and the row whose multiplier that uses up.
    fn reach_of_rows(&self) -> (f64, Option<usize>) {
        let (mut share, mut emptied) = (1.0, None);
        let steps = self.multipliers.iter().zip(self.step.as_flattened());
        for (j, (member, (multiplier, step))) in self.working_set.members.iter().zip(steps).enumerate() {
            if matches!(member, Member::Row(_)) && multiplier + share * step <= 0.0 {
                (share, emptied) = (multiplier / -step, Some(j));
            }
        }
        (share, emptied)
    }

    /// How much the dual objective rises along a `share` of the step, that starts with `slope`.
    fn rise(&self, share: f64, slope: f64) -> f64 {
        let mut rise = share * (1.0 - 0.5 * share) * slope;
        for (cut, turning) in self.cuts() {
            let across = share * self.step.as_flattened()[turning];
            let along = self.multipliers[cut] + share * self.step.as_flattened()[cut];
            let length = (along * along + across * across).sqrt();
            // In place of the parabola: |mu| - along, written so that nothing cancels.
            rise += 0.5 * across * across / self.multipliers[cut];
            rise -= if along > 0.0 { across * across / (length + along) } else { length - along };
        }
        rise
    }

    /// The next shorter share to try: one half, or before that where a force passes nearest to zero, for there the
    /// objective has its kinks.
    fn shorten(&self, share: f64) -> f64 {
        let kinks = self.cuts().map(|(cut, _)| self.multipliers[cut] / -self.step.as_flattened()[cut]);
        kinks.filter(|kink| *kink < share).fold(0.5 * share, f64::max)
    }

    /// Gives each cut the direction of its force, and drops the turning rows behind the `members`.
    fn bend(&mut self, members: usize) {
        let mut turning = members;
        for j in 0..members {
            let Member::Cut { towards: [cos, sin], .. } = self.working_set.members[j] else {
                self.multipliers[j] = self.multipliers[j].max(0.0);
                continue;
            };
            let (along, across) = (self.multipliers[j], self.multipliers[turning]);
            let length = (along * along + across * across).sqrt();
            turning += 1;
            self.multipliers[j] = length;
            if let Member::Cut { towards, .. } = &mut self.working_set.members[j]
                && length > 0.0
            {
                *towards = [(along * cos - across * sin) / length, (along * sin + across * cos) / length];
            }
        }
        self.held.truncate(members);
        self.multipliers.truncate(members);
    }

    /// Each cut with its turning row.
    fn cuts(&self) -> impl Iterator<Item = (usize, usize)> {
        let members = &self.working_set.members;
        let cuts = members.iter().enumerate().filter(|(_, member)| matches!(member, Member::Cut { .. }));
        cuts.map(|(j, _)| j).zip(members.len()..)
    }
}
