//! Tests of plans: continuity, limits, figures and headings.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use airframe::angle;
use nalgebra::Vector3;
use proptest::prelude::*;

use crate::curve::SAMPLES;
use crate::figure::FigureShape;
use crate::heading::{Rule, SLOW_MPS};
use crate::limits::Demand;
use crate::plan::{Least, Start};
use crate::stray::{Offer, Stray};
use crate::{MissionPlan, PartMotion, PlanPart, Planned, Setpoint, VehicleLimits, named};

/// Limits of the vehicle of Table I under the profile robust.
const VEHICLE: VehicleLimits = VehicleLimits {
    g_mps2: 9.81,
    drag_linear_1ps: 0.0,
    drag_quadratic_1pm: 0.0,
    most: Demand {
        speed_mps: f64::INFINITY,
        acceleration_mps2: f64::INFINITY,
        vertical_mps: 4.0,
        tilt_rad: PI / 6.0,
        thrust_mps2: [0.5, 39.0],
        turn_radps: TAU,
    },
};
const AT: [f64; 3] = [3.0, -2.0, -5.0];

fn start(limits: VehicleLimits) -> Start {
    Start { position_m: AT, heading_rad: 0.3, heading_rate_radps: PI, limits }
}

fn plan(motions: Vec<PartMotion>) -> MissionPlan {
    let parts: Vec<PlanPart> = motions.into_iter().map(|motion| PlanPart { motion, heading: Rule::KEEP }).collect();
    MissionPlan::new(&start(VEHICLE.share(0.7)), &parts)
}

fn one(motion: PartMotion, heading: Rule) -> MissionPlan {
    MissionPlan::new(&start(VEHICLE.share(0.7)), &[PlanPart { motion, heading }])
}

fn rest(duration_s: f64) -> PartMotion {
    PartMotion::Rest { at_m: None, duration_s }
}

fn through(points_m: Vec<[f64; 3]>, least: Least) -> PartMotion {
    PartMotion::Through { points_m, times_s: None, least }
}

fn figure(shape: FigureShape, laps: u32, climb_m: f64) -> PartMotion {
    PartMotion::Figure { shape, radius_m: 6.0, period_s: Some(12.0), laps, climb_m, direction_rad: FRAC_PI_2 }
}

/// Legs of 4 s each.
fn legs(points_m: &[[f64; 3]], ramp_s: Option<f64>) -> PartMotion {
    let times_s = (1..=points_m.len()).map(|i| 4.0 * i as f64).collect();
    PartMotion::Legs { points_m: points_m.to_vec(), times_s, ramp_s }
}

fn at_instants(duration_s: f64, count: u32) -> impl Iterator<Item = f64> {
    (0..=count).map(move |i| duration_s * f64::from(i) / f64::from(count))
}

fn points() -> impl Strategy<Value = Vec<[f64; 3]>> {
    let apart = |points: &Vec<[f64; 3]>| {
        let all: Vec<_> = std::iter::once(&AT).chain(points).map(|p| Vector3::from(*p)).collect();
        all.windows(2).all(|two| (two[1] - two[0]).norm() > 0.2)
    };
    let place = (-40.0..40.0_f64, -40.0..40.0_f64, -30.0..-2.0_f64).prop_map(|(n, e, d)| [n, e, d]);
    prop::collection::vec(place, 1..6).prop_filter("points apart", apart)
}

fn least() -> impl Strategy<Value = Least> {
    prop_oneof![Just(Least::Snap), Just(Least::Jerk)]
}

fn motion() -> impl Strategy<Value = PartMotion> {
    prop_oneof![
        (0.5..20.0_f64, prop::option::of(1.0..20.0_f64))
            .prop_map(|(height, duration)| PartMotion::Climb(height, duration)),
        (points(), least()).prop_map(|(points, least)| through(points, least)),
        points().prop_map(|points_m| legs(&points_m, None)),
        (any::<bool>(), 1..4_u32, 0.5..20.0_f64, prop::option::of(2.0..60.0_f64), -5.0..5.0_f64, -PI..PI).prop_map(
            |(eight, laps, radius_m, period_s, climb_m, direction_rad)| PartMotion::Figure {
                shape: if eight { FigureShape::Eight } else { FigureShape::Circle },
                radius_m,
                period_s,
                laps,
                climb_m,
                direction_rad,
            }
        ),
        (0.1..5.0_f64).prop_map(rest),
        (0.1..1.5_f64).prop_map(|sink_mps| PartMotion::Land { standing_down_m: 30.0, sink_mps }),
    ]
}

