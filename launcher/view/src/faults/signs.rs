//! What a message shows of a fault: the table of [`super`] in code.

use contract::message::{Controls, SolveStatus, guidance_flags, mixer_flags};
use contract::scenario::{Fault, FaultKind, FaultTarget};
use contract::topic::Topic;

use flight::log::Record;

/// What is known to be wrong with ACTUATORS of these flags, other than a limit.
const REACTIONS: u64 = mixer_flags::BAD_INPUT
    | mixer_flags::HELD
    | mixer_flags::LEVELLED
    | mixer_flags::DESCENDING
    | mixer_flags::TRIM_ONLY
    | mixer_flags::CUT
    | mixer_flags::TERMINATED;

/// Whether `record` is a message of the topic that `fault` has struck; what is only doubled bears no mark.
pub fn struck(fault: &Fault, record: &Record) -> bool {
    let marked = record.stamp().is_faulted() || fault.kind == FaultKind::Duplicate;
    marked && fault.target.topic() == Some(record.topic())
}

/// Whether `record` shows harm done by a fault of `target`; nothing when it is no witness. `obeyed` is the command that
/// the STATE before it was under.
pub fn harm(target: FaultTarget, record: &Record, obeyed: u64) -> Option<bool> {
    use FaultTarget as T;
    match (target, record) {
        (T::Mpc, Record::Controls(controls)) => Some(controls.status > SolveStatus::Solved as u64),
        (T::Rotor1 | T::Rotor2 | T::Rotor3 | T::Tilt, Record::Actuators(actuators)) => {
            Some(actuators.flags & mixer_flags::TERMINATED != 0)
        }
        (T::Actuators, Record::State(state)) => Some(state.applied_sequence == obeyed),
        (T::State | T::Reference | T::Controls | T::Position | T::Velocity | T::Attitude | T::Rates, _) => {
            let first = target.topic().unwrap_or(Topic::State); // what sensors say travels in STATE
            if record.topic() as usize > first as usize { Some(reacts(record)) } else { None }
        }
        _ => None,
    }
}

/// Whether the sender of `record` did without what it should have heard.
pub fn reacts(record: &Record) -> bool {
    match record {
        Record::State(_) => false,
        Record::Reference(reference) => guidance_flags::repeated(reference.flags),
        Record::Controls(Controls { status, .. }) => {
            SolveStatus::repeated(*status) || *status == SolveStatus::NoReference as u64
        }
        Record::Actuators(actuators) => actuators.flags & REACTIONS != 0,
    }
}
