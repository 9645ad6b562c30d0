//! The messages of the ring: fixed layout, plain numbers, newest value wins.
//!
//! Every message begins with a [`Stamp`], which the process fills in and not the core: it names the plant sample that the
//! message descends from.
//!
//! Frames: NED for the world, forward-right-down for the body. SI units and radians; rotor speeds in the paper's unit.

use airframe::Actuation;
use bytemuck::{Pod, Zeroable};

use crate::Topic;
use crate::integrity::checksum;
use iceoryx2_bb_derive_macros::ZeroCopySend;
use iceoryx2_bb_elementary_traits::zero_copy_send::ZeroCopySend;

mod plausible;
pub mod stamp;

pub use plausible::Plausible;
pub use stamp::Stamp;

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

/// Rotor speeds and tilt on the wire: the same four numbers as [`airframe::Actuation`].
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[repr(C)]
pub struct ActuationMsg {
    /// `Omega_1..3` \[rotor speed unit\].
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
#[type_name("trefoil.State.v3")]
#[repr(C)]
pub struct State {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Sequence number of the ACTUATORS message in force up to this sample; 0 = none yet, the trim command.
    pub applied_sequence: u64,
    /// How old the sample behind that command was when the command took effect: the age at the actuator \[ns\].
    pub applied_age_ns: u64,
    /// What the sensors measured. With `command_in_force` the only part that a controller may use.
    pub measured: Kinematics,
    /// What is true: for the recorder and the report.
    pub actual: Kinematics,
    /// True actuator positions: for the recorder and the report.
    pub actuators: ActuationMsg,
    /// The command that was in force up to this sample.
    pub command_in_force: ActuationMsg,
    /// See [`PlantStatus`].
    pub status: u64,
}

/// REFERENCE: what the attitude loop shall follow.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Reference.v3")]
#[repr(C)]
pub struct Reference {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// Where the trajectory is, NED \[m\].
    pub position_m: [f64; 3],
    /// Its velocity, NED \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Reference of w, the body z velocity \[m/s\].
    pub w_mps: f64,
    /// References of phi, theta, psi \[rad\].
    pub attitude_rad: [f64; 3],
    /// References of p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Outer disturbance estimate, acceleration x, y in the heading frame \[m/s2\].
    pub disturbance_mps2: [f64; 2],
    /// Which limits were active: see [`guidance_flags`].
    pub flags: u64,
}

/// CONTROLS: the demanded conventional inputs, as deviations from trim.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Controls.v3")]
#[repr(C)]
pub struct Controls {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// col, lon, lat, ped \[N, N m, N m, N m\].
    pub demand: [f64; 4],
    /// Input-disturbance estimate, same axes and units.
    pub disturbance: [f64; 4],
    /// See [`SolveStatus`].
    pub status: u64,
    /// Iterations of the constrained solver, 0 on the explicit path.
    pub iterations: u64,
    /// Time inside the constrained solver \[ns\], 0 on the explicit path.
    pub solve_ns: u64,
    /// How many actuator constraints the published plan touches.
    pub active_constraints: u64,
    /// Ticks so far on which a solve failed and a fallback was published.
    pub fallbacks: u64,
}

/// ACTUATORS: the command for rotors and servo.
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend, Pod, Zeroable)]
#[type_name("trefoil.Actuators.v3")]
#[repr(C)]
pub struct Actuators {
    /// Provenance and timing.
    pub stamp: Stamp,
    /// The command, inside the limits.
    pub command: ActuationMsg,
    /// Which limits it ran into: see [`mixer_flags`].
    pub flags: u64,
}

/// Meaning of [`State::status`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum PlantStatus {
    /// In flight.
    Flying = 0,
    /// The last sample of a complete run.
    Finished = 1,
    /// A state became infinite or NaN.
    NonFinite = 2,
    /// Farther than 500 m from the origin on some axis.
    TooFar = 3,
    /// |theta| beyond 1.55 rad: the Euler angles of (8) are about to be singular.
    Singular = 4,
    /// A body rate beyond 100 rad/s.
    TooFast = 5,
}

impl PlantStatus {
    /// Reads the wire value; anything unknown is `None`.
    pub fn from_wire(value: u64) -> Option<Self> {
        let all = [Self::Flying, Self::Finished, Self::NonFinite, Self::TooFar, Self::Singular, Self::TooFast];
        all.into_iter().find(|s| *s as u64 == value)
    }

    /// Whether the run ended because the vehicle left the bounds of the simulation.
    pub fn diverged(self) -> bool {
        !matches!(self, Self::Flying | Self::Finished)
    }

    /// In words, for messages to the user.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Flying => "in flight",
            Self::Finished => "finished",
            Self::NonFinite => "a state became NaN or infinite",
            Self::TooFar => "position beyond 500 m",
            Self::Singular => "|theta| beyond 1.55 rad, where the Euler angles are singular",
            Self::TooFast => "a body rate beyond 100 rad/s",
        }
    }
}

