//! Checks of a mission of parts: the keys of each part, and what its curves ask of the vehicle. A part that may exceed
//! the limits of the vehicle gets a warning and is flown.

use curves::fastest::MAX_POINTS;
use curves::limits::Demand;
use curves::stray::{Offer, Stray};
use curves::{Excess, Planned, Quantity, VehicleLimits};

use crate::check::found::Found;
use crate::check::ranges::{DAY_S, SPACE_M};
use crate::plan;
use crate::table::mission::TrajectoryKind;
use crate::table::part::{CurveKind, HeadingRule, MissionPart, PartHeading, PartKind};
use crate::table::run::Scenario;
use crate::words::word;

/// Largest number of parts, which bounds the time of the check.
const MAX_PARTS: usize = 100;
/// Largest number of points of a part whose curve needs `times_s`, so that no times are searched for.
const MAX_TIMED_POINTS: usize = 1000;
/// Shortest time between successive points \[s\].
const MIN_LEG_S: f64 = 0.01;
/// Shortest distance between successive points \[m\].
const MIN_WAY_M: f64 = 0.01;
/// Depth of a curve below the position of a standing vehicle that still counts as rounding \[m\].
const GRAZE_M: f64 = 0.01;

/// Finds every rule that the parts of `scenario` break. Curves are built only of parts with the right keys, and only
/// for a vehicle that can hover.
pub fn check(scenario: &Scenario, found: &mut Found) {
    let mission = &scenario.mission;
    if mission.trajectory != TrajectoryKind::Parts {
        return;
    }
    let count = mission.part.len();
    found.require(
        (1..=MAX_PARTS).contains(&count),
        &["mission.part", "mission.trajectory"],
        format!("`mission.trajectory` = \"parts\" with {count} parts"),
        &format!("1 to {MAX_PARTS} tables `[[mission.part]]`"),
    );
    for (i, part) in mission.part.iter().enumerate().take(MAX_PARTS) {
        check_keys(part, &Place(i), found);
        check_place(scenario, i, found);
    }
    if found.0.is_empty() {
        check_curves(scenario, found);
    }
}

/// Place of a part, counted from 0.
struct Place(usize);

impl Place {
    /// Adds a violation of the part unless the rule `holds`. `key` is the key of the part that is most likely wrong.
    fn require(&self, found: &mut Found, holds: bool, key: &str, what: &str, allowed: &str) {
        let part = format!("mission.part.{}", self.0);
        let key = format!("{part}.{key}");
        found.require(holds, &[&key, &part, "mission.part"], format!("`mission.part[{}]`: {what}", self.0), allowed);
    }
}

/// Requires that `part` has the keys of its kind.
fn check_keys(part: &MissionPart, place: &Place, found: &mut Found) {
    let curve = part.curve.filter(|_| part.kind == PartKind::Waypoints && part.may_exceed());
    let kind = word(part.kind) + &curve.map_or(String::new(), |curve| format!(" along a {}", word(curve)));
    let [needed, possible] = part.keys();
    let given = part.given();
    let given: Vec<&str> = given.iter().map(String::as_str).collect();
    for key in needed.iter().filter(|key| !given.contains(key)) {
        place.require(found, false, "kind", &format!("a {kind} without `{key}`"), &format!("`{key}` with it"));
    }
    for key in given.iter().filter(|key| !needed.contains(key) && !possible.contains(key)) {
        let all = [needed, possible, &["heading_deg"]].concat().join("`, `");
        let what = format!("a {kind} with a `{key}` that it has no use for");
        place.require(found, false, key, &what, &format!("without it; a {kind} uses `{all}`"));
    }
    check_points(part, place, found);
    check_heading(part, place, found);
}

/// Requires an allowed number of points, and rising times whose legs have room for the ramps.
fn check_points(part: &MissionPart, place: &Place, found: &mut Found) {
    let Some(points_m) = &part.points_m else { return };
    let count = points_m.len();
    let most = if part.may_exceed() { MAX_TIMED_POINTS } else { MAX_POINTS };
    let allowed = format!("1 to {most} points");
    place.require(found, (1..=most).contains(&count), "points_m", &format!("{count} points"), &allowed);
    let Some(times_s) = &part.times_s else { return };
    place.require(
        found,
        times_s.len() == count,
        "times_s",
        &format!("{count} points and {} times", times_s.len()),
        "one time in `times_s` for each point, since the beginning of the part",
    );
    let legs = std::iter::once(&0.0).chain(times_s).zip(times_s);
    let shortest_s = legs.map(|(from_s, until_s)| until_s - from_s).fold(f64::INFINITY, f64::min);
    let rises = shortest_s >= MIN_LEG_S && times_s.iter().all(|t_s| *t_s <= DAY_S);
    place.require(
        found,
        rises,
        "times_s",
        "`times_s` does not rise from 0",
        &format!("each time at least {MIN_LEG_S} s after the one before, the first after 0, at most {DAY_S}"),
    );
    let ramp_s = part.ramp_s.unwrap_or(0.0);
    place.require(
        found,
        !rises || ramp_s <= shortest_s / 2.0,
        "ramp_s",
        &format!("`ramp_s` = {ramp_s:?} does not fit the shortest leg of {shortest_s:?} s"),
        &format!("at most half of it, {:?}", shortest_s / 2.0),
    );
}

