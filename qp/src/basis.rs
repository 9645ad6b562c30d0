//! Constants of a set-up: every constraint is a combination of *basis rows*, whose products are computed once.
//!
//! The basis rows are the linear rows, followed by two rows for each disc.

use nalgebra::DMatrix;

use crate::working_set::HeldConstraint;

/// Matrices `G`, `K = H^-1 G'` and the Gram matrix `G K` of all basis rows.
pub struct Basis {
    /// Number of linear rows; the basis rows after them belong to the discs.
    pub rows: usize,
    /// Number of discs.
    pub discs: usize,
    /// Number of variables, n.
    pub variables: usize,
    /// Number of blocks of four variables.
    pub blocks: usize,
    /// Matrix `G` in tiles; tiles of zeros are left out.
    tiles: Vec<Tile>,
    /// Matrix `K`, one column after the other, in blocks of four.
    lift: Vec<[f64; 4]>,
    /// Matrix `G K`, one column after the other.
    gram: Vec<f64>,
    /// Softness `1/w` of each linear row; 0 is hard.
    softness: Vec<f64>,
    /// Inverse length of each linear row, in the norm of `H^-1` with its softness.
    pub scale: Vec<f64>,
}

/// Block of four rows by four variables of a matrix.
struct Tile {
    rows: usize,
    variables: usize,
    /// Columns of the block.
    columns: [[f64; 4]; 4],
}

/// Constraint as a combination of two basis rows, with the slack `constant + weights . (basis rows)`.
#[derive(Debug, Clone, Copy)]
pub struct Combination {
    basis: [usize; 2],
    weights: [f64; 2],
    constant: f64,
    /// Softness `1/w`; 0 is hard.
    pub softness: f64,
}

impl Basis {
    /// Prepares linear `rows` (m x n) with their `softness` (m), and `discs` (2k x n), under the `hessian` (n x n).
    pub fn new(hessian: &DMatrix<f64>, rows: &DMatrix<f64>, softness: &[f64], discs: &DMatrix<f64>) -> Self {
        assert_eq!((rows.nrows(), discs.nrows() % 2), (softness.len(), 0), "one softness a row, two rows a disc");
        let mut slopes = DMatrix::zeros(rows.nrows() + discs.nrows(), hessian.nrows());
        slopes.rows_mut(0, rows.nrows()).copy_from(rows);
        slopes.rows_mut(rows.nrows(), discs.nrows()).copy_from(discs);

        // With H = L L', the Gram matrix is that of the columns of L^-1 G', so it is symmetric to the last bit.
        let lower = hessian.clone().cholesky().expect("the Hessian is positive definite").unpack();
        let whitened = lower.solve_lower_triangular(&slopes.transpose()).expect("and so is its factor");
        let lift = lower.tr_solve_lower_triangular(&whitened).expect("and so is its factor");
        let gram = whitened.tr_mul(&whitened);
        let scale = softness.iter().enumerate().map(|(i, s)| 1.0 / (gram[(i, i)] + s).sqrt()).collect();
        Self {
            scale,
            rows: rows.nrows(),
            discs: discs.nrows() / 2,
            variables: hessian.nrows(),
            blocks: hessian.nrows().div_ceil(4),
            gram: gram.as_slice().to_vec(),
            tiles: tiles(&slopes),
            lift: lift.column_iter().flat_map(|column| blocks(column.iter())).collect(),
            softness: softness.to_vec(),
        }
    }

    /// Number of basis rows.
    pub fn len(&self) -> usize {
        self.rows + 2 * self.discs
    }

    /// Computes the basis rows at `x`: `offsets + G x`.
    pub fn slacks(&self, x: &[[f64; 4]], offsets: &[f64], slacks: &mut [[f64; 4]]) {
        slacks.as_flattened_mut()[..offsets.len()].copy_from_slice(offsets);
        for Tile { rows, variables, columns } in &self.tiles {
            let slacks = &mut slacks[*rows];
            for (column, x) in columns.iter().zip(x[*variables]) {
                for lane in 0..4 {
                    slacks[lane] += column[lane] * x;
                }
            }
        }
    }

