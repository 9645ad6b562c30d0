//! What is flown when demands stop coming: the ladder, and the law on its middle rungs.
//!
//! | newest demand | newest state | rung | what is commanded |
//! |---|---|---|---|
//! | below 15 ms old | any | used | the demand |
//! | below 30 ms | any | held | the demand, once more |
//! | below 2 s | below 50 ms | levelled | level, no vertical speed |
//! | older, or none came | below 50 ms | descending | level, 0.7 m/s down |
//! | 30 ms or older | below 500 ms | trim only | the trim command |
//! | 30 ms or older | older, or none came | cut | no thrust |
//!
//! Every tick finds its rung anew: the first fresh demand leads straight back to the top. Only a dead rotor
//! ([`crate::rotors`]) and a landing ([`crate::landing`]) end the flight for good. Over no ground a descent goes on until
//! demands come again.
//!
//! ```text
//! lon = Iyy (-a^2 theta             - 2 a q) - d_lon
//! lat = Ixx (-a^2 (phi - phi_trim)  - 2 a p) - d_lat
//! ped = Izz (                       -   a r) - d_ped
//! col = m a_z (descent - vd)                 - d_col        vd = -u sin theta + (v sin phi + w cos phi) cos theta
//! ```
//!
//! Both poles of an axis lie at `-a`. The loop crosses over at 2.06 a, where 30 ms of actuator lag and a period of 20
//! ms take 29 degrees of the 76 that the law has, at a = 5 rad/s; a demand every 20 ms from a state of 40 ms ago is
//! still stable. `d` is the last disturbance estimate of the controller: what the air or a weak rotor did a moment ago,
//! they still do.

use airframe::Parameters;
use contract::message::Kinematics;
use nalgebra::Vector4;

/// Poles of roll and pitch, and of the yaw rate, `a` \[rad/s\].
const BANDWIDTH_RADPS: f64 = 5.0;
/// Pole of the vertical speed, `a_z` \[rad/s\]: slower than the tilt, which decides where thrust points.
const CLIMB_BANDWIDTH_RADPS: f64 = 2.0;
/// Vertical speed of a descent, down positive \[m/s\]: slow enough to touch down.
const DESCENT_MPS: f64 = 0.7;

/// Below this age a demand is used as a new one \[ns\].
const USED_NS: u64 = 15_000_000;
/// A demand below this age is held \[ns\].
const HELD_NS: u64 = 30_000_000;
/// From this age of the demand on the vehicle descends \[ns\].
const LEVELLED_NS: u64 = 2_000_000_000;
/// Below this age a state is recent enough to level the vehicle from \[ns\].
const STATE_NS: u64 = 50_000_000;
/// From this age of the state on the thrust is cut: nothing is known of the vehicle \[ns\].
const TRIM_NS: u64 = 500_000_000;

/// One rung of the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rung {
    /// The demand.
    Used,
    /// The demand, once more.
    Held,
    /// Level, no vertical speed.
    Levelled,
    /// Level, and down.
    Descending,
    /// The trim command.
    TrimOnly,
    /// No thrust.
    Cut,
}

impl Rung {
    /// The rung for the ages of the newest demand and the newest state \[ns\].
    pub fn of(demand_ns: u64, state_ns: u64) -> Self {
        match (demand_ns, state_ns) {
            (..USED_NS, _) => Self::Used,
            (..HELD_NS, _) => Self::Held,
            (..LEVELLED_NS, ..STATE_NS) => Self::Levelled,
            (_, ..STATE_NS) => Self::Descending,
            (_, ..TRIM_NS) => Self::TrimOnly,
            _ => Self::Cut,
        }
    }
}

/// The law of the middle rungs.
#[derive(Debug, Clone)]
pub struct Level {
    /// m, Iyy, Ixx, Izz: what turns an acceleration into a demand.
    inertia: Vector4<f64>,
    roll_trim_rad: f64,
}

impl Level {
    /// The law for a vehicle whose trim has a roll angle.
    pub fn new(vehicle: &Parameters, roll_trim_rad: f64) -> Self {
        let inertia = Vector4::new(vehicle.mass_kg, vehicle.iyy_kgm2, vehicle.ixx_kgm2, vehicle.izz_kgm2);
        Self { inertia, roll_trim_rad }
    }

    /// col, lon, lat, ped \[N, N m, N m, N m\] that bring the vehicle level and its vertical speed to zero, or
    /// `descending` to that of a descent, before any disturbance.
    pub fn demand(&self, measured: &Kinematics, descending: bool) -> Vector4<f64> {
        let ([phi, theta, _], [p, q, r]) = (measured.attitude_rad, measured.rates_radps);
        let a = BANDWIDTH_RADPS;
        let descent_mps = if descending { DESCENT_MPS } else { 0.0 };
        self.inertia.component_mul(&Vector4::new(
            CLIMB_BANDWIDTH_RADPS * (descent_mps - measured.sink_mps()),
            -a * a * theta - 2.0 * a * q,
            -a * a * (phi - self.roll_trim_rad) - 2.0 * a * p,
            -a * r,
        ))
    }
}

#[cfg(test)]
mod tests;
