//! Priority of the axes, then the border, then the optimum compared with another solver.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, NonnegativeConeT, SecondOrderConeT, SolverStatus};
use contract::actuation::Actuation;
use nalgebra::Matrix4;
use proptest::prelude::*;

use super::*;
use crate::envelope::Envelope;
use crate::{ActuatorLimits, Parameters};

fn envelope(idle: f64, ratio: f64, tilt_max_deg: f64, tilt_reaction: bool) -> Envelope {
    let vehicle = Parameters::default();
    Envelope::new(&vehicle, tilt_reaction, ActuatorLimits::new(&vehicle, idle, ratio, tilt_max_deg.to_radians()))
}

/// Vehicles of different strength, with and without idle speed and tilt reaction.
fn vehicle() -> impl Strategy<Value = Envelope> {
    let idle = prop_oneof![Just(0.0), 0.0..600.0_f64];
    (idle, 1.15..3.0_f64, 35.0..=90.0_f64, any::<bool>())
        .prop_map(|(idle, ratio, tilt_max_deg, tilt_reaction)| envelope(idle, ratio, tilt_max_deg, tilt_reaction))
}

/// Demands inside the actuators' set, near its border and far outside.
fn moderate_demand() -> impl Strategy<Value = Vector4<f64>> {
    (prop::array::uniform4(-1.0..1.0_f64), -1.0..3.0_f64).prop_map(|(direction, decades)| {
        let size = 10_f64.powf(decades);
        Vector4::from(direction.map(|share| share * size))
    })
}

fn onto(envelope: &Envelope) -> Projection {
    Projection::new(DemandSet::exact(envelope), &WEIGHTS)
}

/// Projects a `demand` outside the set, with the limits of profile robust.
#[track_caller]
fn nearest(demand: [f64; 4]) -> Vector4<f64> {
    let demand = Vector4::from(demand);
    onto(&envelope(200.0, 2.0, 60.0, false)).nearest(&demand).expect("the demand is outside")
}

fn bits(demand: &Vector4<f64>) -> [u64; 4] {
    std::array::from_fn(|axis| demand[axis].to_bits())
}

fn miss(demand: &Vector4<f64>, other: &Vector4<f64>) -> f64 {
    let gap = demand - other;
    0.5 * gap.component_mul(&gap).dot(&Vector4::from(WEIGHTS))
}

#[test]
fn thrust_is_given_up_to_hold_roll_and_pitch() {
    // Roll needs a strong rear rotor: the most without pitch is 3.02 N m, at 10 N more thrust than demanded.
    for roll in [-5.0, 5.0] {
        let got = nearest([0.0, 0.0, roll, 0.0]);
        assert!(got[2] / roll.signum() > 2.9 && got[0] < -9.0, "{got}");
    }
    for up in [-400.0, -100.0, -60.0, 60.0, 100.0, 400.0] {
        let [_, pitch, roll, _] = nearest([up, 1.0, 1.0, 0.0]).into();
        assert!(pitch > 0.9 && roll > 0.9, "{up} N: pitch {pitch}, roll {roll}");
    }
}

#[test]
fn yaw_is_given_up_before_roll_and_pitch() {
    for yaw in [-5.0, 5.0] {
        let [_, pitch, roll, got] = nearest([0.0, 0.0, 0.0, yaw]).into();
        let lost = (yaw - got).abs();
        assert!(lost > 0.5 && got / yaw > 0.0, "yaw gave way: {got} of {yaw}");
        assert!(pitch.abs() < lost / 5.0 && roll.abs() < lost / 10.0, "pitch and roll did not: {pitch} {roll}");
    }
}

#[test]
fn weights_far_apart_give_strict_priority() {
    let set = DemandSet::exact(&envelope(200.0, 2.0, 60.0, false));
    let mut ordered = Projection::new(set, &[1.0, 1e4, 1e4, 1e-3]);
    let [col, pitch, roll, yaw] = ordered.nearest(&Vector4::new(-3.0, 0.2, 0.1, 5.0)).unwrap().into();
    assert!((pitch - 0.2).abs() < 1e-3 && (roll - 0.1).abs() < 1e-3, "first {pitch} {roll}");
    assert!((col + 3.0).abs() < 0.05 && yaw < 4.0, "then {col}, and {yaw} is left");
}

#[test]
fn a_huge_demand_is_clipped_to_the_attainable_range() {
    let most = nearest([-60.0, 5.0, -5.0, 5.0]);
    for size in [1e3, 1e10, 1e200, f64::MAX] {
        assert_eq!(nearest([-size, size, -size, size]), most, "{size:e}");
    }
}

