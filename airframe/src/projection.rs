//! Projection of a demand that the actuators cannot produce onto the nearest demand that they can produce.
//!
//! ```text
//! minimise (v - u)' W (v - u)   over the demands v of the set;   u is the demand, clipped to its attainable range
//! ```
//!
//! The demand is clipped before distances are measured. A demanded climb of 400 N is then as far away as the 30 N that
//! the rotors have, and does not outweigh the moments that keep the vehicle upright. The weights decide which axis is
//! given up first. Weights that differ by orders of magnitude give the priority that is usual for small multirotors,
//! roll and pitch before thrust before yaw (PX4's sequential desaturation; Faessler, Falanga and Scaramuzza, *IEEE
//! Robotics and Automation Letters* 2 (2017)). docs/mpc.md compares weights.
//!
//! The mixer projects demands of a controller that is late, foreign or plans without limits; the controller projects if
//! its solver fails. The paper has no such step, and profile `paper` flies without it.
//!
//! The result is slightly inside the border, so that the allocation does not clip it, not even by rounding.

use nalgebra::{DMatrix, DVector, Vector4};

use crate::demand_set::{DemandSet, Slack};
use qp::{ActiveSet, Termination};

/// Default cost of a deviation of (col, lon, lat, ped), per N^2 and (N m)^2: a newton metre of pitch or roll costs as
/// much as 32 N of thrust, a newton metre of yaw as much as 10 N.
pub const WEIGHTS: [f64; 4] = [0.1, 100.0, 100.0, 10.0];
/// Largest number of iterations of the solver; 300 000 random demands took 14 at most.
const MAX_ITERATIONS: u32 = 100;
/// Distance to the border, in shares of `Omega1max^2`, below which a demand counts as outside: rounding could clip it.
const ROUNDING: f64 = 1e-12;
/// Distance of the result from the border, as a share of the way to hover; far more than [`ROUNDING`].
const HAIR: f64 = 1e-9;
/// Projection for one vehicle.
pub struct Projection {
    set: DemandSet,
    solver: ActiveSet,
    /// Slacks at hover, in the solver's order.
    offsets: Vec<f64>,
}

impl Projection {
    /// Prepares the projection onto a set of demands; `weights` are the cost of a deviation of col, lon, lat, ped.
    pub fn new(set: DemandSet, weights: &[f64; 4]) -> Self {
        let disc = set.disc.as_ref().map_or(&[][..], |disc| disc);
        let slopes = |slacks: &[Slack]| DMatrix::from_fn(slacks.len(), 4, |row, axis| slacks[row].slope[axis]);
        let hard = vec![0.0; set.linear.len()];
        let hessian = DMatrix::from_diagonal(&DVector::from_column_slice(weights));
        let solver = ActiveSet::new(&hessian, &slopes(&set.linear), &hard, &slopes(disc), MAX_ITERATIONS);
        let offsets = set.linear.iter().chain(disc).map(|slack| slack.offset).collect();
        Self { set, solver, offsets }
    }

    /// Finds the nearest demand inside the set \[N, N m, N m, N m\]; `None` if `demand` is inside already.
    ///
    /// If the solver does not converge, returns the last point inside on the way from hover to the clipped demand.
    pub fn nearest(&mut self, demand: &Vector4<f64>) -> Option<Vector4<f64>> {
        if self.set.violation(demand) <= -ROUNDING {
            return None;
        }
        let wanted = demand.zip_zip_map(&self.set.lower, &self.set.upper, f64::clamp);
        let mut found = Vector4::zeros();
        self.solver.forget(); // without a warm start the answer does not depend on earlier demands
        let outcome = self.solver.solve(wanted.as_slice(), &self.offsets, found.as_mut_slice());
        let towards = if outcome.termination == Termination::Optimal { found } else { wanted };
        let share = self.set.reach(&Vector4::zeros(), &towards);
        Some(towards * (share * (1.0 - HAIR)))
    }
}

#[cfg(test)]
mod tests;
