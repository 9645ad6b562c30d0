//! The figures' data: one column of little-endian f32 per quantity, base64, in one JSON object.
//!
//! Row `i` of every column stands for the time `i * dt_s`; what is unknown at a tick is NaN. The page's script derives
//! nothing but units from these numbers.

use base64::prelude::{BASE64_STANDARD, Engine};
use contract::Scenario;
use contract::message::{ActuationMsg, Kinematics};
use contract::scenario::Mode;
use serde_json::{Map, Value, json};

use super::claims;
use crate::thinning::extremes;
use crate::ticks::LoggedTick;
use crate::timing::Age;

/// Longer columns are thinned: a 60 s flight is shown tick by tick.
const MAX_ROWS: usize = 6400;

/// Quantities of a tick, where they are known.
type Quantities = fn(&LoggedTick) -> Option<Vec<f64>>;

/// Every column by its name in the page's script, in groups that are known together. SI units and radians, NED and body axes.
const COLUMNS: [(&[&str], Quantities); 13] = [
    (&["x", "y", "z"], |tick| Some(actual(tick)?.position_m.into())),
    (&["x_wanted", "y_wanted", "z_wanted"], |tick| Some(tick.wanted_m.into())),
    (&["error_x", "error_y", "error_z"], |tick| Some(tick.error_m?.into())),
    (&["error"], |tick| Some(vec![tick.distance_m()?])),
    (&["u", "v", "w"], |tick| Some(actual(tick)?.velocity_mps.into())),
    (&["w_ref"], |tick| Some(vec![tick.of.reference?.w_mps])),
    (&["phi", "theta", "psi"], |tick| Some(actual(tick)?.attitude_rad.into())),
    (&["phi_ref", "theta_ref", "psi_ref"], |tick| Some(tick.of.reference?.attitude_rad.into())),
    (&["p", "q", "r"], |tick| Some(actual(tick)?.rates_radps.into())),
    (&["p_ref", "q_ref", "r_ref"], |tick| Some(tick.of.reference?.rates_radps.into())),
    (&["omega1", "omega2", "omega3", "tilt"], |tick| Some(actuation(&tick.of.state?.actuators))),
    (&["omega1_command", "omega2_command", "omega3_command", "tilt_command"], |tick| {
        Some(actuation(&tick.of.actuators?.command))
    }),
    (&["col", "lon", "lat", "ped"], |tick| Some(tick.of.controls?.demand.into())),
];

/// The script's whole input: `rows`, `dt_s`, `realtime`, `columns` and the horizontal `lines` of the figures.
pub fn document(ticks: &[LoggedTick], scenario: &Scenario) -> Value {
    let bucket = bucket(ticks.len());
    let step = if bucket == 1 { 1.0 } else { bucket as f64 / 2.0 };
    let mut columns = Map::new();
    let mut length = 0;
    let mut add = |name: &str, values: Vec<Option<f64>>| {
        let values: Vec<f32> = values.into_iter().map(|value| value.map_or(f32::NAN, |value| value as f32)).collect();
        let thinned = thin(&values, bucket);
        length = thinned.len();
        let bytes: Vec<u8> = thinned.into_iter().flat_map(f32::to_le_bytes).collect();
        columns.insert(name.into(), BASE64_STANDARD.encode(bytes).into());
    };
    for (names, quantities) in COLUMNS {
        let known: Vec<_> = ticks.iter().map(quantities).collect();
        for (i, name) in names.iter().enumerate() {
            add(name, known.iter().map(|values| values.as_ref().map(|values| values[i])).collect());
        }
    }
    add("age_ms", held_ages_ms(ticks, scenario));
    json!({
        "rows": length,
        "dt_s": step * scenario.sample_s(),
        "realtime": scenario.run.mode == Mode::Realtime,
        "columns": columns,
        "lines": lines(scenario),
    })
}

fn actual<'a>(tick: &LoggedTick<'a>) -> Option<&'a Kinematics> {
    Some(&tick.of.state?.actual)
}

