//! What one `[[fault]]` may be: written into the scenario, or given while the stack flies.

use toml::Value;

use super::{Found, surroundings};
use crate::scenario::{Constraints, Fault, FaultKind, FaultTarget, LONGEST_MS, LONGEST_S, Law, Mode, Plant, Scenario};

/// Bits that a corrupt message has flipped at most: more than any message has.
const MOST_BITS: f64 = 10_000.0;
/// Messages of a burst, or of which one passes.
const MOST_MESSAGES: f64 = 1e6;
/// Wind along one axis \[m/s\].
const STRONGEST_WIND_MPS: f64 = 200.0;
/// A payload \[kg\].
const HEAVIEST_KG: f64 = 1000.0;
/// Bias, factor or deviation of what is measured or demanded, in its unit.
const LARGEST_ERROR: f64 = 1e6;

/// Every rule that `fault` breaks as one of `scenario`.
pub fn check(scenario: &Scenario, fault: &Fault, found: &mut Found) {
    check_sizes(fault, found);
    check_air(fault, &scenario.plant, found);
    surroundings::check(fault, scenario.run.mode, found);
    let (at_s, for_s) = (fault.at_s, fault.for_s.unwrap_or(0.0));
    found.require(
        (0.0..=LONGEST_S).contains(&at_s) && (0.0..=LONGEST_S).contains(&for_s),
        &["fault"],
        format!("a fault at {at_s:?} s for {for_s:?} s"),
        "`at_s` and `for_s` of 0 to 86400",
    );
    let kinds = fault.target.kinds();
    found.require(
        kinds.contains(&fault.kind),
        &["fault"],
        format!("{} cannot suffer {}", fault.target.name(), word(fault.kind)),
        &format!("{} has {}", fault.target.name(), kinds.iter().map(|kind| word(*kind)).collect::<Vec<_>>().join(", ")),
    );
    let hangs = matches!(fault.kind, FaultKind::Stop | FaultKind::Hog | FaultKind::Exit);
    found.require(
        !(fault.target == FaultTarget::Plant && hangs && scenario.run.mode != Mode::Realtime),
        &["fault", "run.mode"],
        format!("the plant cannot suffer {} where it is what makes time go on", word(fault.kind)),
        "`run.mode` = \"realtime\", or kill",
    );
    found.require(
        fault.target != FaultTarget::Mpc
            || scenario.mpc.law == Law::Mpc && scenario.mpc.constraints != Constraints::None,
        &["fault", "mpc.law", "mpc.constraints"],
        "a fault of the solver where nothing is solved".into(),
        "target \"mpc\" with `mpc.law` = \"mpc\" and `mpc.constraints` = \"box\" or \"cone\"",
    );
}

/// Every rule that the sizes of `fault` break, whatever the scenario: a size that means nothing to its kind, and one out of
/// its range.
pub fn check_sizes(fault: &Fault, found: &mut Found) {
    let keys = fault.keys();
    let what = format!("{} {}", fault.target.name(), word(fault.kind));
    for given in fault.given() {
        let uses = if keys.is_empty() { "none of the sizes".to_owned() } else { format!("`{}`", keys.join("` and `")) };
        found.require(
            keys.contains(&given),
            &["fault"],
            format!("a fault with a `{given}` that {what} has no use for"),
            &format!("without it; this one uses {uses}"),
        );
    }
    let vector = fault.vector.into_iter().flatten().map(|axis| ("vector", axis));
    let others = [
        ("ms", fault.ms),
        ("value", fault.value),
        ("probability", fault.probability),
        ("count", fault.count.map(|count| count as f64)),
    ];
    let sizes = others.into_iter().filter_map(|(key, size)| Some((key, size?))).chain(vector);
    for (key, size) in sizes {
        let (least, most) = range(fault, key);
        found.require(
            (least..=most).contains(&size),
            &["fault"],
            format!("{what} with `{key}` = {size:?}, which is out of range"),
            &format!("`{key}` of {least} to {most}"),
        );
    }
}

/// What a size of `fault` may be, in the unit of its key.
fn range(fault: &Fault, key: &str) -> (f64, f64) {
    use FaultKind as K;
    match (key, fault.kind) {
        ("ms", K::Offset) => (-LONGEST_MS, LONGEST_MS), // only a clock can be off either way
        ("ms", _) => (0.0, LONGEST_MS),
        ("probability", _) | ("value", K::Saturated) => (0.0, 1.0),
        ("count", K::Corrupt) => (1.0, MOST_BITS),
        ("count", _) => (1.0, MOST_MESSAGES),
        ("vector", _) => (-STRONGEST_WIND_MPS, STRONGEST_WIND_MPS),
        ("value", K::Mass) => (0.0, HEAVIEST_KG),
        ("value", K::Wrong) if fault.target == FaultTarget::Tilt => (-180.0, 180.0),
        ("value", K::Wrong) if fault.target.is_an_actuator() => (0.0, 2.0), // as `plant.rotor_effectiveness`
        ("value", K::Noise) => (0.0, LARGEST_ERROR),
        _ => (-LARGEST_ERROR, LARGEST_ERROR),
    }
}

/// Wind is felt through drag.
fn check_air(fault: &Fault, plant: &Plant, found: &mut Found) {
    found.require(
        fault.target != FaultTarget::Wind || plant.drag_quadratic_ns2pm2 > 0.0 || plant.drag_linear_nspm != [0.0; 3],
        &["fault", "plant.drag_linear_nspm", "plant.drag_quadratic_ns2pm2"],
        "a wind that a vehicle without drag does not feel".into(),
        "drag, for instance `plant.drag_linear_nspm` = [0.2, 0.2, 0.1]",
    );
}

/// A kind as the file spells it.
pub fn word(kind: FaultKind) -> String {
    Value::try_from(kind).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}
