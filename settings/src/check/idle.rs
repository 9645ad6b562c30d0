//! Refuses settings without effect, because a flight would seem to test them.
//!
//! A setting is idle if its value differs from the default while another setting, its switch, is off: no code then
//! reads the idle setting.
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

use On::{Has, If, Is, IsNot};

use crate::check::found::Found;
use crate::table::control::{IndiActuators, Law};
use crate::table::mission::TrajectoryKind;
use crate::table::program::ProgramKind;
use crate::table::run::Scenario;
use crate::words::at;

/// Dotted keys of settings, the key of the switch that decides whether they are read, and the condition under which the
/// switch is on. The key of a table stands for all settings in the table.
type Switch = (&'static [&'static str], &'static str, On);

/// Condition under which a switch is on. Its text describes, for messages, the value that turns the switch on.
enum On {
    /// Requires this word.
    Is(&'static str),
    /// Requires any word except the first.
    IsNot(&'static str, &'static str),
    /// Requires a value that is not off by name.
    Has(&'static str),
    /// Depends on other settings too.
    If(fn(&Scenario) -> bool, &'static str),
}

const SWITCHES: [Switch; 19] = [
    (&["mission.ramp_s"], "mission.trajectory", Is("survey")),
    (&["mission.part", "mission.limits"], "mission.trajectory", Is("parts")),
    (
        &["mission.heading_deg"],
        "mission.trajectory",
        IsNot("parts", "a trajectory other than \"parts\", which have a `heading_deg` each,"),
    ),
    (&["attitude.mpc.r_rate"], "attitude.law", Is("mpc")),
    (
        &["attitude.mpc.model"],
        "attitude.law",
        If(|scenario| matches!(scenario.attitude.law, Law::Mpc | Law::Lqr), "\"mpc\", or \"lqr\" with \"coupled\","),
    ),
    (
        &["guidance.lead_s"],
        "guidance.acceleration_feedforward",
        If(has_lead, "true, or `guidance.velocity_feedforward`, or with a heading that turns,"),
    ),
    (
        &["guidance.preview_s"],
        "attitude.law",
        If(|scenario| scenario.attitude.law == Law::Mpc || has_own_controller(scenario), "\"mpc\""),
    ),
    (&["attitude.disturbance_gain"], "attitude.law", IsNot("indi", "a law other than \"indi\"")),
    (
        &["plant.sensors.telemetry"],
        "attitude.indi.actuators",
        If(
            |scenario| scenario.attitude.indi.actuators == IndiActuators::Sensed || has_own_controller(scenario),
            "\"sensed\"",
        ),
    ),
    (
        &[
            "attitude.mpc.solver",
            "attitude.mpc.max_iterations",
            "attitude.mpc.time_limit_ms",
            "attitude.mpc.state_constraints",
        ],
        "attitude.mpc.constraints",
        IsNot("none", "\"box\" or \"cone\""),
    ),
    (
        &["attitude.mpc.attitude_limit_deg", "attitude.mpc.rates_limit_dps"],
        "attitude.mpc.state_constraints",
        Is("soft"),
    ),
    (&["plant.ground"], "plant.ground.present", Has("true")),
    (
        &["plant.turbulence"],
        "plant.turbulence.wind_at_6m_mps",
        If(|scenario| scenario.plant.turbulence.is_on(), "a wind above 0"),
    ),
    (&["plant.wind_roughness_m"], "plant.wind_ned_mps", Has("a wind")),
    (&["plant.battery"], "plant.battery.energy_wh", Has("an energy above 0")),
    (
        &[
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
        "node.plant.exec",
        If(|scenario| scenario.node.plant.kind() != ProgramKind::Library, "\"\""),
    ),
    (
        &[
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
        "plant.sensors.filter",
        Is("ekf"),
    ),
    (
        &[
            "plant.sensors.alignment.position_m",
            "plant.sensors.alignment.velocity_mps",
            "plant.sensors.alignment.tilt_deg",
            "plant.sensors.alignment.heading_deg",
        ],
        "plant.sensors.alignment.standing_s",
        If(|scenario| scenario.plant.sensors.alignment.standing_s == 0.0, "0"),
    ),
    (&["plant.noise.attitude_deg"], "plant.sensors.filter", IsNot("ekf", "\"none\"")),
];

/// Returns whether there is a feed-forward or a heading that turns, to which a lead applies.
fn has_lead(scenario: &Scenario) -> bool {
    let turns = scenario.mission.trajectory == TrajectoryKind::Parts;
    scenario.guidance.acceleration_feedforward || scenario.guidance.velocity_feedforward || turns
}

/// Returns whether attitude-mpc is a library or program of the user, which may use any setting.
fn has_own_controller(scenario: &Scenario) -> bool {
    scenario.node.attitude_mpc.kind() != ProgramKind::Own
}

impl On {
    /// Returns whether a switch with this `value` is on.
    fn holds(&self, value: Option<&Value>, scenario: &Scenario) -> bool {
        match self {
            Is(word) => value.and_then(Value::as_str) == Some(word),
            IsNot(word, _) => value.and_then(Value::as_str) != Some(word),
            Has(_) => !value.is_none_or(is_off_by_name),
            If(holds, _) => holds(scenario),
        }
    }

    /// Describes the value that turns the switch on, for messages.
    fn words(&self) -> String {
        match self {
            Is(word) => format!("{word:?}"),
            IsNot(_, words) | Has(words) | If(_, words) => (*words).to_owned(),
        }
    }
}

/// Finds every setting of `scenario` that differs from the `defaults` while its switch is off. Switches that were
/// turned off by name in `given` are left out.
pub fn check(scenario: &Scenario, given: &Table, defaults: &Scenario, found: &mut Found) {
    let [settings, defaults] = [scenario, defaults].map(|of| Table::try_from(of).expect("it came from TOML"));
    for (keys, switch, on) in &SWITCHES {
        let is_intended = at(given, switch).is_some_and(is_off_by_name);
        if on.holds(at(&settings, switch), scenario) || is_intended {
            continue;
        }
        for key in *keys {
            let Some(idle) = changed(key, at(&settings, key), at(&defaults, key)) else { continue };
            found.require(
                false,
                &[&idle, switch],
                format!("`{idle}` has no effect here"),
                &format!("`{switch}` = {} with it, or remove it", on.words()),
            );
        }
    }
}

/// Drops from the settings `below` those that a switch in the settings `above` turns off, for instance the parts of a
/// file under `--set mission.trajectory=hover`. `merge` makes a scenario of both; if it fails nothing is dropped.
pub fn drop_overridden(below: &mut Table, above: &Table, merge: impl Fn(Table, Table) -> Option<Scenario>) {
    let given: Vec<&Switch> = SWITCHES.iter().filter(|(_, switch, _)| at(above, switch).is_some()).collect();
    if given.is_empty() {
        return;
    }
    let Some(scenario) = merge(below.clone(), above.clone()) else { return };
    let settings = Table::try_from(&scenario).expect("it came from TOML");
    for (keys, switch, on) in given {
        if !on.holds(at(&settings, switch), &scenario) {
            keys.iter().filter(|key| at(above, key).is_none()).for_each(|key| remove(below, key));
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

/// Refuses a fault or a swap, `what`, that begins after the last tick of the flight.
pub fn check_begin(what: &str, at_s: f64, first_tick: u64, scenario: &Scenario, found: &mut Found) {
    let duration_s = scenario.run.duration_s;
    found.require(
        first_tick <= scenario.ticks(),
        &[what, "run.duration_s"],
        format!("a {what} at {at_s:?} s in a flight that ends at {duration_s:?} s"),
        &format!("`at_s` of at most {duration_s:?}, or a longer flight"),
    );
}

/// Returns whether `value` turns a switch off by name: `false`, 0, `"none"` or an empty list.
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
