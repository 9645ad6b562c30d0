//! What one `[[fault]]` may be: written into the scenario, or given while the stack flies.

use toml::Value;

use super::{Found, surroundings};
use crate::scenario::{Constraints, Fault, FaultKind, FaultTarget, LONGEST_MS, LONGEST_S, Law, Mode, Plant, Scenario};

/// Every rule that `fault` breaks as one of `scenario`.
pub fn check(scenario: &Scenario, fault: &Fault, found: &mut Found) {
    check_size(fault, found);
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
        &format!(
            "{} suffers {}",
            fault.target.name(),
            kinds.iter().map(|kind| word(*kind)).collect::<Vec<_>>().join(", ")
        ),
    );
    let hangs = matches!(fault.kind, FaultKind::Stop | FaultKind::Hog | FaultKind::Exit);
    found.require(
        !(fault.target == FaultTarget::Plant && hangs && scenario.run.mode != Mode::Realtime),
        &["fault", "run.mode"],
        format!("the plant cannot suffer {} where it is what makes time go on", word(fault.kind)),
        "`run.mode` = \"realtime\", or kill",
    );
    let sizes = fault.vector.into_iter().flatten().chain(fault.value);
    let is_mass = fault.target == FaultTarget::Payload;
    found.require(
        sizes.clone().all(f64::is_finite) && !(is_mass && fault.value.is_some_and(|mass| mass < 0.0)),
        &["fault"],
        "a fault with a `value` or `vector` that cannot be".into(),
        "finite numbers; a mass of 0 or more",
    );
    found.require(
        fault.probability.is_none_or(|share| (0.0..=1.0).contains(&share)),
        &["fault"],
        "a fault with a `probability` that is none".into(),
        "0 to 1",
    );
    found.require(
        fault.ms.is_none_or(|ms| (least_ms(fault.kind)..=LONGEST_MS).contains(&ms)) && fault.count != Some(0),
        &["fault"],
        "a fault with a time or a count out of range".into(),
        "`ms` of 0 to 60000 (offset: from -60000), `count` of 1 or more",
    );
    found.require(
        fault.target != FaultTarget::Mpc
            || scenario.mpc.law == Law::Mpc && scenario.mpc.constraints != Constraints::None,
        &["fault", "mpc.law", "mpc.constraints"],
        "a fault of the solver where nothing is solved".into(),
        "target \"mpc\" with `mpc.law` = \"mpc\" and `mpc.constraints` = \"box\" or \"cone\"",
    );
}

/// Only a clock can be off either way.
fn least_ms(kind: FaultKind) -> f64 {
    if kind == FaultKind::Offset { -LONGEST_MS } else { 0.0 }
}

/// A fault has no size that means nothing to it.
fn check_size(fault: &Fault, found: &mut Found) {
    let keys = fault.keys();
    for given in fault.given() {
        let uses = if keys.is_empty() { "none of the sizes".to_owned() } else { format!("`{}`", keys.join("` and `")) };
        found.require(
            keys.contains(&given),
            &["fault"],
            format!("a fault with a `{given}` that {} {} has no use for", fault.target.name(), word(fault.kind)),
            &format!("without it; this one uses {uses}"),
        );
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
