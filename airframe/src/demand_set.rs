//! Convex set of demands, as slacks that must not become negative. The controller's moves and the mixer's command stay
//! inside this set.
//!
//! Every limit of the [envelope](crate::envelope) is a row `s = offset + slope . u` with `s >= 0`, except the highest
//! speed of rotor 1, a disc: two rows whose slack is `1 - |(s1, s2)|`. Slacks are in shares of `Omega1max^2`,
//! except those of a box, which are in shares of its width.

use nalgebra::Vector4;

use crate::envelope::Envelope;

/// Slack that is affine in the demand `u` \[N, N m, N m, N m\], a deviation from trim.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Slack {
    /// Slack at hover.
    pub offset: f64,
    /// Change of the slack per N, N m, N m, N m.
    pub slope: Vector4<f64>,
}

/// Set of admissible demands.
#[derive(Debug, Clone)]
pub struct DemandSet {
    /// Rows with `s >= 0`.
    pub linear: Vec<Slack>,
    /// Rows with `|(s1, s2)| <= 1`.
    pub disc: Option<[Slack; 2]>,
    /// Smallest value of each input over the set \[N, N m, N m, N m\].
    pub lower: Vector4<f64>,
    /// Largest value of each input over the set \[N, N m, N m, N m\].
    pub upper: Vector4<f64>,
}

impl DemandSet {
    /// Builds the exact set of the demands that the actuators can meet.
    pub fn exact(envelope: &Envelope) -> Self {
        let [max1, max2, max3] = envelope.limits.rotor_speed_max.map(|omega| omega * omega);
        let idle = envelope.limits.rotor_speed_min * envelope.limits.rotor_speed_min;
        let (sin_wedge, cos_wedge) = libm::sincos(envelope.limits.tilt_max_rad);
        let (sin_cut, cos_cut) = libm::sincos(envelope.cut_tilt_rad);

        let mixing = &envelope.mixing;
        let row = |constant: f64, [u1, u2, u3, u4]: [f64; 4]| {
            let c = Vector4::new(u1, u2, u3, u4) / max1;
            Slack { offset: constant / max1 + c.dot(&mixing.trim), slope: mixing.inverse.tr_mul(&c) }
        };
        let mut linear = vec![
            row(0.0, [-cos_wedge, sin_wedge, 0.0, 0.0]),
            row(0.0, [cos_wedge, sin_wedge, 0.0, 0.0]),
            row(-idle, [0.0, 0.0, 1.0, 0.0]),
            row(max2, [0.0, 0.0, -1.0, 0.0]),
            row(-idle, [0.0, 0.0, 0.0, 1.0]),
            row(max3, [0.0, 0.0, 0.0, -1.0]),
        ];
        if idle > 0.0 {
            linear.push(row(-idle, [sin_cut, cos_cut, 0.0, 0.0]));
        }
        let disc = Some([row(0.0, [1.0, 0.0, 0.0, 0.0]), row(0.0, [0.0, 1.0, 0.0, 0.0])]);
        let (lower, upper) = envelope.bounding_box();
        Self { linear, disc, lower, upper }
    }

    /// Builds the smallest box around the exact set.
    pub fn bounding_box(envelope: &Envelope) -> Self {
        let (lower, upper) = envelope.bounding_box();
        let mut linear = Vec::with_capacity(8);
        for axis in 0..4 {
            let slope = Vector4::ith(axis, 1.0 / (upper[axis] - lower[axis]));
            linear.push(Slack { offset: -lower[axis] * slope[axis], slope });
            linear.push(Slack { offset: upper[axis] * slope[axis], slope: -slope });
        }
        Self { linear, disc: None, lower, upper }
    }

    /// Visits every slack of `u`, first of the rows, then of the disc. A NaN slack is visited as minus infinity.
    pub fn slacks(&self, u: &Vector4<f64>, mut visit: impl FnMut(f64)) {
        let mut tell = |slack: f64| visit(if slack.is_nan() { f64::NEG_INFINITY } else { slack });
        for row in &self.linear {
            tell(row.at(u));
        }
        if let Some([side, ahead]) = &self.disc {
            let (s1, s2) = (side.at(u), ahead.at(u));
            tell(1.0 - (s1 * s1 + s2 * s2).sqrt());
        }
    }

    /// Largest amount by which `u` violates a limit; at most 0 if `u` is inside the set.
    pub fn violation(&self, u: &Vector4<f64>) -> f64 {
        let mut worst = f64::NEG_INFINITY;
        self.slacks(u, |slack| worst = worst.max(-slack));
        worst
    }

