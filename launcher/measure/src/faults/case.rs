//! Matrix of the faults: every target with every kind of fault that it can have, and the promise for each.
//!
//! One rule holds for all faults: a fault is **recoverable** if, for its whole duration,
//!
//! ```text
//! the plant lives               the plant is the vehicle, and is not replaced
//! every actuator obeys          it may be late, weak, limited or off by some degrees, but follows its command
//! no sensor is wrong            without a second sensor the stack cannot detect a stuck or wrong one
//! no node errs                  a wrong but plausible demand is obeyed; from a candidate it ends the swap
//! no sensor is late             slow and delayed are 200 and 100 ms by default; the loop tolerates 50 ms for the rates
//! the state is known            the newest accepted STATE is at most 50 ms old; measured in each flight
//! the vehicle does not fall     profile paper only: its controller does not catch a falling vehicle; measured too
//! ```
//!
//! If a rotor is off, the flight must be terminated. For other faults nothing is promised; the table has the outcome.

use campaign::OwnController;
use flight::programs;
use serde::Serialize;
use settings::{Fault, FaultKind, FaultTarget, NodeSettings, Scenario, load};

/// Time at which every fault begins \[s\].
pub const AT_S: f64 = 5.0;
/// Duration of the fault \[s\].
pub const FOR_S: f64 = 1.0;
/// Time after the fault at which the vehicle must be back \[s\].
pub const BACK_S: f64 = 5.0;
/// Largest age of a state that the vehicle can be flown by \[s\]; with an older state the mixer gives up levelling.
pub const KNOWN_S: f64 = 0.05;

/// Fault of the matrix.
#[derive(Debug, Clone)]
pub struct FaultCase(pub Fault);

/// Promise for a flight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultPromise {
    /// The vehicle flies on within the limits.
    Recover,
    /// The flight is terminated in time.
    Terminate,
    /// No promise: the plant has ended.
    NoPlant,
    /// No promise: an actuator does not obey.
    NoActuator,
    /// No promise: a sensor is wrong.
    Lie,
    /// No promise: a node's output is wrong.
    Error,
    /// No promise: a sensor is late.
    Late,
    /// No promise: thrust was cut, and the paper's controller does not catch a falling vehicle.
    Fall,
    /// No promise: no node knew the state.
    Blind,
}

impl FaultCase {
    /// Lists all faults except hangs and exits of the plant, which only a wall clock can detect, faults of clock and
    /// host, which change no bit of the flight (see `tests/isolation.rs`), and faults of sensors that this flight does
    /// not have.
    pub fn all() -> Vec<Self> {
        let fault = |target, kind: &FaultKind| Self(Fault::new(target, *kind, AT_S, Some(FOR_S)));
        let of = |(target, _): (FaultTarget, _)| target.kinds().iter().map(move |kind| fault(target, kind));
        let needs_a_clock = |case: &Self| {
            case.0.target == FaultTarget::Plant && !matches!(case.0.kind, FaultKind::Kill | FaultKind::Slow)
        };
        FaultTarget::ALL.into_iter().flat_map(of).filter(|case| !needs_a_clock(case) && !case.is_elsewhere()).collect()
    }

    /// Returns whether the fault acts on the surroundings of the processes, or on a sensor behind the EKF.
    fn is_elsewhere(&self) -> bool {
        let target = self.0.target;
        matches!(target, FaultTarget::Clock | FaultTarget::Host) || target.is_of_the_unit()
    }

    /// Returns whether the fault acts on a process or on a message.
    pub fn is_of_software(&self) -> bool {
        self.0.target.process().is_some() || self.0.target.topic().is_some()
    }

