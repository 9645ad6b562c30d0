//! Names of the words of a message, to say where two messages differ.

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State};

use crate::log::Record;

/// Format of a word.
#[derive(Clone, Copy)]
enum Kind {
    Number,
    Count,
    /// Depends on the machine and not on the flight, so it is not compared.
    Measured,
}
use Kind::{Count, Measured, Number};

/// Fields after the stamp, with the number of their words.
type Fields = &'static [(&'static str, usize, Kind)];

const STATE: Fields = &[
    ("applied_sequence", 1, Count),
    ("applied_age_ns", 1, Count),
    ("measured.position_m", 3, Number),
    ("measured.velocity_mps", 3, Number),
    ("measured.attitude_rad", 3, Number),
    ("measured.rates_radps", 3, Number),
    ("actual.position_m", 3, Number),
    ("actual.velocity_mps", 3, Number),
    ("actual.attitude_rad", 3, Number),
    ("actual.rates_radps", 3, Number),
    ("actuators.rotor_speed", 3, Number),
    ("actuators.tilt_rad", 1, Number),
    ("command_in_force.rotor_speed", 3, Number),
    ("command_in_force.tilt_rad", 1, Number),
    ("status", 1, Count),
    ("arrivals", 12, Count),
    ("arrived", 1, Count),
];
const REFERENCE: Fields = &[
    ("position_m", 3, Number),
    ("velocity_mps", 3, Number),
    ("w_mps", 1, Number),
    ("attitude_rad", 3, Number),
    ("rates_radps", 3, Number),
    ("disturbance_mps2", 2, Number),
    ("flags", 1, Count),
];
const CONTROLS: Fields = &[
    ("demand", 4, Number),
    ("disturbance", 4, Number),
    ("status", 1, Count),
    ("iterations", 1, Count),
    ("solve_ns", 1, Measured),
    ("active_constraints", 1, Count),
    ("fallbacks", 1, Count),
];
const ACTUATORS: Fields = &[("command.rotor_speed", 3, Number), ("command.tilt_rad", 1, Number), ("flags", 1, Count)];

const fn words(fields: Fields) -> usize {
    let (mut sum, mut i) = (0, 0);
    while i < fields.len() {
        sum += fields[i].1;
        i += 1;
    }
    sum
}
const STAMP_WORDS: usize = size_of::<Stamp>() / 8;
const _: () = {
    assert!(words(STATE) == size_of::<State>() / 8 - STAMP_WORDS);
    assert!(words(REFERENCE) == size_of::<Reference>() / 8 - STAMP_WORDS);
    assert!(words(CONTROLS) == size_of::<Controls>() / 8 - STAMP_WORDS);
    assert!(words(ACTUATORS) == size_of::<Actuators>() / 8 - STAMP_WORDS);
};

/// Field in which two messages differ, with both values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Differs {
    pub field: String,
    pub values: [String; 2],
}

/// Returns the first field in which two messages of one topic differ: provenance first, then the payload bit by bit.
/// Clock times are not compared.
pub fn difference(one: &Record, other: &Record) -> Option<Differs> {
    let provenance = |record: &Record| {
        let Stamp { tick, sequence, epoch, inputs, input_epochs, faults, delivery, .. } = *record.stamp();
        [
            ("stamp.tick", vec![tick]),
            ("stamp.sequence", vec![sequence]),
            ("stamp.epoch", vec![epoch]),
            ("stamp.inputs", inputs.to_vec()),
            ("stamp.input_epochs", input_epochs.to_vec()),
            ("stamp.faults", vec![faults]),
            ("stamp.delivery", vec![delivery]),
        ]
    };
    let stamps = provenance(one).into_iter().zip(provenance(other));
    let mut stamps = stamps.filter(|((_, one), (_, other))| one != other);
    if let Some(((field, one), (_, other))) = stamps.next() {
        return Some(Differs { field: field.into(), values: [one, other].map(|words| format!("{words:?}")) });
    }
    let fields = match one.topic() {
        Topic::State => STATE,
        Topic::Reference => REFERENCE,
        Topic::Controls => CONTROLS,
        Topic::Actuators => ACTUATORS,
    };
    let named = fields.iter().flat_map(|(name, words, kind)| (0..*words).map(move |i| (*name, *words, *kind, i)));
    let payloads = named.zip(payload(one).into_iter().zip(payload(other)));
    let mut differing = payloads.filter(|((_, _, kind, _), (one, other))| !matches!(kind, Measured) && one != other);
    let ((name, words, kind, i), (one, other)) = differing.next()?;
    let field = if words == 1 { name.to_owned() } else { format!("{name}[{i}]") };
    let written = |word: u64| match kind {
        Number => format!("{:?}", f64::from_bits(word)),
        Count | Measured => word.to_string(),
    };
    Some(Differs { field, values: [one, other].map(written) })
}

fn payload(record: &Record) -> Vec<u64> {
    fn words<M: Message>(message: &M) -> Vec<u64> {
        bytemuck::bytes_of(message)[STAMP_WORDS * 8..].chunks_exact(8).map(bytemuck::pod_read_unaligned).collect()
    }
    match record {
        Record::State(message) => words(message),
        Record::Reference(message) => words(message),
        Record::Controls(message) => words(message),
        Record::Actuators(message) => words(message),
    }
}