/// Meaning of [`Controls::status`], better ones first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum SolveStatus {
    /// The unconstrained optimum satisfies every constraint: one matrix-vector product.
    Explicit = 0,
    /// The constrained optimum, to the solver's tolerance.
    Solved = 1,
    /// The solver ran out of iterations or time: the best plan found inside the set.
    LimitReached = 2,
    /// The solver found nothing: the unconstrained plan, each move replaced by the nearest one inside the set.
    Fallback = 3,
    /// An input was not finite: the previous demand was repeated.
    BadInput = 4,
    /// No fresh state: the previous demand was repeated.
    Stale = 5,
    /// The optimum without a reference of this tick: for the last one, then for level flight, then for a descent.
    NoReference = 6,
}

impl SolveStatus {
    /// Whether the wire value `status` means that an earlier demand was repeated.
    pub fn repeated(status: u64) -> bool {
        status == Self::BadInput as u64 || status == Self::Stale as u64
    }
}

/// Bits of [`Reference::flags`].
pub mod guidance_flags {
    /// Roll reference at its limit.
    pub const ROLL_LIMITED: u64 = 1;
    /// Pitch reference at its limit.
    pub const PITCH_LIMITED: u64 = 1 << 1;
    /// Vertical velocity reference at its limit.
    pub const W_LIMITED: u64 = 1 << 2;
    /// An integrator at its clamp.
    pub const INTEGRAL_CLAMPED: u64 = 1 << 3;
    /// The measured state was not finite: the previous reference was repeated.
    pub const BAD_INPUT: u64 = 1 << 4;
    /// No fresh state, or one of a vehicle without thrust: the previous reference was repeated.
    pub const STALE: u64 = 1 << 5;

    /// Whether the reference is an earlier one, repeated.
    pub const fn repeated(flags: u64) -> bool {
        flags & (BAD_INPUT | STALE) != 0
    }
}

/// Bits of [`Actuators::flags`].
pub mod mixer_flags {
    /// Rotor 1, 2, 3 at a limit: shift by the rotor's index.
    pub const ROTOR_SATURATED: u64 = 1;
    /// Tilt at its limit.
    pub const TILT_SATURATED: u64 = 1 << 3;
    /// (42) or (43) asked for the root of a negative number.
    pub const NEGATIVE_SQUARE: u64 = 1 << 4;
    /// The demand was not finite: it counts as missing.
    pub const BAD_INPUT: u64 = 1 << 5;
    /// The demand was outside the exact actuator set: the nearest one inside was taken.
    pub const PROJECTED: u64 = 1 << 6;
    /// No new demand: the last one was taken once more.
    pub const HELD: u64 = 1 << 7;
    /// No demand for too long: level, from the measured state.
    pub const LEVELLED: u64 = 1 << 8;
    /// The same, and down.
    pub const DESCENDING: u64 = 1 << 9;
    /// No state either: the trim command.
    pub const TRIM_ONLY: u64 = 1 << 10;
    /// No thrust.
    pub const CUT: u64 = 1 << 11;
    /// A rotor is dead: no thrust, for good.
    pub const TERMINATED: u64 = 1 << 12;

    /// Whether the command was computed without a demand.
    pub const fn fallback(flags: u64) -> bool {
        flags & (LEVELLED | DESCENDING | TRIM_ONLY | CUT | TERMINATED) != 0
    }

    /// Whether any clamp acted.
    pub const fn saturated(flags: u64) -> bool {
        flags & ((0b111 * ROTOR_SATURATED) | TILT_SATURATED | NEGATIVE_SQUARE) != 0
    }
}

/// What all four messages have in common.
pub trait Message: Pod + Plausible + Default + std::fmt::Debug + Send {
    /// The topic it travels on.
    const TOPIC: Topic;
    /// Provenance and timing.
    fn stamp(&self) -> &Stamp;
    /// The same, for the process that publishes it.
    fn stamp_mut(&mut self) -> &mut Stamp;

    /// The message with the checksum that its bits have.
    #[must_use]
    fn with_checksum(mut self) -> Self {
        self.stamp_mut().checksum = 0;
        self.stamp_mut().checksum = checksum(&self);
        self
    }

    /// Whether the checksum fits the bits.
    fn is_intact(&self) -> bool {
        self.with_checksum().stamp().checksum == self.stamp().checksum
    }
}

macro_rules! message {
    ($($name:ident: $bytes:literal),*) => {$(
        impl Message for $name {
            const TOPIC: Topic = Topic::$name;
            fn stamp(&self) -> &Stamp { &self.stamp }
            fn stamp_mut(&mut self) -> &mut Stamp { &mut self.stamp }
        }
        // The layout is the interface: a change of size is a change of version.
        const _: () = assert!(size_of::<$name>() == $bytes && align_of::<$name>() == 8);
    )*};
}
message!(State: 440, Reference: 288, Controls: 264, Actuators: 200);

impl State {
    /// Feeds the payload's bits to `sink`, in field order and without the stamp: what `state_hash` is made of.
    pub fn payload(&self, mut sink: impl FnMut(&[u8])) {
        sink(bytemuck::bytes_of(&self.measured));
        sink(bytemuck::bytes_of(&self.actual));
        sink(bytemuck::bytes_of(&self.actuators));
        sink(bytemuck::bytes_of(&self.command_in_force));
        sink(bytemuck::bytes_of(&self.status));
    }
}