    /// Returns the promise; `blind_s` is the longest time without a known state, and `fell` is `true` if thrust was cut
    /// under the paper's controller.
    pub fn promise(&self, blind_s: f64, fell: bool) -> FaultPromise {
        use {FaultKind as K, FaultTarget as T};
        match (self.0.target, self.0.kind) {
            (T::Plant, K::Kill) => FaultPromise::NoPlant,
            (T::Rotor1 | T::Rotor2 | T::Rotor3, K::Off) => FaultPromise::Terminate,
            (T::Rotor1 | T::Rotor2 | T::Rotor3 | T::Tilt, K::Off | K::Stuck) => FaultPromise::NoActuator,
            (target, K::Stuck | K::Wrong) if target.is_a_sensor() => FaultPromise::Lie,
            (T::Reference | T::Controls | T::Actuators, K::Wrong) => FaultPromise::Error,
            (target, K::Slow | K::Delayed) if target.is_a_sensor() => FaultPromise::Late,
            _ if blind_s > KNOWN_S + 1e-9 => FaultPromise::Blind,
            _ if fell => FaultPromise::Fall,
            _ => FaultPromise::Recover,
        }
    }
}

/// Returns `base` with an attitude controller of the user.
///
/// # Errors
/// The controller cannot be flown.
pub fn with_controller(base: &Scenario, own: &OwnController) -> anyhow::Result<Scenario> {
    let mut scenario = base.clone();
    let exec = own.path().to_string_lossy().into_owned();
    scenario.node.attitude_mpc = NodeSettings { exec, ..NodeSettings::default() };
    programs::pin_all(&mut scenario)?;
    programs::check(&scenario)?;
    Ok(scenario)
}

/// Returns a hover in calm with the paper's controller.
pub fn hover_of_the_paper() -> anyhow::Result<Scenario> {
    let settings = ["profile=paper", "mission.trajectory=hover", "run.duration_s=12.0"].map(str::to_owned);
    Ok(load(None, &settings)?)
}

#[cfg(test)]
mod tests {
    use settings::{Mode, from_merged, to_toml};

    use super::*;
    use crate::flights::hover_in_gusts;

    #[test]
    fn the_matrix_is_the_whole_catalogue_and_every_case_is_a_scenario() {
        let cases = FaultCase::all();
        assert_eq!(cases.len(), 2 + 3 * 5 + 4 * 9 + 3 + 4 * 8 + 4 * 5 + 2 + 1 + 3);
        let base = hover_in_gusts().expect("a scenario");
        assert!(base.run.duration_s > AT_S + FOR_S + BACK_S, "there is time to come back");
        assert_ne!(base.run.mode, Mode::Inprocess);
        for case in cases {
            let mut scenario = base.clone();
            scenario.fault = vec![case.0];
            from_merged(&to_toml(&scenario), "case").unwrap_or_else(|e| panic!("{case:?}: {e}"));
        }
    }

    #[test]
    fn the_promise_follows_from_the_fault_and_the_time_without_a_state() {
        let promise =
            |target, kind, blind_s| FaultCase(Fault::new(target, kind, AT_S, Some(FOR_S))).promise(blind_s, false);
        assert_eq!(promise(FaultTarget::AttitudeMpc, FaultKind::Kill, 0.0), FaultPromise::Recover);
        assert_eq!(promise(FaultTarget::State, FaultKind::Drop, 0.05), FaultPromise::Recover);
        assert_eq!(promise(FaultTarget::State, FaultKind::Drop, 0.06), FaultPromise::Blind);
        assert_eq!(promise(FaultTarget::Plant, FaultKind::Kill, 0.0), FaultPromise::NoPlant);
        assert_eq!(promise(FaultTarget::Plant, FaultKind::Slow, 0.0), FaultPromise::Recover);
        assert_eq!(promise(FaultTarget::Rotor2, FaultKind::Off, 0.0), FaultPromise::Terminate);
        assert_eq!(promise(FaultTarget::Tilt, FaultKind::Off, 0.0), FaultPromise::NoActuator);
        assert_eq!(promise(FaultTarget::Rates, FaultKind::Wrong, 0.0), FaultPromise::Lie);
        assert_eq!(promise(FaultTarget::Controls, FaultKind::Wrong, 0.0), FaultPromise::Error);
        assert_eq!(promise(FaultTarget::Rates, FaultKind::Delayed, 0.0), FaultPromise::Late);
        assert_eq!(promise(FaultTarget::Tilt, FaultKind::Slow, 0.0), FaultPromise::Recover, "late, but it obeys");
    }
}
