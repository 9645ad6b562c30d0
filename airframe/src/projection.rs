//! A demand the actuators cannot produce, and the nearest one they can.
//!
//! ```text
//! minimise (v - u)' W (v - u)   over the demands v of the set,   u the demand as it came
//! ```
//!
//! The safety net of the mixer, for a controller that is late, foreign or plans without limits, and of the controller
//! itself when its solver fails. Clipped rotor by rotor, such a demand would become whatever forces are left; here it
//! gives up first what matters least. The paper has no such step, and profile `paper` flies without it.
//!
//! The result is slightly inside the border, so that the allocation clips nothing, rounding included.

use nalgebra::{DMatrix, DVector, Vector4};

use crate::demand_set::{DemandSet, Slack};
use qp::{ActiveSet, Termination};

/// What a miss of (col, lon, lat, ped) costs, per N^2 and (N m)^2.
///
/// Pitch and roll keep the vehicle upright: a newton metre of either costs as much as 10 N of thrust. Yaw only turns the
/// heading, at a tenth of their cost. Missing the whole range of an input costs as 1.2 : 3.4 : 2.2 : 1 (paper's vehicle,
/// rotors up to twice the speed at trim): yaw is lost first, then thrust, then roll and pitch.
pub const WEIGHTS: [f64; 4] = [1.0, 100.0, 100.0, 10.0];
/// Iterations granted to the solver; 300 000 random demands took 14 at most.
const MAX_ITERATIONS: u32 = 100;
/// A demand this near to the border (in shares of `Omega1max^2`) is not inside: rounding could clip it.
const ROUNDING: f64 = 1e-12;
/// Share of the way back to hover that the result keeps from the border; by far more than [`ROUNDING`].
const HAIR: f64 = 1e-9;
/// Beyond this \[N, N m\], hundreds of times what the rotors can do, only the direction of a demand counts. Nothing
/// overflows then, and the solver keeps its digits.
const FAR: f64 = 1e4;

/// The projection of one vehicle.
pub struct Projection {
    set: DemandSet,
    solver: ActiveSet,
    /// Slacks at hover, as the solver takes them.
    offsets: Vec<f64>,
}

impl Projection {
    /// The projection onto a set of demands.
    pub fn new(set: DemandSet) -> Self {
        let disc = set.disc.as_ref().map_or(&[][..], |disc| disc);
        let slopes = |slacks: &[Slack]| DMatrix::from_fn(slacks.len(), 4, |row, axis| slacks[row].slope[axis]);
        let hard = vec![0.0; set.linear.len()];
        let hessian = DMatrix::from_diagonal(&DVector::from_column_slice(&WEIGHTS));
        let solver = ActiveSet::new(&hessian, &slopes(&set.linear), &hard, &slopes(disc), MAX_ITERATIONS);
        let offsets = set.linear.iter().chain(disc).map(|slack| slack.offset).collect();
        Self { set, solver, offsets }
    }

    /// The nearest demand inside the set \[N, N m, N m, N m\]; `None` when the finite `demand` is inside itself.
    ///
    /// Should the solver find none, it is the last point inside on the way from hover to the demand.
    pub fn nearest(&mut self, demand: &Vector4<f64>) -> Option<Vector4<f64>> {
        if self.set.violation(demand) <= -ROUNDING {
            return None;
        }
        let size = demand.amax();
        let wanted = if size > FAR { demand * (FAR / size) } else { *demand };
        let mut found = Vector4::zeros();
        self.solver.forget(); // what it keeps from solve to solve would make the answer depend on earlier demands
        let outcome = self.solver.solve(wanted.as_slice(), &self.offsets, found.as_mut_slice());
        let towards = if outcome.termination == Termination::Optimal { found } else { wanted };
        let share = self.set.reach(&Vector4::zeros(), &towards);
        Some(towards * (share * (1.0 - HAIR)))
    }
}

#[cfg(test)]
mod tests;
