use contract::scenario::{Fault, FaultKind, FaultTarget, Mode, to_toml};

use super::case::{AT_S, Case, FOR_S, Promise};
use super::{hover_in_gusts, one_flight};

#[test]
fn the_matrix_is_the_whole_catalogue_and_every_case_is_a_scenario() {
    let cases = Case::all();
    assert_eq!(cases.len(), 2 + 3 * 5 + 4 * 9 + 3 + 4 * 8 + 4 * 5 + 2 + 1 + 3);
    let base = hover_in_gusts().expect("a scenario");
    assert!(base.run.duration_s > AT_S + FOR_S + one_flight::BACK_S, "there is time to come back");
    assert_ne!(base.run.mode, Mode::Inprocess);
    for case in cases {
        let mut scenario = base.clone();
        scenario.fault = vec![case.0];
        contract::scenario::from_merged(&to_toml(&scenario), "case").unwrap_or_else(|e| panic!("{case:?}: {e}"));
    }
}

#[test]
fn what_is_promised_follows_from_the_fault_and_the_blindness() {
    let promise = |target, kind, blind_s| Case(Fault::new(target, kind, AT_S, Some(FOR_S))).promise(blind_s, false);
    assert_eq!(promise(FaultTarget::AttitudeMpc, FaultKind::Kill, 0.0), Promise::Recover);
    assert_eq!(promise(FaultTarget::State, FaultKind::Drop, 0.05), Promise::Recover);
    assert_eq!(promise(FaultTarget::State, FaultKind::Drop, 0.06), Promise::Blind);
    assert_eq!(promise(FaultTarget::Plant, FaultKind::Kill, 0.0), Promise::NoPlant);
    assert_eq!(promise(FaultTarget::Plant, FaultKind::Slow, 0.0), Promise::Recover);
    assert_eq!(promise(FaultTarget::Rotor2, FaultKind::Off, 0.0), Promise::Terminate);
    assert_eq!(promise(FaultTarget::Tilt, FaultKind::Off, 0.0), Promise::NoActuator);
    assert_eq!(promise(FaultTarget::Rates, FaultKind::Wrong, 0.0), Promise::Lie);
    assert_eq!(promise(FaultTarget::Controls, FaultKind::Wrong, 0.0), Promise::Error);
    assert_eq!(promise(FaultTarget::Rates, FaultKind::Delayed, 0.0), Promise::Late);
    assert_eq!(promise(FaultTarget::Tilt, FaultKind::Slow, 0.0), Promise::Recover, "late, but it obeys");
}
