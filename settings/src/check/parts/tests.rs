//! One case per way to break a rule of a mission of parts.

use std::collections::BTreeMap;

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;

use crate::load::{from_merged, to_toml};
use crate::plan;
use crate::tests::from_set;

use crate::check::parts::warnings;

const TAKEOFF: &str = "{kind='takeoff', height_m=5}";

fn of(parts: &str, more: &[&str]) -> Result<crate::Scenario, String> {
    let part = format!("mission.part=[{parts}]");
    from_set(&[&[part.as_str()], more].concat()).map_err(|error| error.to_string())
}

#[test]
fn each_kind_flies_with_the_keys_it_needs() {
    let parts = "{kind='takeoff', height_m=5}, {kind='waypoints', points_m=[[5, 0, -5], [5, 5, -8]]}, \
                 {kind='circle', radius_m=3}, {kind='figure-eight', radius_m=3}, \
                 {kind='helix', radius_m=3, climb_m=-1}, {kind='loiter', duration_s=1}, \
                 {kind='jump', point_m=[0, 0, -5], duration_s=1}, {kind='landing'}";
    let scenario = of(parts, &["plant.ground.present=true"]).unwrap();
    let plan = plan::build(&scenario);
    assert_eq!(plan.parts().len(), 8);
    assert!(plan.duration_s() > 20.0 && plan.duration_s() < 60.0, "{} s", plan.duration_s());
    assert_eq!(from_merged(&to_toml(&scenario), "merged.toml").unwrap(), scenario);
}

