//! The constants of a set-up. All constraints are combinations of *basis rows*: the linear rows first, then two rows for
//! each disc. What can be known of those beforehand is worked out once.
//!
//! ```text
//! K = H^-1 G',   G K = V'V,   V = L^-1 G',   H = L L'
//! ```

use nalgebra::DMatrix;

use super::Member;

/// `G`, `K` and the Gram matrix `G K` of all basis rows.
pub struct Basis {
    /// Linear rows; the basis rows after them belong to the discs.
    pub rows: usize,
    /// Discs.
    pub discs: usize,
    /// Variables, n.
    pub variables: usize,
    /// `1 / sqrt((G K)_ii + 1/w_i)` of each linear row: from a slack to its distance in the metric of `H`.
    pub scales: Vec<f64>,
    /// `1/w` of each linear row; 0 is hard.
    softness: Vec<f64>,
    /// `G` in tiles; those of zeros are left out.
    slopes: Vec<Tile>,
    /// `K`, one column after the other, in blocks of four variables.
    lift: Vec<[f64; 4]>,
    /// `G K`, one column after the other.
    gram: Vec<f64>,
}

/// Four rows by four variables.
struct Tile {
    rows: usize,
    variables: usize,
    columns: [[f64; 4]; 4],
}

/// A constraint as a combination of two basis rows: its slack is `constant + weights . (basis rows)`.
#[derive(Clone, Copy)]
pub struct Combination {
    /// `1/w`; 0 is hard.
    pub softness: f64,
    basis: [usize; 2],
    weights: [f64; 2],
    constant: f64,
}

impl Basis {
    /// Prepares linear `rows` (m x n) with their `softness` (m), and `discs` (2k x n), under the `hessian` (n x n).
    pub fn new(hessian: &DMatrix<f64>, rows: &DMatrix<f64>, softness: &[f64], discs: &DMatrix<f64>) -> Self {
        assert_eq!((rows.nrows(), discs.nrows() % 2), (softness.len(), 0), "one softness a row, two rows a disc");
        let mut slopes = DMatrix::zeros(rows.nrows() + discs.nrows(), hessian.nrows());
        slopes.rows_mut(0, rows.nrows()).copy_from(rows);
        slopes.rows_mut(rows.nrows(), discs.nrows()).copy_from(discs);

        let lower = hessian.clone().cholesky().expect("the Hessian is positive definite").unpack();
        let whitened = lower.solve_lower_triangular(&slopes.transpose()).expect("no zero on its diagonal");
        let lift = lower.tr_solve_lower_triangular(&whitened).expect("no zero on its diagonal");
        let gram = whitened.tr_mul(&whitened);
        Self {
            rows: rows.nrows(),
            discs: discs.nrows() / 2,
            variables: hessian.nrows(),
            scales: softness.iter().enumerate().map(|(i, softness)| 1.0 / (gram[(i, i)] + softness).sqrt()).collect(),
            softness: softness.to_vec(),
            slopes: tiles(&slopes),
            lift: lift.column_iter().flat_map(|column| blocks(column.as_slice())).collect(),
            gram: gram.as_slice().to_vec(),
        }
    }

    /// Number of basis rows.
    pub fn len(&self) -> usize {
        self.rows + 2 * self.discs
    }

    /// Writes the basis rows at `x`: `offsets + G x`.
    pub fn slacks(&self, x: &[[f64; 4]], offsets: &[f64], slacks: &mut [[f64; 4]]) {
        slacks.as_flattened_mut()[..offsets.len()].copy_from_slice(offsets);
        for Tile { rows, variables, columns } in &self.slopes {
            let slacks = &mut slacks[*rows];
            for (column, x) in columns.iter().zip(x[*variables]) {
                for lane in 0..4 {
                    slacks[lane] += column[lane] * x;
                }
            }
        }
    }

