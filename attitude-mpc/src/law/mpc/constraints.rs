//! Constraints on a plan: every move is inside the actuators' set, and predicted states beyond their limits have a
//! cost.
//!
//! ```text
//! u_min <= u_k <= u_max,   k = 0..Nu-1                                   (3)
//! |theta|, |phi| <= pi/2                                                 (49)
//! |psi| <= 2 pi                                                          (50)
//! |p|, |q|, |r| <= 2 pi rad/s                                            (51)
//! ```
//!
//! The paper finds no bounds for (3) and approximates them. Here they are exact: [`airframe::demand_set`] has the
//! limits of rotors and servo as linear rows and a disc for each move. The smallest box around this set can be chosen
//! instead.
//!
//! Departure: (49)-(51) are soft. No move can stop the vehicle's motion within a sample, so hard limits would make the
//! problem infeasible as soon as a state exceeds its limit. A state beyond its limit by the share `e` of the limit
//! costs `1/2 w e^2` per predicted sample, over the first `Nu` samples. Test
//! `a_state_beyond_its_limit_still_has_a_plan`.

use airframe::DemandSet;
use airframe::envelope::Envelope;
use nalgebra::{DMatrix, DVector, Vector4};
use settings::{Constraints, MpcSettings, Scenario, StateConstraints};

use crate::law::mpc::condensed::PredictedStates;

/// Number of states with a limit: phi, theta, psi, p, q, r.
const LIMITED: usize = 6;
/// Factor that scales a move back from the border, so that the mixer does not clip it by rounding.
const RETRACTION: f64 = 1.0 - 1e-9;
/// Weight `w` of the cost `1/2 w e^2` of a state that is the share `e` beyond its limit, per predicted sample.
pub const STATE_PENALTY: f64 = 1e4;

/// Set of admissible plans.
#[derive(Debug, Clone)]
pub struct PlanSet {
    /// Set of admissible moves.
    pub moves: DemandSet,
    /// Limits of the predicted states; `None` if not imposed.
    pub states: Option<StateLimits>,
}

/// Soft limits of the predicted states: `|y| <= 1 + e`, where `y` are states over their limits.
#[derive(Debug, Clone)]
pub struct StateLimits {
    /// Matrix from `(x; r; d; v)` to `y`, 6Nu x (n + 15).
    free: DMatrix<f64>,
    /// Matrix from the moves to `y`, 6Nu x 4Nu.
    pub forced: DMatrix<f64>,
    /// Value of `y` at the model's origin, 6Nu, which has the roll angle of trim.
    origin: DVector<f64>,
    /// Value of `y` at this tick without moves, 6Nu.
    pub drift: DVector<f64>,
    /// Value of `y` under the plan checked last, 6Nu.
    reached: DVector<f64>,
}

impl PlanSet {
    /// Builds the set of a scenario; `None` if the scenario has no constraint on the moves.
    pub fn new(scenario: &Scenario, course: &PredictedStates, roll_trim_rad: f64) -> Option<Self> {
        let envelope = Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits());
        let moves = match scenario.attitude.mpc.constraints {
            Constraints::None => return None,
            Constraints::Box => DemandSet::bounding_box(&envelope),
            Constraints::Cone => DemandSet::exact(&envelope),
        };
        let states = match scenario.attitude.mpc.state_constraints {
            StateConstraints::None => None,
            StateConstraints::Soft => Some(StateLimits::new(scenario, course, roll_trim_rad)),
        };
        Some(Self { moves, states })
    }

    /// Sets the start of this tick, `given` = (x; r; d; v).
    pub fn start(&mut self, given: &DVector<f64>) {
        if let Some(states) = &mut self.states {
            states.drift.copy_from(&states.origin);
            states.drift.gemv(1.0, &states.free, given, 1.0);
        }
    }

    /// Largest violation of the set by any of the `moves`; at most 0 if all are inside.
    pub fn violation(&self, moves: &DVector<f64>) -> f64 {
        each(moves.as_slice()).map(|u| self.moves.violation(&u)).fold(f64::NEG_INFINITY, f64::max) // (3)
    }

    /// Largest excess of a predicted state over its limit, as a share of the limit; at most 0 if all are inside.
    pub fn excess(&mut self, moves: &DVector<f64>) -> f64 {
        let Some(states) = &mut self.states else { return f64::NEG_INFINITY };
        states.reached.copy_from(&states.drift);
        states.reached.gemv(1.0, &states.forced, moves, 1.0);
        states.reached.amax() - 1.0 // (49), (50), (51)
    }

    /// Number of limits that the `moves` touch, with a slack of at most `near`.
    pub fn touching(&self, moves: &DVector<f64>, near: f64) -> u64 {
        let mut touching = 0;
        for u in each(moves.as_slice()) {
            self.moves.slacks(&u, |slack| touching += u64::from(slack <= near));
        }
        touching
    }

    /// Scales every move that is outside or on the border towards hover, until it is slightly inside.
    pub fn retract(&self, moves: &mut DVector<f64>) {
        for u in moves.as_mut_slice().chunks_exact_mut(4) {
            let wanted = Vector4::from_column_slice(u);
            if self.moves.violation(&wanted) > RETRACTION - 1.0 {
                let share = self.moves.reach(&Vector4::zeros(), &wanted) * RETRACTION;
                for u in u {
                    *u *= share;
                }
            }
        }
    }

    /// Moves `plan`, which is inside, straight towards `wanted` as far as the set, which is convex, allows. The cost
    /// decreases on the way if `wanted` is the unconstrained optimum.
    pub fn approach(&self, plan: &mut DVector<f64>, wanted: &DVector<f64>) {
        let pairs = each(plan.as_slice()).zip(each(wanted.as_slice()));
        let share = pairs.map(|(u, to)| self.moves.reach(&u, &to)).fold(1.0, f64::min);
        if share > 0.0 {
            plan.axpy(share, wanted, 1.0 - share);
            self.retract(plan);
        }
    }
}