#[test]
fn keys_that_a_part_needs_or_does_not_use_are_named() {
    let long = format!("[{}]", ["[1, 2, -3]"; 51].join(", "));
    for (parts, expected) in [
        ("{kind='takeoff'}", "`mission.part[0]`: a takeoff without `height_m`"),
        ("{kind='takeoff', height_m=5, laps=2}", "`mission.part[0]`: a takeoff with a `laps` that it has no use for"),
        ("{kind='helix', radius_m=5}", "`mission.part[0]`: a helix without `climb_m`"),
        ("{kind='jump', duration_s=1}", "`mission.part[0]`: a jump without `point_m`"),
        ("{kind='waypoints', curve='line', points_m=[[1, 2, -3]]}", "a waypoints along a line without `times_s`"),
        (
            "{kind='waypoints', curve='trapezoid', points_m=[[1, 2, -3]], times_s=[9]}",
            "`mission.part[0]`: a waypoints along a trapezoid without `ramp_s`",
        ),
        (
            "{kind='waypoints', curve='trapezoid', points_m=[[1, 2, -3]], times_s=[9], ramp_s=5}",
            "`mission.part[0]`: `ramp_s` = 5.0 does not fit the shortest leg of 9.0 s",
        ),
        (
            "{kind='waypoints', curve='spline', points_m=[[1, 2, -3]], times_s=[9], ramp_s=2}",
            "`mission.part[0]`: a waypoints along a spline with a `ramp_s` that it has no use for",
        ),
        ("{kind='loiter', duration_s=2, heading_deg=[[3, 90]]}", "a step of `heading_deg` at 3.0 s in a part of 2.0 s"),
        (
            "{kind='loiter', duration_s=2, heading_deg=[[1, 90], [0, 0]]}",
            "`mission.part[0]`: the steps of `heading_deg` are out of order or range",
        ),
        ("{kind='circle', radius_m=0}", "`mission.part[0].radius_m` = 0.0 is out of range"),
        ("{kind='circle', radius_m=5, laps=0}", "`mission.part[0].laps` = 0.0 is out of range"),
        ("{kind='circle', radius_m=5, period_s=nan}", "`mission.part[0].period_s` = NaN is not finite"),
        ("{kind='waypoints', points_m=[]}", "`mission.part[0]`: 0 points"),
        (&format!("{{kind='waypoints', points_m={long}}}"), "`mission.part[0]`: 51 points"),
        ("{kind='waypoints', points_m=[[1, 2, -600]]}", "`mission.part[0].points_m` = -600.0 is out of range"),
        ("{kind='waypoints', points_m=[[1, 2, -3]], times_s=[3, 4]}", "`mission.part[0]`: 1 points and 2 times"),
        (
            "{kind='waypoints', points_m=[[9, 2, -3], [1, 2, -3]], times_s=[3, 3]}",
            "`mission.part[0]`: `times_s` does not rise from 0",
        ),
        (
            "{kind='waypoints', points_m=[[9, 2, -3], [9, 2, -3]]}",
            "`mission.part[0]`: point 1 of `points_m` is where the point before it is",
        ),
        (
            "{kind='takeoff', height_m=5}, {kind='waypoints', points_m=[[0, 0, -5], [9, 2, -3]]}",
            "`mission.part[1]`: point 0 of `points_m` is where the part begins",
        ),
        ("{kind='waypoints', points_m=[[9, 2, -3]], heading_deg=[1, 2]}", "`mission.part[0]`: 1 points and 2 headings"),
        ("{kind='loiter', duration_s=1, heading_deg=400}", "`mission.part[0]`: `heading_deg` = 400.0 is out of range"),
        (
            "{kind='loiter', duration_s=1, heading_deg='centre'}",
            "`mission.part[0]`: `heading_deg` = \"centre\" on a loiter, which has none",
        ),
        (
            "{kind='loiter', duration_s=1, heading_deg='along-track'}",
            "`mission.part[0]`: `heading_deg` = \"along-track\" on a loiter, which has no track on the map",
        ),
        ("{kind='loiter', duration_s=1}, {kind='takeoff', height_m=5}", "`mission.part[1]`: a takeoff in flight"),
        ("{kind='landing'}", "`mission.part[0]`: a landing where there is no ground"),
        ("{kind='loiter', duration_s=86400}, {kind='loiter', duration_s=1}", "the parts of the mission take 86401.0 s"),
    ] {
        let message = of(parts, &[]).expect_err(parts);
        assert!(message.contains(expected), "{parts}: {message}");
    }
    let ground = ["plant.ground.present=true"];
    for (parts, expected) in [
        (format!("{TAKEOFF}, {{kind='landing'}}, {TAKEOFF}"), "`mission.part[1]`: a landing with parts after it"),
        (
            format!("{TAKEOFF}, {{kind='landing', sink_mps=1.5}}"),
            "`mission.part[1]`: a landing at 1.5 m/s, which is a crash",
        ),
        (
            format!("{TAKEOFF}, {{kind='waypoints', points_m=[[9, 0, 0.5], [9, 9, -5]]}}"),
            "`mission.part[1]`: its curve goes 0.",
        ),
    ] {
        let message = of(&parts, &ground).expect_err(&parts);
        assert!(message.contains(expected), "{parts}: {message}");
    }
}

#[test]
fn unknown_keys_and_kinds_are_refused_in_a_part() {
    assert!(of("{kind='takeof', height_m=5}", &[]).unwrap_err().contains("did you mean `takeoff`?"));
    assert!(of("{kind='takeoff', hight_m=5}", &[]).unwrap_err().contains("did you mean `height_m`?"));
}

#[test]
fn settings_that_parts_do_not_use_are_idle_and_those_of_parts_without_them() {
    let idle = of(TAKEOFF, &["mission.heading_deg=90"]).unwrap_err();
    assert!(idle.contains("`mission.heading_deg` has no effect here"), "{idle}");
    let idle = from_set(&["mission.limits.share=0.5"]).unwrap_err().to_string();
    assert!(idle.contains("has no effect here") && idle.contains("`mission.trajectory` = \"parts\""), "{idle}");
    let none = from_set(&["mission.trajectory=parts"]).unwrap_err().to_string();
    assert!(none.contains("`mission.trajectory` = \"parts\" with 0 parts"), "{none}");
    assert!(of(TAKEOFF, &["mission.trajectory=hover"]).is_ok(), "what a later switch turns off is dropped");
}

