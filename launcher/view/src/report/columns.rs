//! The figures' data: one column of little-endian f32 per quantity, base64, in one JSON object.
//!
//! Row `i` of every column stands for the time `begin_s + i * dt_s`; what is unknown at a tick is NaN. The page's
//! script derives nothing but units from these numbers.

use base64::prelude::{BASE64_STANDARD, Engine};
use contract::Scenario;
use contract::message::{ActuationMsg, Kinematics};
use contract::scenario::Mode;
use serde_json::{Map, Value, json};

use super::claims;
use crate::thinning::Thinned;
use outcome::ticks::LoggedTick;
use outcome::timing::Age;

/// Returns quantities of a tick; `None` if they are unknown.
type Quantities = fn(&LoggedTick) -> Option<Vec<f64>>;

/// Every column by its name in the page's script, in groups that are known together. SI units and radians, NED and body
/// axes.
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

/// The columns of a flight, gathered tick by tick, the age at the actuator last.
pub struct Columns {
    all: Vec<(&'static str, Thinned)>,
    age: Age,
    age_ms: Thinned,
    /// Ticks since the newest state; the age in their slots is known with the next state.
    waiting: usize,
    first: u64,
    ticks: u64,
}

impl Columns {
    /// Makes the columns of the ticks from `first` on.
    pub fn new(scenario: &Scenario, first: u64) -> Self {
        let names = COLUMNS.iter().flat_map(|(names, _)| *names);
        Self {
            all: names.map(|name| (*name, Thinned::default())).collect(),
            age: Age::new(scenario.sample_ns()),
            age_ms: Thinned::default(),
            waiting: 0,
            first,
            ticks: 0,
        }
    }

    /// Takes in the next tick.
    pub fn observe(&mut self, tick: &LoggedTick) {
        let mut columns = self.all.iter_mut();
        for (names, quantities) in COLUMNS {
            let known = quantities(tick);
            for (i, (_, column)) in columns.by_ref().take(names.len()).enumerate() {
                column.push(known.as_ref().map_or(f32::NAN, |values| values[i] as f32));
            }
        }
        self.waiting += 1;
        self.ticks += 1;
        if let Some(state) = &tick.of.state {
            let slots_ns = self.age.observe(state);
            (slots_ns.len()..self.waiting).for_each(|_| self.age_ms.push(f32::NAN));
            let surplus = slots_ns.len().saturating_sub(self.waiting);
            slots_ns.iter().skip(surplus).for_each(|ns| self.age_ms.push((*ns as f64 / 1e6) as f32));
            self.waiting = 0;
        }
    }

    /// Says how the figures relate to the samples.
    pub fn sampling(&self, scenario: &Scenario) -> String {
        let Self { first, ticks, .. } = *self;
        let time_s = |tick: u64| tick as f64 * scenario.sample_s();
        let (from_s, to_s) = (time_s(first), time_s(first + ticks.saturating_sub(1)));
        let samples = format!("{ticks} samples from {from_s:.2} to {to_s:.2} s");
        match self.all[0].1.bucket() {
            1 => format!("{samples}, each one drawn."),
            bucket => format!(
                "{samples}, drawn as the smallest and the largest of every {bucket}; \
                 <code>launcher report RUN --from TIME --to TIME</code> draws every sample of a part."
            ),
        }
    }

    /// The script's whole input: `rows`, `begin_s`, `dt_s`, `realtime`, `columns` and the horizontal `lines` of the
    /// figures.
    pub fn document(mut self, scenario: &Scenario) -> Value {
        (0..self.waiting).for_each(|_| self.age_ms.push(f32::NAN));
        self.all.push(("age_ms", self.age_ms));
        let values: Vec<(&str, Vec<f32>)> = self.all.iter().map(|(name, column)| (*name, column.values())).collect();
        let encoded = |values: &[f32]| {
            let bytes: Vec<u8> = values.iter().copied().flat_map(f32::to_le_bytes).collect();
            Value::from(BASE64_STANDARD.encode(bytes))
        };
        let columns: Map<_, _> = values.iter().map(|(name, values)| ((*name).to_owned(), encoded(values))).collect();
        json!({
            "rows": values[0].1.len(),
            "begin_s": self.first as f64 * scenario.sample_s(),
            "dt_s": self.all[0].1.step() * scenario.sample_s(),
            "realtime": scenario.run.mode == Mode::Realtime,
            "columns": columns,
            "lines": lines(scenario),
        })
    }
}

fn actual(tick: &LoggedTick) -> Option<&Kinematics> {
    Some(&tick.of.state.as_ref()?.actual)
}

fn actuation(message: &ActuationMsg) -> Vec<f64> {
    [message.rotor_speed.as_slice(), &[message.tilt_rad]].concat()
}

/// Lines that the figures are read against: the paper's claims, the scenario's bounds, the limits of the actuators.
fn lines(scenario: &Scenario) -> Value {
    let bounds = &scenario.bounds;
    let paper = |y: f64| claims::concerns(scenario).then_some((y, "paper"));
    let bound = |y: Option<f64>| y.filter(|y| y.is_finite()).map(|y| (y, "bound"));
    let error = [paper(claims::POSITION_M), bound(bounds.max_position_error_m)].into_iter().flatten();
    // Time in which the paper's flight is horizontal, and the times before and after.
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

/// Makes the same line above and below zero.
fn both(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> [Value; 2] {
    [line(y, label, span_s), line(-y, label, span_s)]
}
