//! The figures' data: one [column](column()) per quantity, in one JSON object.
//!
//! Row `i` of every column stands for the time `begin_s + i * dt_s`; a value that is unknown at a tick is NaN. The
//! page's script derives nothing but units from these numbers. Columns without information are left out, with their
//! lines in the figures: measurements that equal the truth, a wind or an estimate that is zero all the time.

use contract::message::{ActuationMsg, Kinematics, mixer_flags};
use serde_json::{Value, json};
use settings::{Mode, Scenario};

use super::air::Wind;
use super::claims;
use super::estimate::{self, ERRORS, EXPECTED, MEASUREMENTS};
use crate::draw::{FlightColumns, column};
use crate::thinning::Thinned;
use outcome::bounds::bounds;
use outcome::ticks::LoggedTick;
use outcome::timing::Age;

/// Function that returns quantities of a tick, or `None` if they are unknown.
type Quantities = fn(&LoggedTick, &mut DerivedSources) -> Option<Vec<f64>>;

/// Sources of the quantities that no message has.
pub struct DerivedSources {
    wind: Wind,
    /// Weights of the demand in the cost (4).
    r: [f64; 4],
}

impl DerivedSources {
    pub fn new(scenario: &Scenario) -> Self {
        Self { wind: Wind::new(scenario), r: scenario.attitude.mpc.r }
    }
}

/// Columns that are left out if every value is zero or unknown.
const NOTHING_IF_ZERO: [&[&str]; 4] =
    [&["wind_north", "wind_east", "wind_down", "estimate_ahead", "estimate_right"], &ERRORS, &EXPECTED, &MEASUREMENTS];
/// Columns that are left out unless one of two other columns is shown.
const NOTHING_WITHOUT: [(&str, [&str; 2]); 2] =
    [("unexplained_ahead", WIND_OR_ESTIMATE), ("unexplained_right", WIND_OR_ESTIMATE)];
const WIND_OR_ESTIMATE: [&str; 2] = ["wind_north", "estimate_ahead"];

/// Every column by its name in the page's script, in groups that are known together. SI units and radians, NED and body
/// axes.
const COLUMNS: [(&[&str], Quantities); 25] = [
    (&["x", "y", "z"], |tick, _| Some(actual(tick)?.position_m.into())),
    (&["x_wanted", "y_wanted", "z_wanted"], |tick, _| Some(tick.wanted_m.into())),
    (&["error_x", "error_y", "error_z"], |tick, _| Some(tick.error_m?.into())),
    (&["error"], |tick, _| Some(vec![tick.distance_m()?])),
    (&["u", "v", "w"], |tick, _| Some(actual(tick)?.velocity_mps.into())),
    (&["w_ref"], |tick, _| Some(vec![tick.of.reference?.w_mps])),
    (&["phi", "theta", "psi"], |tick, _| Some(actual(tick)?.attitude_rad.into())),
    (&["phi_ref", "theta_ref", "psi_ref"], |tick, _| Some(tick.of.reference?.attitude_rad.into())),
    (&["p", "q", "r"], |tick, _| Some(actual(tick)?.rates_radps.into())),
    (&["p_ref", "q_ref", "r_ref"], |tick, _| Some(tick.of.reference?.rates_radps.into())),
    (&["omega1", "omega2", "omega3", "tilt"], |tick, _| Some(actuation(&tick.of.truth?.actuators))),
    (&["omega1_command", "omega2_command", "omega3_command", "tilt_command"], |tick, _| {
        Some(actuation(&tick.of.actuators?.command))
    }),
    (&["col", "lon", "lat", "ped"], |tick, _| Some(tick.of.controls?.demand.into())),
    (&["x_measured", "y_measured", "z_measured"], |tick, _| Some(measured(tick)?.position_m.into())),
    (&["u_measured", "v_measured", "w_measured"], |tick, _| Some(measured(tick)?.velocity_mps.into())),
    (&["phi_measured", "theta_measured", "psi_measured"], |tick, _| Some(measured(tick)?.attitude_rad.into())),
    (&["p_measured", "q_measured", "r_measured"], |tick, _| Some(measured(tick)?.rates_radps.into())),
    (&["wind_north", "wind_east", "wind_down"], |tick, derived| Some(derived.wind.wind_mps(tick)?.into())),
    (&["unexplained_ahead", "unexplained_right"], |tick, derived| Some(derived.wind.acceleration_mps2(tick)?.into())),
    (&["estimate_ahead", "estimate_right"], |tick, _| Some(tick.of.reference?.disturbance_mps2.into())),
    (&["effort"], |tick, derived| {
        let demand = tick.of.controls?.demand;
        Some(vec![demand.iter().zip(derived.r).map(|(u, r)| u * u * r).sum()])
    }),
    (&["rung"], |tick, _| Some(vec![rung(tick.of.actuators?.flags)])),
    (&ERRORS, |tick, _| estimate::errors(tick)),
    (&EXPECTED, |tick, _| estimate::expected(tick)),
    (&MEASUREMENTS, |tick, _| estimate::measurements(tick)),
];

