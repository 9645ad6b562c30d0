//! The map as a page of its own: one heat map per profile and probability of a miss, without scripts or network.
//!
//! Colour is the logarithm of the largest error, in cividis, which colour-blind readers see as others do; the number
//! stands in every cell, and a lost vehicle is hatched.

use std::fmt::Write;

use super::cell::{Cell, PROFILES, axes, name};
use super::point::Point;

const STYLE: &str = include_str!("../../assets/sensitivity/style.css");
/// Width and height of a cell \[px\].
const CELL: (f64, f64) = (46.0, 27.0);
/// Room for labels to the left of the cells, above and below \[px\].
const ROOM: (f64, f64, f64) = (68.0, 22.0, 38.0);
/// Errors at the ends of the scale of colours \[m\].
const SCALE_M: (f64, f64) = (0.03, 3.0);
/// Cividis at equal steps: red, green, blue.
const CIVIDIS: [[f64; 3]; 9] = [
    [0.0, 34.0, 78.0],
    [18.0, 53.0, 112.0],
    [59.0, 73.0, 108.0],
    [87.0, 93.0, 109.0],
    [112.0, 113.0, 115.0],
    [138.0, 134.0, 120.0],
    [165.0, 156.0, 116.0],
    [195.0, 179.0, 105.0],
    [254.0, 232.0, 56.0],
];

/// The page of a map of the scenario `title`.
pub fn page(title: &str, cells: &[Cell], point: Option<&Point>) -> String {
    let title = title.replace('&', "&amp;").replace('<', "&lt;");
    let sections = PROFILES.into_iter().map(|profile| {
        let cells: Vec<&Cell> = cells.iter().filter(|cell| cell.profile == profile).collect();
        section(name(profile), &cells, point)
    });
    let sections: String = sections.collect();
    let point = point.map_or("No operating point was measured.".into(), Point::describe);
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\
         <title>Sensitivity: {title}</title><style>{STYLE}</style></head>\n<body><main>\
         <h1>What delay, jitter and misses cost: {title}</h1>\
         <p>Largest position error in metres over the whole flight, flown in process, exactly. A command acts so long \
         after its sample as <em>delay</em> says, plus a random time up to <em>jitter</em>, and is lost with the \
         probability above each map. Of flights with different random numbers the worst one counts.</p>\
         <p>{point} <span class=\"hint\">The dot is drawn at the median age, with jitter from there to the 99th \
         percentile, where its line ends; between two columns or rows the scale is even.</span></p>{}\n{sections}</main></body></html>\n",
        legend()
    )
}

/// The maps of one profile.
fn section(name: &str, cells: &[&Cell], point: Option<&Point>) -> String {
    let [.., misses] = axes(cells);
    // The point belongs to the map whose probability is nearest to its own.
    let off = |p: &Point, miss: f64| (p.miss_probability - miss).abs();
    let nearest = |p: &&Point, miss: f64| misses.iter().all(|other| off(p, miss) <= off(p, *other));
    let map = |miss: &f64| {
        let cells: Vec<&Cell> = cells.iter().copied().filter(|cell| cell.miss_probability == *miss).collect();
        heat_map(&cells, point.filter(|p| nearest(p, *miss)))
    };
    let maps: String = misses.iter().map(map).collect();
    format!("<section><h2>Profile {name}</h2><div class=\"maps\">{maps}</div></section>\n")
}

/// The cells of one profile and probability of a miss.
fn heat_map(cells: &[&Cell], point: Option<&Point>) -> String {
    let [delays, jitters, misses] = axes(cells);
    let (left, top, below) = ROOM;
    let (w, h) = (CELL.0 * delays.len() as f64, CELL.1 * jitters.len() as f64);
    let x = |position: f64| left + CELL.0 * position;
    let y = |position: f64| top + h - CELL.1 * position;
    let missed = format!("{} % missed", (misses[0] * 1e4).round() / 100.0);
    let mut svg = svg(left + w + 4.0, top + h + below, &format!("largest error over delay and jitter, {missed}"));
    svg += &text(left, 14.0, "map", &missed);
    for (i, delay) in delays.iter().enumerate() {
        svg += &text(x(i as f64 + 0.5), top + h + 14.0, "tick middle", &delay.to_string());
    }
    svg += &text(left + w / 2.0, top + h + 32.0, "tick middle", "delay [ms]");
    for (i, jitter) in jitters.iter().enumerate() {
        svg += &text(left - 6.0, y(i as f64 + 0.5) + 4.0, "tick end", &jitter.to_string());
    }
    svg += &text(left - 6.0, 14.0, "tick end", "jitter [ms]");
    for cell in cells {
        svg += &rectangle(cell, x(position(&delays, cell.delay_ms)), y(position(&jitters, cell.jitter_ms) + 1.0));
    }
    if let Some(point) = point {
        let at = |delay_ms: f64| x(position(&delays, delay_ms) + 0.5);
        let (from, to) = (at(point.age_p50_ms), at(point.age_p99_ms));
        let cy = y(position(&jitters, point.age_p99_ms - point.age_p50_ms) + 0.5);
        for class in ["halo", "point"] {
            let _ = write!(
                svg,
                "<g class=\"{class}\"><circle cx=\"{from:.1}\" cy=\"{cy:.1}\" r=\"4\"/>\
                 <path d=\"M{from:.1} {cy:.1}H{to:.1}m0 -4v8\"/></g>"
            );
        }
    }
    svg + "</svg>"
}

