//! The protobuf form of messages and events: field for field, bit for bit, both ways.

use std::mem::offset_of;
use std::ops::RangeFrom;

use anyhow::Context;
use bytemuck::{bytes_of, cast_slice};
use contract::{
    Topic,
    message::{
        ActuationMsg, Actuators, Ahead, Arrival, Controls, Kinematics, MAX_ARRIVALS, Navigation, PREVIEW, Reference,
        Stamp, State, Truth,
    },
};
use prost::{DecodeError, Message as _};
use runtime::shared_role::Origin;
use serde_json::json;

use super::{Memory, Record};
use crate::event::name;
use crate::event::{Event, Sender};

/// Types generated from `proto/trefoil.proto`.
mod wire {
    #![expect(clippy::pedantic, reason = "generated code")]
    include!(concat!(env!("OUT_DIR"), "/trefoil.v1.rs"));
    pub type ActuationMsg = Actuation;
}

/// The schema as logs carry it: a serialised `FileDescriptorSet`.
pub const DESCRIPTORS: &[u8] = include_bytes!(concat!(env!("OUT_DIR"), "/trefoil.fds"));

/// Full name of the protobuf message of an event.
pub const EVENT: &str = "trefoil.v1.Event";

/// Full name of the protobuf message of a node's snapshot.
pub const MEMORY: &str = "trefoil.v1.Memory";

/// Full names of the protobuf messages of the ring, by [`Record::kind`].
pub const MESSAGES: [&str; Record::KINDS] =
    ["trefoil.v1.State", "trefoil.v1.Reference", "trefoil.v1.Controls", "trefoil.v1.Actuators", "trefoil.v1.Truth"];

/// Returns the bytes of a message.
pub fn encode(record: &Record) -> Vec<u8> {
    match *record {
        Record::State(message) => wire::State::from(message).encode_to_vec(),
        Record::Reference(message) => wire::Reference::from(message).encode_to_vec(),
        Record::Controls(message) => wire::Controls::from(message).encode_to_vec(),
        Record::Actuators(message) => wire::Actuators::from(message).encode_to_vec(),
        Record::Truth(message) => wire::Truth::from(message).encode_to_vec(),
    }
}

/// Reads a message of a [kind](Record::kind).
pub fn decode(kind: usize, bytes: &[u8]) -> Result<Record, DecodeError> {
    Ok(match Topic::ALL.get(kind) {
        Some(Topic::State) => State::from(wire::State::decode(bytes)?).into(),
        Some(Topic::Reference) => Reference::from(wire::Reference::decode(bytes)?).into(),
        Some(Topic::Controls) => Controls::from(wire::Controls::decode(bytes)?).into(),
        Some(Topic::Actuators) => Actuators::from(wire::Actuators::decode(bytes)?).into(),
        None => Truth::from(wire::Truth::decode(bytes)?).into(),
    })
}

/// Returns the bytes of an event.
pub fn encode_event(event: &Event) -> Vec<u8> {
    let Event { tick, ref node, epoch, what, ref why, swap, origin, by, ref fault } = *event;
    let [swap, origin] = [swap, origin].map(|swap| swap.map(|swap| swap as u64));
    let by = by.map(|Sender { pid, user }| wire::Sender { pid, user });
    let fault_number = fault.as_ref().map(|fault| fault.0 as u64);
    let fault = fault.as_ref().map(|fault| json!(fault.1).to_string());
    wire::Event {
        tick,
        node: node.clone(),
        epoch,
        what: name(what),
        why: why.clone(),
        swap,
        origin,
        by,
        fault_number,
        fault,
    }
    .encode_to_vec()
}

pub fn decode_event(bytes: &[u8]) -> anyhow::Result<Event> {
    let wire::Event { tick, node, epoch, what, why, swap, origin, by, fault_number, fault } =
        wire::Event::decode(bytes)?;
    let by = by.map(|wire::Sender { pid, user }| Sender { pid, user });
    let what = serde_json::from_value(what.into()).context("an event of an unknown kind")?;
    let fault =
        fault_number.zip(fault).map(|(number, text)| Ok(Box::new((number as usize, serde_json::from_str(&text)?))));
    let fault = fault
        .transpose()
        .map_err(|error: serde_json::Error| error)
        .context("a fault given in flight cannot be read")?;
    let [swap, origin] = [swap, origin].map(|swap| swap.map(|swap| swap as usize));
    Ok(Event { tick, node, epoch, what, why, swap, origin, by, fault })
}

/// Returns the bytes of a snapshot.
pub fn encode_memory(memory: &Memory) -> Vec<u8> {
    let Memory { tick, topic, origin: Origin { epoch, done }, words } = memory;
    let (tick, epoch, done, words) = (*tick, *epoch, *done, words.clone());
    wire::Memory { tick, node: topic.publisher().into(), epoch, done, words }.encode_to_vec()
}

