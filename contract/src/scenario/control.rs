//! `[guidance]`, `[mpc]` and `[mixer]`: the controllers' settings.

use serde::{Deserialize, Serialize};

/// `[guidance]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "nine gains of Table III, named as printed there")]
#[expect(clippy::struct_excessive_bools, reason = "independent switches of the file")]
pub struct Guidance {
    pub kp_phi: f64,
    pub ki_phi: f64,
    pub kd_phi: f64,
    pub kp_theta: f64,
    pub ki_theta: f64,
    pub kd_theta: f64,
    pub kp_w: f64,
    pub ki_w: f64,
    pub kd_w: f64,
    /// What `phi_ref` is added to.
    pub roll_reference: RollReference,
    /// What the D terms act on.
    pub derivative: Derivative,
    /// References of p, q, r.
    pub rate_reference: RateReference,
    /// Rotate errors and feed-forward by psi.
    pub heading_frame: bool,
    /// `phi += a_y/g`, `theta -= a_x/g`.
    pub acceleration_feedforward: bool,
    /// w += reference climb rate.
    pub velocity_feedforward: bool,
    /// w such that the inertial vertical speed is the wanted one.
    pub exact_w: bool,
    /// Bandwidth of the outer acceleration observer \[rad/s\], 0 = off.
    pub disturbance_observer_radps: f64,
    /// \[deg\]
    pub angle_limit_deg: f64,
    /// \[m/s\]
    pub w_limit_mps: f64,
    /// Clamp of each error integral \[m s\].
    pub integral_limit: f64,
}

/// `guidance.roll_reference`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RollReference {
    /// Added to `phi_trim`.
    Trim,
    /// Taken as it is.
    Absolute,
}

/// `guidance.derivative`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Derivative {
    /// Backward difference of the position error, 0 at the first tick.
    Error,
    /// Reference velocity minus measured velocity.
    Velocity,
}

/// `guidance.rate_reference`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RateReference {
    /// Backward difference of the angle references, through the inverse of (8).
    Difference,
    /// Zero.
    Zero,
}

/// `[mpc]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mpc {
    /// Diagonal of Q on w, phi, theta, psi, p, q, r.
    pub q: [f64; 7],
    /// Diagonal of R on col, lon, lat, ped.
    pub r: [f64; 4],
    /// Prediction horizon Np \[samples\].
    pub np: usize,
    /// Control horizon Nu \[samples\].
    pub nu: usize,
    /// Terminal weight P.
    pub terminal: Terminal,
    /// Which actuator constraints the moves obey.
    pub constraints: Constraints,
    /// Time constant of the modelled actuator lag \[s\], 0 = not modelled.
    pub actuator_lag_model_s: f64,
    /// Predict one sample forward with the last command.
    pub delay_compensation: bool,
    /// Gain of the input-disturbance estimate, 0 = off.
    pub disturbance_gain: f64,
}

/// `mpc.terminal`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Terminal {
    /// P = 0.
    Zero,
    /// P = Q.
    Q,
    /// P solves the discrete algebraic Riccati equation of the model in use.
    Dare,
}

/// `mpc.constraints`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Constraints {
    /// The unconstrained optimum, whatever it asks for.
    None,
    /// The smallest box around the exact set.
    Box,
    /// The exact set.
    Cone,
}

/// `[mixer]`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mixer {
    /// Use the mixing matrix with the tilt reaction.
    pub tilt_reaction: bool,
    /// Project the demand onto the exact actuator set.
    pub projection: bool,
}