#[test]
fn a_demand_beyond_the_vehicle_names_the_leg_the_limit_and_the_time_that_suffices() {
    let waypoints = |times_s: &str| {
        format!("{{kind='waypoints', points_m=[[10, 0, 0], [10, 10, 0], [0, 10, 0]], times_s={times_s}}}")
    };
    for (parts, more, expected) in [
        (
            "{kind='takeoff', height_m=10, duration_s=2}".to_owned(),
            "guidance.climb_limit_mps=4",
            "`mission.part[0]`: it asks for 9.4 m/s up or down, the vehicle has 4.0 (`guidance.climb_limit_mps`); give \
             it 4.7 s or more",
        ),
        (
            "{kind='circle', radius_m=5, period_s=3}".to_owned(),
            "guidance.angle_limit_deg=30",
            "g of thrust, the vehicle has 4.00; give it ",
        ),
        (
            "{kind='circle', radius_m=5, period_s=9}".to_owned(),
            "guidance.angle_limit_deg=30",
            "`mission.part[0]`: a lap asks for a tilt of 41.1 deg, the vehicle has 30.0 (`guidance.angle_limit_deg`); \
             give it 11.1 s or more",
        ),
        (waypoints("[4, 5, 9]"), "guidance.angle_limit_deg=30", "`mission.part[0]`: the leg to point 0 asks for "),
        (waypoints("[10, 20, 30]"), "mission.limits.speed_mps=1", "`mission.limits.speed_mps` is 1.0; give it "),
        (
            waypoints("[10, 20, 30]"),
            "mission.limits.acceleration_mps2=0.2",
            "`mission.limits.acceleration_mps2` is 0.2; give it ",
        ),
        (
            "{kind='takeoff', height_m=100, duration_s=5}".to_owned(),
            "guidance.climb_limit_mps=1000",
            "`mission.part[0]`: it asks for an acceleration down that gravity does not have; give it 7.8 s or more",
        ),
    ] {
        let message = of(&parts, &[more]).expect_err(&parts);
        assert!(message.contains(expected), "{parts}: {message}");
    }
    assert!(of("{kind='takeoff', height_m=10, duration_s=4.7}", &[]).is_ok());
    assert!(of(&waypoints("[10, 20, 30]"), &[]).is_ok());
}

#[test]
fn the_place_of_a_wrong_part_is_shown() {
    let text = "[mission]\n[[mission.part]]\nkind = \"takeoff\"\nheight_m = 5\n\
                [[mission.part]]\nkind = \"circle\"\nradius_m = 5\nperiod_s = 2\n";
    let message = from_merged(text, "wrong.toml").unwrap_err().to_string();
    assert!(message.contains("wrong.toml:8:"), "{message}");
}

#[test]
fn hand_made_curves_and_jumps_are_warned_of_and_flown() {
    let warned = |parts: &str, more: &[&str]| warnings(&of(parts, more).unwrap_or_else(|error| panic!("{error}")));
    let within = |time_s: f64, curve: &str| {
        format!("{{kind='waypoints', points_m=[[10, 0, 0]], times_s=[{time_s}], curve={curve}}}")
    };
    let asks = vec!["`mission.part[0]`: the leg to point 0 asks for"];
    for (parts, expected) in [
        (
            within(1.6, "'line'"),
            vec!["`mission.part[0]`: its velocity steps, to up to 6.2 m/s, which no vehicle can follow"],
        ),
        (within(1.5, "'trapezoid', ramp_s=0.5"), asks.clone()),
        (within(1.5, "'min-jerk'"), asks.clone()),
        (within(1.5, "'spline'"), asks.clone()),
        (
            "{kind='loiter', duration_s=1}, {kind='jump', point_m=[3, 4, 0], duration_s=1}".into(),
            vec!["`mission.part[1]`: the reference jumps by 5.0 m, which no vehicle can follow"],
        ),
        (within(10.0, "'trapezoid', ramp_s=1"), vec![]),
        (within(4.0, "'trapezoid', ramp_s=2"), vec![]), // the turn rate is not limited where the acceleration steps
    ] {
        let warned = warned(&parts, &[]);
        assert_eq!(warned.len(), expected.len(), "{parts}: {warned:?}");
        assert!(warned.iter().zip(&expected).all(|(found, expected)| found.starts_with(expected)), "{warned:?}");
    }
    let down = "{kind='waypoints', points_m=[[0, 0, 5]], times_s=[9], curve='min-jerk'}";
    let ground = ["plant.ground.present=true"];
    assert_eq!(warned(down, &ground), Vec::<String>::new(), "it lands");
    let through = warned(&format!("{down}, {}", down.replace("5]", "-5]")), &ground);
    assert!(through.len() == 1 && through[0].starts_with("`mission.part[0]`: its curve goes 5."), "{through:?}");
}

