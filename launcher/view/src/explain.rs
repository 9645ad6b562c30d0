//! Costs of disturbed ticks, for people and programs: tables, page and JSON.

use outcome::happenings::Happenings;
use replay::explain::{Cost, Explained, FlightCost};
use serde_json::{Value, json};

use crate::draw::{self, FlightColumns, Plot, STYLE, Series, TimePlots, escape};
use crate::table::Table;

const COLUMNS: [&str; 7] =
    ["tick", "at [s]", "error integral [mm s]", "courses apart [mm]", "largest error [mm]", "worst tilt [deg]", "what"];
/// Heading of the column of the undisturbed flight, and its explanation.
const ANOTHER: [&str; 2] = [
    "another flight",
    "Another flight: in-process, with this program's controllers in every node's place, as long as this flight, \
     without any fault or swap of the scenario, not even faults of air, sensors and actuators.",
];
/// Rows of a table in the terminal.
const ROWS: usize = 20;
/// Largest number of plots of a page.
const PLOTS: usize = 5;
/// Smallest distance of the courses that is worth a plot \[m\]: a closer pair is one line to the eye.
const PLOTTED_M: f64 = 1e-3;

/// Costs and happenings of a flight, to be shown.
pub struct ShownCosts<'a> {
    pub explained: &'a Explained,
    pub happened: &'a Happenings,
}

/// Formats the ticks of a cost: one tick, or the first and the last of a burst.
fn ticks_in_words(cost: &Cost) -> String {
    let (first, last) = cost.ticks;
    if first == last { first.to_string() } else { format!("{first}-{last}") }
}

/// Makes a table with a line for each cost.
fn table(title: &str, costs: &[Cost]) -> Table {
    let cells = |cost: &Cost| {
        let Cost { at_s, node, what, max_error_m, max_distance_m, error_integral_ms, worst_tilt_deg, .. } = cost;
        vec![
            ticks_in_words(cost),
            format!("{at_s:.2}"),
            format!("{:+.3}", error_integral_ms * 1e3),
            format!("{:.3}", max_distance_m * 1e3),
            format!("{:+.3}", max_error_m * 1e3),
            format!("{worst_tilt_deg:+.3}"),
            format!("{node} {what}"),
        ]
    };
    Table::new(title, &COLUMNS, costs.iter().map(cells).collect())
}