pub fn decode_memory(bytes: &[u8]) -> anyhow::Result<Memory> {
    let wire::Memory { tick, node, epoch, done, words } = wire::Memory::decode(bytes)?;
    let topic = Topic::of_node(&node).context("the node is unknown")?;
    Ok(Memory { tick, topic, origin: Origin { epoch, done }, words })
}

/// One word of a message in memory, by its name in the schema: `actual.position_m.x`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    pub name: String,
    /// `true` for a `u64`, `false` for an `f64`.
    pub is_count: bool,
}

/// Returns the fields of a [kind](Record::kind) of messages, in the order of [`Record::words`].
pub fn fields(kind: usize) -> Vec<Column> {
    let mut columns = vec![];
    match Topic::ALL.get(kind) {
        Some(Topic::State) => wire::State::columns("", &mut columns),
        Some(Topic::Reference) => wire::Reference::columns("", &mut columns),
        Some(Topic::Controls) => wire::Controls::columns("", &mut columns),
        Some(Topic::Actuators) => wire::Actuators::columns("", &mut columns),
        None => wire::Truth::columns("", &mut columns),
    }
    columns
}

/// Returns the columns of a topic's table, in the order of [`words`]: the fields of its messages, and for STATE also
/// the true motion and actuator positions.
pub fn columns(topic: Topic) -> Vec<Column> {
    let mut columns = fields(topic as usize);
    if topic == Topic::State {
        columns.extend(fields(Topic::COUNT).drain(TRUE_WORDS));
    }
    columns
}

/// Words of TRUTH that the table of STATE has too.
const TRUE_WORDS: RangeFrom<usize> = offset_of!(Truth, actual) / 8..;

/// Returns the values of a message of the ring in the order of [`columns`]; `truth` is the TRUTH of the same tick;
/// without it, its values are NaN.
pub fn words(record: &Record, truth: Option<&Truth>) -> Vec<u64> {
    let mut words = record.words().to_vec();
    if let Record::State(_) = record {
        let lost = [f64::NAN.to_bits(); size_of::<Truth>() / 8];
        words.extend_from_slice(&truth.map_or(&lost[..], |truth| cast_slice(bytes_of(truth)))[TRUE_WORDS]);
    }
    words
}

/// Returns the name of the status of a message; `None` if the topic has no status, or the number no name.
pub fn status_name(record: &Record) -> Option<&'static str> {
    let number = |status: u64| i32::try_from(status).ok();
    match record {
        Record::State(state) => {
            wire::PlantStatus::try_from(number(state.status)?).ok().map(|status| status.as_str_name())
        }
        Record::Controls(controls) => {
            wire::SolveStatus::try_from(number(controls.status)?).ok().map(|status| status.as_str_name())
        }
        Record::Reference(_) | Record::Actuators(_) | Record::Truth(_) => None,
    }
}

/// Type of the schema whose value in memory is a row of words.
trait Columns {
    /// Appends the columns of a value called `name`.
    fn columns(name: &str, columns: &mut Vec<Column>);
}

impl Columns for f64 {
    fn columns(name: &str, columns: &mut Vec<Column>) {
        columns.push(Column { name: name.into(), is_count: false });
    }
}

impl Columns for u64 {
    fn columns(name: &str, columns: &mut Vec<Column>) {
        columns.push(Column { name: name.into(), is_count: true });
    }
}

/// Appends the columns of a `field` of the value called `of`; the type of the field is the one that `_get` returns.
fn field<M, T: Columns>(_get: fn(&M) -> &T, of: &str, field: &str, columns: &mut Vec<Column>) {
    let name = if of.is_empty() { field.to_owned() } else { format!("{of}.{field}") };
    T::columns(&name, columns);
}

/// Implements [`Columns`] for a type of the schema: the columns of its fields, in this order.
macro_rules! columns {
    ($name:ident { $($field:ident),* }) => {
        impl Columns for wire::$name {
            fn columns(name: &str, columns: &mut Vec<Column>) {
                $(field(|value: &Self| &value.$field, name, stringify!($field), columns);)*
            }
        }
    };
}

/// Converts between an array and a message with named fields, both ways.
macro_rules! named_array {
    ($([$element:ty; $count:expr] as $name:ident { $($field:ident),* })*) => {$(
        columns!($name { $($field),* });
        impl From<[$element; $count]> for wire::$name {
            fn from([$($field),*]: [$element; $count]) -> Self {
                Self { $($field: $field.into()),* }
            }
        }
        impl From<wire::$name> for [$element; $count] {
            fn from(wire::$name { $($field),* }: wire::$name) -> Self {
                [$($field.into()),*]
            }
        }
    )*};
}
named_array! {
    [u64; 4] as PerTopic { state, reference, controls, actuators }
    [f64; 3] as Ned { x, y, z }
    [f64; 3] as BodyVelocity { u, v, w }
    [f64; 3] as Attitude { roll, pitch, yaw }
    [f64; 3] as BodyRates { p, q, r }
    [f64; 2] as Heading { x, y }
    [f64; 3] as RotorSpeed { rotor_1, rotor_2, rotor_3 }
    [f64; 4] as Inputs { col, lon, lat, ped }
    [f64; 3] as BodyAxes { x, y, z }
    [f64; 5] as PerSource { position, velocity, height, heading, flow }
    [u64; 5] as CountPerSource { position, velocity, height, heading, flow }
    [Arrival; MAX_ARRIVALS] as Arrivals { first, second, third, fourth }
    [Ahead; PREVIEW] as Preview { first, second, third, fourth, fifth, sixth, seventh, eighth }
}

