//! Allowed range of every single number.

use std::ops::Bound::{self, Excluded, Included, Unbounded};
use std::ops::RangeBounds;
use std::sync::LazyLock;

use toml::Value;

use crate::check::found::Found;

/// Lowest and highest value.
pub type AllowedRange = (Bound<f64>, Bound<f64>);
/// Largest magnitude of any setting: a larger number means nothing to a vehicle, and computations with it may overflow.
const MAX: f64 = 1e9;
const ANY: AllowedRange = (Included(-MAX), Included(MAX));
/// Range of a bound on a metric; an infinite bound is lifted.
const LIFTED: AllowedRange = (Excluded(0.0), Unbounded);
const POSITIVE: AllowedRange = (Included(1e-9), Included(MAX));
const NOT_NEGATIVE: AllowedRange = (Included(0.0), Included(MAX));
/// Longest horizon of the MPC \[samples\].
pub const MAX_HORIZON: usize = 200;
/// Shortest integration step \[s\]: the longest sample then has 2000 steps.
const MIN_STEP_S: f64 = 1e-5;
const MASS: AllowedRange = (Included(1e-4), Included(1e6));
const LATENCY_MS: AllowedRange = (Included(0.0), Included(500.0));
const INERTIA: AllowedRange = (Included(1e-9), Included(1e6));
const ARM: AllowedRange = (Included(1e-3), Included(1e3));
const ROTOR_CONSTANT: AllowedRange = (Included(1e-12), Included(1e3));
/// Range of a node's priority, out of 1 to 99 in `SCHED_FIFO`: the nodes downstream of the plant add up to 3, and the
/// highest belong to the kernel.
const PRIORITY: AllowedRange = (Included(1.0), Included(95.0));
/// Horizons from one sample at the highest rate to [`MAX_HORIZON`] samples at the lowest.
const HORIZON_S: AllowedRange = (Included(1.0 / 2000.0), Included(MAX_HORIZON as f64 / 50.0));
/// Longest flight \[s\].
pub const DAY_S: f64 = 86_400.0;
const TIME_S: AllowedRange = (Included(0.0), Included(DAY_S));
const DURATION_S: AllowedRange = (Included(0.1), Included(DAY_S));
/// Distance from the origin on any axis beyond which the plant ends a flight \[m\].
pub const SPACE_M: f64 = 500.0;
const POSITION_M: AllowedRange = (Included(-SPACE_M), Included(SPACE_M));
const CPU: AllowedRange = (Included(0.0), Included(1023.0));

