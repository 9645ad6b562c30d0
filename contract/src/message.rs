//! The messages of the ring: fixed layout, plain numbers, newest value wins.
//!
//! Every message begins with a [`Stamp`], which names the plant sample that the message descends from. The process
//! fills the stamp in, not the core of the node.
//!
//! Frames: NED for the world, forward-right-down for the body. SI units and radians; rotor speeds in the paper's unit.

use airframe::Actuation;
use bytemuck::{Pod, Zeroable};

use crate::Topic;
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

pub mod stamp;
mod status;

pub use stamp::{Message, Stamp};
pub use status::{PlantStatus, SolveStatus, guidance_flags, mixer_flags};

/// Names of the four message types by topic. A name ends in the version of the layout: a process with another version
/// cannot join a ring, and a log of another version is refused.
pub const LAYOUT: [&str; Topic::COUNT] =
    ["trefoil.State.v4", "trefoil.Reference.v4", "trefoil.Controls.v4", "trefoil.Actuators.v4"];

/// Largest plausible position \[m\] and velocity \[m/s\]: twenty times the 500 m at which a flight counts as diverged.
const MAX_POSITION_M_VELOCITY_MPS: f64 = 1e4;
/// Largest plausible Euler angle, heading reference or tilt \[rad\]: some sixteen turns. Real angles stay within a few.
const MAX_ANGLE_RAD: f64 = 100.0;
/// Largest plausible body rate \[rad/s\]: ten times the rate at which a flight counts as diverged.
const MAX_RATE_RADPS: f64 = 1e3;
/// Largest plausible force \[N\], moment \[N m\] and rotor speed \[rotor speed unit\]: hundreds of times the real ones.
const MAX_DEMAND: f64 = 1e6;

/// Position, velocity, attitude and rates.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct Kinematics {
    /// Position X, Y, Z in NED \[m\].
    pub position_m: [f64; 3],
    /// Velocity u, v, w in the body frame \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Euler angles phi, theta, psi \[rad\].
    pub attitude_rad: [f64; 3],
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
}

impl Kinematics {
    /// Angle between the body's z axis and the vertical \[rad\].
    pub fn tilt_rad(&self) -> f64 {
        let [phi, theta, _] = self.attitude_rad;
        libm::acos((libm::cos(phi) * libm::cos(theta)).clamp(-1.0, 1.0))
    }

    /// Vertical speed, down positive \[m/s\].
    pub fn sink_mps(&self) -> f64 {
        let ([phi, theta, _], [u, v, w]) = (self.attitude_rad, self.velocity_mps);
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (libm::sincos(phi), libm::sincos(theta));
        -u * sin_theta + (v * sin_phi + w * cos_phi) * cos_theta
    }
}

/// Rotor speeds and tilt on the wire: the four numbers of [`airframe::Actuation`].
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct ActuationMsg {
    /// Rotor speeds `Omega_1..3` \[rotor speed unit\].
    pub rotor_speed: [f64; 3],
    /// Tilt mu of rotor 1 \[rad\].
    pub tilt_rad: f64,
}

impl From<Actuation> for ActuationMsg {
    fn from(a: Actuation) -> Self {
        Self { rotor_speed: a.rotor_speed, tilt_rad: a.tilt_rad }
    }
}

impl From<ActuationMsg> for Actuation {
    fn from(a: ActuationMsg) -> Self {
        Self { rotor_speed: a.rotor_speed, tilt_rad: a.tilt_rad }
    }
}

/// STATE: the measured motion, the true motion, and the command in force.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.State.v4")]
#[repr(C)]
pub struct State {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Sequence number of the ACTUATORS message in force up to this sample; 0 = none yet, the trim command.
    pub applied_sequence: u64,
    /// Age of the sample behind that command when the command took effect at the actuators \[ns\].
    pub applied_age_ns: u64,
    /// Measured motion. A controller may use only this and `command_in_force`.
    pub measured: Kinematics,
    /// True motion, for the recorder and the report.
    pub actual: Kinematics,
    /// True actuator positions, for the recorder and the report.
    pub actuators: ActuationMsg,
    /// Command that was in force up to this sample.
    pub command_in_force: ActuationMsg,
    /// Wire value of a [`PlantStatus`].
    pub status: u64,
    /// Commands received since the previous sample, in order of arrival; entries beyond `arrived` are zero.
    pub arrivals: [Arrival; MAX_ARRIVALS],
    /// Number of valid entries in `arrivals`.
    pub arrived: u64,
}

/// Largest number of commands that the plant accepts between two samples; it ignores any further ones.
pub const MAX_ARRIVALS: usize = 4;

/// Command that the plant received, for replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct Arrival {
    /// Sequence number of the message.
    pub sequence: u64,
    /// Epoch of the publisher.
    pub epoch: u64,
    /// Time from the previous sample to the arrival \[ns\].
    pub after_ns: u64,
}

