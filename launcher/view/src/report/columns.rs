//! The figures' data: one column of little-endian f32 per quantity, base64, in one JSON object.
//!
//! Row `i` of every column stands for the time `i * dt_s`; what is unknown at a tick is NaN. The page's script derives
//! nothing but units from these numbers.

use contract::Scenario;
use contract::message::Kinematics;
use contract::scenario::Mode;
use serde_json::{Map, Value, json};

use super::claims;
use super::flight::Row;
use crate::timing::Holding;

/// Longer columns are thinned: a 60 s flight is shown tick by tick.
const MAX_ROWS: usize = 6400;

/// One quantity of a row, if the row knows it.
type Quantity = fn(&Row) -> Option<f64>;

/// Every column by its name in the page's script. SI units and radians, NED and body axes.
const COLUMNS: [(&str, Quantity); 38] = [
    ("x", |row| Some(actual(row)?.position_m[0])),
    ("y", |row| Some(actual(row)?.position_m[1])),
    ("z", |row| Some(actual(row)?.position_m[2])),
    ("x_wanted", |row| Some(row.wanted_m[0])),
    ("y_wanted", |row| Some(row.wanted_m[1])),
    ("z_wanted", |row| Some(row.wanted_m[2])),
    ("error_x", |row| Some(row.position_error_m()?[0])),
    ("error_y", |row| Some(row.position_error_m()?[1])),
    ("error_z", |row| Some(row.position_error_m()?[2])),
    ("error", |row| Some(row.position_error_m()?.iter().map(|e| e * e).sum::<f64>().sqrt())),
    ("u", |row| Some(actual(row)?.velocity_mps[0])),
    ("v", |row| Some(actual(row)?.velocity_mps[1])),
    ("w", |row| Some(actual(row)?.velocity_mps[2])),
    ("w_ref", |row| Some(row.reference?.w_mps)),
    ("phi", |row| Some(actual(row)?.attitude_rad[0])),
    ("theta", |row| Some(actual(row)?.attitude_rad[1])),
    ("psi", |row| Some(actual(row)?.attitude_rad[2])),
    ("phi_ref", |row| Some(row.reference?.attitude_rad[0])),
    ("theta_ref", |row| Some(row.reference?.attitude_rad[1])),
    ("psi_ref", |row| Some(row.reference?.attitude_rad[2])),
    ("p", |row| Some(actual(row)?.rates_radps[0])),
    ("q", |row| Some(actual(row)?.rates_radps[1])),
    ("r", |row| Some(actual(row)?.rates_radps[2])),
    ("p_ref", |row| Some(row.reference?.rates_radps[0])),
    ("q_ref", |row| Some(row.reference?.rates_radps[1])),
    ("r_ref", |row| Some(row.reference?.rates_radps[2])),
    ("omega1", |row| Some(row.state?.actuators.rotor_speed[0])),
    ("omega2", |row| Some(row.state?.actuators.rotor_speed[1])),
    ("omega3", |row| Some(row.state?.actuators.rotor_speed[2])),
    ("tilt", |row| Some(row.state?.actuators.tilt_rad)),
    ("omega1_command", |row| Some(row.actuators?.command.rotor_speed[0])),
    ("omega2_command", |row| Some(row.actuators?.command.rotor_speed[1])),
    ("omega3_command", |row| Some(row.actuators?.command.rotor_speed[2])),
    ("tilt_command", |row| Some(row.actuators?.command.tilt_rad)),
    ("col", |row| Some(row.controls?.demand[0])),
    ("lon", |row| Some(row.controls?.demand[1])),
    ("lat", |row| Some(row.controls?.demand[2])),
    ("ped", |row| Some(row.controls?.demand[3])),
];

/// The script's whole input: `rows`, `dt_s`, `realtime`, `columns` and the horizontal `lines` of the figures.
pub fn document(rows: &[Row], scenario: &Scenario) -> Value {
    let bucket = bucket(rows.len());
    let step = if bucket == 1 { 1.0 } else { bucket as f64 / 2.0 };
    let mut columns = Map::new();
    let mut length = 0;
    let single = |value: Option<f64>| value.map_or(f32::NAN, |value| value as f32);
    let of_rows =
        COLUMNS.iter().map(|(name, quantity)| (*name, rows.iter().map(|row| single(quantity(row))).collect()));
    let ages = held_ages_ms(rows, scenario).into_iter().map(single).collect();
    for (name, values) in of_rows.chain([("age_ms", ages)]) {
        let values: Vec<f32> = values;
        let thinned = thin(&values, bucket);
        length = thinned.len();
        let bytes: Vec<u8> = thinned.into_iter().flat_map(f32::to_le_bytes).collect();
        columns.insert(name.into(), base64(&bytes).into());
    }
    json!({
        "rows": length,
        "dt_s": step * scenario.sample_s(),
        "realtime": scenario.run.mode == Mode::Realtime,
        "columns": columns,
        "lines": lines(scenario),
    })
}

/// How many ticks share one pair of drawn values; 1 draws every tick.
pub fn bucket(rows: usize) -> usize {
    if rows <= MAX_ROWS { 1 } else { (2 * rows).div_ceil(MAX_ROWS) }
}

fn actual<'a>(row: &Row<'a>) -> Option<&'a Kinematics> {
    Some(&row.state?.actual)
}

