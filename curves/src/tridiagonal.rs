//! Symmetric block tridiagonal equations, as the waypoints of a curve give them: each waypoint is coupled with its
//! neighbours only. Block elimination (the algorithm of Thomas) solves them.

use nalgebra::SMatrix;

/// Equations of one waypoint with `N` unknowns on each axis: `across-' x- + on x + across x+ = right`.
#[derive(Debug, Clone, Copy)]
pub struct WaypointRow<const N: usize> {
    /// Coefficients of the unknowns of this waypoint.
    pub on: SMatrix<f64, N, N>,
    /// Coefficients of the unknowns of the next waypoint; without meaning in the last row.
    pub across: SMatrix<f64, N, N>,
    /// Right-hand side, a column for each axis.
    pub right: SMatrix<f64, N, 3>,
}

/// Solves the equations. A block without an inverse, which only waypoints that coincide in time have, counts as zero:
/// the curve rests there.
pub fn solve<const N: usize>(rows: &[WaypointRow<N>]) -> Vec<SMatrix<f64, N, 3>> {
    // Forward: eliminate the unknowns of the previous waypoint from each row.
    let mut left: Vec<(SMatrix<f64, N, N>, SMatrix<f64, N, 3>)> = vec![];
    for (i, WaypointRow { mut on, mut right, .. }) in rows.iter().copied().enumerate() {
        if let Some((inverse, last_right)) = left.last() {
            let across = rows[i - 1].across;
            let eliminated = across.transpose() * inverse;
            on -= eliminated * across;
            right -= eliminated * last_right;
        }
        left.push((on.try_inverse().unwrap_or_else(SMatrix::zeros), right));
    }
    // Backward: solve each waypoint from the next waypoint.
    let mut next = SMatrix::<f64, N, 3>::zeros();
    let mut solved = vec![next; rows.len()];
    for (i, (inverse, right)) in left.iter().enumerate().rev() {
        next = inverse * (right - rows[i].across * next);
        solved[i] = next;
    }
    solved
}
