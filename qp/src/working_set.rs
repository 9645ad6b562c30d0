//! The working set: all that one solve leaves to the next.

/// The constraints held as equations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorkingSet {
    /// In the order they joined.
    pub members: Vec<Member>,
}

/// One constraint held as an equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Member {
    /// A linear row, by its index.
    Row(usize),
    /// A tangent of a disc.
    Cut {
        /// Index of the disc.
        disc: usize,
        /// Cosine and sine of the angle at which it touches.
        towards: [f64; 2],
    },
}
