//! The dual objective `D` of the present multipliers, and what must hold between two steps.

use super::basis::Combination;
use super::{ActiveSet, BLURRED};

/// Share of the sum of all `|l_i M_ij l_j|` by which rounding may lower the dual: a Cholesky factor and its solves are exact
/// for a matrix that is off by about the number of members times 1e-16 in each entry.
const ROUNDING: f64 = 1e-13;

impl ActiveSet {
    /// `D` of the present multipliers.
    pub(super) fn objective(&self) -> f64 {
        let slack =
            |held: &Combination| held.slack(self.at_centre.as_flattened()) + held.slack(self.slacks.as_flattened());
        -0.5 * self.held.iter().zip(&self.multipliers).map(|(held, multiplier)| multiplier * slack(held)).sum::<f64>()
    }

    /// By how much the dual objective rises over a share of the step, the true length of the turned forces included.
    pub(super) fn rise(&self, share: f64, slope: f64) -> f64 {
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

    /// Forms `x` anew from the multipliers: where those come from far away, what was added up on the way is rounding.
    pub(super) fn restore(&mut self) {
        let Self { x, centre, basis, held, multipliers, .. } = self;
        x.copy_from_slice(centre);
        held.iter().zip(multipliers).for_each(|(held, multiplier)| basis.push(x, held, *multiplier));
    }

    /// The entry of the working set's Gram block, softness included.
    fn entry(&self, i: usize, j: usize) -> f64 {
        let softness = if i == j { self.held[i].softness } else { 0.0 };
        self.basis.entries(&self.held[i])(&self.held[j]) + softness
    }

    /// What must hold of the working set.
    pub(super) fn check_invariants(&self) {
        debug_assert!(self.held.len() == self.working_set.members.len() && self.held.len() == self.multipliers.len());
        debug_assert!(self.held.len() <= self.held.capacity(), "the working set outgrew its room");
        debug_assert!(self.multipliers.iter().all(|multiplier| *multiplier >= 0.0), "{:?}", self.multipliers);
        debug_assert!(self.factor.misfit(|i, j| self.entry(i, j)) < 1e-6, "the factor is not that of the Gram block");
    }

    /// A step to the optimum of the working set does not lower the dual, but for rounding; `first` is the dual of the first
    /// violated constraint alone. Where that is blurred, the slacks' own rounding is far above the tolerance they are held
    /// to, and nothing is promised.
    pub(super) fn check_rise(&self, before: f64, first: f64) {
        if cfg!(debug_assertions) && first <= BLURRED {
            let all = 0..self.held.len();
            let force = |i: usize, j: usize| (self.multipliers[i] * self.entry(i, j) * self.multipliers[j]).abs();
            let forces: f64 =
                all.clone().flat_map(|i| all.clone().map(move |j| (i, j))).map(|(i, j)| force(i, j)).sum();
            let slack = (1e-6 * before.abs().max(first)).max(ROUNDING * forces);
            let objective = self.objective();
            assert!(objective >= before - slack, "a step fell to {objective:e} from {before:e}, of forces {forces:e}");
        }
    }
}
