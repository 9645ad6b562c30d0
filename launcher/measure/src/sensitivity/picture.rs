//! Page of the map: one heat map per controller and probability of a miss.

use view::draw::{self, HeatCell, HeatMap, escape};

use super::map::{Cell, Place, axes, controllers};
use super::point::Point;

const STYLE: &str = include_str!("../../assets/sensitivity/style.css");
/// Scale of the largest position errors \[m\].
const ERRORS: HeatMap = HeatMap { scale: (0.03, 3.0), values: "largest error", axes: ["delay [ms]", "jitter [ms]"] };

/// Renders the page of a map of the scenario `title`.
pub fn page(title: &str, cells: &[Cell], point: Option<&Point>) -> String {
    let sections = controllers(cells).into_iter().map(|controller| {
        let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.at.controller == controller).collect();
        section(controller, &cells, point)
    });
    let sections: String = sections.collect();
    let point = point.map_or("No operating point was measured.".into(), Point::describe);
    let body = format!(
        "<h1>What delay, jitter and misses cost: {title}</h1>\
         <p>Largest position error in metres over the whole flight, flown in process, exactly. A command acts so long \
         after its sample as <em>delay</em> says, plus a random time up to <em>jitter</em>, and is lost with the \
         probability above each map. Of flights with different random numbers the worst one counts.</p>\
         <p>{point} <span class=\"hint\">The dot is drawn at the median age, with jitter from there to the 99th \
         percentile, where its line ends; between two columns or rows the scale is even.</span></p>{}\n{sections}",
        ERRORS.legend(&[0.03, 0.1, 0.3, 1.0, 3.0], "m", "lost"),
        title = escape(title)
    );
    draw::page(&format!("Sensitivity: {title}"), STYLE, &body)
}

/// Renders the maps of one controller.
fn section(name: &str, cells: &[&Cell], point: Option<&Point>) -> String {
    let [.., misses] = axes(cells);
    // The point is drawn in the map with the nearest probability.
    let off = |p: &Point, miss: f64| (p.miss_probability - miss).abs();
    let nearest = |p: &&Point, miss: f64| misses.iter().all(|other| off(p, miss) <= off(p, *other));
    let map = |miss: &f64| {
        let cells: Vec<&Cell> = cells.iter().copied().filter(|cell| cell.at.miss_probability == *miss).collect();
        heat_map(&cells, point.filter(|p| nearest(p, *miss)))
    };
    let maps: String = misses.iter().map(map).collect();
    format!("<section><h2>{name}</h2><div class=\"maps\">{maps}</div></section>\n")
}

/// Renders the cells of one controller and probability of a miss.
fn heat_map(cells: &[&Cell], point: Option<&Point>) -> String {
    let [delays, jitters, misses] = axes(cells);
    let missed = format!("{} % missed", (misses[0] * 1e4).round() / 100.0);
    let drawn: Vec<HeatCell> = cells.iter().map(|cell| drawn(cell)).collect();
    let point = point.map(|point| [point.age_p99_ms - point.age_p50_ms, point.age_p50_ms, point.age_p99_ms]);
    ERRORS.draw(&missed, [&delays, &jitters], &drawn, point)
}

fn drawn(cell: &Cell) -> HeatCell {
    let &Cell { flights, lost, max_position_error_m: value, .. } = cell;
    let Place { delay_ms, jitter_ms, .. } = cell.at;
    let label = match value {
        Some(error_m) => metres(error_m),
        None if lost == flights => String::new(),
        None => format!("{lost}/{flights}"),
    };
    let outcome = if lost > 0 { format!("{lost} of {flights} lost") } else { format!("{label} m") };
    let title = format!("delay {delay_ms} ms, jitter {jitter_ms} ms: {outcome}");
    HeatCell { column: delay_ms, row: jitter_ms, value, label, title }
}

/// Formats an error so that it fits into a cell.
fn metres(error_m: f64) -> String {
    match error_m {
        e if e < 1.0 => format!("{e:.3}"),
        e if e < 10.0 => format!("{e:.2}"),
        e => format!("{e:.0}"),
    }
}