    /// Moves `x` as the force `multiplier` of a constraint does: `x += K a multiplier`.
    pub fn push(&self, x: &mut [[f64; 4]], constraint: &Combination, multiplier: f64) {
        for (row, weight) in constraint.basis.into_iter().zip(constraint.weights).filter(|(_, weight)| *weight != 0.0) {
            for (x, lift) in x.iter_mut().zip(&self.lift[row * self.variables.div_ceil(4)..]) {
                for lane in 0..4 {
                    x[lane] += weight * multiplier * lift[lane];
                }
            }
        }
    }

    /// The entries of the Gram matrix between `a` and others, softness left out.
    pub fn entries<'a>(&'a self, a: &Combination) -> impl Fn(&Combination) -> f64 + use<'a> {
        let [first, second] = a.basis.map(|row| &self.gram[row * self.len()..][..self.len()]);
        let weights = a.weights;
        move |b| {
            weights[0] * (b.weights[0] * first[b.basis[0]] + b.weights[1] * first[b.basis[1]])
                + weights[1] * (b.weights[0] * second[b.basis[0]] + b.weights[1] * second[b.basis[1]])
        }
    }

    /// The diagonal entry of `a`, softness included.
    pub fn diagonal(&self, a: &Combination) -> f64 {
        self.entries(a)(a) + a.softness
    }

    /// The constraint a member of a working set stands for: `1 - cos s_a - sin s_b` for a cut.
    pub fn constraint(&self, member: Member) -> Combination {
        match member {
            Member::Row(row) => {
                Combination { softness: self.softness[row], basis: [row; 2], weights: [1.0, 0.0], constant: 0.0 }
            }
            Member::Cut { disc, towards: [cos, sin] } => {
                Combination { softness: 0.0, basis: self.pair(disc), weights: [-cos, -sin], constant: 1.0 }
            }
        }
    }

    /// How the slack of a cut changes with its angle, `sin s_a - cos s_b`: a row that is to become zero, as soft as the
    /// disc is round.
    pub fn turning(&self, disc: usize, [cos, sin]: [f64; 2], multiplier: f64) -> Combination {
        Combination { softness: 1.0 / multiplier, basis: self.pair(disc), weights: [sin, -cos], constant: 0.0 }
    }

    /// Where a member stands among all rows and then all discs; `None` when it is not of this problem.
    pub fn place(&self, member: Member) -> Option<usize> {
        match member {
            Member::Row(row) => (row < self.rows).then_some(row),
            Member::Cut { disc, towards: [cos, sin] } => {
                let is_unit = (cos * cos + sin * sin - 1.0).abs() < 1e-9;
                (disc < self.discs && is_unit).then_some(self.rows + disc)
            }
        }
    }

    fn pair(&self, disc: usize) -> [usize; 2] {
        [self.rows + 2 * disc, self.rows + 2 * disc + 1]
    }
}

impl Combination {
    /// Its slack, from the basis rows.
    pub fn slack(&self, basis: &[[f64; 4]]) -> f64 {
        let basis = basis.as_flattened();
        self.constant + self.weights[0] * basis[self.basis[0]] + self.weights[1] * basis[self.basis[1]]
    }

    /// Whether nothing may violate it.
    pub fn is_hard(&self) -> bool {
        self.softness == 0.0
    }
}

/// Numbers in blocks of four, filled up with zeros.
pub fn blocks(numbers: &[f64]) -> Vec<[f64; 4]> {
    let mut blocks = vec![[0.0; 4]; numbers.len().div_ceil(4)];
    blocks.as_flattened_mut()[..numbers.len()].copy_from_slice(numbers);
    blocks
}

/// The tiles of a matrix that are not zero.
fn tiles(matrix: &DMatrix<f64>) -> Vec<Tile> {
    let mut tiles = vec![];
    for rows in 0..matrix.nrows().div_ceil(4) {
        for variables in 0..matrix.ncols().div_ceil(4) {
            let entry =
                |row: usize, column: usize| matrix.get((4 * rows + row, 4 * variables + column)).map_or(0.0, |e| *e);
            let columns = [0, 1, 2, 3].map(|column| [0, 1, 2, 3].map(|row| entry(row, column)));
            if columns != [[0.0; 4]; 4] {
                tiles.push(Tile { rows, variables, columns });
            }
        }
    }
    tiles
}
