//! Account of a mission of parts before its flight: when each part begins, and what it asks of the vehicle.

use std::fmt::Write;

use contract::Scenario;
use contract::scenario::plan;
use guidance::Trajectory;
use runtime::console::eprint_line;

/// Names and units of the columns.
const COLUMNS: [&str; 8] = ["begins s", "takes s", "m/s", "up, down m/s", "m/s2", "tilt deg", "thrust g", "turn deg/s"];

/// Describes the parts of the mission, and the limits of the vehicle, as a table; `None` for any other trajectory.
pub fn describe(scenario: &Scenario) -> Option<String> {
    let (trajectory, has) = (Trajectory::new(scenario), plan::limits(scenario));
    let plan = trajectory.plan()?;
    let uses = has.share(scenario.mission.limits.share);
    let mut text = format!("mission of {:.1} s:\n", plan.duration_s());
    let mut line = |name: &str, cells: [String; 8]| {
        // Writing to a String cannot fail.
        let _ = write!(text, "  {name:<16}");
        cells.iter().zip(COLUMNS).for_each(|(cell, column)| _ = write!(text, "  {cell:>0$}", column.len().max(9)));
        text.push('\n');
    };
    line("", COLUMNS.map(str::to_owned));
    let g = |thrust_mps2: [f64; 2]| {
        let [least, most] = thrust_mps2.map(|thrust| thrust / has.g_mps2);
        format!("{least:.2}-{most:.2}")
    };
    for (name, limits) in [("the vehicle has", has), ("curves may use", uses)] {
        let cells = [
            String::new(),
            String::new(),
            number(limits.speed_mps),
            number(limits.vertical_mps),
            number(limits.acceleration_mps2),
            number(limits.tilt_rad.to_degrees()),
            g(limits.thrust_mps2),
            number(limits.turn_radps.to_degrees()),
        ];
        line(name, cells);
    }
    for (i, (part, planned)) in scenario.mission.part.iter().zip(plan.parts()).enumerate() {
        let demand = planned.demand(&has);
        let cells = [
            number(planned.begins_s),
            number(planned.curve.duration_s()),
            number(demand.speed_mps),
            number(demand.vertical_mps),
            number(demand.acceleration_mps2),
            number(demand.tilt_rad.to_degrees()),
            g(demand.thrust_mps2),
            number(demand.turn_radps.to_degrees()),
        ];
        line(&format!("{i} {}", part.kind.name()), cells);
    }
    Some(text)
}

/// Says on stderr that the flight ends before its mission does, if that is so.
pub fn tell_end(scenario: &Scenario) {
    let mission_s = Trajectory::new(scenario).plan().map_or(0.0, |plan| plan.duration_s());
    let flight_s = scenario.run.duration_s;
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
