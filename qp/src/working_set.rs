//! The working set, which is all that one solve leaves to the next.

/// Constraints held as equations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorkingSet {
    /// Members in the order in which they joined.
    pub members: Vec<HeldConstraint>,
}

/// Constraint held as an equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HeldConstraint {
    /// A linear row, by its index.
    Row(usize),
    /// A tangent of a disc.
    Cut {
        /// Index of the disc.
        disc: usize,
        /// Cosine and sine of the angle at which the tangent touches.
        towards: [f64; 2],
    },
}
