//! Cholesky factor of the Gram matrix of a working set, extended at its end by one row at a time.

use std::cmp::Ordering;

/// Factor `L` with `L L' = M`, in tiles of four rows by four columns.
pub struct CholeskyFactor {
    len: usize,
    /// Tiles on and below the diagonal, one column of tiles after the other, each `stride` long; a tile is four
    /// columns. Entries left of the diagonal are those of `L`, entries on the diagonal 0, all others undefined.
    tiles: Vec<[[f64; 4]; 4]>,
    stride: usize,
    /// Inverse diagonal `1 / L_ii`.
    inverse_diagonal: Vec<[f64; 4]>,
    /// Joining row: `L^-1` times its entries.
    row: Vec<[f64; 4]>,
}

impl CholeskyFactor {
    /// Allocates room for `capacity` rows.
    pub fn new(capacity: usize) -> Self {
        let stride = capacity.div_ceil(4);
        Self {
            len: 0,
            tiles: vec![[[0.0; 4]; 4]; stride * stride],
            stride,
            inverse_diagonal: vec![[0.0; 4]; stride],
            row: vec![[0.0; 4]; stride],
        }
    }

    /// Removes all rows except the first `len`.
    pub fn truncate(&mut self, len: usize) {
        self.len = len.min(self.len);
    }

    /// Prepares to append a row of `M`, given its `entries` left of the diagonal. Returns the remainder of its
    /// `diagonal` after elimination of the rows before it.
    pub fn reduce(&mut self, entries: impl Fn(usize) -> f64, diagonal: f64) -> f64 {
        let mut row = std::mem::take(&mut self.row);
        for (j, entry) in row.as_flattened_mut()[..self.len].iter_mut().enumerate() {
            *entry = entries(j);
        }
        self.forward(&mut row);
        self.row = row;
        diagonal - self.row.as_flattened()[..self.len].iter().map(|l| l * l).sum::<f64>()
    }

    /// Appends the row [reduced](Self::reduce) last, whose diagonal has the remainder `left`.
    pub fn append(&mut self, left: f64) {
        let last = self.len;
        for (j, l) in self.row.as_flattened()[..last].iter().enumerate() {
            self.tiles[j / 4 * self.stride + last / 4][j % 4][last % 4] = *l;
        }
        self.inverse_diagonal[last / 4][last % 4] = 1.0 / left.sqrt();
        self.len += 1;
    }

    /// Replaces `right` by the solution of `M x = right`. Returns `x . right`.
    pub fn solve(&self, right: &mut [[f64; 4]]) -> f64 {
        self.forward(right);
        let square = right.as_flattened()[..self.len].iter().map(|y| y * y).sum();
        self.backward(right);
        square
    }

    /// Computes the `shares` of the rows of the factor in the row that was reduced last.
    pub fn composition(&self, shares: &mut [[f64; 4]]) {
        shares.copy_from_slice(&self.row);
        self.backward(shares);
    }

    /// Solves `L y = x` in place. After the last row, the numbers up to the end of its block are undefined.
    fn forward(&self, x: &mut [[f64; 4]]) {
        for (block, inverse) in self.inverse_diagonal[..self.blocks()].iter().enumerate() {
            let [diagonal, below @ ..] = self.column(block) else { return };
            let [y, rest @ ..] = &mut x[block..] else { return };
            for lane in 0..4 {
                y[lane] *= inverse[lane];
                for row in lane + 1..4 {
                    y[row] -= diagonal[lane][row] * y[lane];
                }
            }
            for (x, tile) in rest.iter_mut().zip(below) {
                for (column, y) in tile.iter().zip(*y) {
                    for lane in 0..4 {
                        x[lane] -= column[lane] * y;
                    }
                }
            }
        }
    }

    /// Solves `L' x = y` in place.
    fn backward(&self, x: &mut [[f64; 4]]) {
        let blocks = self.blocks();
        x.as_flattened_mut()[self.len..4 * blocks].fill(0.0);
        for (block, inverse) in self.inverse_diagonal[..blocks].iter().enumerate().rev() {
            let [diagonal, below @ ..] = self.column(block) else { return };
            let [y, rest @ ..] = &mut x[block..] else { return };
            let mut sums = [[0.0; 4]; 4];
            for (x, tile) in rest.iter().zip(below) {
                for (sums, column) in sums.iter_mut().zip(tile) {
                    for lane in 0..4 {
                        sums[lane] += column[lane] * x[lane];
                    }
                }
            }
            for lane in (0..4).rev() {
                let [a, b, c, d] = sums[lane];
                let mut sum = (a + b) + (c + d);
                for row in lane + 1..4 {
                    sum += diagonal[lane][row] * y[row];
                }
                y[lane] = (y[lane] - sum) * inverse[lane];
            }
        }
    }

    fn blocks(&self) -> usize {
        self.len.div_ceil(4)
    }

    /// Used tiles of one column, from the diagonal down.
    fn column(&self, block: usize) -> &[[[f64; 4]; 4]] {
        &self.tiles[block * self.stride..][block..self.blocks()]
    }

    /// Largest deviation of `L L'` from the matrix with these entries, relative to the diagonal; for checks.
    pub fn misfit(&self, entry: impl Fn(usize, usize) -> f64) -> f64 {
        let l = |i: usize, j: usize| match i.cmp(&j) {
            Ordering::Less => 0.0,
            Ordering::Equal => 1.0 / self.inverse_diagonal[i / 4][i % 4],
            Ordering::Greater => self.tiles[j / 4 * self.stride + i / 4][j % 4][i % 4],
        };
        let miss = |i: usize, j: usize| {
            let product: f64 = (0..=j).map(|k| l(i, k) * l(j, k)).sum();
            (product - entry(i, j)).abs() / (entry(i, i) * entry(j, j)).sqrt()
        };
        (0..self.len).flat_map(|i| (0..=i).map(move |j| (i, j))).map(|(i, j)| miss(i, j)).fold(0.0, f64::max)
    }
}
