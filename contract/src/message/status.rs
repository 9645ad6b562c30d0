//! Meaning of the numbers `status` and `flags` of the messages.

use bytemuck::CheckedBitPattern;

/// Meaning of [`State::status`](super::State::status).
#[derive(Debug, Clone, Copy, PartialEq, Eq, CheckedBitPattern)]
#[repr(u64)]
pub enum PlantStatus {
    /// Airborne.
    Flying = 0,
    /// The last sample of a complete run.
    Finished = 1,
    /// Infinite or NaN state.
    NonFinite = 2,
    /// Position farther than 500 m from the origin on some axis.
    TooFar = 3,
    /// Body rate beyond 100 rad/s.
    TooFast = 5,
    /// Last sample of a complete run: the vehicle has come down, is at rest on its feet, and its rotors idle or stand.
    Landed = 6,
    /// Touchdown that was too hard, too fast or too tilted, or on the rotors.
    Crashed = 7,
    /// Rotor or centre that touched the ground while the vehicle was on its feet.
    TippedOver = 8,
    /// Last sample of a complete run: the vehicle has come down, but slid too far or still moves.
    Slid = 9,
    /// Last sample of a complete run: the vehicle is on the ground and has not landed, because it never took off, has
    /// not rested for a second, or its rotors turn.
    NotLanded = 10,
    /// Standing on the ground, at rest, without thrust: before the take-off, or after a landing.
    Standing = 11,
    /// Taking off: on the ground with thrust, before the vehicle leaves it.
    TakingOff = 12,
    /// Landing: on one foot or more after a flight, and not yet at rest for long enough.
    Landing = 13,
}

impl PlantStatus {
    /// Reads the wire value; `None` if it is unknown.
    pub fn from_wire(value: u64) -> Option<Self> {
        bytemuck::checked::try_cast(value).ok()
    }

    /// Returns whether a sample with this status is the last of the run.
    pub fn is_last(self) -> bool {
        !matches!(self, Self::Flying | Self::Standing | Self::TakingOff | Self::Landing)
    }

    /// Returns whether the run ended because the vehicle left the bounds of the simulation, crashed or tipped over.
    pub fn diverged(self) -> bool {
        matches!(self, Self::NonFinite | Self::TooFar | Self::TooFast | Self::Crashed | Self::TippedOver)
    }

    /// Returns whether the vehicle diverged, or slid instead of landing.
    pub fn failed(self) -> bool {
        self.diverged() || self == Self::Slid
    }

    /// Description in words, for messages to the user.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Flying => "in flight",
            Self::Finished => "finished",
            Self::Landed => "landed",
            Self::Crashed => "crashed",
            Self::TippedOver => "tipped over",
            Self::Slid => "slid",
            Self::NotLanded => "on the ground, not landed",
            Self::Standing => "standing",
            Self::TakingOff => "taking off",
            Self::Landing => "landing",
            Self::NonFinite => "a state became NaN or infinite",
            Self::TooFar => "position beyond 500 m",
            Self::TooFast => "a body rate beyond 100 rad/s",
        }
    }
}

/// Meaning of [`Controls::status`](super::Controls::status); up to `Stale` from the best result to the worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u64)]
pub enum SolveStatus {
    /// Unconstrained optimum, which satisfies every constraint: one matrix-vector product. Also the answer of a law
    /// without constraints, and of a library.
    Explicit = 0,
    /// Constrained optimum, to the solver's tolerance.
    Solved = 1,
    /// Best plan found inside the set when the solver ran out of iterations or time.
    LimitReached = 2,
    /// Unconstrained plan with each move replaced by the nearest one inside the set, because the solver found no plan.
    Fallback = 3,
    /// Previous demand repeated, because an input was not finite.
    BadInput = 4,
    /// Previous demand repeated, because there was no fresh state.
    Stale = 5,
    /// Optimum without a reference of this tick: for the last reference, later for level flight, later for a descent.
    NoReference = 6,
}

impl SolveStatus {
    /// Returns whether the wire value `status` means that an earlier demand was repeated.
    pub fn repeated(status: u64) -> bool {
        status == Self::BadInput as u64 || status == Self::Stale as u64
    }
}

/// Bits of [`Reference::flags`](super::Reference::flags).
pub mod guidance_flags {
    /// Roll reference at its limit.
    pub const ROLL_LIMITED: u64 = 1;
    /// Pitch reference at its limit.
    pub const PITCH_LIMITED: u64 = 1 << 1;
    /// Wanted vertical speed or reference of w at its limit.
    pub const W_LIMITED: u64 = 1 << 2;
    /// Integrator at its clamp.
    pub const INTEGRAL_CLAMPED: u64 = 1 << 3;
    /// Previous reference repeated, because the measured state was not finite.
    pub const BAD_INPUT: u64 = 1 << 4;
    /// Previous reference repeated, because there was no fresh state or the vehicle had no thrust.
    pub const STALE: u64 = 1 << 5;

    /// Returns whether the reference repeats an earlier one.
    pub const fn repeated(flags: u64) -> bool {
        flags & (BAD_INPUT | STALE) != 0
    }
}

/// Bits of [`Actuators::flags`](super::Actuators::flags).
pub mod mixer_flags {
    /// Rotor 1 at a limit; shift left by one for rotor 2, by two for rotor 3.
    pub const ROTOR_SATURATED: u64 = 1;
    /// Tilt at its limit.
    pub const TILT_SATURATED: u64 = 1 << 3;
    /// Negative number under the root of (42) or (43).
    pub const NEGATIVE_SQUARE: u64 = 1 << 4;
    /// Demand that was not finite; it counts as missing.
    pub const BAD_INPUT: u64 = 1 << 5;
    /// Demand outside the exact actuator set, replaced by the nearest one inside.
    pub const PROJECTED: u64 = 1 << 6;
    /// Last demand repeated, because there was no new one.
    pub const HELD: u64 = 1 << 7;
    /// Level flight from the measured state, because there was no demand for too long.
    pub const LEVELLED: u64 = 1 << 8;
    /// Level descent from the measured state, because there was still no demand.
    pub const DESCENDING: u64 = 1 << 9;
    /// Trim command, because there was neither a demand nor a usable state.
    pub const TRIM_ONLY: u64 = 1 << 10;
    /// No thrust; without another flag because neither a demand nor a state came for too long.
    pub const CUT: u64 = 1 << 11;
    /// No thrust for good, because the vehicle cannot descend without its dead rotor.
    pub const TERMINATED: u64 = 1 << 12;
    /// Rotors at idle, because the vehicle is to sink and the ground carries it.
    pub const GROUND_CONTACT: u64 = 1 << 13;
    /// No thrust for good, after a landing.
    pub const DISARMED: u64 = 1 << 14;
    /// Descent in a spin, because a part is broken: yaw is given up.
    pub const YAW_GIVEN_UP: u64 = 1 << 15;

    /// Returns whether the command was computed without a demand.
    pub const fn fallback(flags: u64) -> bool {
        flags & (LEVELLED | DESCENDING | TRIM_ONLY | CUT | TERMINATED) != 0
    }

    /// Returns whether a limit of rotors or tilt was reached, or a root was clamped.
    pub const fn saturated(flags: u64) -> bool {
        flags & ((0b111 * ROTOR_SATURATED) | TILT_SATURATED | NEGATIVE_SQUARE) != 0
    }
}