/// Finds the stray of the curve from [`AT`] through `points_m` at `times_s`; `None` if it stays near.
fn stray(points_m: &[[f64; 3]], times_s: Option<&[f64]>, least: Least) -> Option<Stray> {
    let motion = PartMotion::Through { points_m: points_m.to_vec(), times_s: times_s.map(Vec::from), least };
    let plan = one(motion, Rule::KEEP);
    Stray::find(&plan.parts()[0].curve, &[&[AT], points_m].concat(), least, &VEHICLE.share(0.7))
}

#[test]
fn a_curve_that_leaves_its_points_is_offered_times_that_keep_it() {
    let [n, e, d] = AT;
    let out_and_back = [[n + 1.0, e, d], AT];
    for least in [Least::Snap, Least::Jerk] {
        let found = stray(&out_and_back, Some(&[2.0, 22.0]), least).expect("it strays");
        assert!(found.beyond_m > 5.0 && (found.longest_leg_m - 1.0).abs() < 1e-9, "{found:?}");
        let Offer { times_s, beyond_m } = found.offer.expect("an offer");
        assert!((times_s[1] - 22.0).abs() < 1e-9 && (times_s[0] - 11.0).abs() < 0.5, "as long as before: {times_s:?}");
        assert!(beyond_m < 0.05, "{beyond_m}");
        assert_eq!(stray(&out_and_back, Some(&times_s), least), None);
    }
    assert_eq!(stray(&[[n + 20.0, e, d]], Some(&[9.0]), Least::Snap), None, "a straight line");
}

