//! `[guidance]`, `[attitude]` and `[mixer]`: the controllers' settings.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Settings of the position controller, `[guidance]`. The nine gains of Table III have the names printed there.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(clippy::struct_excessive_bools, reason = "independent switches of the file")]
pub struct GuidanceSettings {
    /// Gain of the roll reference, on the lateral position error, to the right \[rad/m\].
    pub kp_phi: f64,
    /// Gain of the roll reference, on the integral of the lateral position error, to the right \[rad/(m s)\].
    pub ki_phi: f64,
    /// Gain of the roll reference, on the derivative of the lateral position error, to the right \[rad s/m\].
    pub kd_phi: f64,
    /// Gain of the pitch reference, on the longitudinal position error, ahead \[rad/m\].
    pub kp_theta: f64,
    /// Gain of the pitch reference, on the integral of the longitudinal position error, ahead \[rad/(m s)\].
    pub ki_theta: f64,
    /// Gain of the pitch reference, on the derivative of the longitudinal position error, ahead \[rad s/m\].
    pub kd_theta: f64,
    /// Gain of the vertical speed, down positive, on the vertical position error, down \[1/s\].
    pub kp_w: f64,
    /// Gain of the vertical speed, down positive, on the integral of the vertical position error, down \[1/s2\].
    pub ki_w: f64,
    /// Gain of the vertical speed, down positive, on the derivative of the vertical position error, down \[1\].
    pub kd_w: f64,
    /// Roll angle that `phi_ref` is added to.
    pub roll_reference: RollReference,
    /// Error derivative that the D terms act on.
    pub derivative: Derivative,
    /// References of the body rates p, q, r.
    pub rate_reference: RateReference,
    /// `true` to rotate errors and feed-forward by psi into the heading frame (ahead, right, down); `false` = north is
    /// ahead and east is right, whatever the heading.
    pub heading_frame: bool,
    /// `true` to feed the reference acceleration forward: `phi += a_y/g`, `theta -= a_x/g`.
    pub acceleration_feedforward: bool,
    /// `true` to feed the reference climb rate forward to w.
    pub velocity_feedforward: bool,
    /// `true` to choose w such that the vertical speed in the world is the wanted vertical speed.
    pub exact_w: bool,
    /// Bandwidth of the outer acceleration observer \[rad/s\], below `run.rate_hz`; 0 = off.
    pub disturbance_observer_radps: f64,
    /// Limit of the references of roll (without trim) and pitch \[deg\]: with `heading_frame` of their common tilt, in
    /// any direction; without it of each angle.
    pub angle_limit_deg: f64,
    /// Limit of the wanted vertical speed in the world, up or down, before `exact_w` \[m/s\].
    pub climb_limit_mps: f64,
    /// Limit of the reference of w, the body z velocity, after `exact_w` \[m/s\]. Level flight at speed V has w = V sin
    /// theta; a lower limit costs altitude.
    pub w_limit_mps: f64,
    /// Rate at which the heading reference turns \[deg/s\]; 0 = the reference steps.
    pub heading_rate_limit_dps: f64,
    /// Limit of the horizontal error integral, in any direction, and of the vertical error integral \[m s\].
    pub integral_limit: f64,
    /// Time by which the feed-forward and the heading reference are ahead of the position reference \[s\]: about the
    /// time in which the vehicle follows a reference of its attitude.
    pub lead_s: f64,
    /// Time for which REFERENCE tells how the reference will change; 0 = no preview \[s\]. The law `mpc` plans with
    /// this preview.
    pub preview_s: f64,
}

/// Zero point of the roll reference, `guidance.roll_reference`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RollReference {
    /// Roll angle `phi_trim`.
    Trim,
    /// Zero: the reference is used as it is.
    Absolute,
}

/// Input of the D terms, `guidance.derivative`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Derivative {
    /// Backward difference of the position error, 0 at the first tick.
    Error,
    /// Reference velocity minus measured velocity.
    Velocity,
}

/// References of the body rates, `guidance.rate_reference`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RateReference {
    /// Backward difference of the angle references, through the inverse of (8).
    Difference,
    /// Zero body rates.
    Zero,
}

