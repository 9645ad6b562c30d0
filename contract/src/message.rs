//! The messages of the ring: fixed layout, plain numbers, newest value wins.
//!
//! Every message on a topic begins with a [`Stamp`], which names the plant sample that the message descends from. The
//! process fills the stamp in, not the core of the node. [`Truth`] has no topic: no node receives it.
//! [`messages!`](crate::messages) is the table of all fields.
//!
//! Frames: NED for the world, forward-right-down for the body. SI units and radians; rotor speeds in the paper's unit.

use std::mem::offset_of;

use bytemuck::{Pod, Zeroable};

use crate::actuation::Actuation;
use crate::integrity::checksum;
use crate::{Topic, messages};
use field::{Field, FieldMark, FieldShape, HasShape};
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

pub mod field;
pub mod stamp;
mod status;
mod table;

pub use stamp::{Content, Message, Payload};
pub use status::{PlantStatus, SolveStatus, guidance_flags, mixer_flags};

/// Largest plausible position \[m\] and velocity \[m/s\]: twenty times the 500 m at which a flight counts as diverged.
const MAX_POSITION_M_VELOCITY_MPS: f64 = 1e4;
/// Largest plausible Euler angle, heading reference or tilt \[rad\]: sixteen turns. Real angles are within a few turns.
const MAX_ANGLE_RAD: f64 = 100.0;
/// Largest plausible body rate \[rad/s\]: ten times the rate at which a flight counts as diverged.
const MAX_RATE_RADPS: f64 = 1e3;
/// Largest plausible force \[N\], moment \[N m\] and rotor speed \[rotor speed unit\]: at least hundreds of times the
/// real ones.
const MAX_DEMAND: f64 = 1e6;

/// Largest number of commands that the plant accepts between two samples; it ignores any further ones.
pub const MAX_ARRIVALS: usize = 4;

/// Number of later times for which a reference has a preview.
pub const PREVIEW: usize = 8;