/// REFERENCE: the attitude, rates and vertical velocity that the attitude loop shall follow.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Reference.v4")]
#[repr(C)]
pub struct Reference {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Position on the trajectory, NED \[m\].
    pub position_m: [f64; 3],
    /// Velocity on the trajectory, NED \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Reference of w, the body z velocity \[m/s\].
    pub w_mps: f64,
    /// References of phi, theta, psi \[rad\].
    pub attitude_rad: [f64; 3],
    /// References of p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Disturbance estimate of the position loop: acceleration x, y in the heading frame \[m/s2\].
    pub disturbance_mps2: [f64; 2],
    /// Limits that were active, and repeated references: bits of [`guidance_flags`].
    pub flags: u64,
}

/// CONTROLS: the demanded conventional inputs, as deviations from trim.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Controls.v4")]
#[repr(C)]
pub struct Controls {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Demand of col, lon, lat, ped \[N, N m, N m, N m\].
    pub demand: [f64; 4],
    /// Input-disturbance estimate, same axes and units.
    pub disturbance: [f64; 4],
    /// Wire value of a [`SolveStatus`].
    pub status: u64,
    /// Iterations of the constrained solver, 0 on the explicit path.
    pub iterations: u64,
    /// Time inside the constrained solver \[ns\], 0 on the explicit path.
    pub solve_ns: u64,
    /// Number of actuator constraints that are active in the published plan.
    pub active_constraints: u64,
    /// Number of ticks so far on which a solve failed and a fallback was published.
    pub fallbacks: u64,
}

/// ACTUATORS: the command for rotors and servo.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Actuators.v4")]
#[repr(C)]
pub struct Actuators {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Command inside the actuators' limits.
    pub command: ActuationMsg,
    /// Limits that the command reached, and fallbacks: bits of [`mixer_flags`].
    pub flags: u64,
}

macro_rules! message {
    ($($name:ident: $bytes:literal $({ $own:item })?),*) => {$(
        impl Message for $name {
            const TOPIC: Topic = Topic::$name;
            fn stamp(&self) -> &Stamp { &self.stamp }
            fn stamp_mut(&mut self) -> &mut Stamp { &mut self.stamp }
            fn plausible(&self) -> bool { self.within_limits() }
            $($own)?
        }
        // The layout is the interface: a change of size is a change of version.
        const _: () = assert!(size_of::<$name>() == $bytes && align_of::<$name>() == 8);
    )*};
}
message!(
    State: 584 { fn is_last(&self) -> bool { PlantStatus::from_wire(self.status).is_none_or(PlantStatus::is_last) } },
    Reference: 328,
    Controls: 304,
    Actuators: 240
);

impl State {
    /// Feeds the bits that `state_hash` is made of to `sink`: motions, actuators, command and status, in field order.
    pub fn payload(&self, mut sink: impl FnMut(&[u8])) {
        sink(bytemuck::bytes_of(&self.measured));
        sink(bytemuck::bytes_of(&self.actual));
        sink(bytemuck::bytes_of(&self.actuators));
        sink(bytemuck::bytes_of(&self.command_in_force));
        sink(bytemuck::bytes_of(&self.status));
    }

    /// Requires attitude and rates, without which no controller can fly. A NaN position or velocity means that the
    /// sensor is off; the nodes that need it handle that.
    fn within_limits(&self) -> bool {
        let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = &self.measured;
        let off = |value: &f64| value.is_nan() || within(&[*value], MAX_POSITION_M_VELOCITY_MPS);
        position_m.iter().chain(velocity_mps).all(off)
            && within(attitude_rad, MAX_ANGLE_RAD)
            && within(rates_radps, MAX_RATE_RADPS)
            && within(&self.command_in_force.rotor_speed, MAX_DEMAND)
            && within(&[self.command_in_force.tilt_rad], MAX_ANGLE_RAD)
    }
}

impl Reference {
    fn within_limits(&self) -> bool {
        within(&self.attitude_rad, MAX_ANGLE_RAD)
            && within(&self.rates_radps, MAX_RATE_RADPS)
            && within(&[self.w_mps], MAX_POSITION_M_VELOCITY_MPS)
    }
}

impl Controls {
    fn within_limits(&self) -> bool {
        within(&self.demand, MAX_DEMAND)
    }
}

impl Actuators {
    fn within_limits(&self) -> bool {
        within(&self.command.rotor_speed, MAX_DEMAND) && within(&[self.command.tilt_rad], MAX_ANGLE_RAD)
    }
}

/// Returns whether all values are finite and at most `bound` in magnitude.
fn within(values: &[f64], bound: f64) -> bool {
    values.iter().all(|value| value.abs() <= bound) // false for NaN
}

#[cfg(test)]
mod tests {
    use super::LAYOUT;

    #[test]
    fn the_layout_is_the_names_of_the_types() {
        let source = include_str!("message.rs");
        let names: Vec<&str> =
            source.lines().filter_map(|line| line.strip_prefix("#[type_name(\"")?.strip_suffix("\")]")).collect();
        assert_eq!(names, LAYOUT);
    }
}