/// Names of the columns, without the age at the actuator.
pub fn names() -> impl Iterator<Item = &'static str> {
    COLUMNS.iter().flat_map(|(names, _)| *names).copied()
}

/// Returns the values of a tick in the order of [`names`]; NaN where they are unknown.
pub fn values(tick: &LoggedTick, derived: &mut DerivedSources) -> Vec<f64> {
    let of_group = |(names, quantities): &(&[&str], Quantities)| {
        quantities(tick, derived).unwrap_or_else(|| vec![f64::NAN; names.len()])
    };
    COLUMNS.iter().flat_map(of_group).collect()
}

/// The columns of a flight, gathered tick by tick, the age at the actuator last.
pub struct ReportColumns {
    all: Vec<(&'static str, Thinned)>,
    derived: DerivedSources,
    age: Age,
    age_ms: Thinned,
    /// Ticks since the newest state; the age in their slots is known with the next state.
    waiting: usize,
    first: u64,
    ticks: u64,
}

impl ReportColumns {
    /// Makes the columns of the ticks from `first` on.
    pub fn new(scenario: &Scenario, first: u64) -> Self {
        Self {
            all: names().map(|name| (name, Thinned::default())).collect(),
            derived: DerivedSources::new(scenario),
            age: Age::new(scenario.sample_ns()),
            age_ms: Thinned::default(),
            waiting: 0,
            first,
            ticks: 0,
        }
    }