/// Requires headings within 360 degrees, one per point or sorted by time, and a rule that the kind of part can follow.
fn check_heading(part: &MissionPart, place: &Place, found: &mut Found) {
    let is_figure = matches!(part.kind, PartKind::Circle | PartKind::FigureEight | PartKind::Helix);
    let count = part.points_m.as_ref().map_or(0, Vec::len);
    let (holds, what, allowed) = match &part.heading_deg {
        None => return,
        Some(PartHeading::Constant(deg)) => {
            (deg.abs() <= 360.0, format!("`heading_deg` = {deg:?} is out of range"), "-360 to 360".into())
        }
        Some(PartHeading::Points(all)) => (
            part.kind == PartKind::Waypoints && all.len() == count && all.iter().all(|deg| deg.abs() <= 360.0),
            format!("{count} points and {} headings", all.len()),
            "one heading of -360 to 360 for each of `points_m`, or one for all".to_owned(),
        ),
        Some(PartHeading::Steps(all)) => (
            all.iter().all(|(t_s, deg)| *t_s >= 0.0 && deg.abs() <= 360.0) && all.is_sorted_by_key(|(t_s, _)| *t_s),
            "the steps of `heading_deg` are out of order or range".into(),
            "[[t_s, deg], ...] with times of 0 or later, sorted, and -360 to 360 degrees".into(),
        ),
        Some(PartHeading::Named(HeadingRule::Centre)) => (
            is_figure,
            format!("`heading_deg` = \"centre\" on a {}, which has none", word(part.kind)),
            "\"centre\" on a circle, figure-eight or helix".into(),
        ),
        Some(PartHeading::Named(HeadingRule::AlongTrack)) => (
            is_figure || part.kind == PartKind::Waypoints,
            format!("`heading_deg` = \"along-track\" on a {}, which has no track on the map", word(part.kind)),
            "degrees, or without it: the heading stays".into(),
        ),
    };
    place.require(found, holds, "heading_deg", &what, &allowed);
}

/// Requires that a take-off is the first part, and that a landing is the last, above ground and slower than a crash.
fn check_place(scenario: &Scenario, i: usize, found: &mut Found) {
    let (place, kind, last) = (Place(i), scenario.mission.part[i].kind, scenario.mission.part.len() - 1);
    let is_first = kind != PartKind::Takeoff || i == 0;
    place.require(found, is_first, "kind", "a takeoff in flight", "takeoff first; \"waypoints\" climb later");
    let is_last = kind != PartKind::Landing || i == last;
    place.require(
        found,
        is_last,
        "kind",
        "a landing with parts after it",
        "landing last: it stops the rotors for good",
    );
    if kind != PartKind::Landing {
        return;
    }
    let ground = &scenario.plant.ground;
    let allowed = "`plant.ground.present` = true with it";
    place.require(found, ground.present, "kind", "a landing where there is no ground", allowed);
    let (sink_mps, most_mps) = (scenario.mission.part[i].sink_mps.unwrap_or(0.0), ground.max_sink_mps);
    place.require(
        found,
        !ground.present || sink_mps < most_mps,
        "sink_mps",
        &format!("a landing at {sink_mps:?} m/s, which is a crash"),
        &format!("`sink_mps` below `plant.ground.max_sink_mps` = {most_mps:?}"),
    );
}