    /// Adds the effect of the `multiplier` of a constraint with the weights `a` to `x`: `x += K a multiplier`.
    pub fn push(&self, x: &mut [[f64; 4]], constraint: &Combination, multiplier: f64) {
        for (row, weight) in constraint.basis.into_iter().zip(constraint.weights) {
            if weight != 0.0 {
                let factor = weight * multiplier;
                for (x, lift) in x.iter_mut().zip(&self.lift[row * self.blocks..]) {
                    for lane in 0..4 {
                        x[lane] += factor * lift[lane];
                    }
                }
            }
        }
    }

    /// Returns a function for the entries of the Gram matrix between `a` and other constraints, without softness.
    pub fn entries<'a>(&'a self, a: &Combination) -> impl Fn(&Combination) -> f64 + use<'a> {
        let [first, second] = a.basis.map(|row| &self.gram[row * self.len()..][..self.len()]);
        let weights = a.weights;
        move |b: &Combination| {
            weights[0] * (b.weights[0] * first[b.basis[0]] + b.weights[1] * first[b.basis[1]])
                + weights[1] * (b.weights[0] * second[b.basis[0]] + b.weights[1] * second[b.basis[1]])
        }
    }

    /// Square of a constraint in the norm of `H^-1`.
    pub fn square(&self, a: &Combination) -> f64 {
        self.entries(a)(a)
    }

    /// Constraint of a member of the working set.
    pub fn constraint(&self, member: HeldConstraint) -> Combination {
        match member {
            HeldConstraint::Row(row) => {
                Combination { basis: [row; 2], weights: [1.0, 0.0], constant: 0.0, softness: self.softness[row] }
            }
            HeldConstraint::Cut { disc, towards: [cos, sin] } => {
                Combination { basis: self.pair(disc), weights: [-cos, -sin], constant: 1.0, softness: 0.0 }
            }
        }
    }

    /// Derivative of the slack of a cut by its angle, as a row to be brought to zero.
    pub fn turning(&self, disc: usize, [cos, sin]: [f64; 2], multiplier: f64) -> Combination {
        Combination { basis: self.pair(disc), weights: [sin, -cos], constant: 0.0, softness: 1.0 / multiplier }
    }

    fn pair(&self, disc: usize) -> [usize; 2] {
        [self.rows + 2 * disc, self.rows + 2 * disc + 1]
    }
}

impl Combination {
    /// Slack of the constraint, from the values of the basis rows.
    pub fn slack(&self, basis: &[f64]) -> f64 {
        self.constant + self.weights[0] * basis[self.basis[0]] + self.weights[1] * basis[self.basis[1]]
    }
}

/// Splits a matrix into tiles, and leaves out tiles of zeros.
fn tiles(matrix: &DMatrix<f64>) -> Vec<Tile> {
    let mut tiles = vec![];
    for rows in 0..matrix.nrows().div_ceil(4) {
        for variables in 0..matrix.ncols().div_ceil(4) {
            let mut columns = [[0.0; 4]; 4];
            for (column, entries) in columns.iter_mut().enumerate() {
                for (row, entry) in entries.iter_mut().enumerate() {
                    *entry = matrix.get((4 * rows + row, 4 * variables + column)).copied().unwrap_or_default();
                }
            }
            if columns != [[0.0; 4]; 4] {
                tiles.push(Tile { rows, variables, columns });
            }
        }
    }
    tiles
}

/// Arranges numbers in blocks of four, padded with zeros.
pub fn blocks<'a>(numbers: impl ExactSizeIterator<Item = &'a f64>) -> Vec<[f64; 4]> {
    let mut blocks = vec![[0.0; 4]; numbers.len().div_ceil(4)];
    numbers.enumerate().for_each(|(i, number)| blocks[i / 4][i % 4] = *number);
    blocks
}
