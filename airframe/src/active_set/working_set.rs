//! The working set: all that one solve leaves to the next.

/// The constraints held as equations, in the order in which they joined.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct WorkingSet {
    /// No constraint twice.
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
        /// The angle at which it touches, as its cosine and sine.
        towards: [f64; 2],
    },
}
