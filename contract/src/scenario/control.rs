//! `[guidance]`, `[mpc]` and `[mixer]`: the controllers' settings.

use serde::{Deserialize, Serialize};

/// Settings of the position controller, `[guidance]`.
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
    /// Roll angle that `phi_ref` is added to.
    pub roll_reference: RollReference,
    /// Error derivative that the D terms act on.
    pub derivative: Derivative,
    /// References of p, q, r.
    pub rate_reference: RateReference,
    /// `true` to rotate errors and feed-forward by psi into the heading frame.
    pub heading_frame: bool,
    /// `true` to feed the reference acceleration forward: `phi += a_y/g`, `theta -= a_x/g`.
    pub acceleration_feedforward: bool,
    /// `true` to feed the reference climb rate forward to w.
    pub velocity_feedforward: bool,
    /// `true` to choose w such that the inertial vertical speed is the wanted one.
    pub exact_w: bool,
    /// Bandwidth of the outer acceleration observer \[rad/s\], 0 = off.
    pub disturbance_observer_radps: f64,
    /// Largest references of roll (without trim) and pitch, either way \[deg\].
    pub angle_limit_deg: f64,
    /// Limit of the wanted vertical speed, up or down, before `exact_w` \[m/s\].
    pub climb_limit_mps: f64,
    /// Limit of the reference of w, after `exact_w` \[m/s\]. Level flight at speed V has w = V sin theta; a lower limit
    /// costs altitude.
    pub w_limit_mps: f64,
    /// Rate at which the heading reference turns \[deg/s\]; 0 = it steps.
    pub heading_rate_limit_dps: f64,
    /// Clamp of each error integral \[m s\].
    pub integral_limit: f64,
}

/// Zero point of the roll reference, `guidance.roll_reference`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RollReference {
    /// Roll angle `phi_trim`.
    Trim,
    /// Zero: the reference is used as it is.
    Absolute,
}

/// Input of the D terms, `guidance.derivative`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Derivative {
    /// Backward difference of the position error, 0 at the first tick.
    Error,
    /// Reference velocity minus measured velocity.
    Velocity,
}

/// References of the body rates, `guidance.rate_reference`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum RateReference {
    /// Backward difference of the angle references, through the inverse of (8).
    Difference,
    /// Zero body rates.
    Zero,
}

/// Settings of the attitude controller, `[mpc]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mpc {
    /// Control law of the attitude loop. `mpc` and `lqr` use weights, model and disturbance estimate; only `mpc` uses
    /// constraints.
    pub law: Law,
    /// Point at which the prediction model is linearised.
    pub model: Model,
    /// Diagonal of Q on w, phi, theta, psi, p, q, r.
    pub q: [f64; 7],
    /// Diagonal of R on col, lon, lat, ped: R1 of Table IV.
    pub r: [f64; 4],
    /// Diagonal of the weight on their change from sample to sample, for `mpc` only: R2 of Table IV, zero in the paper.
    pub r_rate: [f64; 4],
    /// Prediction horizon Np \[samples\].
    pub np: usize,
    /// Control horizon Nu \[samples\].
    pub nu: usize,
    /// Terminal weight P.
    pub terminal: Terminal,
    /// Actuator constraints on the moves.
    pub constraints: Constraints,
    /// Solver of the constrained problem.
    pub solver: Solver,
    /// Largest number of iterations of a solve.
    pub max_iterations: u32,
    /// Longest solve of Clarabel in real time \[ms\], 0 = unlimited. It has no effect in lockstep and in process,
    /// because a flight that repeats bit for bit cannot depend on the clock.
    pub time_limit_ms: f64,
    /// Constraints that keep predicted states inside the limits below.
    pub state_constraints: StateConstraints,
    /// Cost of leaving a state limit: 1/2 penalty (excess / limit)^2 per predicted sample.
    pub state_penalty: f64,
    /// Limits of phi, theta, psi in either direction \[deg\].
    pub attitude_limit_deg: [f64; 3],
    /// Limits of p, q, r in either direction \[deg/s\].
    pub rates_limit_dps: [f64; 3],
    /// Time constant of the modelled actuator lag \[s\], 0 = not modelled.
    pub actuator_lag_model_s: f64,
    /// `true` to predict one sample ahead with the last command before solving.
    pub delay_compensation: bool,
    /// Gain of the input-disturbance estimate, 0 = off.
    pub disturbance_gain: f64,
    /// Gains of the law `pid`.
    pub pid: PidGains,
}

/// Gains of the law `pid`, `[mpc.pid]`: accelerations per error, so that another vehicle has the same poles with them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PidGains {
    /// Gains on the errors of w \[1/s\] and of theta, phi, psi \[1/s2\], which drive col, lon, lat, ped.
    pub kp: [f64; 4],
    /// Gains on the integrals of these errors \[1/s2\], \[1/s3\]; 0 = no integral.
    pub ki: [f64; 4],
    /// Gains on the errors of q, p, r \[1/s\], which drive lon, lat, ped.
    pub kd: [f64; 3],
}

impl Default for PidGains {
    /// Places all three poles of each angle at -4 rad/s, which a loop with 30 ms of lag and 20 ms of delay tolerates
    /// with a margin, and both poles of the climb at -2.
    fn default() -> Self {
        Self { kp: [4.0, 48.0, 48.0, 48.0], ki: [4.0, 64.0, 64.0, 64.0], kd: [12.0; 3] }
    }
}

/// Control law of the attitude loop, `mpc.law`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// The paper's law: the best plan over the horizon.
    Mpc,
    /// Optimum of that cost over an infinite horizon, without constraints.
    Lqr,
    /// One PID per axis.
    Pid,
}

/// Linearisation of the prediction model, `mpc.model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Model at hover.
    Hover,
    /// Model at hover; the disturbance estimate takes the term `q u - p v` of w from the measured state.
    Coupled,
    /// Models at trimmed level flight at several velocities, blended by the measured velocity.
    Scheduled,
    /// Model at the measured state, renewed at every sample.
    Ltv,
}

/// Solver of the constrained problem, `mpc.solver`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Solver {
    /// Clarabel, an interior-point method.
    Clarabel,
    /// Our own dual active-set method.
    ActiveSet,
}

/// Constraints on predicted states, `mpc.state_constraints`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum StateConstraints {
    /// No constraints.
    None,
    /// Soft constraints: a violation has a cost, so that there is always a plan.
    Soft,
}

/// Terminal weight P, `mpc.terminal`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Terminal {
    /// P = 0.
    Zero,
    /// P = Q.
    Q,
    /// Solution P of the discrete algebraic Riccati equation of the model in use.
    Dare,
}

/// Constraints on the actuators, `mpc.constraints`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Constraints {
    /// No constraints: the unconstrained optimum.
    None,
    /// Smallest box around the exact actuator set.
    Box,
    /// Exact actuator set.
    Cone,
}

/// Settings of the control allocation, `[mixer]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mixer {
    /// `true` to use the mixing matrix with the tilt reaction.
    pub tilt_reaction: bool,
    /// `true` to replace a demand outside the exact actuator set by the nearest one inside.
    pub projection: bool,
    /// Cost of an error in col, lon, lat, ped in the projection, per N^2 and (N m)^2: the cheapest is given up first.
    /// The controller uses the same costs when its solver fails.
    pub projection_weights: [f64; 4],
}
