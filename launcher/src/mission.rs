//! Description of a mission before its flight: when each part begins, what it asks of the vehicle, and how far it
//! reaches.

use runtime::console::eprint_line;
use settings::plan::{Demand, Planned, range_m};
use settings::{Scenario, TrajectoryKind, mission_warnings, plan, word};
use view::table::Table;

/// Describes the parts of the mission, the limits of the vehicle, and the reach of each part beside that of its points,
/// as tables; `None` if the trajectory is not made of parts.
pub fn describe(scenario: &Scenario) -> Option<String> {
    if scenario.mission.trajectory != TrajectoryKind::Parts {
        return None;
    }
    let (plan, limits) = (plan::build(scenario), plan::limits(scenario));
    let sizes = |name: String, times: [String; 2], demand: Demand| -> Vec<String> {
        let [least, most] = demand.thrust_mps2.map(|thrust| thrust / limits.g_mps2);
        let speeds = [demand.speed_mps, demand.vertical_mps, demand.acceleration_mps2].map(number);
        let angles = [number(demand.tilt_rad.to_degrees()), format!("{least:.2}-{most:.2}")];
        let turn = number(demand.turn_radps.to_degrees());
        [name].into_iter().chain(times).chain(speeds).chain(angles).chain([turn]).collect()
    };
    let of_vehicle = |name: &str, demand| sizes(name.into(), [(); 2].map(|()| "-".into()), demand);
    let share = scenario.mission.limits.share;
    let mut asked =
        vec![of_vehicle("the vehicle has", limits.most), of_vehicle("curves may use", limits.share(share).most)];
    let mut reached = vec![];
    for (i, (part, planned)) in scenario.mission.part.iter().zip(plan.parts()).enumerate() {
        let name = format!("{i} {}", word(part.kind));
        let times = [planned.begins_s, planned.curve.duration_s()].map(number);
        asked.push(sizes(name.clone(), times, planned.demand(&limits)));
        reached.push([name].into_iter().chain(reach(planned, part.points_m.as_deref())).collect());
    }
    let title = format!("mission of {:.1} s:", plan.duration_s());
    let asks = ["", "begins s", "takes s", "m/s", "up, down m/s", "m/s2", "tilt deg", "thrust g", "turn deg/s"];
    let axes = ["", "north m", "its points", "east m", "its points", "down m", "its points"];
    Some(Table::new(&title, &asks, asked).text() + "\n" + &Table::new("reach:", &axes, reached).text())
}

/// Formats, for each axis, the range of a part and the range of its points with the position where the part begins.
fn reach(planned: &Planned, points_m: Option<&[[f64; 3]]>) -> [String; 6] {
    let range = |[low, high]: [f64; 2]| {
        let rounded = |x: f64| (x * 10.0).round() / 10.0 + 0.0; // + 0.0: no -0.0
        format!("{:.1} to {:.1}", rounded(low), rounded(high))
    };
    let of_curve = planned.curve.range_m();
    let of_points = points_m.map(|points_m| range_m(&[&[planned.curve.at(0.0).position_m], points_m].concat()));
    std::array::from_fn(|i| match (i % 2, of_points) {
        (0, _) => range(of_curve.map(|end| end[i / 2])),
        (_, Some(of_points)) => range(of_points.map(|end| end[i / 2])),
        (_, None) => "-".into(),
    })
}

/// Warns on stderr if the parts ask for more than the vehicle has, or if curves leave their points; notes if the flight
/// ends before the mission does.
pub fn warn(scenario: &Scenario) {
    for warning in mission_warnings(scenario) {
        eprint_line(&format!("warning: {warning}"));
    }
    let (mission_s, flight_s) = (plan::build(scenario).duration_s(), scenario.run.duration_s);
    if scenario.mission.trajectory == TrajectoryKind::Parts && flight_s < mission_s {
        eprint_line(&format!(
            "note: the mission takes {mission_s:.1} s, and the flight ends at {flight_s:.1} s (`run.duration_s`)"
        ));
    }
}

/// Formats a number of a column; `-` for an absent limit.
fn number(x: f64) -> String {
    if x < 1e6 { format!("{x:.1}") } else { "-".into() }
}