/// Settings of the attitude controller, `[attitude]`: the law, and what several laws share.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Attitude {
    /// Control law of the attitude loop.
    pub law: Law,
    /// Time constant of the modelled actuator lag \[s\]; 0 = not modelled, else at least 0.001.
    pub actuator_lag_model_s: f64,
    /// Time constant of the servo in the model \[s\], at least 0.001; absent = that of the rotors,
    /// `actuator_lag_model_s`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub servo_lag_model_s: Option<f64>,
    /// Time over which the state is predicted before solving: `false` = none, `true` = one sample with the last demand,
    /// `"measured"` = the delay that STATE reports, with the demands that are still under way.
    pub delay_compensation: DelayCompensation,
    /// Last gain of the input-disturbance estimate, to which it falls from 0.2: share of the prediction error that one
    /// sample takes in; 0 = off. By default 2 per second in profile `robust`. The law `indi` has an estimate of its
    /// own.
    pub disturbance_gain: f64,
    /// Model and costs of the laws `mpc` and `lqr`; horizons and constraints of `mpc`.
    pub mpc: MpcSettings,
    /// Gains of the law `pid`.
    pub pid: PidGains,
    /// Gains of the law `geometric`, with the units of `pid`; the gains of phi, theta, psi are about x, y, z of the
    /// level frame, and w is the vertical speed.
    pub geometric: PidGains,
    /// Gains of the law `indi`.
    pub indi: IndiGains,
}

/// Model and costs of the laws `mpc` and `lqr`, `[attitude.mpc]`. Only `mpc` has horizons and constraints.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MpcSettings {
    /// Point at which the prediction model is linearised.
    pub model: Model,
    /// Diagonal of Q: cost of the squared errors of w \[s2/m2\], of phi, theta, psi \[1/rad2\] and of p, q, r
    /// \[s2/rad2\].
    pub q: [f64; 7],
    /// Diagonal of R: cost of the squares of col \[1/N2\] and of lon, lat, ped \[1/(N m)2\], as deviations from trim;
    /// R1 of Table IV. By default scaled with mass and inertia of `airframe`; the defaults are for the vehicle of Table
    /// I.
    pub r: [f64; 4],
    /// Diagonal of the weight on the change of col \[1/N2\] and of lon, lat, ped \[1/(N m)2\] from sample to sample,
    /// for `mpc` only: R2 of Table IV, zero in the paper.
    pub r_rate: [f64; 4],
    /// Prediction horizon \[s\]: Np, the nearest whole number of samples, is 1 to 200. By default no more than 200
    /// samples in profile `robust`.
    pub prediction_horizon_s: f64,
    /// Control horizon \[s\], in which the plan moves: Nu, the nearest whole number of samples, is 1 to Np. By default
    /// no more than 20 samples in profile `robust`.
    pub control_horizon_s: f64,
    /// Terminal weight P.
    pub terminal: Terminal,
    /// Actuator constraints on the moves.
    pub constraints: Constraints,
    /// Solver of the constrained problem.
    pub solver: SolverName,
    /// Largest number of iterations of a solve.
    pub max_iterations: u32,
    /// Longest solve of Clarabel in real time \[ms\]; 0 = unlimited. It has no effect in lockstep and in process,
    /// because a flight that repeats bit for bit cannot depend on the clock.
    pub time_limit_ms: f64,
    /// Constraints that keep predicted states inside the limits below.
    pub state_constraints: StateConstraints,
    /// Limits of phi, theta, psi in either direction \[deg\].
    pub attitude_limit_deg: [f64; 3],
    /// Limits of the body rates p, q, r in either direction \[deg/s\].
    pub rates_limit_dps: [f64; 3],
}

/// Prediction over the delay of the commands, `attitude.delay_compensation`: `false`, `true` or `"measured"`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected true, false or \"measured\"")]
pub enum DelayCompensation {
    /// Prediction over one sample with the last demand (`true`), or none (`false`).
    Sample(bool),
    /// Prediction over a delay that has a name.
    Named(DelayName),
}

impl DelayCompensation {
    /// Returns whether the delay is the measured delay.
    pub fn is_measured(self) -> bool {
        self == Self::Named(DelayName::Measured)
    }
}