/// Converts between the types of the table and those of the schema, both ways, and lists their columns. A field that
/// only one of them has does not compile. The name of a status is for human readers; it is not read back.
macro_rules! convert {
    (parts { $($(#[$about:meta])* $part:ident { $($fields:tt)* })* }
     messages { $($(#[$of:meta])* $message:ident $layout:literal $bytes:literal bytes { $($its:tt)* })* }
     truth { $(#[$of_truth:meta])* $truth:ident $its_layout:literal $its_bytes:literal bytes { $($true:tt)* } }) => {
        $(convert! { $part { $($fields)* } })*
        $(convert! { $message { $($its)* } })*
        convert! { $truth { $($true)* } }
    };
    ($name:ident {
        $($(#[$doc:meta])* $field:ident: $type:ty $(= $names:ident)? $(as $mark:ident)?,)*
    }) => {
        columns!($name { $($field),* });
        impl From<$name> for wire::$name {
            fn from($name { $($field),* }: $name) -> Self {
                Self { $($(status_name: named($field, wire::$names::is_valid),)?)* $($field: $field.into()),* }
            }
        }
        impl From<wire::$name> for $name {
            fn from(wire::$name { $($field,)* .. }: wire::$name) -> Self {
                Self { $($field: $field.into()),* }
            }
        }
    };
}
contract::messages!(convert);

/// Returns the number as an enum value; `None` if the schema has no name for it.
fn named(status: u64, is_valid: fn(i32) -> bool) -> Option<i32> {
    i32::try_from(status).ok().filter(|&number| is_valid(number))
}

#[cfg(test)]
mod tests {
    use contract::message::{Controls, PlantStatus, SolveStatus, State, Truth};

    use super::{Topic, columns, status_name, wire, words};

    #[test]
    fn statuses_have_the_same_names_as_in_the_contract() {
        for number in 0..20 {
            let theirs = wire::PlantStatus::try_from(number).ok().map(|status| format!("{status:?}"));
            let ours = PlantStatus::from_wire(number as u64).map(|status| format!("{status:?}"));
            assert_eq!(theirs, ours, "{number}");
        }
        let solve = [
            SolveStatus::Explicit,
            SolveStatus::Solved,
            SolveStatus::LimitReached,
            SolveStatus::Fallback,
            SolveStatus::BadInput,
            SolveStatus::Stale,
            SolveStatus::NoReference,
        ];
        for ours in solve {
            let theirs = wire::SolveStatus::try_from(ours as i32).unwrap();
            assert_eq!(format!("{theirs:?}"), format!("{ours:?}"));
        }
    }

    #[test]
    fn columns_are_the_words_of_a_message_by_their_names_in_the_schema() {
        let mut state = State::default();
        state.stamp.input_epochs[1] = 7;
        state.arrivals[3].after_ns = u64::MAX;
        let mut truth = Truth::default();
        truth.actual.position_m[2] = -0.0;
        truth.actuators.tilt_rad = 0.5;
        let record = crate::log::Record::from(state);
        let (columns, words) = (columns(Topic::State), [words(&record, Some(&truth)), words(&record, None)]);
        assert_eq!([columns.len(); 2], words.each_ref().map(Vec::len));
        let at = |name: &str| columns.iter().position(|column| column.name == name).unwrap();
        let value = |name: &str| (columns[at(name)].is_count, words[0][at(name)]);
        assert_eq!(value("stamp.input_epochs.reference"), (true, 7));
        assert_eq!(value("actual.position_m.z"), (false, (-0.0_f64).to_bits()));
        assert_eq!(value("actuators.tilt_rad"), (false, 0.5_f64.to_bits()));
        assert!(f64::from_bits(words[1][at("actual.position_m.z")]).is_nan(), "without a TRUTH");
        assert_eq!(value("arrivals.fourth.after_ns"), (true, u64::MAX));
        assert_eq!(status_name(&record), Some("FLYING"));
    }

    #[test]
    fn a_status_is_written_with_its_name_if_it_has_one() {
        let name = |status| wire::State::from(State { status, ..State::default() }).status_name;
        assert_eq!(name(PlantStatus::TooFast as u64), Some(wire::PlantStatus::TooFast as i32));
        assert_eq!(name(14), None);
        assert_eq!(name(1 << 32), None, "not FLYING");
        let name = |status| wire::Controls::from(Controls { status, ..Controls::default() }).status_name;
        assert_eq!(name(SolveStatus::BadInput as u64), Some(wire::SolveStatus::BadInput as i32));
        assert_eq!(name(7), None);
    }
}