/// Requires that no curve asks for more than the vehicle has, leaves the space of the plant, or enters the ground.
fn check_curves(scenario: &Scenario, found: &mut Found) {
    let (plan, limits) = (plan::build(scenario), plan::limits(scenario));
    for (i, (part, planned)) in scenario.mission.part.iter().zip(plan.parts()).enumerate() {
        let place = Place(i);
        check_space(part, planned, &place, found);
        check_steps(part, planned, &place, found);
        if part.may_exceed() {
            continue;
        }
        check_ways(part, planned, &place, found);
        if let Some((key, what)) = excess(part, planned, &limits) {
            let allowed = "times within the limits of `trefoil check`, or none: as fast as they allow";
            place.require(found, false, key, &what, allowed);
        }
        if let Some(what) = below_ground(scenario, i, planned) {
            let allowed = "a curve above it; one through points swings out less with more points, or as \"quintic\"";
            place.require(found, false, culprit(part), &what, allowed);
        }
    }
    let duration_s = plan.duration_s();
    found.require(
        duration_s <= DAY_S,
        &["mission.part"],
        format!("the parts of the mission take {duration_s:.1} s"),
        &format!("at most a day, {DAY_S} s"),
    );
}

/// Describes where the parts of a checked scenario ask for more than the vehicle has, and how far smooth curves leave
/// their points.
pub fn warnings(scenario: &Scenario) -> Vec<String> {
    if scenario.mission.trajectory != TrajectoryKind::Parts {
        return vec![];
    }
    let (plan, limits) = (plan::build(scenario), plan::limits(scenario));
    let mut all = vec![];
    for (i, (part, planned)) in scenario.mission.part.iter().zip(plan.parts()).enumerate() {
        let mut found = vec![];
        if part.may_exceed() {
            let jumps = || format!("the reference jumps by {:.1} m, which no vehicle can follow", planned.jump_m);
            found.extend((planned.jump_m > 0.0).then(jumps));
            let steps = || {
                let speed_mps = planned.demand(&limits).speed_mps;
                format!("its velocity steps, to up to {speed_mps:.1} m/s, which no vehicle can follow")
            };
            found.extend((part.curve == Some(CurveKind::Line)).then(steps));
            found.extend(excess(part, planned, &for_curve(part, limits)).map(|(_, what)| what));
            found.extend(below_ground(scenario, i, planned));
        }
        found.extend(plan::stray(scenario, part, planned).map(|Stray { beyond_m, longest_leg_m, offer }| {
            let advice = offer.map_or("give it more points".into(), |Offer { times_s, beyond_m }| {
                let times_s = times_s.iter().map(|t_s| format!("{t_s:.2}")).collect::<Vec<_>>().join(", ");
                format!("with `times_s = [{times_s}]` it stays within {beyond_m:.2} m of it")
            });
            format!(
                "its curve goes {beyond_m:.1} m beyond the box of its points, whose longest leg has \
                 {longest_leg_m:.1} m; {advice}"
            )
        }));
        all.extend(found.into_iter().map(|what| format!("`mission.part[{i}]`: {what}")));
    }
    all
}

/// Limits for the curve of `part`, without a limit of the turn rate for curves whose acceleration steps: the direction
/// of the thrust then steps too.
fn for_curve(part: &MissionPart, limits: VehicleLimits) -> VehicleLimits {
    match part.curve {
        Some(CurveKind::Line | CurveKind::Trapezoid) => {
            VehicleLimits { most: Demand { turn_radps: f64::INFINITY, ..limits.most }, ..limits }
        }
        _ => limits,
    }
}

/// Requires a distance of at least [`MIN_WAY_M`] between successive points; the start of the part is the first.
fn check_ways(part: &MissionPart, planned: &Planned, place: &Place, found: &mut Found) {
    let from_m = planned.curve.at(0.0).position_m;
    let points_m = part.points_m.iter().flatten();
    let mut ways = std::iter::once(&from_m).chain(points_m.clone()).zip(points_m).enumerate();
    let is_near = |(from, to): (&[f64; 3], &[f64; 3])| {
        libm::hypot(libm::hypot(to[0] - from[0], to[1] - from[1]), to[2] - from[2]) < MIN_WAY_M
    };
    if let Some((leg, _)) = ways.find(|(_, ends)| is_near(*ends)) {
        let where_it_is = if leg == 0 { "where the part begins" } else { "where the point before it is" };
        let what = format!("point {leg} of `points_m` is {where_it_is}");
        place.require(found, false, "points_m", &what, "without it; points are counted from 0");
    }
}

/// Requires that each step of the heading begins within the part.
fn check_steps(part: &MissionPart, planned: &Planned, place: &Place, found: &mut Found) {
    let Some(PartHeading::Steps(steps)) = &part.heading_deg else { return };
    let (last_s, duration_s) = (steps.last().map_or(0.0, |(t_s, _)| *t_s), planned.curve.duration_s());
    place.require(
        found,
        last_s <= duration_s,
        "heading_deg",
        &format!("a step of `heading_deg` at {last_s:?} s in a part of {duration_s:.1} s"),
        "times since the beginning of the part, up to its end",
    );
}

