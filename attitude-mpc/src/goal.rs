//! Goal that the controller follows, also when references stop coming.
//!
//! | age of the newest reference | goal |
//! |---|---|
//! | below 500 ms | the reference |
//! | below 2 s | level: the attitude of trim, the last heading, no vertical velocity |
//! | 2 s or older, or none received | level, and 0.7 m/s down |
//!
//! The last heading is the heading of the last reference, or the measured heading if no reference was received. The
//! controller does not know the ground: it descends until references come again. A reference that guidance repeated,
//! because it had no state, has the age of the original.

use bytemuck::{Pod, Zeroable};
use contract::message::{Ahead, PREVIEW, Reference, State, guidance_flags};
use contract::snapshot::OptionalTick;

/// Age below which a reference is followed \[ns\].
const FOLLOWED_NS: u64 = 500_000_000;
/// Age of the reference from which on the vehicle descends \[ns\].
const LEVELLED_NS: u64 = 2_000_000_000;
/// Body z velocity of the descent, down positive \[m/s\]: slow enough to touch down.
const DESCENT_MPS: f64 = 0.7;

/// Part of a reference that the controller follows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct Goal {
    /// Tick of the reference; none before the first reference.
    pub tick: OptionalTick,
    /// Body z velocity w \[m/s\].
    pub w_mps: f64,
    /// Euler angles phi, theta, psi \[rad\].
    pub attitude_rad: [f64; 3],
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Time from one element of `preview` to the next, and from the reference to the first element \[ns\]; 0 = no
    /// preview.
    pub preview_step_ns: u64,
    /// Changes of `w_mps` and `attitude_rad` at the times that `preview_step_ns` gives.
    pub preview: [Ahead; PREVIEW],
}

impl Goal {
    /// Returns the goal of `reference`, or `self` if the reference is missing or a repetition.
    #[must_use]
    pub fn renewed(&self, reference: &Reference) -> Self {
        let Reference { stamp, w_mps, attitude_rad, rates_radps, flags, preview_step_ns, preview, .. } = *reference;
        if stamp.sequence == 0 || guidance_flags::repeated(flags) {
            return *self;
        }
        Self { tick: OptionalTick::some(stamp.tick), w_mps, attitude_rad, rates_radps, preview_step_ns, preview }
    }

    /// Returns whether the goal is young enough to be followed at `tick`.
    pub fn is_followed(&self, tick: u64, sample_ns: u64) -> bool {
        self.age_ns(tick, sample_ns) < FOLLOWED_NS
    }

    /// Time from the sample of the reference to `tick` \[ns\]; `u64::MAX` without a reference.
    fn age_ns(&self, tick: u64, sample_ns: u64) -> u64 {
        self.tick.get().map_or(u64::MAX, |of| tick.saturating_sub(of).saturating_mul(sample_ns))
    }

    /// Returns the goal at `tick` by its age, with samples of `sample_ns`, for a measured `state`.
    #[must_use]
    pub fn at(&self, tick: u64, sample_ns: u64, state: &State, roll_trim_rad: f64) -> Self {
        let age_ns = self.age_ns(tick, sample_ns);
        if age_ns < FOLLOWED_NS {
            return *self;
        }
        let heading_rad = if self.tick.get().is_some() { self.attitude_rad[2] } else { state.measured.attitude_rad[2] };
        let w_mps = if age_ns < LEVELLED_NS { 0.0 } else { DESCENT_MPS };
        let attitude_rad = [roll_trim_rad, 0.0, heading_rad];
        Self { tick: self.tick, w_mps, attitude_rad, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use contract::message::{Kinematics, Stamp};

    use super::*;

    const SAMPLE_NS: u64 = 10_000_000;
    const ROLL_TRIM_RAD: f64 = -0.05;

    fn reference(tick: u64) -> Reference {
        let stamp = Stamp { tick, sequence: tick + 1, ..Stamp::default() };
        Reference { stamp, w_mps: -1.0, attitude_rad: [0.2, 0.3, 0.4], rates_radps: [0.1; 3], ..Reference::default() }
    }

    #[test]
    fn an_ageing_reference_is_followed_then_levelled_then_descended_from() {
        let goal = Goal::default().renewed(&reference(7));
        let at = |age: u64| goal.at(7 + age, SAMPLE_NS, &State::default(), ROLL_TRIM_RAD);
        for age in [0, 1, 49] {
            assert_eq!(at(age), goal);
        }
        for (age, w_mps) in [(50, 0.0), (199, 0.0), (200, DESCENT_MPS), (u64::MAX - 7, DESCENT_MPS)] {
            let level = at(age);
            assert_eq!((level.w_mps, level.attitude_rad), (w_mps, [ROLL_TRIM_RAD, 0.0, 0.4]), "at {age} samples");
            assert_eq!(level.rates_radps, [0.0; 3]);
        }
    }

    #[test]
    fn a_repeated_reference_keeps_its_age() {
        let goal = Goal::default().renewed(&reference(7));
        for flags in [guidance_flags::STALE, guidance_flags::BAD_INPUT | guidance_flags::ROLL_LIMITED] {
            assert_eq!(goal.renewed(&Reference { flags, ..reference(90) }), goal);
        }
        assert_eq!(
            goal.renewed(&Reference { flags: guidance_flags::ROLL_LIMITED, ..reference(90) }).tick.get(),
            Some(90)
        );
        assert_eq!(goal.renewed(&Reference::default()), goal, "none came");
    }

    #[test]
    fn without_any_reference_the_vehicle_descends_with_its_measured_heading() {
        let measured = Kinematics { attitude_rad: [0.5, 0.5, 2.0], ..Kinematics::default() };
        let state = State { measured, ..State::default() };
        let goal = Goal::default().at(0, SAMPLE_NS, &state, ROLL_TRIM_RAD);
        assert_eq!((goal.w_mps, goal.attitude_rad), (DESCENT_MPS, [ROLL_TRIM_RAD, 0.0, 2.0]));
    }
}