/// Named delays.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum DelayName {
    /// Age at which commands take effect, as STATE reports it; the demands that are still under way are taken into
    /// account.
    Measured,
}

/// Gains of the law `pid`, `[attitude.pid]`: accelerations per error, so that every vehicle has the same poles
/// with these gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
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

/// Gains of the law `indi`, `[attitude.indi]`: accelerations per error, like the gains of `geometric`, without
/// integrals.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct IndiGains {
    /// Gains on the errors of w \[1/s\] and of theta, phi, psi \[1/s2\], which drive col, lon, lat, ped.
    pub kp: [f64; 4],
    /// Gains on the errors of q, p, r \[1/s\], which drive lon, lat, ped.
    pub kd: [f64; 3],
    /// Bandwidth of each of the two low-passes on acceleration and actuators \[rad/s\].
    pub filter_radps: f64,
    /// Origin of the positions of the actuators.
    pub actuators: IndiActuators,
}

/// Origin of the actuators' positions in the law `indi`, `attitude.indi.actuators`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum IndiActuators {
    /// Simulated under the command in force, with the lag `attitude.actuator_lag_model_s`.
    #[default]
    Modelled,
    /// Measured, by `plant.sensors.telemetry`.
    Sensed,
}

impl Default for IndiGains {
    /// Places both poles of each angle at -6 rad/s and the pole of the climb at -4. The filter is five times as fast.
    fn default() -> Self {
        Self { kp: [4.0, 36.0, 36.0, 36.0], kd: [12.0; 3], filter_radps: 30.0, actuators: IndiActuators::Modelled }
    }
}

/// Control law of the attitude loop, `attitude.law`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Law {
    /// The paper's law: the best plan over the horizon.
    Mpc,
    /// Optimum of the cost of `mpc` over an infinite horizon, without constraints.
    Lqr,
    /// One PID per axis.
    Pid,
    /// Tilt before heading on SO(3), with the inverse of the rigid body's nonlinear equations.
    Geometric,
    /// Incremental nonlinear dynamic inversion: the measured acceleration replaces the model of disturbances.
    Indi,
}

/// Linearisation of the prediction model, `attitude.mpc.model`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Model {
    /// Model at hover.
    Hover,
    /// Model at hover; the disturbance estimate takes the term `q u - p v` of w from the measured state.
    Coupled,
    /// Models at trimmed level flight at several velocities, blended by the measured velocity.
    Scheduled,
}

/// Solver of the constrained problem, `attitude.mpc.solver`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SolverName {
    /// Clarabel, an interior-point method.
    Clarabel,
    /// Our own dual active-set method.
    ActiveSet,
}

/// Constraints on predicted states, `attitude.mpc.state_constraints`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StateConstraints {
    /// No constraints.
    None,
    /// Soft constraints: a violation has a cost, so that there is always a plan.
    Soft,
}

/// Terminal weight P, `attitude.mpc.terminal`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Terminal {
    /// P = 0.
    Zero,
    /// P = Q.
    Q,
    /// Solution P of the discrete algebraic Riccati equation of the model in use.
    Dare,
}

/// Constraints on the actuators, `attitude.mpc.constraints`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct MixerSettings {
    /// `true` to use the mixing matrix with the tilt reaction.
    pub tilt_reaction: bool,
    /// `true` to replace a demand outside the exact actuator set by the nearest demand inside.
    pub projection: bool,
    /// Cost of an error in col \[1/N2\] and in lon, lat, ped \[1/(N m)2\] in the projection: the cheapest is given up
    /// first. The controller uses the same costs when its solver fails.
    pub projection_weights: [f64; 4],
    /// Reaction to a dead rotor or a stuck tilt servo.
    pub broken_vehicle: BrokenVehicle,
}

/// Reaction of the mixer to a broken vehicle, `mixer.broken_vehicle`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum BrokenVehicle {
    /// Cut the thrust if a rotor is dead; a stuck tilt servo is not noticed.
    #[default]
    Cut,
    /// Give up yaw and descend in a spin, if the remaining rotors allow a spin.
    Descend,
}
