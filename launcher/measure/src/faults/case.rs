//! The matrix: every target with every kind that it can suffer, and what is to be expected.
//!
//! The rule, for all alike: a fault is **recoverable** when, all the while,
//!
//! ```text
//! the plant lives               it is the vehicle; nobody can take its place
//! every actuator obeys          late or weakly perhaps, but it moves where it is told
//! no sensor lies                stuck and wrong are nothing that a stack without a second sensor can know
//! no node errs                  a demand that could be right is obeyed; where it is a candidate's, a swap is ended by it
//! no sensor is late             slow and delayed, by default 200 and 100 ms: the loop bears 50 ms of the rates
//! the state is known            a STATE that can be taken is never older than 50 ms: measured, flight by flight
//! nobody falls                  only of the paper's profile, which does not catch a vehicle that had no thrust: measured too
//! ```
//!
//! A rotor that is off is to be terminated. Of the rest nothing is promised, and the table says what came of it.

use contract::scenario::{Fault, FaultKind, FaultTarget};
use serde::Serialize;

/// When every fault begins \[s\].
pub const AT_S: f64 = 5.0;
/// How long it lasts \[s\].
pub const FOR_S: f64 = 1.0;
/// The oldest state that can be flown from \[s\]: where the mixer gives up levelling.
pub const KNOWN_S: f64 = 0.05;

/// One fault of the matrix.
#[derive(Debug, Clone)]
pub struct Case(pub Fault);

/// What is to be expected of a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Promise {
    /// It flies on within the limits.
    Recover,
    /// It is terminated in time.
    Terminate,
    /// Nothing: the plant is gone.
    NoPlant,
    /// Nothing: an actuator does not obey.
    NoActuator,
    /// Nothing: a sensor lies.
    Lie,
    /// Nothing: a node demands what is wrong.
    Error,
    /// Nothing: a sensor tells of the past.
    Late,
    /// Nothing: thrust was cut, and the paper's controller does not catch what falls.
    Fall,
    /// Nothing: nobody knew the state.
    Blind,
}

impl Case {
    /// All of them that are part of the flight; without a plant that hangs or leaves, which only the clock would outlast.
    /// Clock, host and intruders are no part of it: `tests/isolation.rs` shows that it does not change by a bit.
    pub fn all() -> Vec<Self> {
        let fault = |target, kind: &FaultKind| Self(Fault::new(target, *kind, AT_S, Some(FOR_S)));
        let of = |(target, _): (FaultTarget, _)| target.kinds().iter().map(move |kind| fault(target, kind));
        let needs_a_clock = |case: &Self| {
            case.0.target == FaultTarget::Plant && !matches!(case.0.kind, FaultKind::Kill | FaultKind::Slow)
        };
        FaultTarget::ALL.into_iter().flat_map(of).filter(|case| !needs_a_clock(case) && !case.is_around()).collect()
    }

    /// Whether it strikes what is around the processes.
    fn is_around(&self) -> bool {
        matches!(self.0.target, FaultTarget::Clock | FaultTarget::Host) || self.0.kind.is_intrusion()
    }

    /// Whether it strikes a process.
    pub fn is_of_a_process(&self) -> bool {
        self.0.target.process().is_some()
    }

    /// Whether it strikes a process or what one says.
    pub fn is_of_software(&self) -> bool {
        self.is_of_a_process() || self.0.target.topic().is_some()
    }

    /// What is promised when the state was unknown for `blind_s` at most, and whether the paper's controller had no thrust
    /// for a while, and `fell`.
    pub fn promise(&self, blind_s: f64, fell: bool) -> Promise {
        use {FaultKind as K, FaultTarget as T};
        match (self.0.target, self.0.kind) {
            (T::Plant, K::Kill) => Promise::NoPlant,
            (T::Rotor1 | T::Rotor2 | T::Rotor3, K::Off) => Promise::Terminate,
            (T::Rotor1 | T::Rotor2 | T::Rotor3 | T::Tilt, K::Off | K::Stuck) => Promise::NoActuator,
            (T::Position | T::Velocity | T::Attitude | T::Rates, K::Stuck | K::Wrong) => Promise::Lie,
            (T::Reference | T::Controls | T::Actuators, K::Wrong) => Promise::Error,
            (T::Position | T::Velocity | T::Attitude | T::Rates, K::Slow | K::Delayed) => Promise::Late,
            _ if blind_s > KNOWN_S + 1e-9 => Promise::Blind,
            _ if fell => Promise::Fall,
            _ => Promise::Recover,
        }
    }
}