impl StateLimits {
    fn new(scenario: &Scenario, course: &PredictedStates, roll_trim_rad: f64) -> Self {
        let MpcSettings { attitude_limit_deg, rates_limit_dps, .. } = &scenario.attitude.mpc;
        let rows = LIMITED * scenario.nu();
        let limits: Vec<f64> =
            attitude_limit_deg.iter().chain(rates_limit_dps).map(|limit| limit.to_radians()).collect();
        let states = course.free.nrows() / scenario.nu();
        // Limited states are x[1..7] of each sample; w and the lag states have no limit.
        let over_limit = |of: &DMatrix<f64>| {
            DMatrix::from_fn(rows, of.ncols(), |row, column| {
                of[(states * (row / LIMITED) + 1 + row % LIMITED, column)] / limits[row % LIMITED]
            })
        };
        let roll = roll_trim_rad / limits[0];
        Self {
            free: over_limit(&course.free),
            forced: over_limit(&course.forced),
            origin: DVector::from_fn(rows, |row, _| if row % LIMITED == 0 { roll } else { 0.0 }),
            drift: DVector::zeros(rows),
            reached: DVector::zeros(rows),
        }
    }
}

/// Moves of a plan.
fn each(moves: &[f64]) -> impl Iterator<Item = Vector4<f64>> {
    moves.chunks_exact(4).map(Vector4::from_column_slice)
}

#[cfg(test)]
mod tests {
    use settings::Profile;

    use super::*;
    use crate::fixture;
    use crate::law::mpc::condensed::Condensed;
    use crate::model::PredictionModel;

    fn set(scenario: &Scenario) -> Option<PlanSet> {
        let model = PredictionModel::new(scenario);
        PlanSet::new(scenario, &Condensed::new(&model, scenario).unwrap().course, model.trim.roll_rad)
    }

    #[test]
    fn hover_is_inside_every_set() {
        assert!(set(&Scenario::from(Profile::Paper)).is_none());
        for constraints in [Constraints::Box, Constraints::Cone] {
            let mut scenario = crate::fixture::constrained();
            scenario.attitude.mpc.constraints = constraints;
            let set = set(&scenario).unwrap();
            let hover = DVector::zeros(20);
            assert!(set.violation(&hover) < -0.1 && set.touching(&hover, 1e-6) == 0);
        }
    }

    #[test]
    fn one_move_outside_is_a_plan_outside() {
        let set = set(&crate::fixture::constrained()).unwrap();
        let mut plan = DVector::zeros(20);
        plan[6] = 50.0;
        assert!(set.violation(&plan) > 0.0);
        set.retract(&mut plan);
        assert!((-1e-6..=0.0).contains(&set.violation(&plan)), "{}", set.violation(&plan));
        assert!(plan[6] > 0.1 && set.touching(&plan, 1e-6) == 1);
    }

    #[test]
    fn a_plan_approaches_until_the_border() {
        let set = set(&crate::fixture::constrained()).unwrap();
        let (mut plan, mut wanted) = (DVector::zeros(20), DVector::zeros(20));
        wanted[4] = -1.0;
        set.approach(&mut plan, &wanted);
        assert_eq!(plan, wanted, "inside: all the way");
        wanted[4] = -1000.0;
        set.approach(&mut plan, &wanted);
        assert!(plan[4] < -20.0 && set.violation(&plan) <= 0.0, "{plan}");
    }

    #[test]
    fn predicted_states_are_those_of_the_model() {
        let mut scenario = crate::fixture::constrained();
        scenario.attitude.mpc.state_constraints = StateConstraints::Soft;
        let model = PredictionModel::new(&scenario);
        let mut set = set(&scenario).unwrap();
        let given = DVector::from_fn(26, |i, _| 0.1 * (1.0 + i as f64).sin());
        let plan = DVector::from_fn(4 * scenario.nu(), |i, _| (2.0 + i as f64).cos());
        set.start(&given);
        set.excess(&plan);

        let d = Vector4::from_column_slice(given.rows(18, 4).as_slice());
        let (mut x, mut next) = (given.rows(0, 11).into_owned(), DVector::zeros(11));
        for (k, u) in each(plan.as_slice()).enumerate() {
            model.predict(&x, &u, &d, &mut next);
            x.copy_from(&next);
            let over = [x[1] + model.trim.roll_rad, x[2], x[3] / 4.0, x[4] / 4.0, x[5] / 4.0, x[6] / 4.0];
            for (i, over) in over.into_iter().enumerate() {
                let ours = set.states.as_ref().unwrap().reached[6 * k + i] * std::f64::consts::FRAC_PI_2;
                assert!((ours - over).abs() < 1e-12, "sample {k}, state {i}: {ours} is not {over}");
            }
        }
    }

    #[test]
    fn val_box_with_the_limits_of_the_paper() {
        let mut scenario = Scenario::from(Profile::Paper);
        scenario.attitude.mpc.constraints = Constraints::Box;
        let rows = set(&scenario).unwrap().moves.linear;
        for (key, side) in [("lo", 0), ("hi", 1)] {
            let theirs = fixture::vector(&fixture::reference()["reference"]["box_outer"][key]);
            for axis in 0..4 {
                let row = &rows[2 * axis + side];
                let ours = -row.offset / row.slope[axis];
                assert!((ours / theirs[axis] - 1.0).abs() < 1e-9, "{key}[{axis}]: {ours} is not {}", theirs[axis]);
            }
        }
    }
}