/// Finds the first leg that asks for more than the vehicle has. Returns the key that could mend the leg, and a
/// description of the excess.
fn excess(part: &MissionPart, planned: &Planned, limits: &VehicleLimits) -> Option<(&'static str, String)> {
    let legs = planned.legs();
    let exceeded = |(leg, of)| Some((leg, limits.demand(of, 1.0).excess(limits)?));
    let (leg, excess) = legs.iter().enumerate().find_map(exceeded)?;
    let stretch = limits.least_stretch(&legs);
    let longer = |duration_s: f64| (duration_s * stretch * 10.0).ceil() / 10.0;
    let (key, which, advice) = match part.kind {
        PartKind::Waypoints => {
            let advice = format!(
                "give it {:.1} s or more, and the other legs as much in proportion",
                longer(legs[leg].duration_s())
            );
            ("times_s", format!("the leg to point {leg}"), advice)
        }
        PartKind::Takeoff => {
            ("duration_s", "it".into(), format!("give it {:.1} s or more", longer(planned.curve.duration_s())))
        }
        PartKind::Landing => ("sink_mps", "it".into(), "give it a lower `sink_mps`".into()),
        _ => {
            let period_s = longer(part.period_s.unwrap_or_default());
            ("period_s", "a lap".into(), format!("give it {period_s:.1} s or more"))
        }
    };
    Some((key, format!("{which} asks for {}; {advice}", describe(&excess, limits.g_mps2))))
}

/// Describes a demand and its limit.
fn describe(Excess { quantity, asked, has }: &Excess, g_mps2: f64) -> String {
    let (deg, g) = (|rad: &f64| rad.to_degrees(), |thrust: &f64| thrust / g_mps2);
    match quantity {
        Quantity::Speed => format!("{asked:.1} m/s, `mission.limits.speed_mps` is {has:.1}"),
        Quantity::Acceleration => format!("{asked:.1} m/s2, `mission.limits.acceleration_mps2` is {has:.1}"),
        Quantity::Vertical => {
            format!("{asked:.1} m/s up or down, the vehicle has {has:.1} (`guidance.climb_limit_mps`)")
        }
        Quantity::Tilt if deg(asked) > 90.0 => "an acceleration down that gravity does not have".into(),
        Quantity::Tilt => {
            format!("a tilt of {:.1} deg, the vehicle has {:.1} (`guidance.angle_limit_deg`)", deg(asked), deg(has))
        }
        Quantity::Thrust => format!("{:.2} g of thrust, the vehicle has {:.2}", g(asked), g(has)),
        Quantity::LeastThrust => {
            format!("as little as {:.2} g of thrust, the vehicle idles at {:.2}", g(asked), g(has))
        }
        Quantity::Turn => {
            format!(
                "a turn at {:.0} deg/s, the vehicle has {:.0} (`attitude.mpc.rates_limit_dps`)",
                deg(asked),
                deg(has)
            )
        }
    }
}

/// Key that decides where the curve of a part goes.
fn culprit(part: &MissionPart) -> &'static str {
    if part.kind == PartKind::Waypoints { "points_m" } else { "kind" }
}

/// Requires that a curve stays within the space of the plant.
fn check_space(part: &MissionPart, planned: &Planned, place: &Place, found: &mut Found) {
    let [low, high] = planned.curve.range_m();
    let farthest_m = low.amax().max(high.amax());
    place.require(
        found,
        farthest_m < SPACE_M,
        culprit(part),
        &format!("its curve goes {farthest_m:.0} m from the origin"),
        &format!("below {SPACE_M:.0} m on every axis: beyond, a run counts as diverged"),
    );
}

/// Describes how far the curve of part `i` goes below the ground. Returns `None` if the curve stays above, without a
/// ground, and for a part that may end on the ground: a landing, or a last part that may exceed the limits.
fn below_ground(scenario: &Scenario, i: usize, planned: &Planned) -> Option<String> {
    let (ground, parts) = (&scenario.plant.ground, &scenario.mission.part);
    let lands = parts[i].kind == PartKind::Landing || parts[i].may_exceed() && i + 1 == parts.len();
    let below_m = planned.curve.range_m()[1].z - ground.standing_down_m();
    (ground.present && !lands && below_m > GRAZE_M).then(|| format!("its curve goes {below_m:.2} m below the ground"))
}

#[cfg(test)]
mod tests;
