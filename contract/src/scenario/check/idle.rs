//! Refuses settings without effect: with them a flight would seem to test something that it does not.
//!
//! A setting is idle if it differs from its default while another setting, its switch, is off, so that it is not read.
//! A switch that the scenario sets to off by name (`false`, 0, `"none"`, an empty list) shows that this is intended:
//! `plant.turbulence.wind_at_6m_mps=0` flies without turbulence, whatever its other settings are.
//!
//! | not a switch | because |
//! |---|---|
//! | `run.mode`, `realtime.policy` | one file flies in every mode, on every machine |
//! | `attitude.law`, for settings that have a default for every law | swaps and campaigns exchange the law alone |
//! | `run.duration_s`, for mission and wind | a short flight is the beginning of a long one |
//!
//! A setting that a layer above it switches off is dropped, not refused ([`drop_overridden`]).
//!
//! A fault or a swap that begins after the end of the flight is refused too.

use toml::{Table, Value};

use super::found::Found;
use crate::scenario::{
    Constraints, Filter, IndiActuators, Law, ProgramKind, Scenario, StateConstraints, TrajectoryKind,
};

/// Setting that decides whether others are read.
struct Switch {
    /// Dotted keys of the settings that the switch controls; the key of a table stands for all settings in it.
    settings: &'static [&'static str],
    key: &'static str,
    is_on: fn(&Scenario) -> bool,
    /// Value that turns the switch on, for people.
    on: &'static str,
}

