//! Names of the words of a message, to say where two messages differ.

use contract::message::Payload;
use contract::message::field::{FieldMark, FieldShape};

use flight::log::{Record, with_message};

/// Field in which two messages differ, with both values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Differs {
    pub field: String,
    pub values: [String; 2],
}

/// Returns the first field in which two messages of one type differ, in the order of the table of messages: provenance
/// first, then the payload bit by bit. Values that depend on the machine are not compared.
pub fn difference(one: &Record, other: &Record) -> Option<Differs> {
    fn words<M: Payload>(message: &M) -> (FieldShape, &[u64]) {
        (FieldShape::Part(M::FIELDS), bytemuck::cast_slice(bytemuck::bytes_of(message)))
    }
    let truth = one.stamped().is_none();
    let (shape, one) = with_message!(one, message => words(message));
    let (_, other) = with_message!(other, message => words(message));
    let (field, values) = first_difference(&shape, [one, other])?;
    let field = if truth { format!("truth{field}") } else { field.trim_start_matches('.').into() };
    Some(Differs { field, values })
}

/// Returns the path and the values of the first difference between the words of two values of one shape.
fn first_difference(shape: &FieldShape, values: [&[u64]; 2]) -> Option<(String, [String; 2])> {
    match shape {
        FieldShape::Number | FieldShape::Count if values[0][0] == values[1][0] => None,
        FieldShape::Number => Some((String::new(), values.map(|words| format!("{:?}", f64::from_bits(words[0]))))),
        FieldShape::Count => Some((String::new(), values.map(|words| words[0].to_string()))),
        FieldShape::Array(element, count) => (0..*count).find_map(|i| {
            let (path, values) = first_difference(element, values.map(|words| &words[i * element.len()..]))?;
            Some((format!("[{i}]{path}"), values))
        }),
        FieldShape::Part(fields) => {
            fields.iter().filter(|field| field.mark != Some(FieldMark::Clock)).find_map(|field| {
                let (path, values) = first_difference(&field.shape, values.map(|words| &words[field.words.clone()]))?;
                Some((format!(".{}{path}", field.name), values))
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use contract::message::{Arrival, Controls, State};

    use super::*;

    #[test]
    fn the_first_difference_is_named_with_both_values() {
        let difference = |change: fn(&mut State)| {
            let mut changed = State::default();
            change(&mut changed);
            difference(&State::default().into(), &changed.into()).map(|found| (found.field, found.values[1].clone()))
        };
        let named = |field: &str, value: &str| Some((field.to_owned(), value.to_owned()));
        assert_eq!(difference(|state| state.stamp.inputs[2] = 7), named("stamp.inputs[2]", "7"));
        assert_eq!(difference(|state| state.measured.rates_radps[1] = -0.0), named("measured.rates_radps[1]", "-0.0"));
        assert_eq!(
            difference(|state| state.arrivals[3] = Arrival { after_ns: 5, ..Arrival::default() }),
            named("arrivals[3].after_ns", "5")
        );
        assert_eq!(difference(|state| (state.arrived, state.status) = (1, 2)), named("status", "2"), "the first");
    }

    #[test]
    fn fields_from_the_clock_are_not_compared() {
        let mut other = Controls { solve_ns: 9, ..Controls::default() };
        (other.stamp.publish_ns[1], other.stamp.checksum) = (9, 9);
        assert_eq!(difference(&Controls::default().into(), &other.into()), None);
    }
}