/// Even the fastest curve may stray from its points: here it swings out sideways while it climbs slowly.
#[test]
fn where_the_fastest_curve_strays_no_times_are_offered() {
    let points = [[0.0, -34.177, -2.0], [0.0, 0.0, -2.0], [0.0, 0.0, -28.139], [0.0, 0.0, -2.0]];
    let found = stray(&points, None, Least::Snap).expect("it strays");
    assert!(found.beyond_m > 50.0 && found.offer.is_none(), "{found:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    #[test]
    fn times_are_offered_unless_the_fastest_curve_strays_too(
        points in points(),
        shares in prop::collection::vec(0.02..1.0_f64, 8),
        quintic: bool,
    ) {
        let least = if quintic { Least::Jerk } else { Least::Snap };
        let times_s: Vec<f64> = shares.iter().cycle().take(points.len()).scan(0.0, |at_s, share| {
            *at_s += 60.0 * share;
            Some(*at_s)
        }).collect();
        if let Some(found) = stray(&points, Some(&times_s), least) {
            match found.offer {
                Some(offer) => prop_assert_eq!(stray(&points, Some(&offer.times_s), least), None),
                None => prop_assert!(stray(&points, None, least).is_some(), "{:?}", found),
            }
        }
    }

    #[test]
    fn parts_join_at_rest_and_nothing_jumps(motions in prop::collection::vec(motion(), 1..5)) {
        let plan = plan(motions);
        let instants = plan.parts().iter().flat_map(|part| {
            part.curve.times_s().into_iter().map(|t_s| part.begins_s + t_s)
        });
        for t_s in instants {
            let tiny = 1e-7;
            let [before, here, after] = [t_s - tiny, t_s, t_s + tiny].map(|t_s| plan.at(t_s));
            for other in [before, after] {
                for i in 0..3 {
                    prop_assert!((other.position_m[i] - here.position_m[i]).abs() < 1e-4, "{t_s} {other:?} {here:?}");
                    prop_assert!((other.velocity_mps[i] - here.velocity_mps[i]).abs() < 1e-4, "{t_s} {other:?} {here:?}");
                    prop_assert!((other.acceleration_mps2[i] - here.acceleration_mps2[i]).abs() < 1e-3, "{t_s} {other:?} {here:?}");
                }
            }
        }
        for part in plan.parts() {
            for t_s in [0.0, part.curve.duration_s()] {
                let here = part.curve.at(t_s);
                let motion = [here.velocity_mps, here.acceleration_mps2];
                prop_assert!(motion.as_flattened().iter().all(|x| x.abs() < 1e-7), "{t_s} {here:?}");
            }
        }
        prop_assert_eq!(plan.at(-1.0), Setpoint::at_rest(AT));
        let last = plan.at(plan.duration_s() + 1.0);
        prop_assert!(last.velocity_mps.iter().all(|v| *v == 0.0), "{last:?}");
    }

    #[test]
    fn velocity_and_acceleration_are_the_derivatives_of_position(motion in motion(), share in 0.01..0.99_f64) {
        let plan = plan(vec![motion]);
        let t_s = share * plan.duration_s();
        let h = 1e-4;
        let [before, here, after] = [t_s - h, t_s, t_s + h].map(|t_s| plan.at(t_s));
        for i in 0..3 {
            let velocity = (after.position_m[i] - before.position_m[i]) / (2.0 * h);
            let acceleration = (after.velocity_mps[i] - before.velocity_mps[i]) / (2.0 * h);
            prop_assert!((velocity - here.velocity_mps[i]).abs() < 1e-3, "{velocity} {here:?}");
            prop_assert!((acceleration - here.acceleration_mps2[i]).abs() < 2e-2, "{acceleration} {here:?}");
        }
    }

    #[test]
    fn a_fastest_curve_touches_a_limit_and_one_percent_less_time_breaks_it(
        points in points(), least in least(), speed_mps in prop::option::of(1.0..10.0_f64), drag in 0.0..0.3_f64,
    ) {
        let limits = VehicleLimits {
            most: Demand { speed_mps: speed_mps.unwrap_or(f64::INFINITY), ..VEHICLE.most },
            drag_linear_1ps: drag,
            ..VEHICLE
        };
        let plan = MissionPlan::new(&start(limits), &[PlanPart { motion: through(points, least), heading: Rule::KEEP }]);
        let Planned { curve, .. } = &plan.parts()[0];
        let legs = curve.legs(SAMPLES);
        let demand = |stretch: f64| {
            legs.iter().map(|leg| limits.demand(leg, stretch)).reduce(Demand::and).unwrap()
        };
        prop_assert_eq!(demand(1.0).excess(&limits), None);
        prop_assert!(demand(0.99).excess(&limits).is_some());
        // The limits hold between the samples too, except for the change of the curve within a hundredth of a leg.
        let above = |what: f64, limit: f64| what > limit * 1.01;
        for t_s in at_instants(curve.duration_s(), 1777) {
            let here = curve.at(t_s);
            let (velocity, acceleration) = (Vector3::from(here.velocity_mps), Vector3::from(here.acceleration_mps2));
            let thrust = limits.thrust(&velocity, &acceleration);
            prop_assert!(!above(velocity.norm(), limits.most.speed_mps) && !above(velocity.z.abs(), limits.most.vertical_mps));
            prop_assert!(!above(thrust.xy().norm().atan2(-thrust.z), limits.most.tilt_rad), "{t_s}");
            prop_assert!(!above(thrust.norm(), limits.most.thrust_mps2[1]) && thrust.norm() > 0.99 * limits.most.thrust_mps2[0]);
        }
    }

    #[test]
    fn waypoints_are_passed_at_their_times(
        points in points(), least in least(), durations in prop::collection::vec(0.5..9.0_f64, 6),
    ) {
        let times_s: Vec<f64> = durations.iter().scan(0.0, |t, h| { *t += h; Some(*t) }).take(points.len()).collect();
        let motion = PartMotion::Through { points_m: points.clone(), times_s: Some(times_s.clone()), least };
        let plan = plan(vec![rest(2.0), motion]);
        for (point, t_s) in points.iter().zip(times_s) {
            let here = plan.at(2.0 + t_s).position_m;
            prop_assert!((0..3).all(|i| (here[i] - point[i]).abs() < 1e-9), "{here:?} {point:?}");
        }
    }

    #[test]
    fn a_heading_along_track_follows_the_velocity(points in points(), least in least()) {
        let plan = one(through(points, least), Rule::Track);
        let rate_radps = PI;
        let mut behind_since_s = f64::NEG_INFINITY;
        let mut before = None;
        for t_s in at_instants(plan.duration_s(), 4000) {
            let [north, east, _] = plan.at(t_s).velocity_mps;
            let heading = plan.heading_at(t_s);
            if let Some((t_before_s, heading_before)) = before.replace((t_s, heading)) {
                let turned = angle::difference(heading, heading_before).abs();
                prop_assert!(turned <= rate_radps * (t_s - t_before_s) + 1e-9, "too fast at {t_s} s");
            }
            let is_behind = north.hypot(east) > SLOW_MPS
                && angle::difference(east.atan2(north), heading).abs() > 0.15;
            if !is_behind {
                behind_since_s = t_s;
            }
            // Half a turn takes a second.
            prop_assert!(t_s - behind_since_s < 1.5, "at {t_s} s the heading is {heading}, the track {}", east.atan2(north));
        }
    }
}

#[test]
fn a_fastest_climb_and_circle_touch_their_limits() {
    let limits = VEHICLE.share(0.7);
    let plan = plan(vec![
        PartMotion::Climb(10.0, None),
        PartMotion::Figure {
            shape: FigureShape::Circle,
            radius_m: 5.0,
            period_s: None,
            laps: 3,
            climb_m: 0.0,
            direction_rad: 0.0,
        },
    ]);
    let [climb, circle] = [0, 1].map(|i| plan.parts()[i].demand(&limits));
    assert!((climb.vertical_mps / limits.most.vertical_mps - 1.0).abs() < 1e-9, "{climb:?}");
    assert!((circle.tilt_rad / limits.most.tilt_rad - 1.0).abs() < 1e-9, "{circle:?}");
    // The climb has the duration of a min-jerk climb at its largest speed, the circle about the speed of a steady
    // circle at its tilt.
    assert!((plan.parts()[0].curve.duration_s() - 1.875 * 10.0 / 2.8).abs() < 1e-6);
    assert!(circle.speed_mps > 0.9 * (5.0 * 9.81 * limits.most.tilt_rad.tan()).sqrt(), "{circle:?}");
}

#[test]
fn without_ramps_the_velocity_of_a_leg_is_constant() {
    let [n, e, d] = AT;
    let plan = plan(vec![legs(&[[n + 2.0, e, d - 4.0], AT], Some(0.0))]);
    for (t_s, back) in [(0.0, 1.0), (1.0, 1.0), (4.0_f64.next_down(), 1.0), (4.0, -1.0), (7.9, -1.0)] {
        let here = plan.at(t_s);
        assert_eq!((here.velocity_mps, here.acceleration_mps2), ([0.5 * back, 0.0, -back], [0.0; 3]), "at {t_s} s");
    }
    assert!((plan.at(1.0).position_m[0] - n - 0.5).abs() < 1e-12);
    assert_eq!((plan.at(-1.0), plan.at(8.0)), (Setpoint::at_rest(AT), Setpoint::at_rest(AT)));
}

#[test]
fn a_leg_with_ramps_is_a_trapezoid_of_velocity_and_at_rest_at_each_point() {
    let [n, e, d] = AT;
    let plan = plan(vec![legs(&[[n + 6.0, e, d], [n + 6.0, e + 6.0, d]], Some(1.0))]);
    for (t_s, along_m, speed_mps, acceleration_mps2) in [
        (0.0, 0.0, 0.0, 2.0),
        (0.5, 0.25, 1.0, 2.0),
        (1.0, 1.0, 2.0, 0.0),
        (2.0, 3.0, 2.0, 0.0),
        (3.5, 5.75, 1.0, -2.0),
    ] {
        let here = plan.at(t_s);
        let found = [here.position_m[0] - n, here.velocity_mps[0], here.acceleration_mps2[0]];
        let expected = [along_m, speed_mps, acceleration_mps2];
        assert!((0..3).all(|i| (found[i] - expected[i]).abs() < 1e-12), "{found:?} at {t_s} s");
    }
    let corner = plan.at(4.0);
    assert_eq!((corner.position_m, corner.velocity_mps), ([n + 6.0, e, d], [0.0; 3]));
}

#[test]
fn a_jump_is_at_rest_before_and_after() {
    let to = [10.0, 10.0, -10.0];
    let plan = plan(vec![rest(1.0), PartMotion::Rest { at_m: Some(to), duration_s: 2.0 }, rest(1.0)]);
    for (t_s, at) in [(0.0, AT), (1.0_f64.next_down(), AT), (1.0, to), (3.5, to), (60.0, to)] {
        assert_eq!(plan.at(t_s), Setpoint::at_rest(at), "at {t_s} s");
    }
}

#[test]
fn the_named_missions_begin_at_the_origin() {
    let start = Start { position_m: [0.0; 3], ..start(VEHICLE) };
    let named = |motion| MissionPlan::new(&start, &[PlanPart { motion, heading: Rule::KEEP }]);
    let survey = named(named::survey(Some(1.5)));
    for (t_s, at) in [(0.0, [0.0; 3]), (10.0, [0.0, 0.0, -8.0]), (30.0, [8.0, 8.0, -8.0]), (60.0, [0.0; 3])] {
        assert_eq!((survey.at(t_s).position_m, survey.at(t_s).velocity_mps), (at, [0.0; 3]), "at {t_s} s");
    }
    assert!((survey.duration_s() - 60.0).abs() < 1e-12);
    let halfway = |ramp_s| named(named::survey(ramp_s)).at(5.0).velocity_mps[2];
    assert!((halfway(None) + 8.0 * 15.0 / 8.0 / 10.0).abs() < 1e-12 && (halfway(Some(0.0)) + 0.8).abs() < 1e-12);
    assert_eq!(named(named::hover()).at(7.0), Setpoint::at_rest([0.0; 3]));
}

#[test]
fn a_spline_through_points_of_a_min_jerk_leg_is_that_leg() {
    let leg = plan(vec![legs(&[[81.0, 30.0, -20.0]], None)]);
    for times_s in [vec![4.0], vec![0.6, 4.0], vec![0.3, 1.2, 2.8, 3.0, 4.0]] {
        let points_m = times_s.iter().map(|t_s| leg.at(*t_s).position_m).collect();
        let spline = plan(vec![PartMotion::Through { points_m, times_s: Some(times_s), least: Least::Jerk }]);
        for t_s in at_instants(5.0, 100) {
            let [ours, theirs] = [&spline, &leg].map(|plan| plan.at(t_s));
            let apart = |a: [f64; 3], b: [f64; 3]| (Vector3::from(a) - Vector3::from(b)).norm();
            assert!(apart(ours.position_m, theirs.position_m) < 1e-9, "at {t_s} s");
            assert!(apart(ours.velocity_mps, theirs.velocity_mps) < 1e-8, "at {t_s} s");
            assert!(apart(ours.acceleration_mps2, theirs.acceleration_mps2) < 1e-7, "at {t_s} s");
        }
    }
}

#[test]
fn a_spline_has_no_jump_up_to_the_fourth_derivative() {
    let points_m = vec![[0.0, 0.0, -8.0], [20.0, 5.0, -8.0], [25.0, -10.0, -12.0], [0.0, 0.0, -8.0]];
    let times_s = vec![4.0, 9.0, 11.0, 20.0];
    let spline = plan(vec![PartMotion::Through { points_m, times_s: Some(times_s.clone()), least: Least::Jerk }]);
    for t_s in &times_s[..3] {
        // The acceleration is a cubic on each side: four of its points give its derivatives at the waypoint exactly.
        let [after, before] = [0.1, -0.1].map(|h| {
            let at = |i: f64| Vector3::from(spline.at(t_s + i * h).acceleration_mps2);
            let [a0, a1, a2, a3] = [1e-9, 1.0, 2.0, 3.0].map(at);
            let jerk = (-11.0 * a0 + 18.0 * a1 - 9.0 * a2 + 2.0 * a3) / (6.0 * h);
            [jerk, (2.0 * a0 - 5.0 * a1 + 4.0 * a2 - a3) / (h * h)]
        });
        for (after, before) in after.into_iter().zip(before) {
            assert!((after - before).norm() < 1e-5 * after.norm().max(1.0), "at {t_s} s: {after} {before}");
        }
    }
}

#[test]
fn between_its_first_and_last_half_lap_a_circle_is_periodic_at_constant_speed() {
    let (laps, period_s, radius_m) = (5, 12.0, 6.0);
    let plan = plan(vec![figure(FigureShape::Circle, laps, 0.0)]);
    let ends_s = period_s * 15.0 * 5.0 / 47.0;
    let steady_s = ends_s * 8.0 / 15.0; // duration of one steady lap
    let speed_mps = TAU * radius_m / steady_s;
    for t_s in [ends_s / 2.0, 15.0, 20.5] {
        let [here, later] = [t_s, t_s + steady_s].map(|t_s| plan.at(t_s));
        let to_centre = (Vector3::new(AT[0], AT[1] + radius_m, AT[2]) - Vector3::from(here.position_m)) / radius_m;
        let (velocity, acceleration) = (Vector3::from(here.velocity_mps), Vector3::from(here.acceleration_mps2));
        assert!((to_centre.norm() - 1.0).abs() < 1e-12 && (velocity.norm() - speed_mps).abs() < 1e-9, "at {t_s} s");
        assert!((acceleration - to_centre * speed_mps * speed_mps / radius_m).norm() < 1e-9, "v2 / r inwards");
        let apart = Vector3::from(here.position_m) - Vector3::from(later.position_m);
        assert!(apart.norm() < 1e-9, "the same place a lap later: {apart}");
    }
    for laps in [1, 2, 7] {
        let plan = plan_of_laps(laps);
        let [_, east, _] = plan.at(6.0 * f64::from(laps)).position_m; // halfway by symmetry
        let east_m = if laps % 2 == 1 { 12.0 } else { 0.0 };
        assert!((east - AT[1] - east_m).abs() < 1e-9, "{laps} laps: {east}");
        assert!((plan.duration_s() - 12.0 * f64::from(laps)).abs() < 1e-9, "laps take their period on average");
    }
    let turns: f64 = 10.0 / 64.0 - 15.0 / 256.0 + 6.0 / 1024.0;
    let [north, ..] = plan_of_laps(1).at(3.0).position_m;
    assert!((north - AT[0] - 6.0 * libm::sin(turns * TAU)).abs() < 1e-9, "one lap is min-jerk");
}

fn plan_of_laps(laps: u32) -> MissionPlan {
    plan(vec![figure(FigureShape::Circle, laps, 0.0)])
}

#[test]
fn a_circle_keeps_its_radius_and_a_helix_climbs() {
    let plan = plan(vec![figure(FigureShape::Circle, 3, 9.0)]);
    for t_s in at_instants(plan.duration_s(), 100) {
        let [north, east, down] = plan.at(t_s).position_m;
        assert!(((north - AT[0]).hypot(east - AT[1] - 6.0) - 6.0).abs() < 1e-9, "centre 6 m east");
        assert!((AT[2] - 9.0 - 1e-9..=AT[2] + 1e-9).contains(&down));
    }
    let [north, east, down] = plan.at(36.0).position_m;
    assert!((north - AT[0]).abs() < 1e-9 && (east - AT[1]).abs() < 1e-9 && (down - AT[2] + 9.0).abs() < 1e-9);
    assert!(plan.at(1.0).position_m[0] > AT[0], "it leaves to the left of the centre, clockwise");
    assert!((plan.at(18.0).position_m[2] - AT[2] + 4.5).abs() < 1e-9, "half the climb at half time");
}

#[test]
fn a_figure_eight_crosses_where_it_begins_and_has_two_loops() {
    let plan = plan(vec![figure(FigureShape::Eight, 1, 0.0)]);
    for t_s in [0.0, 6.0, 12.0] {
        let [north, east, _] = plan.at(t_s).position_m;
        assert!((north - AT[0]).abs() < 1e-9 && (east - AT[1]).abs() < 1e-9, "at {t_s} s");
    }
    let east_m: Vec<f64> = at_instants(12.0, 2000).map(|t_s| plan.at(t_s).position_m[1] - AT[1]).collect();
    let (most, least) = (east_m.iter().copied().fold(0.0, f64::max), east_m.iter().copied().fold(0.0, f64::min));
    assert!((most - 6.0).abs() < 1e-3 && (least + 6.0).abs() < 1e-3, "{least} to {most}");
    assert!(east_m[..1000].iter().all(|east| *east >= -1e-9), "the first loop is east");
}

#[test]
fn a_landing_sinks_at_its_rate_and_ends_below_the_ground() {
    let plan = plan(vec![PartMotion::Land { standing_down_m: 0.0, sink_mps: 0.7 }]);
    let sinks = |t_s: f64| plan.at(t_s).velocity_mps[2];
    assert!((sinks(1.0) - 0.7).abs() < 1e-12 && (sinks(plan.duration_s() / 2.0) - 0.7).abs() < 1e-12);
    assert!((plan.at(plan.duration_s()).position_m[2] - 0.2).abs() < 1e-9);
    let touch = at_instants(plan.duration_s(), 10_000).find(|t_s| plan.at(*t_s).position_m[2] >= 0.0).unwrap();
    assert!(sinks(touch) > 0.3, "it does not hover above the ground: {}", sinks(touch));
    let near = one(PartMotion::Land { standing_down_m: -5.0, sink_mps: 0.7 }, Rule::KEEP);
    assert!((near.at(99.0).position_m[2] + 4.8).abs() < 1e-9 && near.duration_s() < 2.1, "from the ground");
}

#[test]
fn headings_turn_at_waypoints_towards_a_centre_and_not_at_rest() {
    let times_s = Some(vec![4.0, 8.0]);
    let motion =
        PartMotion::Through { points_m: vec![[3.0, 5.0, -5.0], [9.0, 5.0, -5.0]], times_s, least: Least::Snap };
    let turning = one(motion.clone(), Rule::Waypoints(vec![1.0, -3.0]));
    for (t_s, heading) in [(0.0, 0.3), (4.0, 1.0), (8.0, -3.0), (99.0, -3.0)] {
        assert!(angle::difference(turning.heading_at(t_s), heading).abs() < 0.01, "{t_s}: {}", turning.heading_at(t_s));
    }
    assert!(turning.heading_at(6.0) > 1.0, "the short way, through south");
    assert!((one(motion.clone(), Rule::KEEP).heading_at(5.0) - 0.3).abs() < 1e-12);
    assert!((one(motion, Rule::Steps(vec![(0.0, -1.0)])).heading_at(5.0) + 1.0).abs() < 1e-12);

    let round = one(figure(FigureShape::Circle, 1, 0.0), Rule::Centre);
    for t_s in at_instants(12.0, 50).skip(5) {
        let [north, east, _] = round.at(t_s).position_m;
        let to_centre = (AT[1] + 6.0 - east).atan2(AT[0] - north);
        assert!(angle::difference(round.heading_at(t_s), to_centre).abs() < 0.01, "at {t_s} s");
    }

    let up_and_east = tracking(&[rest(1.0), PartMotion::Climb(5.0, Some(5.0))]);
    assert!(at_instants(6.0, 60).all(|t_s| (up_and_east.heading_at(t_s) - 0.3).abs() < 1e-12), "no track on the map");
}

fn tracking(motions: &[PartMotion]) -> MissionPlan {
    let parts: Vec<PlanPart> =
        motions.iter().map(|motion| PlanPart { motion: motion.clone(), heading: Rule::Track }).collect();
    MissionPlan::new(&start(VEHICLE), &parts)
}

#[test]
fn an_excess_names_the_quantity_the_demand_and_the_limit() {
    let motion = |duration_s| PartMotion::Climb(10.0, Some(duration_s));
    let excess = |duration_s| {
        let plan = plan(vec![motion(duration_s)]);
        plan.parts()[0].demand(&VEHICLE).excess(&VEHICLE)
    };
    let fast = excess(2.0).unwrap();
    assert_eq!((fast.quantity, fast.has), (crate::Quantity::Vertical, 4.0));
    assert!((fast.asked - 1.875 * 10.0 / 2.0).abs() < 1e-9);
    assert_eq!(excess(5.0), None);
}
