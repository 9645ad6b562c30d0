//! The constraints of one move, as slacks that must not become negative.
//!
//! ```text
//! u_min <= u_k <= u_max,   k = 0..Nu-1                                   (3)
//! ```
//!
//! The paper finds no bounds for (3) and approximates. Here they are exact: [`airframe::envelope`] shows that the limits
//! of rotors and servo are convex in the intermediate input, and that is linear in the move. So each limit is a row
//! `s = offset + slope . u_k` with `s >= 0`, but for the highest speed of rotor 1, which is a second-order cone of three
//! rows, `s0 >= |(s1, s2)|`. `box` takes the smallest box around that set instead.
//!
//! Slacks are told in shares of `Omega1max^2`, those of the box in shares of its width.
//!
//! Departure: the bounds on the states (49)-(51) are not imposed: over the moves of a plan they are idle even in a violent
//! turn. Test `the_state_bounds_are_idle_in_a_violent_turn`.

use airframe::envelope::Envelope;
use contract::Scenario;
use contract::scenario::Constraints;
use nalgebra::Vector4;

/// A slack that is affine in the move: `s = offset + slope . u_k`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// Slack at hover.
    pub offset: f64,
    /// Change of the slack per N, N m, N m, N m.
    pub slope: Vector4<f64>,
}

/// What one move may be. Every move of a plan obeys the same set.
#[derive(Debug, Clone)]
pub struct MoveSet {
    /// Rows with `s >= 0`.
    pub linear: Vec<Row>,
    /// Rows with `s0 >= |(s1, s2)|`.
    pub cone: Option<[Row; 3]>,
}

impl MoveSet {
    /// The set a scenario asks for; `None` where it asks for no constraint.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let envelope = Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits());
        match scenario.mpc.constraints {
            Constraints::None => None,
            Constraints::Box => Some(Self::bounding_box(&envelope)),
            Constraints::Cone => Some(Self::exact(&envelope)),
        }
    }

    /// By how much the worst of the `moves` leaves the set (0 or less is inside), and how many constraints they touch:
    /// slacks of `near` or less.
    pub fn judge(&self, moves: &[f64], near: f64) -> (f64, u64) {
        let (mut violation, mut touching) = (f64::NEG_INFINITY, 0);
        let mut visit = |slack: f64| {
            let slack = if slack.is_nan() { f64::NEG_INFINITY } else { slack };
            violation = violation.max(-slack); // (3)
            touching += u64::from(slack <= near);
        };
        for u in moves.chunks_exact(4).map(Vector4::from_column_slice) {
            for row in &self.linear {
                visit(row.slack(&u));
            }
            if let Some([apex, side, ahead]) = &self.cone {
                let (s1, s2) = (side.slack(&u), ahead.slack(&u));
                visit(apex.slack(&u) - (s1 * s1 + s2 * s2).sqrt());
            }
        }
        (violation, touching)
    }

    /// The exact set of the actuators.
    fn exact(envelope: &Envelope) -> Self {
        let [max1, max2, max3] = envelope.limits.rotor_speed_max.map(|omega| omega * omega);
        let idle = envelope.limits.rotor_speed_min.powi(2);
        let (sin_wedge, cos_wedge) = envelope.limits.tilt_max_rad.sin_cos();
        let (sin_cut, cos_cut) = envelope.cut_tilt_rad.sin_cos();

        let mixing = &envelope.mixing;
        let row = |constant: f64, [u1, u2, u3, u4]: [f64; 4]| {
            let c = Vector4::new(u1, u2, u3, u4) / max1;
            Row { offset: constant / max1 + c.dot(&mixing.trim), slope: mixing.inverse.tr_mul(&c) }
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
        let cone = [row(max1, [0.0; 4]), row(0.0, [1.0, 0.0, 0.0, 0.0]), row(0.0, [0.0, 1.0, 0.0, 0.0])];
        Self { linear, cone: Some(cone) }
    }

    /// The smallest box around the exact set.
    fn bounding_box(envelope: &Envelope) -> Self {
        let (lower, upper) = envelope.bounding_box();
        let mut linear = Vec::with_capacity(8);
        for axis in 0..4 {
            let slope = Vector4::ith(axis, 1.0 / (upper[axis] - lower[axis]));
            linear.push(Row { offset: -lower[axis] * slope[axis], slope });
            linear.push(Row { offset: upper[axis] * slope[axis], slope: -slope });
        }
        Self { linear, cone: None }
    }
}

