//! What the numbers `status` and `flags` of the messages mean.

/// Meaning of [`State::status`](super::State::status).
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
    /// A body rate beyond 100 rad/s.
    TooFast = 5,
    /// The last sample of a complete run: the vehicle has come down, is at rest on its feet, and its rotors idle or stand.
    Landed = 6,
    /// It came down too hard, too fast or leaning too much, or on its rotors.
    Crashed = 7,
    /// A rotor or the centre touched the ground while the vehicle was on its feet.
    TippedOver = 8,
    /// The last sample of a complete run: the vehicle has come down, and slid too far or moves still.
    Slid = 9,
    /// The last sample of a complete run: the vehicle is on the ground, and has not landed, for want of a take-off or of a
    /// second of rest, or because its rotors turn.
    NotLanded = 10,
    /// On the ground, at rest, without thrust: before the take-off, or after a landing.
    Standing = 11,
    /// On the ground, with thrust, before it first leaves it.
    TakingOff = 12,
    /// Down on a foot or more after a flight, and not at rest for long enough.
    Landing = 13,
}

impl PlantStatus {
    /// Reads the wire value; anything unknown is `None`.
    pub fn from_wire(value: u64) -> Option<Self> {
        let all = [
            Self::Flying,
            Self::Finished,
            Self::NonFinite,
            Self::TooFar,
            Self::TooFast,
            Self::Landed,
            Self::Crashed,
            Self::TippedOver,
            Self::Slid,
            Self::NotLanded,
            Self::Standing,
            Self::TakingOff,
            Self::Landing,
        ];
        all.into_iter().find(|s| *s as u64 == value)
    }

    /// Returns true if no sample comes after one with this status.
    pub fn is_last(self) -> bool {
        !matches!(self, Self::Flying | Self::Standing | Self::TakingOff | Self::Landing)
    }

    /// Returns true if the run ended because the vehicle was lost: it left the bounds of the simulation, crashed or tipped over.
    pub fn diverged(self) -> bool {
        matches!(self, Self::NonFinite | Self::TooFar | Self::TooFast | Self::Crashed | Self::TippedOver)
    }

    /// Returns true if the vehicle was lost, or came down otherwise than by landing.
    pub fn failed(self) -> bool {
        self.diverged() || self == Self::Slid
    }

    /// In words, for messages to the user.
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

/// Meaning of [`Controls::status`](super::Controls::status), better ones first.
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

/// Bits of [`Reference::flags`](super::Reference::flags).
pub mod guidance_flags {
    /// Roll reference at its limit.
    pub const ROLL_LIMITED: u64 = 1;
    /// Pitch reference at its limit.
    pub const PITCH_LIMITED: u64 = 1 << 1;
    /// The wanted vertical speed or the reference of w at its limit.
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

/// Bits of [`Actuators::flags`](super::Actuators::flags).
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
    /// The ground carries the vehicle, which is to sink: rotors at idle.
    pub const GROUND_CONTACT: u64 = 1 << 13;
    /// Landed: no thrust, for good.
    pub const DISARMED: u64 = 1 << 14;

    /// Whether the command was computed without a demand.
    pub const fn fallback(flags: u64) -> bool {
        flags & (LEVELLED | DESCENDING | TRIM_ONLY | CUT | TERMINATED) != 0
    }

    /// Whether any clamp acted.
    pub const fn saturated(flags: u64) -> bool {
        flags & ((0b111 * ROTOR_SATURATED) | TILT_SATURATED | NEGATIVE_SQUARE) != 0
    }
}
