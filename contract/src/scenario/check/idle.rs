//! Settings without effect. Each would make a flight look as if it had shown something that was never tried.
//!
//! A setting is idle if it differs from its default while its switch, another setting, leaves it unread. A switch that
//! is turned off by name (`false`, 0, `"none"`, an empty list) says that this is meant:
//! `plant.turbulence.wind_at_6m_mps=0` flies without turbulence, whatever else stands of it.
//!
//! | no switch | because |
//! |---|---|
//! | `run.mode`, `realtime.policy` | one file flies in every mode, on every machine |
//! | `mpc.law`, for what every law has a default of | swaps and campaigns exchange the law alone |
//! | `run.duration_s`, for mission and wind | a short flight is the beginning of a long one |
//!
//! A setting of a file that a layer above it switches off is dropped, not refused ([`drop_overridden`]).
//!
//! A fault or a swap that begins after the end is refused: it was asked for by itself.

use toml::{Table, Value};

use super::found::Found;
use crate::scenario::{Constraints, Filter, Law, Scenario, StateConstraints, TrajectoryKind};

/// Setting that decides if some others are read.
struct Switch {
    /// Dotted keys, of tables with all that is in them.
    settings: &'static [&'static str],
    key: &'static str,
    is_on: fn(&Scenario) -> bool,
    /// Value that turns it on, for people.
    on: &'static str,
}

const SWITCHES: [Switch; 12] = [
    Switch {
        settings: &["mission.waypoints_m", "mission.times_s"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory == TrajectoryKind::Waypoints,
        on: "\"waypoints\"",
    },
    Switch {
        settings: &["mission.step_m", "mission.step_at_s"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory == TrajectoryKind::Step,
        on: "\"step\"",
    },
    Switch {
        settings: &["mission.ramp_s"],
        key: "mission.trajectory",
        is_on: |scenario| matches!(scenario.mission.trajectory, TrajectoryKind::Survey | TrajectoryKind::Waypoints),
        on: "\"survey\" or \"waypoints\"",
    },
    Switch {
        settings: &["mission.radius_m", "mission.height_m", "mission.period_s", "mission.laps"],
        key: "mission.trajectory",
        is_on: |scenario| scenario.mission.trajectory == TrajectoryKind::Circle,
        on: "\"circle\"",
    },
    Switch { settings: &["mpc.r_rate"], key: "mpc.law", is_on: |scenario| scenario.mpc.law == Law::Mpc, on: "\"mpc\"" },
    Switch {
        settings: &["mpc.solver", "mpc.max_iterations", "mpc.time_limit_ms"],
        key: "mpc.constraints",
        is_on: |scenario| {
            scenario.mpc.constraints != Constraints::None || scenario.mpc.state_constraints == StateConstraints::Soft
        },
        on: "\"box\" or \"cone\"",
    },
    Switch {
        settings: &["mpc.state_penalty", "mpc.attitude_limit_deg", "mpc.rates_limit_dps"],
        key: "mpc.state_constraints",
        is_on: |scenario| scenario.mpc.state_constraints == StateConstraints::Soft,
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
        is_on: |scenario| scenario.plant.turbulence.wind_at_6m_mps > 0.0,
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
        settings: &["plant.sensors.filter_radps"],
        key: "plant.sensors.filter",
        is_on: |scenario| scenario.plant.sensors.filter == Filter::Complementary,
        on: "\"complementary\"",
    },
];

/// Finds every setting of `scenario` that is none of the `defaults` and that its switch leaves unread; `given` tells
/// which switches were turned off by name.
pub fn check(scenario: &Scenario, given: &Table, defaults: &Scenario, found: &mut Found) {
    let [settings, defaults] = [scenario, defaults].map(|of| Table::try_from(of).expect("it came from TOML"));
    let is_off = |switch: &&Switch| {
        !(switch.is_on)(scenario) && !at(given, switch.key).is_some_and(is_off_by_name) // and not on purpose
    };
    for switch in SWITCHES.iter().filter(is_off) {
        for key in switch.settings {
            let Some(idle) = changed(key, at(&settings, key), at(&defaults, key)) else { continue };
            found.require(
                false,
                &[&idle, switch.key],
                format!("`{idle}` has no effect here"),
                &format!("`{}` = {} with it, or leave it away", switch.key, switch.on),
            );
        }
    }
}

/// Drops from the settings `below` what a switch in those laid `above` them leaves unread: `--set mission.trajectory=hover`
/// takes away the waypoints of the file under it. `merge` makes a scenario of both; where it cannot, nothing is dropped.
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

/// Takes a dotted key out of a table.
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

/// Finds a fault or a swap, `what`, that begins on a tick after the last one of the flight.
pub fn check_begin(what: &str, at_s: f64, first_tick: u64, scenario: &Scenario, found: &mut Found) {
    let duration_s = scenario.run.duration_s;
    found.require(
        first_tick <= scenario.ticks(),
        &[what, "run.duration_s"],
        format!("a {what} at {at_s:?} s in a flight that ends at {duration_s:?} s"),
        &format!("`at_s` of at most {duration_s:?}, or a longer flight"),
    );
}

/// The value of a dotted key.
fn at<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    match key.split_once('.') {
        None => table.get(key),
        Some((first, rest)) => at(table.get(first)?.as_table()?, rest),
    }
}

/// Returns true if a switch with this value is off.
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

/// The first key at or below `key` whose value is not its default.
fn changed(key: &str, value: Option<&Value>, default: Option<&Value>) -> Option<String> {
    match (value, default) {
        (Some(Value::Table(values)), Some(Value::Table(defaults))) => {
            values.iter().find_map(|(name, value)| changed(&format!("{key}.{name}"), Some(value), defaults.get(name)))
        }
        _ => (value != default).then(|| key.to_owned()),
    }
}