const SWITCHES: [Switch; 18] = [
    Switch {
        settings: &["mission.ramp_s"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory == TrajectoryKind::Survey,
        on: "\"survey\"",
    },
    Switch {
        settings: &["mission.part", "mission.limits"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory == TrajectoryKind::Parts,
        on: "\"parts\"",
    },
    Switch {
        settings: &["mission.heading_deg"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory != TrajectoryKind::Parts,
        on: "a trajectory other than \"parts\", which have a `heading_deg` each,",
    },
    Switch {
        settings: &["attitude.mpc.r_rate"],
        key: "attitude.law",
        is_on: |scenario| scenario.attitude.law == Law::Mpc,
        on: "\"mpc\"",
    },
    Switch {
        settings: &["guidance.lead_s"],
        key: "guidance.acceleration_feedforward",
        is_on: |scenario| {
            let turns = scenario.mission.trajectory == TrajectoryKind::Parts;
            scenario.guidance.acceleration_feedforward || scenario.guidance.velocity_feedforward || turns
        },
        on: "true, or `guidance.velocity_feedforward`, or with a heading that turns,",
    },
    Switch {
        settings: &["guidance.preview_s"],
        key: "attitude.law",
        is_on: |scenario| {
            // A program may use it too.
            scenario.attitude.law == Law::Mpc || scenario.node.attitude_mpc.kind() != ProgramKind::Own
        },
        on: "\"mpc\"",
    },
    Switch {
        settings: &["attitude.disturbance_gain"],
        key: "attitude.law",
        is_on: |scenario| scenario.attitude.law != Law::Indi,
        on: "a law other than \"indi\"",
    },
    Switch {
        settings: &["plant.sensors.telemetry"],
        key: "attitude.indi.actuators",
        is_on: |scenario| {
            scenario.attitude.indi.actuators == IndiActuators::Sensed
                || scenario.node.attitude_mpc.kind() != ProgramKind::Own // which may use it
        },
        on: "\"sensed\"",
    },
    Switch {
        settings: &["attitude.mpc.solver", "attitude.mpc.max_iterations", "attitude.mpc.time_limit_ms"],
        key: "attitude.mpc.constraints",
        is_on: |scenario| {
            scenario.attitude.mpc.constraints != Constraints::None
                || scenario.attitude.mpc.state_constraints == StateConstraints::Soft
        },
        on: "\"box\" or \"cone\"",
    },
    Switch {
        settings: &["attitude.mpc.attitude_limit_deg", "attitude.mpc.rates_limit_dps"],
        key: "attitude.mpc.state_constraints",
        is_on: |scenario| scenario.attitude.mpc.state_constraints == StateConstraints::Soft,
        on: "\"soft\"",
    },
    Switch {
        settings: &["plant.ground"],
        key: "plant.ground.present",
        is_on: |scenario| scenario.plant.ground.present,
        on: "true",
    },
    Switch {
        settings: &["plant.turbulence"],
        key: "plant.turbulence.wind_at_6m_mps",
        is_on: |scenario| scenario.plant.turbulence.is_on(),
        on: "a wind above 0",
    },
    Switch {
        settings: &["plant.wind_roughness_m"],
        key: "plant.wind_ned_mps",
        is_on: |scenario| !scenario.plant.wind_ned_mps.is_empty(),
        on: "a wind",
    },
    Switch {
        settings: &["plant.battery"],
        key: "plant.battery.energy_wh",
        is_on: |scenario| scenario.plant.battery.energy_wh > 0.0,
        on: "an energy above 0",
    },
    Switch {
        settings: &[
            "plant.substep_s",
            "plant.tilt_reaction",
            "plant.rotor_effectiveness",
            "plant.wind_ned_mps",
            "plant.wind_roughness_m",
            "plant.turbulence",
            "plant.disturbance",
            "plant.airframe",
            "plant.rotor",
            "plant.battery",
            "plant.ground",
        ],
        key: "node.plant.exec",
        is_on: |scenario| scenario.node.plant.kind() != ProgramKind::Library,
        on: "\"\"",
    },
    Switch {
        settings: &[
            "plant.sensors.position",
            "plant.sensors.velocity",
            "plant.sensors.rates",
            "plant.sensors.imu",
            "plant.sensors.receiver",
            "plant.sensors.barometer",
            "plant.sensors.magnetometer",
            "plant.sensors.flow",
            "plant.sensors.alignment",
        ],
        key: "plant.sensors.filter",
        is_on: |scenario| scenario.plant.sensors.filter == Filter::Ekf,
        on: "\"ekf\"",
    },
    Switch {
        settings: &[
            "plant.sensors.alignment.position_m",
            "plant.sensors.alignment.velocity_mps",
            "plant.sensors.alignment.tilt_deg",
            "plant.sensors.alignment.heading_deg",
        ],
        key: "plant.sensors.alignment.standing_s",
        is_on: |scenario| scenario.plant.sensors.alignment.standing_s == 0.0,
        on: "0",
    },
    Switch {
        settings: &["plant.noise.attitude_deg"],
        key: "plant.sensors.filter",
        is_on: |scenario| scenario.plant.sensors.filter != Filter::Ekf,
        on: "\"none\"",
    },
];

/// Finds every setting of `scenario` that differs from the `defaults` while its switch is off. Switches that were
/// turned off by name in `given` are left out.
pub fn check(scenario: &Scenario, given: &Table, defaults: &Scenario, found: &mut Found) {
    let [settings, defaults] = [scenario, defaults].map(|of| Table::try_from(of).expect("it came from TOML"));
    let is_off = |switch: &&Switch| {
        !(switch.is_on)(scenario) && !at(given, switch.key).is_some_and(is_off_by_name) // not off on purpose
    };
    for switch in SWITCHES.iter().filter(is_off) {
        for key in switch.settings {
            let Some(idle) = changed(key, at(&settings, key), at(&defaults, key)) else { continue };
            found.require(
                false,
                &[&idle, switch.key],
                format!("`{idle}` has no effect here"),
                &format!("`{}` = {} with it, or remove it", switch.key, switch.on),
            );
        }
    }
}

/// Drops from the settings `below` those that a switch in the settings `above` turns off, for instance the parts of a
/// file under `--set mission.trajectory=hover`. `merge` makes a scenario of both; if it fails nothing is dropped.
pub fn drop_overridden(below: &mut Table, above: &Table, merge: impl Fn(Table, Table) -> Option<Scenario>) {
    if !SWITCHES.iter().any(|switch| at(above, switch.key).is_some()) {
        return;
    }
    let Some(scenario) = merge(below.clone(), above.clone()) else { return };
    for switch in SWITCHES.iter().filter(|switch| at(above, switch.key).is_some() && !(switch.is_on)(&scenario)) {
        for key in switch.settings.iter().filter(|key| at(above, key).is_none()) {
            remove(below, key);
        }
    }
}

/// Removes a dotted key from a table.
fn remove(table: &mut Table, key: &str) {
    match key.split_once('.') {
        None => _ = table.remove(key),
        Some((first, rest)) => {
            if let Some(Value::Table(inner)) = table.get_mut(first) {
                remove(inner, rest);
            }
        }
    }
}

/// Refuses a fault or a swap, `what`, that begins on a tick after the last one of the flight.
pub fn check_begin(what: &str, at_s: f64, first_tick: u64, scenario: &Scenario, found: &mut Found) {
    let duration_s = scenario.run.duration_s;
    found.require(
        first_tick <= scenario.ticks(),
        &[what, "run.duration_s"],
        format!("a {what} at {at_s:?} s in a flight that ends at {duration_s:?} s"),
        &format!("`at_s` of at most {duration_s:?}, or a longer flight"),
    );
}

/// Value of a dotted key.
fn at<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    match key.split_once('.') {
        None => table.get(key),
        Some((first, rest)) => at(table.get(first)?.as_table()?, rest),
    }
}

/// Returns whether a switch with this value is off.
fn is_off_by_name(value: &Value) -> bool {
    match value {
        Value::Boolean(is_on) => !is_on,
        Value::Integer(size) => *size == 0,
        Value::Float(size) => *size == 0.0,
        Value::String(word) => word == "none",
        Value::Array(all) => all.is_empty(),
        Value::Table(_) | Value::Datetime(_) => false,
    }
}

/// Finds the first key at or below `key` whose value is not its default.
fn changed(key: &str, value: Option<&Value>, default: Option<&Value>) -> Option<String> {
    match (value, default) {
        (Some(Value::Table(values)), Some(Value::Table(defaults))) => {
            values.iter().find_map(|(name, value)| changed(&format!("{key}.{name}"), Some(value), defaults.get(name)))
        }
        _ => (value != default).then(|| key.to_owned()),
    }
}