/// Solves the same problem with Clarabel.
fn reference(set: &DemandSet, demand: &Vector4<f64>) -> Vector4<f64> {
    let disc = set.disc.expect("the exact set has one");
    let apex = Slack { offset: 1.0, slope: Vector4::zeros() };
    let slacks: Vec<_> = set.linear.iter().chain([&apex]).chain(&disc).collect();
    let a: Vec<[f64; 4]> = slacks.iter().map(|slack| (-slack.slope).into()).collect();
    let b: Vec<f64> = slacks.iter().map(|slack| slack.offset).collect();
    let p: [[f64; 4]; 4] = Matrix4::from_diagonal(&WEIGHTS.into()).into();
    let q: Vec<f64> = demand.iter().zip(WEIGHTS).map(|(u, weight)| -weight * u).collect();
    let cones = [NonnegativeConeT(set.linear.len()), SecondOrderConeT(3)];
    let settings = DefaultSettings {
        verbose: false,
        tol_gap_abs: 1e-10,
        tol_gap_rel: 1e-10,
        tol_feas: 1e-10,
        ..DefaultSettings::default()
    };
    let mut solver =
        DefaultSolver::new(&CscMatrix::from(p.iter()), &q, &CscMatrix::from(a.iter()), &b, &cones, settings).unwrap();
    solver.solve();
    assert!(matches!(solver.solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved));
    Vector4::from_column_slice(&solver.solution.x)
}

proptest! {
    #[test]
    fn a_demand_inside_passes_bit_for_bit(
        envelope in vehicle(), shares in prop::array::uniform3(0.0..=1.0_f64), tilt in -1.0..=1.0_f64,
    ) {
        let limits = envelope.limits;
        let speed = |rotor: usize| limits.rotor_speed_min
            + shares[rotor] * (limits.rotor_speed_max[rotor] - limits.rotor_speed_min);
        let position =
            Actuation { rotor_speed: [speed(0), speed(1), speed(2)], tilt_rad: tilt * limits.tilt_max_rad };
        let demand = envelope.mixing.deviation(&position) * 0.999;
        let mut projection = onto(&envelope);
        prop_assume!(projection.set.violation(&demand) < 0.0); // slow speeds of rotor 1 may be outside the idle cut
        prop_assert_eq!(projection.nearest(&demand), None);
    }

    #[test]
    fn a_demand_outside_lands_on_the_border(envelope in vehicle(), demand in moderate_demand()) {
        let mut projection = onto(&envelope);
        match projection.nearest(&demand) {
            None => prop_assert!(projection.set.violation(&demand) <= 0.0),
            Some(nearest) => {
                let violation = projection.set.violation(&nearest);
                prop_assert!(-1e-8 < violation && violation <= -ROUNDING, "{violation:e}");
                prop_assert_eq!(projection.nearest(&nearest), None, "once is enough");
            }
        }
    }

    #[test]
    fn no_demand_of_the_set_is_nearer(envelope in vehicle(), demand in moderate_demand()) {
        let mut projection = onto(&envelope);
        if let Some(nearest) = projection.nearest(&demand) {
            let wanted = demand.zip_zip_map(&projection.set.lower, &projection.set.upper, f64::clamp);
            let (ours, theirs) = (miss(&wanted, &nearest), miss(&wanted, &reference(&projection.set, &wanted)));
            prop_assert!((ours - theirs).abs() <= 1e-6 * theirs.max(1.0), "{ours} is not {theirs}");
        }
    }

    #[test]
    fn earlier_demands_change_nothing(envelope in vehicle(), demands in prop::collection::vec(moderate_demand(), 2..8)) {
        let mut projection = onto(&envelope);
        for demand in demands {
            let fresh = onto(&envelope).nearest(&demand);
            prop_assert_eq!(projection.nearest(&demand).as_ref().map(bits), fresh.as_ref().map(bits));
        }
    }

    #[test]
    fn without_a_solution_the_way_from_hover_ends_at_the_border(envelope in vehicle(), demand in moderate_demand()) {
        let mut projection = onto(&envelope);
        projection.solver.max_iterations = 1;
        let wanted = demand.zip_zip_map(&projection.set.lower, &projection.set.upper, f64::clamp);
        let mut ignored = [0.0; 4];
        let outcome = projection.solver.solve(wanted.as_slice(), &projection.offsets, &mut ignored);
        prop_assume!(outcome.termination == Termination::IterationLimit);
        let nearest = projection.nearest(&demand).expect("the solver had work to do");
        let violation = projection.set.violation(&nearest);
        prop_assert!(-1e-8 < violation && violation <= -ROUNDING, "{violation:e}");
        let cosine = nearest.dot(&wanted) / (nearest.norm() * wanted.norm());
        prop_assert!((cosine - 1.0).abs() < 1e-12, "{cosine}");
    }
}
