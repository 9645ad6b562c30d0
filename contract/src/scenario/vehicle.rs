//! `[plant]`: the vehicle as it really is, and what acts on it.

use serde::{Deserialize, Serialize};

/// `[plant]`
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Plant {
    /// Longest RK4 step \[s\]; a sample is divided into equal ones.
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