/// Makes the types of the table, with their fields.
macro_rules! define {
    (parts { $($(#[$about:meta])* $part:ident { $($fields:tt)* })* }
     messages { $($(#[$of:meta])* $message:ident $layout:literal $bytes:literal bytes { $($its:tt)* })* }
     truth { $(#[$of_truth:meta])* $truth:ident $its_layout:literal $its_bytes:literal bytes { $($true:tt)* } }) => {
        $(define! { $(#[$about])* $part { $($fields)* } })*
        $(define! { $(#[$of])* $message $layout $bytes { $($its)* } }
        impl Message for $message {
            const TOPIC: Topic = Topic::$message;
            fn stamp(&self) -> &Stamp { &self.stamp }
            fn stamp_mut(&mut self) -> &mut Stamp { &mut self.stamp }
        }
        impl Payload for $message {
            const NAME: &'static str = Topic::$message.name();
            const FIELDS: &'static [Field] = Self::FIELDS;
        })*
        define! { $(#[$of_truth])* $truth $its_layout $its_bytes { $($true)* } }
        impl Payload for $truth {
            const NAME: &'static str = "truth";
            const FIELDS: &'static [Field] = Self::FIELDS;
        }

        /// Names of the message types: the four of the ring by topic, then TRUTH. A name ends in the version of the
        /// layout: a process with another version cannot join a ring, and a log of another version is refused.
        pub const LAYOUT: [&str; Topic::COUNT + 1] = [$($layout,)* $its_layout];
    };
    ($(#[$of:meta])* $name:ident $($layout:literal $bytes:literal)? {
        $($(#[$doc:meta])* $field:ident: $type:ty $(= $names:ident)? $(as $mark:ident)?,)*
    }) => {
        $(#[$of])*
        #[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
        $(#[type_name($layout)])?
        #[repr(C)]
        pub struct $name { $($(#[$doc])* pub $field: $type),* }

        impl $name {
            /// All fields, in order.
            pub const FIELDS: &'static [Field] = &[$(Field {
                name: stringify!($field),
                words: offset_of!(Self, $field) / 8..(offset_of!(Self, $field) + size_of::<$type>()) / 8,
                shape: <$type>::SHAPE,
                mark: define!($($mark)?),
            }),*];
        }

        impl HasShape for $name {
            const SHAPE: FieldShape = FieldShape::Part(Self::FIELDS);
        }

        // The layout is the interface: a change of size is a change of version.
        $(const _: () = assert!(size_of::<$name>() == $bytes && align_of::<$name>() == 8);)?
    };
    () => { None };
    (clock) => { Some(FieldMark::Clock) };
    (demand) => { Some(FieldMark::Demand) };
}
messages!(define);

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

    /// Velocity in NED \[m/s\].
    pub fn velocity_ned_mps(&self) -> [f64; 3] {
        let ([phi, theta, psi], [u, v, w]) = (self.attitude_rad, self.velocity_mps);
        let [(sin_phi, cos_phi), (sin_theta, cos_theta), (sin_psi, cos_psi)] = [phi, theta, psi].map(libm::sincos);
        // Velocity in the heading frame: forward and right, both level.
        let forward = u * cos_theta + (v * sin_phi + w * cos_phi) * sin_theta;
        let right = v * cos_phi - w * sin_phi;
        [forward * cos_psi - right * sin_psi, forward * sin_psi + right * cos_psi, self.sink_mps()]
    }
}

/// Returns the unit quaternion w, x, y, z from the body frame to NED, for the Euler angles phi, theta, psi.
pub fn quaternion(attitude_rad: [f64; 3]) -> [f64; 4] {
    let [(sr, cr), (sp, cp), (sy, cy)] = attitude_rad.map(|angle_rad| libm::sincos(angle_rad / 2.0));
    [cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy]
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

/// One sample of the plant: STATE, which the nodes receive, and TRUTH, which they do not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Measured motion and the command in force.
    pub state: State,
    /// True motion and actuator positions.
    pub truth: Truth,
}

impl Sample {
    /// Passes the bits that `state_hash` covers to `sink`: both motions, actuators, command and status.
    pub fn payload(&self, mut sink: impl FnMut(&[u8])) {
        let Self { state, truth } = self;
        sink(bytemuck::bytes_of(&state.measured));
        sink(bytemuck::bytes_of(&truth.actual));
        sink(bytemuck::bytes_of(&truth.actuators));
        sink(bytemuck::bytes_of(&state.command_in_force));
        sink(bytemuck::bytes_of(&state.status));
    }
}

impl Truth {
    /// Returns the message with the checksum of its bits.
    #[must_use]
    pub fn with_checksum(mut self) -> Self {
        self.checksum = 0;
        self.checksum = checksum(&self);
        self
    }

    /// Returns whether the checksum fits the bits.
    pub fn is_intact(&self) -> bool {
        self.with_checksum().checksum == self.checksum
    }

    /// Returns whether this is a probe, which shows a receiver before the first sample that messages arrive.
    pub fn is_probe(&self) -> bool {
        self.sequence == 0
    }
}

impl Content for State {
    /// Accepts a NaN position or velocity, which means that a sensor is off; the nodes that need the number handle the
    /// NaN. Attitude and rates must be finite, because no controller can fly without them.
    fn plausible(&self) -> bool {
        let Kinematics { position_m, velocity_mps, attitude_rad, rates_radps } = &self.measured;
        let off = |value: &f64| value.is_nan() || within(&[*value], MAX_POSITION_M_VELOCITY_MPS);
        position_m.iter().chain(velocity_mps).all(off)
            && within(attitude_rad, MAX_ANGLE_RAD)
            && within(rates_radps, MAX_RATE_RADPS)
            && within(&self.command_in_force.rotor_speed, MAX_DEMAND)
            && within(&[self.command_in_force.tilt_rad], MAX_ANGLE_RAD)
    }

    fn is_last(&self) -> bool {
        PlantStatus::from_wire(self.status).is_none_or(PlantStatus::is_last)
    }
}

impl Content for Reference {
    fn plausible(&self) -> bool {
        within(&self.attitude_rad, MAX_ANGLE_RAD)
            && within(&self.rates_radps, MAX_RATE_RADPS)
            && within(&[self.w_mps], MAX_POSITION_M_VELOCITY_MPS)
            && self.preview.iter().all(Ahead::plausible)
    }
}

impl Ahead {
    /// Returns whether the change can be that from one plausible reference to another.
    fn plausible(&self) -> bool {
        within(&self.attitude_rad, 2.0 * MAX_ANGLE_RAD) && within(&[self.w_mps], 2.0 * MAX_POSITION_M_VELOCITY_MPS)
    }
}

impl Content for Controls {
    fn plausible(&self) -> bool {
        within(&self.demand, MAX_DEMAND)
    }
}

impl Content for Actuators {
    fn plausible(&self) -> bool {
        within(&self.command.rotor_speed, MAX_DEMAND) && within(&[self.command.tilt_rad], MAX_ANGLE_RAD)
    }
}

/// Returns whether all values are finite and at most `bound` in magnitude.
fn within(values: &[f64], bound: f64) -> bool {
    values.iter().all(|value| value.abs() <= bound) // false for NaN
}