fn rectangle(cell: &Cell, x: f64, y: f64) -> String {
    let (w, h) = CELL;
    let Cell { flights, lost, delay_ms, jitter_ms, .. } = cell;
    let (class, style, label) = match cell.max_position_error_m {
        Some(error_m) => {
            let shade = shade(error_m);
            let class = if shade > 0.55 { "dark" } else { "light" };
            (class, format!("fill:{}", colour(shade)), metres(error_m))
        }
        None if lost == flights => ("lost", String::new(), String::new()),
        None => ("lost", String::new(), format!("{lost}/{flights}")),
    };
    let outcome = if *lost > 0 { format!("{lost} of {flights} lost") } else { format!("{label} m") };
    format!(
        "<g class=\"{class}\"><title>delay {delay_ms} ms, jitter {jitter_ms} ms: {outcome}</title>\
         <rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{w}\" height=\"{h}\" style=\"{style}\"/>{}</g>",
        text(x + w / 2.0, y + h / 2.0 + 4.0, "value middle", &label)
    )
}

/// The scale of colours, and what hatching means.
fn legend() -> String {
    const STEPS: usize = 60;
    let (left, width) = (24.0, 300.0);
    let mut legend = svg(460.0, 44.0, "scale of colours, 0.03 to 3 m; hatched: vehicle lost");
    for i in 0..STEPS {
        let (x, fill) = (left + width * i as f64 / STEPS as f64, colour(i as f64 / (STEPS - 1) as f64));
        let step = width / STEPS as f64 + 0.5;
        let _ = write!(legend, "<rect x=\"{x:.1}\" y=\"4\" width=\"{step:.1}\" height=\"16\" style=\"fill:{fill}\"/>");
    }
    for error_m in [0.03, 0.1, 0.3, 1.0, 3.0] {
        legend += &text(left + width * shade(error_m), 36.0, "tick middle", &format!("{error_m} m"));
    }
    legend += "<g class=\"lost\"><rect x=\"364\" y=\"4\" width=\"46\" height=\"16\"/></g>";
    legend += &text(418.0, 17.0, "tick", "lost");
    // The hatching stands here once, for every map of the page.
    legend
        + "<defs><pattern id=\"hatch\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" \
           patternTransform=\"rotate(45)\"><rect class=\"hatch-ground\" width=\"7\" height=\"7\"/>\
           <path class=\"hatch-line\" d=\"M0 0V7\"/></pattern></defs></svg>"
}

fn svg(width: f64, height: f64, label: &str) -> String {
    format!(
        "<svg viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" role=\"img\" \
         aria-label=\"{label}\">"
    )
}

fn text(x: f64, y: f64, class: &str, text: &str) -> String {
    format!("<text x=\"{x:.1}\" y=\"{y:.1}\" class=\"{class}\">{text}</text>")
}

/// Where `value` lies on an axis of evenly spaced entries, in entries from the first; no farther than the ends.
fn position(axis: &[f64], value: f64) -> f64 {
    let after = axis.partition_point(|entry| *entry < value);
    match (after, axis.get(after)) {
        (0, _) => 0.0,
        (_, None) => axis.len() as f64 - 1.0,
        (_, Some(next)) => after as f64 - (next - value) / (next - axis[after - 1]),
    }
}

/// Where an error lies on the scale of colours, 0 to 1.
fn shade(error_m: f64) -> f64 {
    ((error_m / SCALE_M.0).ln() / (SCALE_M.1 / SCALE_M.0).ln()).clamp(0.0, 1.0)
}

fn colour(shade: f64) -> String {
    let position = shade * (CIVIDIS.len() - 1) as f64;
    let lower = (position as usize).min(CIVIDIS.len() - 2);
    let [r, g, b] = std::array::from_fn(|i| {
        let (from, to) = (CIVIDIS[lower][i], CIVIDIS[lower + 1][i]);
        (from + (position - lower as f64) * (to - from)).round()
    });
    format!("rgb({r},{g},{b})")
}

/// An error in no more room than a cell has.
fn metres(error_m: f64) -> String {
    match error_m {
        e if e < 1.0 => format!("{e:.3}"),
        e if e < 10.0 => format!("{e:.2}"),
        e => format!("{e:.0}"),
    }
}