/// Age at the actuator in the slot before each row \[ms\].
fn held_ages_ms(rows: &[Row], scenario: &Scenario) -> Vec<Option<f64>> {
    let mut holding = Holding::new(scenario.sample_ns());
    let mut ages = vec![None; rows.len()];
    for (i, row) in rows.iter().enumerate() {
        let mut slots = Vec::new();
        if let Some(state) = row.state {
            holding.observe(state, |age_ns| slots.push(Some(age_ns as f64 / 1e6)));
        }
        let first = (i + 1).saturating_sub(slots.len());
        ages[first..].iter_mut().zip(slots).for_each(|(age, slot)| *age = slot);
    }
    ages
}

/// Keeps the smallest and the largest value of every `bucket` values, in the order in which they occurred.
fn thin(values: &[f32], bucket: usize) -> Vec<f32> {
    if bucket == 1 {
        return values.to_vec();
    }
    let extremes = |chunk: &[f32]| {
        let known = || chunk.iter().copied().enumerate().filter(|(_, value)| !value.is_nan());
        let low = known().min_by(|a, b| a.1.total_cmp(&b.1));
        let high = known().max_by(|a, b| a.1.total_cmp(&b.1));
        match (low, high) {
            (Some(low), Some(high)) if low.0 <= high.0 => [low.1, high.1],
            (Some(low), Some(high)) => [high.1, low.1],
            _ => [f32::NAN; 2],
        }
    };
    values.chunks(bucket).flat_map(extremes).collect()
}

/// What the figures are read against: the paper's claims, the scenario's bounds, the limits of the actuators.
fn lines(scenario: &Scenario) -> Value {
    let bounds = &scenario.bounds;
    let (mut error, mut altitude) = (Vec::new(), Vec::new());
    if claims::concerns(scenario) {
        error.push(line(claims::POSITION_M, "paper", None));
        altitude.extend(horizontal(claims::ALTITUDE_HORIZONTAL_M, "paper"));
        altitude.extend(vertical(claims::ALTITUDE_VERTICAL_M, "paper"));
    }
    error.extend(bounds.max_position_error_m.filter(|y| y.is_finite()).map(|y| line(y, "bound", None)));
    altitude.extend(
        bounds
            .max_altitude_error_horizontal_m
            .filter(|y| y.is_finite())
            .map(|y| horizontal(y, "bound"))
            .into_iter()
            .flatten(),
    );
    altitude.extend(
        bounds
            .max_altitude_error_vertical_m
            .filter(|y| y.is_finite())
            .map(|y| vertical(y, "bound"))
            .into_iter()
            .flatten(),
    );

    let limits = scenario.limits();
    let [max1, max2, _] = limits.rotor_speed_max;
    json!({
        "error": error,
        "error_z": altitude,
        "rotors": [
            line(limits.rotor_speed_min, "Ω min", None),
            line(max1, "Ω₁ max", None),
            line(max2, "Ω₂, Ω₃ max", None),
        ],
        "tilt": both(limits.tilt_max_rad.to_degrees(), "limit", None),
    })
}

/// Bounds of the altitude error while the flight of the paper is horizontal.
fn horizontal(y: f64, label: &str) -> [Value; 2] {
    both(y, label, Some(claims::HORIZONTAL_S.map(Some)))
}

/// Bounds of the altitude error before and after; the second span is open.
fn vertical(y: f64, label: &str) -> [Value; 4] {
    let [from, to] = claims::HORIZONTAL_S;
    let [above, below] = both(y, label, Some([Some(0.0), Some(from)]));
    let [above_again, below_again] = both(y, label, Some([Some(to), None]));
    [above, below, above_again, below_again]
}

/// A horizontal line at `y`, from edge to edge or over a span of time \[s\].
fn line(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> Value {
    json!({ "y": y, "label": label, "span_s": span_s })
}

/// The same above and below zero.
fn both(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> [Value; 2] {
    [line(y, label, span_s), line(-y, label, span_s)]
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let mut three = [0; 3];
        three[..chunk.len()].copy_from_slice(chunk);
        let bits = u32::from_be_bytes([0, three[0], three[1], three[2]]);
        for digit in 0..4 {
            let sextet = bits >> (18 - 6 * digit) & 63;
            text.push(if digit > chunk.len() { '=' } else { char::from(ALPHABET[sextet as usize]) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_follows_the_rfc() {
        for (plain, coded) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(plain.as_bytes()), coded);
        }
        assert_eq!(base64(&[0xfb, 0xff, 0xfe]), "+//+");
    }

    #[test]
    fn thinning_keeps_extremes_order_and_holes() {
        let nan = f32::NAN;
        let thinned = thin(&[1.0, 5.0, 2.0, 3.0, -4.0, nan, nan, nan, nan, 7.0], 3);
        assert_eq!(thinned[..4], [1.0, 5.0, 3.0, -4.0]);
        assert!(thinned[4].is_nan() && thinned[5].is_nan());
        assert_eq!(thinned[6..], [7.0, 7.0]);
    }

    #[test]
    fn a_minute_is_drawn_tick_by_tick_and_an_hour_is_thinned() {
        assert_eq!(bucket(6001), 1);
        for rows in [6401_usize, 7000, 360_001] {
            assert!(rows.div_ceil(bucket(rows)) * 2 <= MAX_ROWS + 2, "{rows}");
        }
    }

    #[test]
    fn columns_have_names_of_their_own() {
        let mut names: Vec<_> = COLUMNS.iter().map(|(name, _)| name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), COLUMNS.len());
    }
}
