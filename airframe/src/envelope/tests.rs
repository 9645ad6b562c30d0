use contract::actuation::Actuation;
use nalgebra::Vector4;
use proptest::prelude::*;

use super::*;
use crate::mixing::intermediate;
use crate::tests::{actuation, assert_close, paper_limits, reference, vector};

#[test]
fn val_bounding_box() {
    let r = &reference()["reference"]["box_outer"];
    let (lower, upper) = Envelope::new(&Parameters::default(), false, paper_limits()).bounding_box();
    assert_close(lower.as_slice(), vector(&r["lo"]).as_slice());
    assert_close(upper.as_slice(), vector(&r["hi"]).as_slice());
}

#[test]
fn val_envelope_membership() {
    let reference = reference();
    let envelope = Envelope::new(&Parameters::default(), false, paper_limits());
    let cases = reference["mixer_cases"].as_array().unwrap();
    assert!(cases.len() >= 4);
    for case in cases {
        let inside = envelope.demand_violation(&vector(&case["d_udelta"])) <= 0.0;
        assert_eq!(inside, case["inside_exact_set"], "{}", case["name"]);
    }
}

#[test]
fn the_bounding_box_is_the_smallest_with_idle_and_a_narrow_wedge() {
    for (idle, tilt_deg) in [(0.0, 90.0), (0.0, 40.0), (200.0, 60.0), (900.0, 60.0), (900.0, 80.0)] {
        let limits = ActuatorLimits::new(&Parameters::default(), idle, 2.0, f64::to_radians(tilt_deg));
        for tilt_reaction in [false, true] {
            let envelope = Envelope::new(&Parameters::default(), tilt_reaction, limits);
            let (lower, upper) = envelope.bounding_box();
            let (mut least, mut most) = (Vector4::repeat(f64::INFINITY), Vector4::repeat(f64::NEG_INFINITY));
            for demand in members(&envelope) {
                least = least.inf(&demand);
                most = most.sup(&demand);
            }
            let size = upper - lower;
            for i in 0..4 {
                let (below, above) = ((least[i] - lower[i]) / size[i], (upper[i] - most[i]) / size[i]);
                assert!(below > -1e-9 && above > -1e-9, "idle {idle}, tilt {tilt_deg}: a member is outside");
                assert!(below < 2e-3 && above < 2e-3, "idle {idle}, tilt {tilt_deg}: the box is too large");
            }
        }
    }
}

/// Demands all over the set: a fine grid of rotor 1's speed and tilt with the extreme speeds of rotors 2 and 3.
fn members(envelope: &Envelope) -> impl Iterator<Item = Vector4<f64>> {
    let ActuatorLimits { rotor_speed_min: idle, rotor_speed_max: max, tilt_max_rad } = envelope.limits;
    let n = 800;
    let share = move |i: i32| f64::from(i) / f64::from(n);
    let front = (0..=n).flat_map(move |i| (0..=n).map(move |j| (share(i) * max[0] * max[0], share(j) * 2.0 - 1.0)));
    front.flat_map(move |(square, tilt)| {
        let (sin_mu, cos_mu) = (tilt * tilt_max_rad).sin_cos();
        let rear = [(idle, idle), (idle, max[2]), (max[1], idle), (max[1], max[2])];
        rear.into_iter().filter_map(move |(o2, o3)| {
            let u = Vector4::new(square * sin_mu, square * cos_mu, o2 * o2, o3 * o3);
            (envelope.violation(&u) <= 1e-12).then(|| envelope.mixing.forward * (u - envelope.mixing.trim))
        })
    })
}

proptest! {
    /// Positions within the limits are inside, with and without tilt reaction; all others are outside.
    #[test]
    fn the_envelope_is_exactly_the_limits(
        rotor_speed in prop::array::uniform3(0.0..4000.0f64), tilt_rad in -1.6..1.6f64, tilt_reaction: bool,
    ) {
        let limits = ActuatorLimits::new(&Parameters::default(), 0.0, 2.0, 1.0);
        let envelope = Envelope::new(&Parameters::default(), tilt_reaction, limits);
        let position = Actuation { rotor_speed, tilt_rad };
        let inside = limits.clip(&position) == position;
        let violation = envelope.violation(&intermediate(&position));
        prop_assert_eq!(violation <= 0.0, inside);
        let by_demand = envelope.demand_violation(&envelope.mixing.deviation(&position));
        prop_assert!((by_demand - violation).abs() < 1e-12);
    }

    /// The segment between two members lies in the set, also at the idle cut.
    #[test]
    fn the_envelope_is_convex(a in actuation(), b in actuation(), t in 0.0..1.0f64) {
        let limits = ActuatorLimits::new(&Parameters::default(), 200.0, 2.0, 1.0);
        let envelope = Envelope::new(&Parameters::default(), false, limits);
        let [a, b] = [intermediate(&limits.clip(&a)), intermediate(&limits.clip(&b))];
        let farthest = envelope.violation(&a).max(envelope.violation(&b));
        prop_assert!(envelope.violation(&(a * t + b * (1.0 - t))) <= farthest + 1e-12);
    }
}
