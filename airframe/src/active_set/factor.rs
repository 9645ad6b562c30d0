//! Cholesky factor of a Gram matrix that grows at its end.

/// `L` with `L L' = M`, and `y` with `L y = right`.
pub struct Factor {
    stride: usize,
    len: usize,
    /// `L`, one column after the other.
    lower: Vec<f64>,
    /// `1 / L_ii`
    inverse_diagonal: Vec<f64>,
    /// `y`
    forward: Vec<f64>,
    /// Row under construction.
    row: Vec<f64>,
}

/// A row whose square loses more than this share to the rows before it depends on them.
const INDEPENDENT: f64 = 1e-12;

impl Factor {
    /// Room for `capacity` rows.
    pub fn new(capacity: usize) -> Self {
        Self {
            stride: capacity,
            len: 0,
            lower: vec![0.0; capacity * capacity],
            inverse_diagonal: vec![0.0; capacity],
            forward: vec![0.0; capacity],
            row: vec![0.0; capacity],
        }
    }

    /// Forgets all rows but the first `len`.
    pub fn truncate(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Appends a row of `M` by its entries left of the diagonal, its `diagonal` and its `right` side; false when it
    /// depends on the rows before it, and then it is left out.
    pub fn append(&mut self, entry: impl Fn(usize) -> f64, diagonal: f64, right: f64) -> bool {
        let last = self.len;
        let row = &mut self.row[..last];
        for (j, value) in row.iter_mut().enumerate() {
            *value = entry(j);
        }
        let (mut pivot, mut forward) = (diagonal, right);
        for j in 0..last {
            let value = row[j] * self.inverse_diagonal[j];
            row[j] = value;
            pivot -= value * value;
            forward -= value * self.forward[j];
            let column = &self.lower[j * self.stride + j + 1..][..last - j - 1];
            for (rest, l) in row[j + 1..].iter_mut().zip(column) {
                *rest -= value * l;
            }
        }
        // Written so that NaN counts as dependent.
        if !(pivot > INDEPENDENT * diagonal) {
            return false;
        }
        for (j, value) in row.iter().enumerate() {
            self.lower[j * self.stride + last] = *value;
        }
        let inverse = 1.0 / pivot.sqrt();
        self.inverse_diagonal[last] = inverse;
        self.forward[last] = forward * inverse;
        self.len += 1;
        true
    }

    /// Writes the solution of `M x = right`.
    pub fn solve(&self, x: &mut [f64]) {
        self.backward(&self.forward[..self.len], x);
    }

    /// Writes how the row that [`append`](Self::append) just refused is composed of the rows before it.
    pub fn composition(&self, x: &mut [f64]) {
        self.backward(&self.row[..self.len], x);
    }

    /// `|y|^2`, that is `right' M^-1 right`.
    pub fn square(&self) -> f64 {
        self.forward[..self.len].iter().map(|y| y * y).sum()
    }

    /// Solves `L' x = y`.
    fn backward(&self, y: &[f64], x: &mut [f64]) {
        for i in (0..self.len).rev() {
            let column = &self.lower[i * self.stride + i + 1..][..self.len - i - 1];
            x[i] = (y[i] - dot(column, &x[i + 1..self.len])) * self.inverse_diagonal[i];
        }
    }
}

/// Dot product in two lanes, one operation each.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (a.chunks_exact(2), b.chunks_exact(2));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    let lanes = a.zip(b).fold([0.0; 2], |[even, odd], (a, b)| [even + a[0] * b[0], odd + a[1] * b[1]]);
    lanes[0] + lanes[1] + rest
}
