//! The fields of a message, for code that treats all messages alike.

use std::ops::Range;

/// One field of a message, or of a part of a message.
#[derive(Debug)]
pub struct Field {
    /// Name, as in the table of messages.
    pub name: &'static str,
    /// Place in the message or part \[words of 8 bytes\].
    pub words: Range<usize>,
    /// Format of the value.
    pub shape: FieldShape,
    /// Special treatment; `None` for most fields.
    pub mark: Option<FieldMark>,
}

/// Mark of a field that is treated specially.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldMark {
    /// Value that depends on the machine and not on the flight, so that a replay does not compare it.
    Clock,
    /// Value that the receiver acts on, so that the fault `wrong` changes it.
    Demand,
}

/// Format of a field; every word is a number or a count.
#[derive(Debug)]
pub enum FieldShape {
    /// An `f64`.
    Number,
    /// A `u64`.
    Count,
    /// Elements of one shape, with their number.
    Array(&'static FieldShape, usize),
    /// Fields of a part.
    Part(&'static [Field]),
}

impl FieldShape {
    /// Returns the number of words.
    #[expect(clippy::len_without_is_empty, reason = "no shape is empty")]
    pub fn len(&self) -> usize {
        match self {
            Self::Number | Self::Count => 1,
            Self::Array(element, count) => element.len() * count,
            Self::Part(fields) => fields[fields.len() - 1].words.end,
        }
    }
}

/// Type that a field can have.
pub trait HasShape {
    /// Format of a value.
    const SHAPE: FieldShape;
}

impl HasShape for f64 {
    const SHAPE: FieldShape = FieldShape::Number;
}

impl HasShape for u64 {
    const SHAPE: FieldShape = FieldShape::Count;
}

impl<T: HasShape, const N: usize> HasShape for [T; N] {
    const SHAPE: FieldShape = FieldShape::Array(&T::SHAPE, N);
}
