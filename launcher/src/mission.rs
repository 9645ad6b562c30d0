//! Account of a mission of parts before its flight: when each part begins, and what it asks of the vehicle.

use std::fmt::Write;

use contract::Scenario;
use contract::scenario::plan;
use contract::scenario::plan::Demand;
use guidance::Trajectory;
use runtime::console::eprint_line;

/// Names and units of the columns.
const COLUMNS: [&str; 8] = ["begins s", "takes s", "m/s", "up, down m/s", "m/s2", "tilt deg", "thrust g", "turn deg/s"];

/// Describes the parts of the mission, and the limits of the vehicle, as a table; `None` for any other trajectory.
pub fn describe(scenario: &Scenario) -> Option<String> {
    let (trajectory, limits) = (Trajectory::new(scenario), plan::limits(scenario));
    let plan = trajectory.plan()?;
    let mut text = format!("mission of {:.1} s:\n", plan.duration_s());
    let mut line = |name: &str, cells: [String; 8]| {
        // Writing to a String cannot fail.
        let _ = write!(text, "  {name:<16}");
        cells.iter().zip(COLUMNS).for_each(|(cell, column)| _ = write!(text, "  {cell:>0$}", column.len().max(9)));
        text.push('\n');
    };
    let sizes = |[begins, takes]: [String; 2], demand: Demand| {
        let [least, most] = demand.thrust_mps2.map(|thrust| thrust / limits.g_mps2);
        [
            begins,
            takes,
            number(demand.speed_mps),
            number(demand.vertical_mps),
            number(demand.acceleration_mps2),
            number(demand.tilt_rad.to_degrees()),
            format!("{least:.2}-{most:.2}"),
            number(demand.turn_radps.to_degrees()),
        ]
    };
    line("", COLUMNS.map(str::to_owned));
    line("the vehicle has", sizes(Default::default(), limits.most));
    line("curves may use", sizes(Default::default(), limits.share(scenario.mission.limits.share).most));
    for (i, (part, planned)) in scenario.mission.part.iter().zip(plan.parts()).enumerate() {
        let times = [planned.begins_s, planned.curve.duration_s()].map(number);
        line(&format!("{i} {}", part.kind.name()), sizes(times, planned.demand(&limits)));
    }
    Some(text)
}

/// Says on stderr that the flight ends before its mission does, if that is so.
pub fn tell_end(scenario: &Scenario) {
    let trajectory = Trajectory::new(scenario);
    let Some(plan) = trajectory.plan() else { return };
    let (mission_s, flight_s) = (plan.duration_s(), scenario.run.duration_s);
    if flight_s < mission_s {
        eprint_line(&format!(
            "note: the mission takes {mission_s:.1} s, and the flight ends at {flight_s:.1} s (`run.duration_s`)"
        ));
    }
}

/// Formats a number of a column; a limit that there is not is `-`.
fn number(x: f64) -> String {
    if x < 1e6 { format!("{x:.1}") } else { "-".into() }
}
