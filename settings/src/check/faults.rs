//! Checks of one `[[fault]]`, written into the scenario or given in flight.

use crate::check::found::Found;
use crate::check::idle;
use crate::fault_schedule::MAX_SENSOR_DELAY_TICKS;
use crate::table::control::{Constraints, Law};
use crate::table::fault::{Fault, FaultKind, FaultTarget, MAX_FAULT_MS, MAX_FAULT_S};
use crate::table::program::ProgramKind;
use crate::table::run::{Mode, Scenario};
use crate::table::sensors::{FilterName, SensorsSettings};
use crate::table::vehicle::PlantSettings;
use crate::words::word;

/// Largest number of bits flipped in a corrupt message: more than any message has.
const MAX_BITS: f64 = 10_000.0;
/// Largest number of messages that a burst loses, or of which one passes (`rate`).
const MAX_MESSAGES: f64 = 1e6;
/// Largest wind along one axis \[m/s\]: beyond any storm.
const MAX_WIND_MPS: f64 = 200.0;
/// Largest payload \[kg\]: a thousand times the vehicle's mass.
const MAX_PAYLOAD_KG: f64 = 1000.0;
/// Largest bias, factor or deviation of a measurement or demand, in its unit.
const MAX_ERROR: f64 = 1e6;

/// Finds every rule that `fault` breaks as a fault of `scenario`.
pub fn check(scenario: &Scenario, fault: &Fault, found: &mut Found) {
    check_sizes(fault, found);
    let keys = ["fault", "plant.drag_linear_nspm", "plant.drag_quadratic_ns2pm2"];
    check_air(fault.target == FaultTarget::Wind, &keys, &scenario.plant, found);
    check_vehicle(fault, scenario, found);
    check_unit(fault, &scenario.plant.sensors, found);
    check_imu(fault, &scenario.plant.sensors, found);
    let delay_ms = MAX_SENSOR_DELAY_TICKS as f64 * scenario.sample_s() * 1e3;
    found.require(
        fault.kind != FaultKind::Delayed || fault.ms.is_none_or(|ms| ms <= delay_ms),
        &["fault", "run.rate_hz"],
        "a delay of a sensor longer than the plant stores".into(),
        &format!("`ms` of 0 to {delay_ms}, {MAX_SENSOR_DELAY_TICKS} samples"),
    );
    check_surroundings(fault, scenario.run.mode, found);
    let (at_s, for_s) = (fault.at_s, fault.for_s.unwrap_or(0.0));
    found.require(
        (0.0..=MAX_FAULT_S).contains(&at_s) && (0.0..=MAX_FAULT_S).contains(&for_s),
        &["fault"],
        format!("a fault at {at_s:?} s for {for_s:?} s"),
        "`at_s` and `for_s` of 0 to 86400",
    );
    idle::check_begin("fault", at_s, fault.ticks(scenario.sample_s()).start, scenario, found);
    let kinds = fault.target.kinds();
    found.require(
        kinds.contains(&fault.kind),
        &["fault"],
        format!("{} cannot have {}", fault.target.name(), word(fault.kind)),
        &format!("{} has {}", fault.target.name(), kinds.iter().map(|kind| word(*kind)).collect::<Vec<_>>().join(", ")),
    );
    let hangs = matches!(fault.kind, FaultKind::Stop | FaultKind::Hog | FaultKind::Exit);
    found.require(
        !(fault.target == FaultTarget::Plant && hangs && scenario.run.mode != Mode::Realtime),
        &["fault", "run.mode"],
        format!("the plant cannot have {} where it is what makes time go on", word(fault.kind)),
        "`run.mode` = \"realtime\", or kill",
    );
    found.require(
        fault.target != FaultTarget::Mpc
            || scenario.attitude.law == Law::Mpc && scenario.attitude.mpc.constraints != Constraints::None,
        &["fault", "attitude.law", "attitude.mpc.constraints"],
        "a fault of the solver where nothing is solved".into(),
        "target \"mpc\" with `attitude.law` = \"mpc\" and `attitude.mpc.constraints` = \"box\" or \"cone\"",
    );
}

