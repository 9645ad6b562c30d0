//! The metrics of a flight.

use schemars::JsonSchema;
use serde::{Deserialize, Deserializer, Serialize};

/// Metrics of run.json. Errors, effort and counts of commands are those of the flight in the air: a vehicle that waits
/// for its take-off or has landed does not count. A following error without a sample is NaN, which is null
/// in JSON.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
pub struct Metrics {
    /// Largest Euclidean position error \[m\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub max_position_error_m: f64,
    /// RMS of the Euclidean position error \[m\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub rms_position_error_m: f64,
    /// Largest altitude error \[m\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub max_altitude_error_m: f64,
    /// Euclidean position error at the last sample \[m\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub final_position_error_m: f64,
    /// Integral of the Euclidean position error over the flight \[m s\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub position_error_integral_ms: f64,
    /// RMS of the true phi, theta, psi against their references, as differences of angles \[deg\].
    #[serde(deserialize_with = "each_or_nan")]
    #[schemars(with = "[Option<f64>; 3]")]
    pub rms_attitude_error_deg: [f64; 3],
    /// RMS of the true p, q, r against their references \[deg/s\].
    #[serde(deserialize_with = "each_or_nan")]
    #[schemars(with = "[Option<f64>; 3]")]
    pub rms_rates_error_dps: [f64; 3],
    /// RMS of the true w, the body z velocity, against its reference \[m/s\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub rms_w_error_mps: f64,
    /// Mean of the demand's part of the cost (4), u'Ru with the weights `attitude.mpc.r`. NaN without a demand, and in
    /// a file from before this metric.
    #[serde(default = "nan", deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub demand_effort: f64,
    /// Largest body rate about any axis \[rad/s\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub max_rate_radps: f64,
    /// Lowest true speed of any rotor \[rotor speed unit\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub rotor_speed_min: f64,
    /// Highest true speed of any rotor \[rotor speed unit\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub rotor_speed_max: f64,
    /// Largest true tilt angle in either direction \[deg\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub tilt_max_deg: f64,
    /// Time of the first touchdown after a flight \[s\]. This metric and the next three are NaN without a touchdown,
    /// and in a file from before them.
    #[serde(default = "nan", deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub touchdown_s: f64,
    /// Vertical speed one sample before that touchdown, down positive \[m/s\].
    #[serde(default = "nan", deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub touchdown_sink_mps: f64,
    /// Horizontal speed one sample before that touchdown \[m/s\].
    #[serde(default = "nan", deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub touchdown_drift_mps: f64,
    /// Angle between the body z axis and the vertical at that touchdown \[deg\].
    #[serde(default = "nan", deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub touchdown_tilt_deg: f64,
    /// Time on the ground, before the flight and after it \[s\].
    #[serde(default)]
    pub on_ground_s: f64,
    /// Number of commands clipped at a limit.
    pub commands_saturated: u64,
    /// Commands for which (42) or (43) asked for the root of a negative number.
    pub negative_squares: u64,
    /// Time the mixer flew without a demand \[s\].
    #[serde(deserialize_with = "or_nan")]
    #[schemars(with = "Option<f64>")]
    pub fallback_s: f64,
}

/// Reads a number. Null, by which JSON stands for NaN and infinities, becomes NaN.
pub fn or_nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

fn nan() -> f64 {
    f64::NAN
}

fn each_or_nan<'de, D: Deserializer<'de>>(from: D) -> Result<[f64; 3], D::Error> {
    let all = <[Option<f64>; 3]>::deserialize(from)?;
    Ok(all.map(|value| value.unwrap_or(f64::NAN)))
}
