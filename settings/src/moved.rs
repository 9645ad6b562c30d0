//! Names of earlier versions. Each is refused, with its replacement in the message; docs/names.md lists them. The first
//! release removes the table.

use NameKind::{Column, Command, Field, Key, Value};
use Replacement::{Gone, Name, Seconds};

/// Kind of a name that may have changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameKind {
    /// Setting of a scenario; or a table of settings, for every key in it without a row of its own.
    Key,
    /// Value of a setting, `key = "word"`.
    Value,
    /// Command, or option of a command.
    Command,
    /// Column of a campaign's table of flights.
    Column,
    /// Field of run.json.
    Field,
}

/// Replacement of a name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Replacement {
    /// New name of the same key, value, command, column or field.
    Name(&'static str),
    /// New key, in seconds where the old key was in samples.
    Seconds(&'static str),
    /// No replacement; the text says what to do instead.
    Gone(&'static str),
}

/// Old names: kind, name and replacement.
pub const MOVED: &[(NameKind, &str, Replacement)] = &[
    (Key, "mission.waypoints_m", Gone(WAYPOINTS)),
    (Key, "mission.times_s", Gone(WAYPOINTS)),
    (Key, "mission.radius_m", Gone(CIRCLE)),
    (Key, "mission.height_m", Gone(CIRCLE)),
    (Key, "mission.period_s", Gone(CIRCLE)),
    (Key, "mission.laps", Gone(CIRCLE)),
    (Key, "mission.step_m", Gone(STEP)),
    (Key, "mission.step_at_s", Gone(STEP)),
    (Value, "mission.trajectory = \"waypoints\"", Gone(WAYPOINTS)),
    (Value, "mission.trajectory = \"circle\"", Gone(CIRCLE)),
    (Value, "mission.trajectory = \"step\"", Gone(STEP)),
    (Value, "mission.ramp_s = \"spline\"", Gone("it is a part: kind = \"waypoints\", curve = \"spline\"")),
    (Value, "mission.heading_deg = [[15.0, 90.0]]", Gone("a part has `heading_deg` = [[t_s, deg], ...]")),
    (Key, "mpc", Name("attitude.mpc")),
    (Key, "mpc.law", Name("attitude.law")),
    (Key, "mpc.actuator_lag_model_s", Name("attitude.actuator_lag_model_s")),
    (Key, "mpc.servo_lag_model_s", Name("attitude.servo_lag_model_s")),
    (Key, "mpc.delay_compensation", Name("attitude.delay_compensation")),
    (Key, "mpc.disturbance_gain", Name("attitude.disturbance_gain")),
    (Key, "mpc.pid", Name("attitude.pid")),
    (Key, "mpc.geometric", Name("attitude.geometric")),
    (Key, "mpc.indi", Name("attitude.indi")),
    (Key, "mpc.np", Seconds("attitude.mpc.prediction_horizon_s")),
    (Key, "mpc.nu", Seconds("attitude.mpc.control_horizon_s")),
    (Value, "attitude.mpc.model = \"ltv\"", Gone("\"coupled\" or \"scheduled\" take its place, see docs/tried.md")),
    (Key, "realtime.plant", Name("node.plant")),
    (Key, "realtime.guidance", Name("node.guidance")),
    (Key, "realtime.attitude-mpc", Name("node.attitude-mpc")),
    (Key, "realtime.mixer", Name("node.mixer")),
    (Key, "deadline.plant_ms", Name("node.plant.deadline_ms")),
    (Key, "deadline.guidance_ms", Name("node.guidance.deadline_ms")),
    (Key, "deadline.attitude_mpc_ms", Name("node.attitude-mpc.deadline_ms")),
    (Key, "deadline.mixer_ms", Name("node.mixer.deadline_ms")),
    (Key, "node.plant.sha256", Gone("the hash of the program stands in `node.plant.files`")),
    (Key, "node.guidance.sha256", Gone("the hash of the program stands in `node.guidance.files`")),
    (Key, "node.attitude-mpc.sha256", Gone("the hash of the program stands in `node.attitude-mpc.files`")),
    (Key, "node.mixer.sha256", Gone("the hash of the program stands in `node.mixer.files`")),
    (Key, "node.plant.lock_memory", Name("realtime.lock_memory")),
    (Key, "node.plant.rttime_ms", Name("realtime.rttime_ms")),
    (Key, "node.guidance.lock_memory", Name("realtime.lock_memory")),
    (Key, "node.guidance.rttime_ms", Name("realtime.rttime_ms")),
    (Key, "node.attitude-mpc.lock_memory", Name("realtime.lock_memory")),
    (Key, "node.attitude-mpc.rttime_ms", Name("realtime.rttime_ms")),
    (Key, "node.mixer.lock_memory", Name("realtime.lock_memory")),
    (Key, "node.mixer.rttime_ms", Name("realtime.rttime_ms")),
    (Key, "deadline.policy", Name("deadline.late")),
    (Key, "deadline.plant_policy", Name("node.plant.late")),
    (Key, "deadline.guidance_policy", Name("node.guidance.late")),
    (Key, "deadline.attitude_mpc_policy", Name("node.attitude-mpc.late")),
    (Key, "deadline.mixer_policy", Name("node.mixer.late")),
    (Key, "plant.sensors.attitude", Gone("no sensor of the EKF measures it; without one `plant.noise` is the error")),
    (
        Key,
        "plant.sensors.filter_radps",
        Gone("the complementary filter has left; set `plant.sensors.filter` = \"ekf\""),
    ),
    (Value, "plant.sensors.filter = \"complementary\"", Gone("set \"ekf\"; without it the errors are `plant.noise`")),
    (Key, "plant.sensors.position.latency_ms", Name("plant.sensors.receiver.latency_ms")),
    (Key, "plant.sensors.velocity.latency_ms", Name("plant.sensors.receiver.latency_ms")),
    (Key, "plant.sensors.velocity.bias", Gone(VELOCITY)),
    (Key, "plant.sensors.velocity.bias_s", Gone(VELOCITY)),
    (Key, "plant.sensors.velocity.bias_walk", Gone(VELOCITY)),
    (Key, "plant.ground.stiffness_npm", Gone(FEET)),
    (Key, "plant.ground.damping_nspm", Gone(FEET)),
    (Key, "plant.ground.max_drift_mps", Gone("a touchdown faster than 1 m/s along the ground is a crash")),
    (Key, "plant.ground.max_tilt_deg", Gone("a touchdown that leans by more than 20 deg is a crash")),
    (Key, "plant.ground.max_slide_m", Gone("a vehicle that slides by more than 1 m has not landed")),
    (
        Key,
        "attitude.mpc.state_penalty",
        Gone("it is 1e4; `attitude_limit_deg` and `rates_limit_dps` say what is limited"),
    ),
    (Key, "supervision.hang_ticks", Gone("it is 3 samples; `supervision.hang_ms` is the time")),
    (Key, "supervision.window_s", Gone("it is 5 s; `supervision.restart_ms` says how often a node is restarted in it")),
    (Key, "supervision.detect_ms", Gone("it is 2 ms, as in real time")),
    (Key, "bounds.max_altitude_error_horizontal_m", Name("bounds.max_altitude_error_m")),
    (Key, "bounds.max_altitude_error_vertical_m", Name("bounds.max_altitude_error_m")),
    (Value, "fault.target = \"solver\"", Name("fault.target = \"mpc\"")),
    (Value, "fault.kind = \"second-publisher\"", Gone(A_TEST)),
    (Value, "fault.kind = \"wrong-layout\"", Gone(A_TEST)),
    (Value, "fault.kind = \"wrong-user\"", Gone(A_TEST)),
    (Value, "fault.kind = \"shm-removed\"", Gone(A_TEST)),
    (Key, "swap.shadow_s", Name("swap.standby_s")),
    (Key, "swap.bounds.accord", Name("swap.bounds.similarity")),
    (Value, "swap.node = \"recorder\"", Gone(NO_RECORDER)),
    (Command, "swap recorder", Gone(NO_RECORDER)),
    (Command, "swap --shadow", Name("swap --standby")),
    (
        Command,
        "compare --align",
        Gone("the pages of the flights tell their times; an equal `at_s` puts faults at equal times"),
    ),
    (Command, "trace", Name("export --to perfetto --worst")),
    (Command, "export fmu", Name("export --to fmu")),
    (Command, "measure laws", Name("campaign aggressive")),
    (Command, "measure conditions", Gone("fly the campaigns conditions and conditions-estimated")),
    (Command, "measure sensitivity", Name("campaign delay-limit")),
    (Command, "measure mpc --compare", Gone(OTHER_SOLVERS)),
    (Command, "measure mpc --export", Gone(OTHER_SOLVERS)),
    (Command, "measure navigation --faults", Name("campaign sensor-faults")),
    (Command, "measure navigation", Name("measure mpc")),
    (Command, "measure kills", Name("measure stress")),
    (Command, "measure replay", Name("measure stress")),
    (Command, "measure timing --survey-s", Name("measure timing --survey")),
    (Column, "max_altitude_error_horizontal_m", Name("max_altitude_error_m")),
    (Column, "max_altitude_error_vertical_m", Name("max_altitude_error_m")),
    (Field, "metrics.max_altitude_error_horizontal_m", Name("metrics.max_altitude_error_m")),
    (Field, "metrics.max_altitude_error_vertical_m", Name("metrics.max_altitude_error_m")),
    (Field, "but", Name("reservations")),
];

/// Parts that take the places of the old trajectories.
const WAYPOINTS: &str = "waypoints are a part, from the end of the part before on: [[mission.part]] kind = \"waypoints\", \
    curve, points_m, times_s since its beginning";
const CIRCLE: &str = "a circle is three parts: kind = \"takeoff\" with height_m and duration_s, \"circle\" with radius_m, \
    period_s and laps, and \"waypoints\" down";
const STEP: &str = "a step is two parts: kind = \"loiter\" with duration_s, and \"jump\" with point_m and duration_s";
const VELOCITY: &str =
    "the velocity of a receiver has no bias; a fault has one: target = \"velocity\", kind = \"wrong\"";
const FEET: &str = "feet are as stiff as a vehicle of `airframe.mass_kg` needs them";
const NO_RECORDER: &str = "a recorder is not swapped; kill it, and another continues the log";
const OTHER_SOLVERS: &str = "other solvers have lost, docs/tried.md has the commit that compares them";
const A_TEST: &str = "it tests the stack and no controller, and is a test, tests/isolation.rs";

/// Old name that was used, with its replacement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Moved {
    /// Refusal, in words.
    pub title: String,
    /// New name, if there is one.
    pub name: Option<String>,
    /// Replacement in the table.
    pub now: Replacement,
}

/// Finds the replacement of `name`; `None` if `name` is no old name. If several rows match a key, the longest old name
/// counts.
pub fn find(kind: NameKind, name: &str) -> Option<Moved> {
    let rest =
        |old: &str| name.strip_prefix(old).filter(|rest| rest.is_empty() || kind == Key && rest.starts_with('.'));
    let rows = MOVED.iter().filter(|(of, old, _)| *of == kind && rest(old).is_some());
    let (_, old, now) = rows.max_by_key(|(_, old, _)| old.len())?;
    let new = |new: &str| format!("{new}{}", rest(old).unwrap_or_default());
    let (name, title) = match *now {
        Name(key) => (Some(new(key)), format!("`{name}` is `{}` now", new(key))),
        Seconds(key) => (Some(new(key)), format!("`{name}` is `{}` now, in seconds", new(key))),
        Gone(words) => (None, format!("there is no `{name}` any more: {words}")),
    };
    Some(Moved { title, name, now: *now })
}

/// Finds the old name that Serde has refused at `key`: by the text `given` there, or by `message`, Serde's error for an
/// unknown field or variant. `key` may name a list of tables.
pub(super) fn refused(key: &str, given: &str, message: &str) -> Option<Moved> {
    let find_by = |is_it: &dyn Fn(&str) -> bool| {
        let (kind, old, _) = MOVED.iter().find(|(kind, old, _)| matches!(kind, Key | Value) && is_it(old))?;
        find(*kind, old)
    };
    let whole = format!("{key} = {}", given.replace('\'', "\""));
    let is_list = |of: &str| of.starts_with(&format!("{key} = ["));
    if let Some(moved) = find_by(&|old| old == whole || is_list(old) && is_list(&whole)) {
        return Some(moved);
    }
    let (_, word) = message.split_once("unknown ")?;
    let word = word.split('`').nth(1)?;
    let ends = [format!(".{word}"), format!(" = {word:?}")];
    find_by(&|old| old.starts_with(key) && ends.iter().any(|end| old.ends_with(end.as_str())))
}

/// Returns whether old keys were in the table `key`.
pub(super) fn were_in(key: &str) -> bool {
    MOVED.iter().any(|(kind, old, _)| *kind == Key && (*old == key || old.starts_with(&format!("{key}."))))
}
