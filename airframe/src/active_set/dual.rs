//! The constants of a problem, and the dual quantities formed from them.
//!
//! All constraints are combinations of *basis rows*: the linear rows first, then two rows for each disc.

use nalgebra::DMatrix;

use super::working_set::Member;

/// What a set-up keeps: `G`, `K = H^-1 G'` and the Gram matrix `G K`, over all basis rows.
pub struct Dual {
    /// Linear rows; the basis rows from here on belong to the discs.
    pub rows: usize,
    /// Basis rows.
    pub basis: usize,
    /// Variables.
    variables: usize,
    /// `G`, one column after the other, each `basis` long.
    slopes: Vec<f64>,
    /// `K`, one column after the other, each `variables` long.
    lift: Vec<f64>,
    /// `G H^-1 G'`, one column after the other.
    gram: Vec<f64>,
    /// `1/w` of each linear row; 0 is hard.
    softness: Vec<f64>,
}

/// A constraint as a combination of two basis rows: `s = constant + weights . (basis rows)`.
#[derive(Debug, Clone, Copy)]
pub struct Combination {
    basis: [usize; 2],
    weights: [f64; 2],
    constant: f64,
    softness: f64,
}

impl Dual {
    /// Prepares `rows` (m x n) with their `softness` (m), and `discs` (2k x n), under `hessian` (n x n).
    pub fn new(hessian: &DMatrix<f64>, rows: &DMatrix<f64>, softness: &[f64], discs: &DMatrix<f64>) -> Self {
        let (m, variables) = (rows.nrows(), hessian.nrows());
        let basis = m + discs.nrows();
        let mut slopes = DMatrix::zeros(basis, variables);
        slopes.rows_mut(0, m).copy_from(rows);
        slopes.rows_mut(m, discs.nrows()).copy_from(discs);

        // With H = C C', the Gram matrix is that of the columns of C^-1 G': symmetric to the last bit.
        let cholesky = hessian.clone().cholesky().expect("the Hessian is positive definite");
        let whitened = cholesky.l().solve_lower_triangular(&slopes.transpose()).expect("so is its factor");
        let lift = cholesky.l().tr_solve_lower_triangular(&whitened).expect("so is its factor");
        Self {
            rows: m,
            basis,
            variables,
            gram: whitened.tr_mul(&whitened).as_slice().to_vec(),
            slopes: slopes.as_slice().to_vec(),
            lift: lift.as_slice().to_vec(),
            softness: softness.to_vec(),
        }
    }

    /// Discs.
    pub fn discs(&self) -> usize {
        (self.basis - self.rows) / 2
    }

    /// Writes the basis rows at the unconstrained optimum, `offsets + G centre`.
    pub fn start(&self, centre: &[f64], offsets: &[f64], start: &mut [f64]) {
        start.copy_from_slice(offsets);
        for (variable, c) in centre.iter().enumerate() {
            add(start, *c, &self.slopes[variable * self.basis..][..self.basis]);
        }
    }

    /// Writes the basis rows under `multipliers` of the constraints `held`.
    pub fn slacks(&self, start: &[f64], held: &[Combination], multipliers: &[f64], slack: &mut [f64]) {
        slack.copy_from_slice(start);
        for (of, multiplier) in held.iter().zip(multipliers) {
            for (basis, weight) in of.basis.into_iter().zip(of.weights) {
                if weight != 0.0 {
                    add(slack, weight * multiplier, &self.gram[basis * self.basis..][..self.basis]);
                }
            }
        }
    }

    /// Writes the variables under `multipliers` of the constraints `held`: `x = c + K lambda`.
    pub fn variables(&self, centre: &[f64], held: &[Combination], multipliers: &[f64], x: &mut [f64]) {
        x.copy_from_slice(centre);
        for (of, multiplier) in held.iter().zip(multipliers) {
            for (basis, weight) in of.basis.into_iter().zip(of.weights) {
                if weight != 0.0 {
                    add(x, weight * multiplier, &self.lift[basis * self.variables..][..self.variables]);
                }
            }
        }
    }

    /// Entry of the Gram matrix between two constraints.
    pub fn entry(&self, a: &Combination, b: &Combination) -> f64 {
        let along = |basis: usize| {
            let column = &self.gram[basis * self.basis..][..self.basis];
            b.weights[0] * column[b.basis[0]] + b.weights[1] * column[b.basis[1]]
        };
        let first = a.weights[0] * along(a.basis[0]);
        if a.weights[1] == 0.0 { first } else { first + a.weights[1] * along(a.basis[1]) }
    }

    /// Its diagonal entry, softness included.
    pub fn diagonal(&self, a: &Combination) -> f64 {
        self.entry(a, a) + a.softness
    }

    /// The constraint a member stands for.
    pub fn combination(&self, member: Member) -> Combination {
        match member {
            Member::Row(row) => {
                Combination { basis: [row; 2], weights: [1.0, 0.0], constant: 0.0, softness: self.softness[row] }
            }
            Member::Cut { disc, towards: [cos, sin] } => {
                Combination { basis: self.pair(disc), weights: [-cos, -sin], constant: 1.0, softness: 0.0 }
            }
        }
    }

    /// The row along the tangent of a cut, with the curvature of its disc as softness.
    pub fn tangent(&self, disc: usize, [cos, sin]: [f64; 2], multiplier: f64) -> Combination {
        Combination { basis: self.pair(disc), weights: [sin, -cos], constant: 0.0, softness: 1.0 / multiplier }
    }

    fn pair(&self, disc: usize) -> [usize; 2] {
        [self.rows + 2 * disc, self.rows + 2 * disc + 1]
    }
}

impl Combination {
    /// Its slack, from the basis rows.
    pub fn slack(&self, basis: &[f64]) -> f64 {
        self.constant + self.weights[0] * basis[self.basis[0]] + self.weights[1] * basis[self.basis[1]]
    }

    /// Softness.
    pub fn softness(&self) -> f64 {
        self.softness
    }

    /// Whether it may not be violated at any price.
    pub fn is_hard(&self) -> bool {
        self.softness == 0.0
    }
}

/// `to += factor * from`
fn add(to: &mut [f64], factor: f64, from: &[f64]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to += factor * from;
    }
}
