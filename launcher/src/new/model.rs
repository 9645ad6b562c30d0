//! The linear model of attitude-mpc as a file in the language of a template: JSON, C or Rust.

use std::fmt::Write;

use attitude_mpc::model::PredictionModel;
use settings::Scenario;

/// Name in lower case, meaning and value of a quantity of the model.
type Entry = (&'static str, &'static str, Value);

/// Number, or table of numbers by rows.
enum Value {
    Number(f64),
    List(Vec<f64>),
    Table(Vec<Vec<f64>>),
}

/// Linear model about hover, with the vehicle and its limits.
pub struct HoverModel(Vec<Entry>);

impl HoverModel {
    /// Computes the model that attitude-mpc has for `scenario`.
    pub fn of(scenario: &Scenario) -> Self {
        let (model, vehicle, limits) = (PredictionModel::new(scenario), &scenario.airframe, scenario.limits());
        let table = |rows: usize, columns: usize, at: &dyn Fn((usize, usize)) -> f64| {
            Value::Table((0..rows).map(|i| (0..columns).map(|j| at((i, j))).collect()).collect())
        };
        let (n, m) = (model.a.nrows(), model.b.ncols());
        let lag_s = scenario.attitude.actuator_lag_model_s;
        let lags_s = vec![lag_s, lag_s, lag_s, scenario.attitude.servo_lag_model_s.unwrap_or(lag_s)];
        Self(vec![
            ("sample_s", "Time between two samples [s]", Value::Number(scenario.sample_s())),
            ("actuator_lag_s", "Lags of rotors 1 to 3 and of the servo in the model [s]", Value::List(lags_s)),
            ("g_mps2", "Acceleration of gravity [m/s2]", Value::Number(vehicle.g_mps2)),
            ("mass_kg", "Mass [kg]", Value::Number(vehicle.mass_kg)),
            (
                "inertia_kgm2",
                "Moments of inertia about x, y, z [kg m2]",
                Value::List(vec![vehicle.ixx_kgm2, vehicle.iyy_kgm2, vehicle.izz_kgm2]),
            ),
            (
                "arms_m",
                "Arms: rotor 1 forward, rotors 2 and 3 back, rotors 2 and 3 sideways [m]",
                Value::List(vec![vehicle.l1_m, vehicle.l2_m, vehicle.l3_m]),
            ),
            ("kf", "Thrust constant [N / rotor speed unit squared]", Value::Number(vehicle.kf)),
            ("km", "Torque constant [N m / rotor speed unit squared]", Value::Number(vehicle.km)),
            ("trim_roll_rad", "Roll angle at trim [rad]", Value::Number(model.trim.roll_rad)),
            (
                "trim_rotor_speed",
                "Rotor speeds at trim [rotor speed unit]",
                Value::List(model.trim.actuation.rotor_speed.to_vec()),
            ),
            ("trim_tilt_rad", "Tilt of rotor 1 at trim [rad]", Value::Number(model.trim.actuation.tilt_rad)),
            ("rotor_speed_min", "Lowest rotor speed [rotor speed unit]", Value::Number(limits.rotor_speed_min)),
            (
                "rotor_speed_max",
                "Highest rotor speeds [rotor speed unit]",
                Value::List(limits.rotor_speed_max.to_vec()),
            ),
            ("tilt_max_rad", "Largest tilt of rotor 1 to either side [rad]", Value::Number(limits.tilt_max_rad)),
            (
                "a",
                "x[k+1] = A x[k] + B u[k]; x = w, roll - trim, pitch, yaw, p, q, r, lagging col, lon, lat, ped",
                table(n, n, &|at| model.a[at]),
            ),
            ("b", "Inputs u: deviations of col, lon, lat, ped from trim [N, N m]", table(n, m, &|at| model.b[at])),
            (
                "mixing",
                "(col, lon, lat, ped) = mixing (O1^2 sin tilt, O1^2 cos tilt, O2^2, O3^2) of the rotor speeds O",
                table(m, m, &|at| model.mixing.forward[at]),
            ),
        ])
    }

    /// Writes the model as a JSON object.
    pub fn json(&self) -> String {
        let rows: Vec<String> =
            self.0.iter().map(|(name, _, value)| format!("  \"{name}\": {}", nested(value, ["[", "]"]))).collect();
        format!("{{\n{}\n}}\n", rows.join(",\n"))
    }

    /// Writes the model as a header in C: `MODEL_A`, `MODEL_SAMPLE_S` and so on.
    pub fn c(&self) -> String {
        let mut text = "// Linear model about hover, written by `trefoil new`.\n\n#pragma once\n".to_owned();
        let (states, inputs) = self.size();
        let _ = writeln!(text, "\nenum {{ MODEL_STATES = {states}, MODEL_INPUTS = {inputs} }};");
        for (name, meaning, value) in &self.0 {
            let size = match value {
                Value::Number(_) => String::new(),
                Value::List(list) => format!("[{}]", list.len()),
                Value::Table(rows) => format!("[{}][{}]", rows.len(), rows[0].len()),
            };
            let (name, value) = (name.to_uppercase(), nested(value, ["{", "}"]));
            let _ = writeln!(text, "\n// {meaning}.\nstatic const double MODEL_{name}{size} = {value};");
        }
        text
    }

    /// Writes the model as constants in Rust: `A`, `SAMPLE_S` and so on.
    pub fn rust(&self) -> String {
        let mut text = "//! Linear model about hover, written by `trefoil new`.\n\n#![allow(dead_code)]\n".to_owned();
        let (states, inputs) = self.size();
        let _ = writeln!(text, "\npub const STATES: usize = {states};\npub const INPUTS: usize = {inputs};");
        for (name, meaning, value) in &self.0 {
            let kind = match value {
                Value::Number(_) => "f64".to_owned(),
                Value::List(list) => format!("[f64; {}]", list.len()),
                Value::Table(rows) => format!("[[f64; {}]; {}]", rows[0].len(), rows.len()),
            };
            let (name, value) = (name.to_uppercase(), nested(value, ["[", "]"]));
            let _ = writeln!(text, "\n/// {meaning}.\npub const {name}: {kind} = {value};");
        }
        text
    }

    /// Returns the numbers of states and inputs.
    fn size(&self) -> (usize, usize) {
        let table = self.0.iter().find_map(|(name, _, value)| match value {
            Value::Table(rows) if *name == "b" => Some((rows.len(), rows[0].len())),
            _ => None,
        });
        table.expect("the model has B")
    }
}

/// Writes a value with the brackets `open` and `close` around its lists, and every number as the shortest text that
/// parses to the same bits.
fn nested(value: &Value, [open, close]: [&str; 2]) -> String {
    let row = |numbers: &Vec<f64>| {
        let numbers: Vec<String> = numbers.iter().map(|number| format!("{number:?}")).collect();
        format!("{open}{}{close}", numbers.join(", "))
    };
    match value {
        Value::Number(number) => format!("{number:?}"),
        Value::List(list) => row(list),
        Value::Table(rows) => {
            let rows: Vec<String> = rows.iter().map(|numbers| format!("    {}", row(numbers))).collect();
            format!("{open}\n{}\n  {close}", rows.join(",\n"))
        }
    }
}
