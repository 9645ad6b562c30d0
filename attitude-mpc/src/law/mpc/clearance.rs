//! Bound on how near the moves of an unconstrained plan come to the limits, without computing them.
//!
//! Every move is linear in the numbers `z` that are given at a tick, and a limit has the slack `o + g z`, where `o` is
//! the slack at hover. By the triangle inequality no limit is reached if
//!
//! ```text
//! sum_j |z_j| w_j < 1,      w_j = max |g_j| / o over all moves and limits
//! ```
//!
//! `x` and `r` nearly cancel in a plan, so `z` contains `x - r` and `r`. Ticks on which the bound does not hold compute
//! the whole plan and check every move. Test `a_plan_that_is_clear_has_no_move_near_a_limit`.

use airframe::DemandSet;
use airframe::linear::{INPUTS, STATES};
use nalgebra::{DMatrix, DVector, Vector4};

use crate::law::mpc::condensed::{GIVEN, Gain};

/// Share of the way from hover to a limit below which a move counts as clear of the limit: far from touching it.
const CLEAR: f64 = 0.99;

/// Weights `w` of the bound.
#[derive(Debug, Clone)]
pub struct Clearance {
    /// Weights of `(x - r; r; d; v)`, n + 15.
    given: DVector<f64>,
    /// Weights of the changes of the reference, 7Np or none.
    changes: DVector<f64>,
}

impl Clearance {
    /// Builds the bound for the plans of `gain` and the set `moves`.
    pub fn new(gain: &Gain, moves: &DemandSet) -> Self {
        let n = gain.given.ncols() - GIVEN;
        let mut given = gain.given.clone();
        for state in 0..STATES {
            let both = given.column(state) + given.column(n + state);
            given.set_column(n + state, &both);
        }
        Self { given: weights(&given, moves), changes: weights(&gain.changes, moves) }
    }

    /// Returns whether no move of the plan for `given` = (x; r; d; v) and the `changes` of r reaches a limit; `false`
    /// also if the bound does not decide it.
    pub fn is_clear(&self, given: &DVector<f64>, changes: &DVector<f64>) -> bool {
        let n = given.len() - GIVEN;
        let errors: [f64; STATES] = std::array::from_fn(|state| given[state] - given[n + state]);
        let (of_errors, of_rest) = self.given.as_slice().split_at(STATES);
        let share = weighted(&errors, of_errors)
            + weighted(&given.as_slice()[STATES..], of_rest)
            + weighted(changes.as_slice(), self.changes.as_slice());
        share < CLEAR // false for NaN
    }
}

/// Sum of the magnitudes of `numbers`, each times its weight, in four independent parts that the processor adds in
/// parallel.
fn weighted(numbers: &[f64], weights: &[f64]) -> f64 {
    let ((numbers, last), (weights, of_last)) = (numbers.as_chunks::<4>(), weights.as_chunks::<4>());
    let mut sums = [0.0; 4];
    for (numbers, weights) in numbers.iter().zip(weights) {
        for i in 0..4 {
            sums[i] += numbers[i].abs() * weights[i];
        }
    }
    let last: f64 = last.iter().zip(of_last).map(|(number, weight)| number.abs() * weight).sum();
    sums.iter().sum::<f64>() + last
}

/// Weights `w_j` of the columns of `gain`: the largest share of the slack at hover that one unit uses up, over all
/// moves and limits.
fn weights(gain: &DMatrix<f64>, moves: &DemandSet) -> DVector<f64> {
    let share = |move_: &Vector4<f64>| {
        let rows = moves.linear.iter().map(|row| of_room(row.slope.dot(move_).abs(), row.offset));
        let disc = moves.disc.iter().map(|[side, ahead]| {
            let room = 1.0 - (side.offset * side.offset + ahead.offset * ahead.offset).sqrt();
            let (side, ahead) = (side.slope.dot(move_), ahead.slope.dot(move_));
            of_room((side * side + ahead * ahead).sqrt(), room)
        });
        rows.chain(disc).fold(0.0, f64::max)
    };
    let of_column = |column: usize| {
        let moves = gain.column(column).into_owned();
        moves.as_slice().chunks_exact(INPUTS).map(|u| share(&Vector4::from_column_slice(u))).fold(0.0, f64::max)
    };
    DVector::from_iterator(gain.ncols(), (0..gain.ncols()).map(of_column))
}

/// Ratio of a `way` to the `room` that a limit leaves at hover; infinite without room, so that no plan is clear.
fn of_room(way: f64, room: f64) -> f64 {
    if room > 0.0 { way / room } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use airframe::envelope::Envelope;
    use proptest::prelude::*;
    use settings::{Constraints, Scenario};

    use super::*;
    use crate::law::mpc::condensed::Condensed;
    use crate::model::PredictionModel;

    /// Gain of a plan of 20 moves with a preview, and the set of its moves.
    fn of(constraints: Constraints) -> (Gain, DemandSet) {
        let mut scenario = Scenario::default();
        (scenario.attitude.mpc.control_horizon_s, scenario.guidance.preview_s) = (0.2, 0.4);
        scenario.attitude.disturbance_gain = 0.1;
        let envelope = Envelope::new(&scenario.airframe, false, scenario.limits());
        let moves = match constraints {
            Constraints::Box => DemandSet::bounding_box(&envelope),
            _ => DemandSet::exact(&envelope),
        };
        (Condensed::new(&PredictionModel::new(&scenario), &scenario).unwrap().gain, moves)
    }

    proptest! {
        #[test]
        fn a_plan_that_is_clear_has_no_move_near_a_limit(
            numbers in prop::collection::vec(-1.0..1.0_f64, 26 + 140), size in -3.0..1.0_f64, is_box in prop::bool::ANY,
        ) {
            let (gain, moves) = of(if is_box { Constraints::Box } else { Constraints::Cone });
            let clearance = Clearance::new(&gain, &moves);
            let number = |i: usize| numbers[i] * 10_f64.powf(size);
            let given = DVector::from_fn(gain.given.ncols(), |i, _| number(i));
            let changes = DVector::from_fn(gain.changes.ncols(), |i, _| number(given.len() + i));
            let mut plan = DVector::zeros(80);
            gain.add_plan(1.0, &given, &changes, plan.as_view_mut());
            let nearest = plan.as_slice().chunks_exact(4).map(|u| moves.violation(&Vector4::from_column_slice(u)));
            let nearest = nearest.fold(f64::NEG_INFINITY, f64::max);
            prop_assert!(!clearance.is_clear(&given, &changes) || nearest < -1e-4, "{nearest}");
        }
    }

    #[test]
    fn small_errors_at_any_reference_are_clear_and_nan_is_not() {
        let (gain, moves) = of(Constraints::Cone);
        let clearance = Clearance::new(&gain, &moves);
        let (mut given, changes) = (DVector::zeros(26), DVector::zeros(140));
        for (state, reference) in [(2, 0.3), (3, 2.0)] {
            (given[state], given[11 + state]) = (reference + 0.01, reference);
        }
        assert!(clearance.is_clear(&given, &changes));
        given[2] = 3.0;
        assert!(!clearance.is_clear(&given, &changes));
        given[2] = f64::NAN;
        assert!(!clearance.is_clear(&given, &changes));
    }

    #[test]
    fn nothing_is_clear_where_hover_is_at_a_limit() {
        let (gain, mut moves) = of(Constraints::Cone);
        moves.linear[3].offset = 0.0;
        let mut given = DVector::zeros(26);
        given[0] = 1e-3;
        assert!(!Clearance::new(&gain, &moves).is_clear(&given, &DVector::zeros(140)));
    }
}