/// Finds every rule that the sizes of `fault` break in any scenario: sizes that its kind does not use, and sizes out of
/// range.
pub fn check_sizes(fault: &Fault, found: &mut Found) {
    let has_form = toml::Table::try_from(fault).is_ok();
    found.require(has_form, &["fault"], "a fault with a number that no file can hold".into(), "numbers below 2^63");
    let keys = fault.keys();
    let what = format!("{} {}", fault.target.name(), word(fault.kind));
    for given in fault.given() {
        let uses = if keys.is_empty() { "none of the sizes".to_owned() } else { format!("`{}`", keys.join("` and `")) };
        found.require(
            keys.contains(&given.as_str()),
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

/// Range of a size of `fault`, in the unit of its key.
fn range(fault: &Fault, key: &str) -> (f64, f64) {
    use FaultKind as K;
    match (key, fault.kind) {
        ("ms", K::Offset) => (-MAX_FAULT_MS, MAX_FAULT_MS), // only the offset of a clock can be negative
        ("ms", _) => (0.0, MAX_FAULT_MS),
        ("probability", _) | ("value", K::Saturated) => (0.0, 1.0),
        ("count", K::Corrupt) => (1.0, MAX_BITS),
        ("count", _) => (1.0, MAX_MESSAGES),
        ("vector", _) => (-MAX_WIND_MPS, MAX_WIND_MPS),
        ("value", K::Mass) => (0.0, MAX_PAYLOAD_KG),
        ("value", K::Wrong | K::Stuck) if fault.target == FaultTarget::Tilt => (-180.0, 180.0),
        ("value", K::Wrong) if fault.target.is_an_actuator() => (0.0, 2.0), // the range of `plant.rotor_effectiveness`
        ("value", K::Noise) => (0.0, MAX_ERROR),
        _ => (-MAX_ERROR, MAX_ERROR),
    }
}

/// Requires a vehicle with drag or another effect of air if a wind `blows`.
pub fn check_air(blows: bool, keys: &[&str], plant: &PlantSettings, found: &mut Found) {
    found.require(
        !blows || plant.feels_air(),
        keys,
        "a wind that a vehicle without drag does not feel".into(),
        "drag, for instance `plant.drag_linear_nspm` = [0.2, 0.2, 0.1]",
    );
}

/// Requires the launcher's own vehicle for a fault of actuators, wind or payload: no fault reaches into a library.
fn check_vehicle(fault: &Fault, scenario: &Scenario, found: &mut Found) {
    let is_of_vehicle =
        fault.target.is_an_actuator() || matches!(fault.target, FaultTarget::Wind | FaultTarget::Payload);
    found.require(
        !is_of_vehicle || scenario.node.plant.kind() != ProgramKind::Library,
        &["fault", "node.plant.exec"],
        format!("a fault of {} where the plant is a library", fault.target.name()),
        "faults of sensors, topics and processes, or `node.plant.exec` = \"\"",
    );
}

/// Requires that the faulty sensor exists: height, flow, field and acceleration have sensors only with the EKF, the
/// attitude only without.
fn check_unit(fault: &Fault, sensors: &SensorsSettings, found: &mut Found) {
    let (is_there, key) = match fault.target {
        FaultTarget::Height => (sensors.barometer.rate_hz > 0.0, "plant.sensors.barometer.rate_hz"),
        FaultTarget::Flow => (sensors.flow.rate_hz > 0.0, "plant.sensors.flow.rate_hz"),
        FaultTarget::Field => (sensors.magnetometer.rate_hz > 0.0, "plant.sensors.magnetometer.rate_hz"),
        FaultTarget::Acceleration => (true, "plant.sensors.filter"),
        FaultTarget::Attitude => {
            return found.require(
                sensors.filter != FilterName::Ekf,
                &["fault", "plant.sensors.filter"],
                "a fault of attitude, which the EKF estimates and no sensor measures".into(),
                "`target` = \"field\", the magnetometer's, or \"rates\", the gyros'",
            );
        }
        _ => return,
    };
    let name = fault.target.name();
    found.require(
        sensors.filter == FilterName::Ekf,
        &["fault", "plant.sensors.filter"],
        format!("a fault of {name} where no sensor measures it"),
        "`plant.sensors.filter` = \"ekf\", or a `plant.sensors.preset` with it",
    );
    found.require(
        is_there || sensors.filter != FilterName::Ekf,
        &["fault", key],
        format!("a fault of {name} where no sensor measures it"),
        &format!("`{key}` above 0"),
    );
}

/// Requires that the faulty IMU exists.
fn check_imu(fault: &Fault, sensors: &SensorsSettings, found: &mut Found) {
    let Some(imu) = fault.imu else { return };
    let is_of_one = matches!(fault.target, FaultTarget::Rates | FaultTarget::Acceleration);
    let count = if sensors.filter == FilterName::Ekf { sensors.imu.count } else { 0 };
    found.require(
        is_of_one && (1..=count as u64).contains(&imu),
        &["fault", "plant.sensors.imu.count"],
        format!("a fault of IMU {imu} where {} has {count}", if is_of_one { "the unit" } else { fault.target.name() }),
        "`imu` of 1 to `plant.sensors.imu.count`, with a fault of rates or acceleration",
    );
}

/// Checks faults of clock and host: only an offset names a process, and needs a mode with processes; a fault of the
/// host has no end.
fn check_surroundings(fault: &Fault, mode: Mode, found: &mut Found) {
    let of_one = fault.kind == FaultKind::Offset;
    let named = fault.process.is_some_and(|target| target.process().is_some());
    found.require(
        fault.process.is_some() == of_one && (named || !of_one),
        &["fault"],
        if of_one {
            format!("{} without the name of a process that has it", word(fault.kind))
        } else {
            format!("{} with a `process`", word(fault.kind))
        },
        "`process`, the name of a node, with offset, and with no other",
    );
    found.require(
        !of_one || mode != Mode::Inprocess || !fault.target.kinds().contains(&fault.kind),
        &["fault", "run.mode"],
        format!("{} in mode inprocess, which has no clock", word(fault.kind)),
        "`run.mode` = \"realtime\" or \"lockstep\"",
    );
    found.require(
        fault.target != FaultTarget::Host || fault.for_s.is_none(),
        &["fault"],
        format!("{} with an end", word(fault.kind)),
        "no `for_s`: a log that has failed once is closed",
    );
}