fn part() -> impl Strategy<Value = String> {
    let number = || prop_oneof![-1.0..50.0_f64, Just(0.0), Just(f64::NAN), -1e9..1e9_f64, Just(1e300)];
    let key = select(vec![
        "height_m",
        "radius_m",
        "period_s",
        "climb_m",
        "direction_deg",
        "duration_s",
        "sink_mps",
        "ramp_s",
        "heading_deg",
    ]);
    let numbers = vec((key, number()), 0..4);
    let points = vec([number(), number(), number()], 0..4);
    let kind = select(vec!["takeoff", "waypoints", "jump", "circle", "figure-eight", "helix", "loiter", "landing"]);
    let curve = select(vec![None, Some("quintic"), Some("line"), Some("trapezoid"), Some("min-jerk"), Some("spline")]);
    let times = vec(number(), 0..4);
    (kind, curve, numbers, points, times, 0..5_u32).prop_map(|(kind, curve, numbers, points, times, more)| {
        let mut keys: BTreeMap<&str, String> = numbers.into_iter().map(|(key, x)| (key, format!("{x:?}"))).collect();
        match kind {
            "takeoff" => _ = keys.entry("height_m").or_insert("5.0".into()),
            "loiter" => _ = keys.entry("duration_s").or_insert("5.0".into()),
            "waypoints" => {
                keys.insert("points_m", format!("{points:?}"));
                keys.extend(curve.map(|curve| ("curve", format!("'{curve}'"))));
            }
            "jump" => {
                keys.entry("duration_s").or_insert("5.0".into());
                keys.insert("point_m", format!("{:?}", points.first().unwrap_or(&[1.0, 2.0, -3.0])));
            }
            "landing" => {}
            _ => _ = keys.entry("radius_m").or_insert("5.0".into()),
        }
        if more == 0 {
            keys.insert("times_s", format!("{times:?}"));
        }
        let keys = keys.iter().fold(String::new(), |all, (key, value)| all + &format!(", {key}={value}"));
        format!("{{kind='{kind}'{keys}}}").to_lowercase()
    })
}

proptest! {
    /// Each part alone is refused with a message that names it, or has a finite plan.
    #[test]
    fn any_part_is_refused_or_has_a_finite_plan(part in part(), wild in prop::bool::ANY) {
        let more: &[&str] = if wild { &["guidance.climb_limit_mps=1e-9", "mission.limits.share=0.1"] } else { &[] };
        match of(&part, more) {
            Err(message) => prop_assert!(message.contains("mission.part") || message.contains("parts of the mission"), "{message}"),
            Ok(scenario) => {
                let plan = plan::build(&scenario);
                for share in [0.0, 0.01, 0.5, 0.99, 1.0] {
                    let here = plan.at(share * plan.duration_s());
                    let all = [here.position_m, here.velocity_mps, here.acceleration_mps2];
                    prop_assert!(all.as_flattened().iter().all(|x| x.is_finite()), "{part}: {here:?}");
                    prop_assert!(plan.heading_at(share * plan.duration_s()).is_finite(), "{part}");
                }
            }
        }
    }
}