fn actuation(message: &ActuationMsg) -> Vec<f64> {
    [message.rotor_speed.as_slice(), &[message.tilt_rad]].concat()
}

/// How many ticks share one pair of drawn values; 1 draws every tick.
pub fn bucket(rows: usize) -> usize {
    if rows <= MAX_ROWS { 1 } else { (2 * rows).div_ceil(MAX_ROWS) }
}

/// Age at the actuator in the slot before each row \[ms\].
fn held_ages_ms(ticks: &[LoggedTick], scenario: &Scenario) -> Vec<Option<f64>> {
    let mut age = Age::new(scenario.sample_ns());
    let mut ages_ms = vec![None; ticks.len()];
    for (i, tick) in ticks.iter().enumerate() {
        let slots_ns = tick.of.state.map_or(vec![], |state| age.observe(state));
        let first = (i + 1).saturating_sub(slots_ns.len());
        ages_ms[first..].iter_mut().zip(slots_ns).for_each(|(age_ms, ns)| *age_ms = Some(ns as f64 / 1e6));
    }
    ages_ms
}

/// Keeps the smallest and the largest value of every `bucket` values, in the order in which they occurred.
fn thin(values: &[f32], bucket: usize) -> Vec<f32> {
    if bucket == 1 {
        return values.to_vec();
    }
    let extremes = extremes(values, bucket, |value| f64::from(*value));
    extremes.flat_map(|two| two.map_or([f32::NAN; 2], |two| two.map(|value| *value))).collect()
}

/// What the figures are read against: the paper's claims, the scenario's bounds, the limits of the actuators.
fn lines(scenario: &Scenario) -> Value {
    let bounds = &scenario.bounds;
    let paper = |y: f64| claims::concerns(scenario).then_some((y, "paper"));
    let bound = |y: Option<f64>| y.filter(|y| y.is_finite()).map(|y| (y, "bound"));
    let error = [paper(claims::POSITION_M), bound(bounds.max_position_error_m)].into_iter().flatten();
    // While the flight of the paper is horizontal, and before and after.
    let [from, to] = claims::HORIZONTAL_S;
    let (horizontal, vertical) = (&[[Some(from), Some(to)]][..], &[[Some(0.0), Some(from)], [Some(to), None]][..]);
    let altitude = [
        (paper(claims::ALTITUDE_HORIZONTAL_M), horizontal),
        (paper(claims::ALTITUDE_VERTICAL_M), vertical),
        (bound(bounds.max_altitude_error_horizontal_m), horizontal),
        (bound(bounds.max_altitude_error_vertical_m), vertical),
    ];
    let altitude = altitude.into_iter().filter_map(|(line, spans)| Some((line?, spans)));
    let limits = scenario.limits();
    let [max1, max2, _] = limits.rotor_speed_max;
    json!({
        "error": error.map(|(y, label)| line(y, label, None)).collect::<Value>(),
        "error_z": altitude.flat_map(|((y, label), spans)| spans.iter().flat_map(move |span| both(y, label, Some(*span)))).collect::<Value>(),
        "rotors": [
            line(limits.rotor_speed_min, "Ω min", None),
            line(max1, "Ω₁ max", None),
            line(max2, "Ω₂, Ω₃ max", None),
        ],
        "tilt": both(limits.tilt_max_rad.to_degrees(), "limit", None),
    })
}

/// A horizontal line at `y`, from edge to edge or over a span of time \[s\].
fn line(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> Value {
    json!({ "y": y, "label": label, "span_s": span_s })
}

/// The same above and below zero.
fn both(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> [Value; 2] {
    [line(y, label, span_s), line(-y, label, span_s)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_extremes_order_and_holes() {
        let nan = f32::NAN;
        let thinned = thin(&[1.0, 5.0, 2.0, 3.0, -4.0, nan, nan, nan, nan, 7.0], 3);
        assert_eq!(thinned[..4], [1.0, 5.0, 3.0, -4.0]);
        assert!(thinned[4].is_nan() && thinned[5].is_nan());
        assert_eq!(thinned[6..], [7.0, 7.0]);
    }
}
