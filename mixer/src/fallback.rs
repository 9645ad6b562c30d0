//! Fallback ladder for missing demands, and the control law of its middle rungs.
//!
//! | age of the newest demand | age of the newest state | rung | command |
//! |---|---|---|---|
//! | below 15 ms | any | used | the demand |
//! | below 30 ms | any | held | the same demand |
//! | below 2 s | below 50 ms | levelled | level, no vertical speed |
//! | 2 s or older, or none | below 50 ms | descending | level, 0.7 m/s down |
//! | 30 ms or older | below 500 ms | trim only | the trim command |
//! | 30 ms or older | 500 ms or older, or none | cut | no thrust |
//!
//! Every tick selects its rung anew: the first fresh demand is used at once. Only a broken
//! part ([`crate::rotors`]) and a landing ([`crate::landing`]) end the flight for good. Without a ground a descent
//! lasts until demands come again.
//!
//! A vehicle that descends with a broken part ([`crate::broken`]) uses no demand, because demands are for a whole
//! vehicle: the ladder then begins at the fourth row, with the law for the broken part.
//!
//! ```text
//! lon = Iyy (-a^2 theta             - 2 a q) - d_lon
//! lat = Ixx (-a^2 (phi - phi_trim)  - 2 a p) - d_lat
//! ped = Izz (                       -   a r) - d_ped
//! col = m a_z (descent - vd)                 - d_col        vd = -u sin theta + (v sin phi + w cos phi) cos theta
//! ```
//!
//! Both poles of an axis are at `-a`. The loop crosses over at 2.06 a, where the law has a phase margin of 76 degrees.
//! At a = 5 rad/s 30 ms of actuator lag and a period of 20 ms take 29 degrees of this margin; with a demand every 20 ms
//! from a state 40 ms old the loop is still stable. `d` is the controller's last estimate of the disturbance, by the
//! air or by a weak rotor; the disturbance is assumed to persist.

use airframe::Parameters;
use contract::message::Kinematics;
use nalgebra::Vector4;

/// Poles of roll and pitch, and of the yaw rate, `a` \[rad/s\].
const BANDWIDTH_RADPS: f64 = 5.0;
/// Pole of the vertical speed, `a_z` \[rad/s\]: slower than the tilt, which determines the direction of thrust.
pub(crate) const CLIMB_BANDWIDTH_RADPS: f64 = 2.0;
/// Vertical speed of the descent, down positive \[m/s\]: slow enough to touch down.
pub(crate) const DESCENT_MPS: f64 = 0.7;

/// Age below which a demand counts as new \[ns\].
const USED_NS: u64 = 15_000_000;
/// Age below which a demand is held \[ns\].
const HELD_NS: u64 = 30_000_000;
/// Age of the demand from which on the vehicle descends \[ns\].
const LEVELLED_NS: u64 = 2_000_000_000;
/// Age below which a state is recent enough to level the vehicle \[ns\].
const STATE_NS: u64 = 50_000_000;
/// Age of the state from which on the thrust is cut, because the vehicle's motion is unknown \[ns\].
const TRIM_NS: u64 = 500_000_000;

/// Rung of the ladder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rung {
    /// A new demand.
    Used,
    /// The last demand.
    Held,
    /// Level flight without vertical speed.
    Levelled,
    /// Level descent.
    Descending,
    /// The trim command.
    TrimOnly,
    /// No thrust.
    Cut,
}

impl Rung {
    /// Selects the rung for the ages of the newest demand and the newest state \[ns\].
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

/// Control law of the middle rungs.
#[derive(Debug, Clone)]
pub struct LevellingLaw {
    /// Inertia m, Iyy, Ixx, Izz: ratio of demand to acceleration.
    inertia: Vector4<f64>,
    roll_trim_rad: f64,
}

impl LevellingLaw {
    /// Builds the law for a vehicle with a roll angle at trim.
    pub fn new(vehicle: &Parameters, roll_trim_rad: f64) -> Self {
        let inertia = vehicle.inertia();
        Self { inertia, roll_trim_rad }
    }

    /// Computes col, lon, lat, ped \[N, N m, N m, N m\] that level the vehicle and bring its vertical speed to zero, or
    /// to `DESCENT_MPS` if `descending`. The disturbance is not subtracted.
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