impl Row {
    fn slack(&self, u: &Vector4<f64>) -> f64 {
        self.offset + self.slope.dot(u)
    }
}

#[cfg(test)]
mod tests {
    use contract::scenario::Profile;
    use proptest::prelude::*;

    use super::*;
    use crate::fixture;

    fn envelope(scenario: &Scenario) -> Envelope {
        Envelope::new(&scenario.airframe, scenario.mixer.tilt_reaction, scenario.limits())
    }

    fn set(scenario: &Scenario, constraints: Constraints) -> MoveSet {
        let mut scenario = scenario.clone();
        scenario.mpc.constraints = constraints;
        MoveSet::new(&scenario).expect("constraints were asked for")
    }

    #[test]
    fn none_is_no_set_and_hover_is_inside_the_others() {
        assert!(MoveSet::new(&Scenario::of(Profile::Paper)).is_none());
        for constraints in [Constraints::Box, Constraints::Cone] {
            let (violation, touching) = set(&Scenario::default(), constraints).judge(&[0.0; 20], 1e-6);
            assert!(violation < -0.1 && touching == 0, "{violation} {touching}");
        }
    }

    #[test]
    fn full_speed_touches_one_limit_per_rotor() {
        let scenario = Scenario::default();
        let envelope = envelope(&scenario);
        let full = airframe::Actuation { rotor_speed: envelope.limits.rotor_speed_max, tilt_rad: 0.1 };
        let demand = envelope.mixing.deviation(&full);
        let mut plan = [0.0; 20];
        plan[4..8].copy_from_slice(demand.as_slice());
        let set = set(&scenario, Constraints::Cone);
        let (violation, touching) = set.judge(&plan, 1e-9);
        assert!(violation.abs() < 1e-12);
        assert_eq!(touching, 3);
        assert!(set.judge((demand * 1.01).as_slice(), 1e-9).0 > 0.0);
    }

    #[test]
    fn a_move_that_is_no_number_is_outside() {
        for constraints in [Constraints::Box, Constraints::Cone] {
            let set = set(&Scenario::default(), constraints);
            for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX] {
                assert!(set.judge(&[bad, 0.0, 0.0, bad], 1e-6).0 > 1.0, "{constraints:?} {bad}");
            }
        }
    }

    #[test]
    fn val_box_with_the_limits_of_the_paper() {
        let (lower, upper) = envelope(&Scenario::of(Profile::Paper)).bounding_box();
        for (ours, key) in [(lower, "lo"), (upper, "hi")] {
            let theirs = fixture::vector(&fixture::reference()["reference"]["box_outer"][key]);
            for axis in 0..4 {
                let miss = (ours[axis] - theirs[axis]).abs() / theirs[axis].abs();
                assert!(miss < 1e-9, "{key}[{axis}]: {} is not {}", ours[axis], theirs[axis]);
            }
        }
    }

    proptest! {
        #[test]
        fn the_rows_agree_with_the_envelope(u in prop::array::uniform4(-40.0..40.0_f64), idle in prop::bool::ANY) {
            let mut scenario = Scenario::default();
            scenario.plant.rotor_speed_min = if idle { 200.0 } else { 0.0 };
            let theirs = envelope(&scenario).demand_violation(&Vector4::from(u));
            let ours = set(&scenario, Constraints::Cone).judge(&u, 0.0).0;
            prop_assert!((ours - theirs).abs() < 1e-12 * theirs.abs().max(1.0), "{ours} is not {theirs}");
        }

        #[test]
        fn the_box_holds_the_exact_set(
            speeds in prop::array::uniform3(0.0..=1.0_f64), tilt_rad in -1.0..1.0_f64, ratio in 1.2..3.0_f64,
        ) {
            let mut scenario = Scenario::default();
            scenario.plant.rotor_speed_max_ratio = ratio;
            let envelope = envelope(&scenario);
            let mut rotor_speed = envelope.limits.rotor_speed_max;
            rotor_speed.iter_mut().zip(speeds).for_each(|(max, share)| *max = 200.0 + share * (*max - 200.0));
            let demand = envelope.mixing.deviation(&airframe::Actuation { rotor_speed, tilt_rad });
            prop_assume!(envelope.demand_violation(&demand) <= 0.0);
            prop_assert!(set(&scenario, Constraints::Box).judge(demand.as_slice(), 0.0).0 <= 1e-12);
        }
    }
}