    /// Largest share, 0 to 1, of the way from `inside` to `u` that stays in the set up to rounding; 0 if `u` has a NaN.
    /// `inside` must be a demand of the set.
    pub fn reach(&self, inside: &Vector4<f64>, u: &Vector4<f64>) -> f64 {
        let mut share = 1.0_f64;
        let mut limit = |to: f64| share = if to.is_nan() { 0.0 } else { share.min(to) };
        for row in &self.linear {
            let (here, there) = (row.at(inside), row.at(u));
            if there.is_nan() || there < 0.0 {
                limit(here / (here - there));
            }
        }
        if let Some(disc) = &self.disc {
            let [(a1, b1), (a2, b2)] = disc.map(|row| (row.at(inside), row.at(u)));
            let outside = b1 * b1 + b2 * b2;
            if outside.is_nan() || outside > 1.0 {
                // |a + t (b - a)| = 1, the larger root: (d d) t^2 + 2 (a d) t - (1 - a a) = 0
                let (d1, d2) = (b1 - a1, b2 - a2);
                let (dd, ad, room) = (d1 * d1 + d2 * d2, a1 * d1 + a2 * d2, 1.0 - a1 * a1 - a2 * a2);
                limit((-ad + (ad * ad + dd * room).max(0.0).sqrt()) / dd);
            }
        }
        share.max(0.0)
    }
}

impl Slack {
    /// Slack of the demand `u`.
    pub fn at(&self, u: &Vector4<f64>) -> f64 {
        self.offset + self.slope.dot(u)
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector4;
    use proptest::prelude::*;

    use super::*;
    use crate::tests::paper_limits;
    use crate::{ActuatorLimits, Parameters};
    use contract::actuation::Actuation;

    fn envelope(idle: f64) -> Envelope {
        let limits = ActuatorLimits::new(&Parameters::default(), idle, 2.0, f64::to_radians(60.0));
        Envelope::new(&Parameters::default(), false, limits)
    }

    #[test]
    fn hover_is_inside() {
        let envelope = Envelope::new(&Parameters::default(), false, paper_limits());
        for set in [DemandSet::exact(&envelope), DemandSet::bounding_box(&envelope)] {
            assert!(set.violation(&Vector4::zeros()) < -0.1);
        }
    }

    #[test]
    fn full_speed_touches_one_limit_per_rotor() {
        let envelope = envelope(200.0);
        let full = Actuation { rotor_speed: envelope.limits.rotor_speed_max, tilt_rad: 0.1 };
        let (set, mut touching) = (DemandSet::exact(&envelope), 0);
        set.slacks(&envelope.mixing.deviation(&full), |slack| touching += u32::from(slack.abs() < 1e-12));
        assert_eq!(touching, 3);
    }

    #[test]
    fn a_nan_or_infinite_demand_is_outside_and_out_of_reach() {
        let envelope = envelope(200.0);
        for set in [DemandSet::exact(&envelope), DemandSet::bounding_box(&envelope)] {
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
                let u = Vector4::new(bad, 0.0, 0.0, bad);
                assert!(set.violation(&u) > 1.0, "{bad}");
                assert!(set.reach(&Vector4::zeros(), &u) < 1e-9, "{bad}");
            }
        }
    }

    proptest! {
        #[test]
        fn the_rows_agree_with_the_envelope(u in prop::array::uniform4(-40.0..40.0_f64), idle in prop::bool::ANY) {
            let envelope = envelope(if idle { 200.0 } else { 0.0 });
            let theirs = envelope.demand_violation(&Vector4::from(u));
            let ours = DemandSet::exact(&envelope).violation(&Vector4::from(u));
            prop_assert!((ours - theirs).abs() < 1e-12 * theirs.abs().max(1.0), "{ours} is not {theirs}");
        }

        #[test]
        fn reach_ends_at_the_border(u in prop::array::uniform4(-40.0..40.0_f64), from in prop::array::uniform4(-0.1..0.1_f64)) {
            let set = DemandSet::exact(&envelope(200.0));
            let (from, u) = (Vector4::from(from), Vector4::from(u));
            let share = set.reach(&from, &u);
            let end = set.violation(&(from + (u - from) * share));
            if share < 1.0 {
                prop_assert!(end.abs() < 1e-12, "{end:e}");
            } else {
                prop_assert!(set.violation(&u) <= 0.0);
            }
        }
    }
}