impl ShownCosts<'_> {
    /// Describes for people the costliest ticks and bursts, and the flights side by side.
    pub fn text(&self) -> String {
        let (ticks, bursts) = (self.explained.disturbed, self.explained.bursts_found);
        let mut text = format!("{}: {ticks} disturbed ticks, {bursts} bursts of more than one\n", self.explained.name);
        for (title, costs) in
            [("What single ticks cost", &self.explained.ticks), ("What bursts cost", &self.explained.bursts)]
        {
            if !costs.is_empty() {
                let shown = &costs[..costs.len().min(ROWS)];
                let more = match costs.len() - shown.len() {
                    0 => String::new(),
                    left_out => format!(" (the {ROWS} costliest; {left_out} more in explain.html)"),
                };
                text.extend(["\n", &table(&format!("{title}{more}"), shown).text()]);
            }
        }
        text + &format!("\n{}{}\n", self.side_by_side().text(), ANOTHER[1])
    }

    /// Returns for programs the figures of the flights, the cost of all disturbed ticks together, and the cost of each.
    pub fn to_json(&self) -> Value {
        let (flight, without) = (&self.explained.flight, &self.explained.without_any);
        json!({
            "disturbed_ticks": self.explained.disturbed,
            "flight": figures(flight),
            "without_any": figures(without),
            "another_flight": self.explained.undisturbed.as_ref().map(figures),
            "all_together": {
                "max_error_m": flight.metrics.max_position_error_m - without.metrics.max_position_error_m,
                "max_distance_m": flight.max_distance_m(without),
                "error_integral_ms": flight.metrics.position_error_integral_ms - without.metrics.position_error_integral_ms,
                "worst_tilt_deg": flight.worst_tilt_deg - without.worst_tilt_deg,
            },
            "ticks": self.explained.ticks,
            "bursts": self.explained.bursts,
        })
    }

    /// Makes the table of the flights: error integral, distance of the courses, largest error and worst tilt, with the
    /// cost of all disturbed ticks together and the sum over single ticks.
    fn side_by_side(&self) -> Table {
        let row = |name: &str, scale: f64, of: &dyn Fn(&FlightCost) -> f64, cost: fn(&Cost) -> f64| {
            let [flight, without] = [&self.explained.flight, &self.explained.without_any].map(of);
            let another = self.explained.undisturbed.as_ref().map_or(f64::NAN, of);
            let shown = |value: f64| if value.is_nan() { "-".into() } else { format!("{:.3}", value * scale) };
            let cells = [flight, without, another, flight - without].map(shown);
            let sum: f64 = self.explained.ticks.iter().map(cost).sum();
            let sum = if self.explained.ticks.is_empty() { "-".into() } else { format!("{:.3}", sum * scale) };
            std::iter::once(name.to_owned()).chain(cells).chain([sum]).collect()
        };
        let apart_mm = format!("{:.3}", self.explained.flight.max_distance_m(&self.explained.without_any) * 1e3);
        let apart = ["courses apart [mm]", "-", "-", "-", &apart_mm, "-"].map(str::to_owned);
        let headings = ["figure", "flight", "without any", ANOTHER[0], "all together cost", "sum of single ticks"];
        Table::new(
            "The flights",
            &headings,
            vec![
                row("error integral [mm s]", 1e3, &|of| of.metrics.position_error_integral_ms, |cost| {
                    cost.error_integral_ms
                }),
                apart.into(),
                row("largest error [mm]", 1e3, &|of| of.metrics.max_position_error_m, |cost| cost.max_error_m),
                row("worst tilt [deg]", 1.0, &|of| of.worst_tilt_deg, |cost| cost.worst_tilt_deg),
            ],
        )
    }

    /// Makes the tables and plots, for a page of their own or a section of the report.
    pub fn section(&self) -> String {
        let mut html = format!(
            "<p>A tick is disturbed when a node answered late, not at all, or to old messages, when a fault lost or changed a \
             message, or when the command came after the next sample. Each is undone in a flight of its own; all else stays as it \
             was. {} ticks are disturbed. The cost is the flight less the flight without, and how far apart their courses are.</p>",
            self.explained.disturbed
        );
        html += &self.side_by_side().html();
        html.extend(["<p class=\"hint\">", ANOTHER[1], "</p>"]);
        for (title, costs) in [
            ("Bursts, the costliest first", &self.explained.bursts),
            ("Single ticks, the costliest first", &self.explained.ticks),
        ] {
            if !costs.is_empty() {
                html.extend(["<h3>", title, "</h3>", &table("", costs).html()]);
            }
        }
        html + &self.plots()
    }

    /// Plots the flights with and without each of the costliest ticks and bursts, if they move the course by a visible
    /// distance.
    fn plots(&self) -> String {
        let all = self.explained.bursts.iter().chain(&self.explained.ticks);
        let mut costliest: Vec<&Cost> = all.filter(|cost| cost.max_distance_m >= PLOTTED_M).collect();
        costliest.sort_by(|a, b| b.error_integral_ms.total_cmp(&a.error_integral_ms));
        if costliest.is_empty() {
            return "<p>None of them moved the course by a millimetre: there is nothing to plot.</p>".into();
        }
        let plot = |cost: &&Cost| {
            let caption = format!("Tick {}, {} {}", ticks_in_words(cost), cost.node, cost.what);
            format!("<h3>{}</h3>{}", escape(&caption), self.plot(cost))
        };
        let hint = format!("<p class=\"hint\">{}</p>", draw::HAPPENED_HINT);
        hint + &costliest.iter().take(PLOTS).map(plot).collect::<String>()
    }

    /// Plots the position error of the flight, and of the flight without the ticks of `cost`, around these ticks.
    fn plot(&self, cost: &Cost) -> String {
        let (flight, sample_s) =
            (self.explained.flight.error_around(cost.at_s, self.explained.sample_s), self.explained.sample_s);
        let columns = |points: &[(f64, f64)]| FlightColumns {
            rows: points.len(),
            begin_s: points.first().map_or(0.0, |(time_s, _)| *time_s),
            dt_s: sample_s,
            columns: [("error".to_owned(), draw::column(points.iter().map(|(_, error_m)| *error_m as f32)))]
                .into_iter()
                .collect(),
        };
        let plot = Plot {
            title: Some("position error"),
            unit: "m",
            floor: true,
            series: vec![Series::new("the flight", "error", 0, 0), Series::new("without it", "error", 1, 1)],
            ..Plot::default()
        };
        TimePlots {
            flights: vec![columns(&flight), columns(&cost.without_m)],
            happened: draw::happened(&[("", self.happened)]),
            lines: serde_json::Value::Null,
            plots: vec![plot],
            paths: false,
        }
        .html()
    }

    /// Makes a page of its own; `missing` is a warning for a log with gaps.
    pub fn page(&self, missing: Option<&str>) -> String {
        let title = format!("What disturbed ticks cost: {}", self.explained.name);
        let missing = missing.map_or(String::new(), |why| format!("<p><strong>{}</strong></p>", escape(why)));
        draw::page(
            &title,
            STYLE,
            &format!("<h1>{}</h1>{missing}<h2>With and without them</h2>{}", escape(&title), self.section()),
        )
    }
}

/// Returns the figures of a flight from which its costs are computed, and its state hash.
fn figures(of: &FlightCost) -> Value {
    json!({
        "max_error_m": of.metrics.max_position_error_m,
        "error_integral_ms": of.metrics.position_error_integral_ms,
        "worst_tilt_deg": of.worst_tilt_deg,
        "state_hash": of.state_hash,
    })
}