/// Allowed range of each number under a key, in which `*` is any name; arrays are checked element by element, tables
/// key by key. Check, schema and reference pages take their ranges from here; the ranges of a fault depend on its kind,
/// and are in the check of faults.
const RANGES: &[(&str, AllowedRange)] = &[
    ("mission.heading_deg", ANY),
    ("initial", ANY),
    ("plant", ANY),
    ("guidance", ANY),
    ("airframe.g_mps2", (Included(0.01), Included(1000.0))),
    ("airframe.mass_kg", MASS),
    ("airframe.ixx_kgm2", INERTIA),
    ("airframe.iyy_kgm2", INERTIA),
    ("airframe.izz_kgm2", INERTIA),
    ("airframe.l1_m", ARM),
    ("airframe.l2_m", ARM),
    ("airframe.l3_m", ARM),
    ("airframe.kf", ROTOR_CONSTANT),
    ("airframe.km", ROTOR_CONSTANT),
    ("run.duration_s", (Included(0.01), Included(DAY_S))),
    ("run.rate_hz", (Included(50.0), Included(2000.0))),
    ("run.command_delay_ms", (Included(0.0), Included(1000.0))),
    ("run.command_jitter_ms", (Included(0.0), Included(1000.0))),
    ("run.command_drop_probability", (Included(0.0), Included(1.0))),
    ("mission.ramp_s", NOT_NEGATIVE),
    ("mission.limits.share", (Included(0.1), Included(1.0))),
    ("mission.limits.speed_mps", (Included(0.1), Included(1000.0))),
    ("mission.limits.acceleration_mps2", (Included(0.1), Included(1000.0))),
    ("mission.part.height_m", (Included(0.1), Included(500.0))),
    ("mission.part.points_m", POSITION_M),
    ("mission.part.times_s", (Included(0.0), Included(DAY_S))),
    ("mission.part.ramp_s", (Included(0.01), Included(DAY_S))),
    ("mission.part.point_m", POSITION_M),
    ("mission.part.radius_m", (Included(0.1), Included(250.0))),
    ("mission.part.period_s", DURATION_S),
    ("mission.part.laps", (Included(1.0), Included(10_000.0))),
    ("mission.part.climb_m", POSITION_M),
    ("mission.part.direction_deg", (Included(-360.0), Included(360.0))),
    ("mission.part.duration_s", DURATION_S),
    ("mission.part.sink_mps", (Included(0.1), Included(10.0))),
    ("plant.substep_s", (Included(MIN_STEP_S), Included(0.01))),
    ("plant.rotor_lag_s", POSITIVE),
    ("plant.servo_lag_s", POSITIVE),
    ("plant.rotor_rate_limit", POSITIVE),
    ("plant.servo_rate_limit_radps", POSITIVE),
    ("plant.rotor_speed_min", NOT_NEGATIVE),
    ("plant.rotor_speed_max_ratio", (Included(1.001), Included(1000.0))),
    ("plant.tilt_max_deg", (Excluded(0.0), Included(90.0))),
    ("plant.drag_linear_nspm", NOT_NEGATIVE),
    ("plant.drag_quadratic_ns2pm2", NOT_NEGATIVE),
    ("plant.rotor_effectiveness", (Included(0.0), Included(2.0))),
    ("plant.noise", NOT_NEGATIVE),
    ("plant.airframe.mass_kg", MASS),
    ("plant.airframe.ixx_kgm2", INERTIA),
    ("plant.airframe.iyy_kgm2", INERTIA),
    ("plant.airframe.izz_kgm2", INERTIA),
    ("plant.airframe.centre_of_mass_m", (Included(-1e3), Included(1e3))),
    ("plant.airframe.l1_m", ARM),
    ("plant.airframe.l2_m", ARM),
    ("plant.airframe.l3_m", ARM),
    ("plant.airframe.kf", ROTOR_CONSTANT),
    ("plant.airframe.km", ROTOR_CONSTANT),
    ("plant.rotor.inertia_kgm2", (Included(0.0), Included(1.0))),
    ("plant.rotor", NOT_NEGATIVE),
    ("plant.battery.energy_wh", (Included(0.0), Included(1e6))),
    ("plant.battery.droop", (Included(0.0), Included(0.9))),
    ("plant.battery.sag", (Included(0.0), Included(0.5))),
    ("plant.sensors", NOT_NEGATIVE),
    ("plant.sensors.receiver.latency_ms", LATENCY_MS),
    ("plant.sensors.imu.count", (Included(1.0), Included(2.0))),
    ("plant.sensors.imu.rate_hz", (Included(200.0), Included(1000.0))),
    ("plant.sensors.imu.scale", (Included(0.0), Included(0.1))),
    ("plant.sensors.imu.misalignment_deg", (Included(0.0), Included(10.0))),
    ("plant.sensors.receiver.antenna_m", (Included(0.0), Included(5.0))),
    ("plant.sensors.receiver.clock_ms", (Included(0.0), Included(100.0))),
    ("plant.sensors.barometer.wind_pressure", (Included(0.0), Included(1.0))),
    ("plant.sensors.magnetometer.inclination_deg", (Included(-90.0), Included(90.0))),
    ("plant.sensors.alignment.tilt_deg", (Included(0.0), Included(30.0))),
    ("plant.sensors.alignment.heading_deg", (Included(0.0), Included(30.0))),
    ("plant.sensors.alignment.standing_s", (Included(0.0), Included(60.0))),
    ("plant.sensors.telemetry.latency_ms", LATENCY_MS),
    ("plant.wind_roughness_m", (Included(0.0), Included(3.0))),
    ("plant.turbulence.wind_at_6m_mps", (Included(0.0), Included(100.0))),
    ("plant.turbulence.height_m", (Included(3.0), Included(304.8))),
    ("plant.turbulence.airspeed_mps", (Included(0.1), Included(100.0))),
    ("plant.ground.leg_m", ARM),
    ("plant.ground.friction", (Included(0.0), Included(10.0))),
    ("plant.ground.down_m", POSITION_M),
    ("plant.ground.max_sink_mps", POSITIVE),
    ("guidance.disturbance_observer_radps", NOT_NEGATIVE),
    ("guidance.angle_limit_deg", (Excluded(0.0), Included(80.0))),
    ("guidance.climb_limit_mps", POSITIVE),
    ("guidance.w_limit_mps", POSITIVE),
    ("guidance.heading_rate_limit_dps", NOT_NEGATIVE),
    ("guidance.integral_limit", NOT_NEGATIVE),
    ("guidance.lead_s", (Included(0.0), Included(10.0))),
    ("guidance.preview_s", (Included(0.0), Included(10.0))),
    ("attitude.mpc.q", (Included(0.0), Included(1e12))),
    ("attitude.mpc.r", (Included(1e-12), Included(1e12))),
    ("attitude.mpc.r_rate", (Included(0.0), Included(1e12))),
    ("attitude.mpc.prediction_horizon_s", HORIZON_S),
    ("attitude.mpc.control_horizon_s", HORIZON_S),
    ("attitude.actuator_lag_model_s", (Included(0.0), Included(100.0))),
    ("attitude.servo_lag_model_s", (Included(0.001), Included(100.0))),
    ("attitude.mpc.max_iterations", (Included(1.0), Included(10_000.0))),
    ("attitude.mpc.time_limit_ms", NOT_NEGATIVE),
    ("attitude.mpc.attitude_limit_deg", POSITIVE),
    ("attitude.mpc.rates_limit_dps", POSITIVE),
    ("attitude.disturbance_gain", (Included(0.0), Included(1.0))),
    ("attitude.pid", (Included(0.0), Included(1e6))),
    ("attitude.geometric", (Included(0.0), Included(1e6))),
    ("attitude.indi", (Included(0.0), Included(1e6))),
    ("attitude.indi.filter_radps", POSITIVE),
    ("mixer.projection_weights", (Included(1e-3), Included(1e6))),
    ("bounds", LIFTED),
    ("realtime.priority", PRIORITY),
    ("realtime.affinity", CPU),
    ("realtime.rttime_ms", NOT_NEGATIVE),
    ("deadline.end_to_end_ms", POSITIVE),
    ("node.*.priority", PRIORITY),
    ("node.*.affinity", CPU),
    ("node.*.deadline_ms", POSITIVE),
    ("supervision.hang_ms", (Included(1.0), Included(60_000.0))),
    ("supervision.restart_ms", (Included(0.0), Included(60_000.0))),
    ("supervision.start_limit_s", (Included(0.01), Included(60.0))),
    ("supervision.start_ms", (Included(0.0), Included(10_000.0))),
    ("supervision.wall_limit_s", TIME_S),
    ("swap.at_s", TIME_S),
    ("swap.standby_s", TIME_S),
    ("swap.watch_s", TIME_S),
    ("swap.bounds.difference", LIFTED),
    ("swap.bounds.similarity", (Included(-1.0), Included(1.0))),
    ("swap.bounds.tilt_deg", LIFTED),
    ("swap.bounds.error_m", LIFTED),
    ("swap.bounds.ticks", (Included(1.0), Unbounded)),
];