    /// Takes in the next tick.
    pub fn observe(&mut self, tick: &LoggedTick) {
        for ((_, column), value) in self.all.iter_mut().zip(values(tick, &mut self.derived)) {
            column.push(value as f32);
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

    /// Describes which samples the figures show.
    pub fn sampling(&self, scenario: &Scenario) -> String {
        let Self { first, ticks, .. } = *self;
        let time_s = |tick: u64| tick as f64 * scenario.sample_s();
        let (from_s, to_s) = (time_s(first), time_s(first + ticks.saturating_sub(1)));
        let samples = format!("{ticks} samples from {from_s:.2} to {to_s:.2} s");
        match self.all[0].1.bucket() {
            1 => format!("{samples}, each one drawn."),
            bucket => format!(
                "{samples}, drawn as the smallest and the largest of every {bucket}; \
                 <code>trefoil report RUN --from TIME --to TIME</code> draws every sample of a part."
            ),
        }
    }

    /// Encodes the `chosen` columns, each given with `true` if radians become degrees; the first row is at `begin_s`.
    pub fn encoded<'a>(
        &self,
        chosen: impl Iterator<Item = (&'a str, bool)>,
        begin_s: f64,
        sample_s: f64,
    ) -> FlightColumns {
        let encode = |(name, in_degrees): (&str, bool)| {
            let (_, series) = self.all.iter().find(|(other, _)| *other == name)?;
            let shown = |value: f32| if in_degrees { value.to_degrees() } else { value };
            Some((name.to_owned(), column(series.values().into_iter().map(shown))))
        };
        let (_, first) = &self.all[0];
        let (rows, dt_s) = (first.values().len(), first.step() * sample_s);
        FlightColumns { rows, begin_s, dt_s, columns: chosen.filter_map(encode).collect() }
    }

    /// Returns the script's whole input: `rows`, `begin_s`, `dt_s`, `realtime`, `columns` and the horizontal `lines` of
    /// the figures.
    pub fn document(mut self, scenario: &Scenario) -> Value {
        (0..self.waiting).for_each(|_| self.age_ms.push(f32::NAN));
        self.all.push(("age_ms", std::mem::take(&mut self.age_ms)));
        let values: Vec<(&str, Vec<f32>)> = self.all.iter().map(|(name, column)| (*name, column.values())).collect();
        let said = |name: &str| says_something(name, &values);
        let chosen = names().chain(["age_ms"]).filter(|name| said(name)).map(|name| (name, false));
        let sample_s = scenario.sample_s();
        let mut document = json!(self.encoded(chosen, self.first as f64 * sample_s, sample_s));
        document["realtime"] = (scenario.run.mode == Mode::Realtime).into();
        document["lines"] = lines(scenario);
        document
    }
}

fn actual(tick: &LoggedTick) -> Option<&Kinematics> {
    Some(&tick.of.truth.as_ref()?.actual)
}

fn measured(tick: &LoggedTick) -> Option<&Kinematics> {
    Some(&tick.of.state.as_ref()?.measured)
}

/// Number of the mixer's rung, from 0, a fresh demand, to 6, thrust cut for good; see `mixer::fallback`.
fn rung(flags: u64) -> f64 {
    use mixer_flags::{CUT, DESCENDING, DISARMED, HELD, LEVELLED, TERMINATED, TRIM_ONLY};
    let rungs = [HELD, LEVELLED, DESCENDING, TRIM_ONLY, CUT, TERMINATED | DISARMED];
    rungs.iter().rposition(|rung| flags & rung != 0).map_or(0.0, |rung| (rung + 1) as f64)
}

/// Returns whether a column is worth a line in the figures.
fn says_something(name: &str, all: &[(&str, Vec<f32>)]) -> bool {
    let values =
        |name: &str| all.iter().find(|(other, _)| *other == name).map_or(&[][..], |(_, values)| values.as_slice());
    if let Some(truth) = name.strip_suffix("_measured") {
        return values(name).iter().zip(values(truth)).any(|(one, other)| one.is_finite() && one != other);
    }
    if let Some((_, others)) = NOTHING_WITHOUT.iter().find(|(other, _)| *other == name) {
        return others.iter().any(|other| says_something(other, all));
    }
    !NOTHING_IF_ZERO.as_slice().concat().contains(&name) || values(name).iter().any(|value| value.abs() > 0.0)
}

fn actuation(message: &ActuationMsg) -> Vec<f64> {
    [message.rotor_speed.as_slice(), &[message.tilt_rad]].concat()
}

/// Returns the lines that the figures are compared with: the paper's claims, the scenario's bounds, the limits of the
/// actuators.
pub fn lines(scenario: &Scenario) -> Value {
    let bounds = bounds(scenario);
    let paper = |y: f64| claims::concerns(scenario).then_some((y, "paper"));
    let bound = |y: Option<f64>| y.filter(|y| y.is_finite()).map(|y| (y, "bound"));
    let error = [paper(claims::POSITION_M), bound(bounds.max_position_error_m)].into_iter().flatten();
    // Time in which the paper's flight is horizontal, and the times before and after.
    let [from, to] = claims::HORIZONTAL_S;
    let (horizontal, vertical) =
        (&[Some([Some(from), Some(to)])][..], &[Some([Some(0.0), Some(from)]), Some([Some(to), None])][..]);
    let altitude = [
        (paper(claims::ALTITUDE_HORIZONTAL_M), horizontal),
        (paper(claims::ALTITUDE_VERTICAL_M), vertical),
        (bound(bounds.max_altitude_error_m), &[None][..]),
    ];
    let altitude = altitude.into_iter().filter_map(|(line, spans)| Some((line?, spans)));
    let limits = scenario.limits();
    let [max1, max2, _] = limits.rotor_speed_max;
    json!({
        "error": error.map(|(y, label)| line(y, label, None)).collect::<Value>(),
        "error_z": altitude.flat_map(|((y, label), spans)| spans.iter().flat_map(move |span| both(y, label, *span))).collect::<Value>(),
        "rotors": [
            line(limits.rotor_speed_min, "Ω min", None),
            line(max1, "Ω₁ max", None),
            line(max2, "Ω₂, Ω₃ max", None),
        ],
        "gate": [line(1.0, "gate", None)],
        "tilt": both(limits.tilt_max_rad.to_degrees(), "limit", None),
    })
}

/// Makes a horizontal line at `y`, from edge to edge or over a span of time \[s\].
fn line(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> Value {
    json!({ "y": y, "label": label, "span_s": span_s })
}

/// Makes the same line above and below zero.
fn both(y: f64, label: &str, span_s: Option<[Option<f64>; 2]>) -> [Value; 2] {
    [line(y, label, span_s), line(-y, label, span_s)]
}
