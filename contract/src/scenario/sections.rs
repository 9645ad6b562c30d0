//! The tables of a scenario file, one struct each. Names and units are the file's.

use airframe::{ActuatorLaw, Limits, Parameters};
use serde::{Deserialize, Serialize};

/// Everything that decides a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Scenario {
    /// What this run is called; its folder and report carry it.
    pub name: String,
    /// Which defaults it starts from.
    pub profile: Profile,
    /// How the ring is turned.
    pub run: Run,
    /// Where to fly.
    pub mission: Mission,
    /// Where to start, relative to hover trim.
    pub initial: Initial,
    /// Table I.
    pub airframe: Parameters,
    /// The vehicle as it really is.
    pub plant: Plant,
    /// The position controller.
    pub guidance: Guidance,
    /// The attitude controller.
    pub mpc: Mpc,
    /// The control allocation.
    pub mixer: Mixer,
    /// What the run must stay inside of to count as flown.
    pub bounds: Bounds,
    /// How the processes are scheduled.
    pub realtime: Realtime,
}

/// The two sets of defaults.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Profile {
    /// The paper's controller as verified: fragile, below 5 ms of delay.
    Paper,
    /// The stack's own: lag and delay in the model, exact constraints.
    Robust,
}

/// The three ways to turn the same ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// Processes; the plant is released by the clock.
    Realtime,
    /// Processes; the plant is released by its own tick's ACTUATORS.
    Lockstep,
    /// One thread calls the four steps in order.
    Inprocess,
}

/// `[run]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Run {
    /// How the ring is turned.
    pub mode: Mode,
    /// Simulated time \[s\].
    pub duration_s: f64,
    /// Seed of every random stream.
    pub seed: u64,
    /// Dead time between mixer output and actuators \[ms\]; the held command acts meanwhile.
    pub command_delay_ms: f64,
    /// Plus uniform 0..this \[ms\].
    pub command_jitter_ms: f64,
    /// A dropped command leaves the previous one in force.
    pub command_drop_probability: f64,
}

/// `[mission]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Mission {
    /// Which trajectory.
    pub trajectory: TrajectoryKind,
    /// `step`: from 0 to this, NED \[m\].
    pub step_m: [f64; 3],
    /// `step`: when \[s\].
    pub step_at_s: f64,
    /// `waypoints`: NED \[m\], reached at `times_s`.
    pub waypoints_m: Vec<[f64; 3]>,
    /// `waypoints`: when each is reached \[s\].
    pub times_s: Vec<f64>,
    /// How each leg's velocity rises and falls.
    pub ramp_s: Ramp,
    /// Heading reference \[deg\], constant or steps.
    pub heading_deg: Heading,
}

/// `mission.trajectory`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TrajectoryKind {
    /// The paper's surveillance square (waypoints of READING: 8 m, 60 s).
    Survey,
    /// Stay at the origin.
    Hover,
    /// One step of the position reference.
    Step,
    /// Climb 10 m, one lap of 5 m radius, descend.
    Circle,
    /// The scenario's own waypoints.
    Waypoints,
}

/// `mission.ramp_s`: seconds of velocity ramp (0 = constant velocity), or `"min-jerk"`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected seconds, or \"min-jerk\"")]
pub enum Ramp {
    /// Trapezoid of velocity with ramps this long \[s\].
    Seconds(f64),
    /// A named shape.
    Named(RampName),
}

/// The named velocity shapes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RampName {
    /// Quintic: zero velocity and acceleration at both ends.
    #[serde(rename = "min-jerk")]
    MinJerk,
}

/// `mission.heading_deg`: one value, or `[[t_s, deg], ...]` steps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "expected degrees, or steps [[t_s, deg], ...]")]
pub enum Heading {
    /// Constant \[deg\].
    Constant(f64),
    /// From each time \[s\] on, this heading \[deg\].
    Steps(Vec<(f64, f64)>),
}