/// Checks every number against the ranges of its key.
pub fn check(settings: &[(String, Vec<f64>)], found: &mut Found) {
    for (key, numbers) in settings {
        let range = range_of(key);
        if let Some(x) = numbers.iter().find(|x| !range.contains(*x)) {
            found.require(false, &[key], format!("`{}` = {x:?} is out of range", shown(key)), &describe(range));
        }
    }
}

/// Returns whether a name in a dotted key is the index of an array element.
fn is_index(name: &str) -> bool {
    name.parse::<usize>().is_ok()
}

/// Returns a dotted key with the indices of array elements in brackets.
pub fn shown(key: &str) -> String {
    let name = |name| if is_index(name) { format!("[{name}]") } else { format!(".{name}") };
    key.split('.').map(name).collect::<String>()[1..].to_owned()
}

/// Returns the range of the numbers under `key`: the intersection of its own range with the ranges of the tables around
/// it.
pub fn range_of(key: &str) -> AllowedRange {
    // The keys are split only once, because every flight of a campaign checks all of its settings.
    static TABLES: LazyLock<Vec<(Vec<&str>, AllowedRange)>> =
        LazyLock::new(|| RANGES.iter().map(|(table, range)| (table.split('.').collect(), *range)).collect());
    let names: Vec<&str> = key.split('.').filter(|name| !is_index(name)).collect();
    let is_under = |table: &[&str]| {
        table.len() <= names.len() && table.iter().zip(&names).all(|(of, name)| *of == "*" || of == name)
    };
    let value = |bound| match bound {
        Included(x) | Excluded(x) => Some(x),
        Unbounded => None,
    };
    let ranges = TABLES.iter().filter(|(table, _)| is_under(table)).map(|(_, range)| *range);
    ranges.fold((Unbounded, Unbounded), |(low, high), (other_low, other_high)| {
        let is_higher = value(low).is_none_or(|low| value(other_low).is_some_and(|other| other >= low));
        let is_lower = value(high).is_none_or(|high| value(other_high).is_some_and(|other| other <= high));
        (if is_higher { other_low } else { low }, if is_lower { other_high } else { high })
    })
}

fn describe((low, high): AllowedRange) -> String {
    let plain = |x: f64| if x == 0.0 || (1e-3..1e6).contains(&x.abs()) { x.to_string() } else { format!("{x:e}") };
    let side = |bound, inclusive, exclusive| match bound {
        Included(x) => Some(format!("{inclusive} {}", plain(x))),
        Excluded(x) => Some(format!("{exclusive} {}", plain(x))),
        Unbounded => None,
    };
    let sides = [side(low, "at least", "above"), side(high, "at most", "below")];
    sides.into_iter().flatten().collect::<Vec<_>>().join(", ")
}

/// Collects all numbers of `value`, each list with the dotted key it stands under.
pub fn collect(path: &str, value: Value) -> Vec<(String, Vec<f64>)> {
    let within =
        |(name, value): (String, Value)| collect(&if path.is_empty() { name } else { format!("{path}.{name}") }, value);
    match value {
        Value::Table(table) => table.into_iter().flat_map(within).collect(),
        Value::Array(tables) if tables.iter().any(Value::is_table) => {
            tables.into_iter().enumerate().flat_map(|(i, table)| within((i.to_string(), table))).collect()
        }
        value => vec![(path.into(), numbers(&value))],
    }
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Integer(x) => vec![*x as f64],
        Value::Float(x) => vec![*x],
        Value::Array(values) => values.iter().flat_map(numbers).collect(),
        _ => vec![],
    }
}
