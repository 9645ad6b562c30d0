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
    /// Of the wanted vertical speed, up or down \[m/s\]: `exact_w` comes after it.
    pub climb_limit_mps: f64,
    /// Of the reference of w, after `exact_w` \[m/s\]. Level flight at speed V has w = V sin theta: a limit below that costs
    /// altitude.
    pub w_limit_mps: f64,
    /// How fast the heading reference turns \[deg/s\]; 0 = it steps.
    pub heading_rate_limit_dps: f64,
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
    /// The control law of the attitude loop. Weights, model and disturbance estimate serve `mpc` and `lqr`, constraints
    /// `mpc` alone.
    pub law: Law,
    /// Where the prediction model is linearised.
    pub model: Model,
    /// Diagonal of Q on w, phi, theta, psi, p, q, r.
    pub q: [f64; 7],
    /// Diagonal of R on col, lon, lat, ped: R1 of Table IV.
    pub r: [f64; 4],
    /// Diagonal of the weight on their change from sample to sample: R2 of Table IV, which the paper has zero. For `mpc` alone.
    pub r_rate: [f64; 4],
    /// Prediction horizon Np \[samples\].
    pub np: usize,
    /// Control horizon Nu \[samples\].
    pub nu: usize,
    /// Terminal weight P.
    pub terminal: Terminal,
    /// Which actuator constraints the moves obey.
    pub constraints: Constraints,
    /// What keeps the moves inside.
    pub solver: Solver,
    /// Iterations granted to a solve.
    pub max_iterations: u32,
    /// Time granted to a solve of Clarabel in real time \[ms\], 0 = unlimited. Lockstep and in process do without: a
    /// flight that repeats bit for bit cannot depend on the clock.
    pub time_limit_ms: f64,
    /// Whether predicted states are kept inside the limits below.
    pub state_constraints: StateConstraints,
    /// Cost of leaving a state limit: 1/2 penalty (excess / limit)^2 per predicted sample.
    pub state_penalty: f64,
    /// Limits of phi, theta, psi either way \[deg\].
    pub attitude_limit_deg: [f64; 3],
    /// Limits of p, q, r either way \[deg/s\].
    pub rates_limit_dps: [f64; 3],
    /// Time constant of the modelled actuator lag \[s\], 0 = not modelled.
    pub actuator_lag_model_s: f64,
    /// Predict one sample forward with the last command.
    pub delay_compensation: bool,
    /// Gain of the input-disturbance estimate, 0 = off.
    pub disturbance_gain: f64,
    /// Gains of the law `pid`.
    pub pid: PidGains,
}

/// `[mpc.pid]`: accelerations per error, so that the same gains give another vehicle the same poles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PidGains {
    /// On the errors of w \[1/s\] and of theta, phi, psi \[1/s2\], which drive col, lon, lat, ped.
    pub kp: [f64; 4],
    /// On the integrals of the same errors \[1/s2\], \[1/s3\]; 0 = no integral.
    pub ki: [f64; 4],
    /// On the errors of q, p, r \[1/s\], which drive lon, lat, ped.
    pub kd: [f64; 3],
}

impl Default for PidGains {
    /// All three poles of each angle at -4 rad/s, what a loop of 30 ms of lag and 20 ms of delay bears with a margin; both of
    /// the climb at -2.
    fn default() -> Self {
        Self { kp: [4.0, 48.0, 48.0, 48.0], ki: [4.0, 64.0, 64.0, 64.0], kd: [12.0; 3] }
    }
}

/// `mpc.law`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// The paper's: the best plan over the horizon.
    Mpc,
    /// The same cost over an infinite horizon, without constraints.
    Lqr,
    /// One PID per axis.
    Pid,
}

/// `mpc.model`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// At hover.
    Hover,
    /// At hover; the disturbance estimate knows the term `q u - p v` of the vertical velocity at the measured state.
    Coupled,
    /// At trimmed level flight at several velocities, blended by the measured one.
    Scheduled,
    /// At the measured state, every sample.
    Ltv,
}

/// `mpc.solver`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Clarabel, an interior-point method.
    Clarabel,
    /// Our own dual active-set method.
    ActiveSet,
}

/// `mpc.state_constraints`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StateConstraints {
    /// Not imposed.
    None,
    /// Imposed at a price, so that there is always a plan.
    Soft,
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mixer {
    /// Use the mixing matrix with the tilt reaction.
    pub tilt_reaction: bool,
    /// Take the nearest demand inside the exact actuator set for one that is outside.
    pub projection: bool,
    /// Cost of a miss of col, lon, lat, ped in the projection, per N^2 and (N m)^2: what costs least is given up first. It is
    /// also that of the controller where its solver fails.
    pub projection_weights: [f64; 4],
}