/// `[initial]`: added to hover trim.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Initial {
    /// NED \[m\].
    pub position_m: [f64; 3],
    /// Body \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Roll, pitch, yaw \[deg\].
    pub attitude_deg: [f64; 3],
    /// Body rates \[rad/s\].
    pub rates_radps: [f64; 3],
}

/// `[plant]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plant {
    /// RK4 step \[s\].
    pub substep_s: f64,
    /// Rotor time constant \[s\].
    pub rotor_lag_s: f64,
    /// Servo time constant \[s\].
    pub servo_lag_s: f64,
    /// \[rotor speed unit / s\]
    pub rotor_rate_limit: f64,
    /// \[rad/s\]
    pub servo_rate_limit_radps: f64,
    /// Idle speed \[rotor speed unit\].
    pub rotor_speed_min: f64,
    /// Highest speed over trim speed.
    pub rotor_speed_max_ratio: f64,
    /// \[deg\]
    pub tilt_max_deg: f64,
    /// Linear drag on the air-relative body velocity \[N s/m\].
    pub drag_linear_nspm: [f64; 3],
    /// Quadratic drag \[N s2/m2\].
    pub drag_quadratic_ns2pm2: f64,
    /// Whether the vehicle has the pitching moment of the tilted rotor's torque.
    pub tilt_reaction: bool,
    /// Factor on thrust and torque of each rotor.
    pub rotor_effectiveness: [f64; 3],
    /// Wind steps: from \[s\], NED velocity of the air \[m/s\].
    pub wind_ned_mps: Vec<(f64, [f64; 3])>,
    /// Disturbance steps: from \[s\], force NED \[N\], moment body \[N m\].
    pub disturbance: Vec<(f64, [f64; 3], [f64; 3])>,
    /// Standard deviations of the measurement noise.
    pub noise: Noise,
}

/// `plant.noise`
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Noise {
    /// \[m\]
    pub position_m: f64,
    /// \[m/s\]
    pub velocity_mps: f64,
    /// \[deg\]
    pub attitude_deg: f64,
    /// \[deg/s\]
    pub rates_dps: f64,
}

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

/// `[bounds]`: metrics of the run (see run.json) that must not be exceeded; absent = not judged.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Bounds {
    /// \[m\]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_position_error_m: Option<f64>,
    /// Altitude error for t in \[10, 50\] s \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_altitude_error_horizontal_m: Option<f64>,
    /// Altitude error otherwise \[m\].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_altitude_error_vertical_m: Option<f64>,
    /// \[m\]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub final_position_error_m: Option<f64>,
}

/// `[realtime]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Realtime {
    /// Scheduling class asked for; without the privilege the stack runs as `other` and says so.
    pub policy: Policy,
    /// Lock the processes' memory.
    pub lock_memory: bool,
}

/// `realtime.policy`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Policy {
    /// `SCHED_FIFO`, priorities rising downstream.
    Fifo,
    /// `SCHED_OTHER`.
    Other,
}

impl Default for Scenario {
    /// The robust profile.
    fn default() -> Self {
        Self::of(Profile::Robust)
    }
}

impl Scenario {
    /// Sample time of the ring \[ns\].
    pub const SAMPLE_NS: u64 = 10_000_000;
    /// Sample time of the ring \[s\].
    pub const SAMPLE_S: f64 = 0.01;

    /// Number of periods in the run.
    pub fn ticks(&self) -> u64 {
        (self.run.duration_s / Self::SAMPLE_S).round() as u64
    }

    /// Amplitude limits of the actuators.
    pub fn limits(&self) -> Limits {
        let p = &self.plant;
        Limits::new(&self.airframe, p.rotor_speed_min, p.rotor_speed_max_ratio, p.tilt_max_deg.to_radians())
    }

    /// The actuators as they are.
    pub fn actuator_law(&self) -> ActuatorLaw {
        ActuatorLaw {
            limits: self.limits(),
            rotor_lag_s: self.plant.rotor_lag_s,
            servo_lag_s: self.plant.servo_lag_s,
            rotor_rate_limit: self.plant.rotor_rate_limit,
            servo_rate_limit_radps: self.plant.servo_rate_limit_radps,
        }
    }
}
