//! `compare`: several flights side by side. Tables for terminal and page have the settings that differ, the metrics and
//! the timing of the nodes. The page also has the paths and plots, laid over each other, with the faults and events of
//! each flight.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use contract::topic::NODES;
use flight::event::name;
use hdrhistogram::Histogram;
use settings::{Mode, Scenario};

use crate::differing_settings;
use crate::draw::{self, FlightColumns, Plot, STYLE, Series, TimePlots, escape};
use crate::report::columns::ReportColumns;
use crate::report::sections::{METRICS, ShownMetric};
use crate::table::Table;
use outcome::bounds::bounds;
use outcome::metrics::Metrics;
use outcome::percentiles::percentiles;
use outcome::recorded::{Recorded, TimeSpan};
use outcome::ticks::Joined;
use outcome::timing::Timing;
use serde_json::{Value, json};

/// Table with a row for each metric and a column for each flight, named by `titles`.
pub fn metrics(titles: &[&str], flights: &[Metrics]) -> Table {
    let row = |metric: &ShownMetric| {
        let values: Vec<f64> = flights.iter().map(metric.of).collect();
        let cell = |value: &f64| if value.is_nan() { "-".into() } else { format!("{value:.*}", metric.decimals + 1) };
        let unit = if metric.unit.is_empty() { String::new() } else { format!(" [{}]", metric.unit) };
        let cells = std::iter::once(format!("{}{unit}", metric.name)).chain(values.iter().map(cell));
        values.iter().any(|value| !value.is_nan()).then(|| cells.collect())
    };
    Table::new("Metrics", &headings("metric", titles), METRICS.iter().filter_map(row).collect())
}

fn headings<'a>(first: &'a str, titles: &[&'a str]) -> Vec<&'a str> {
    std::iter::once(first).chain(titles.iter().copied()).collect()
}

/// Plot of every flight: label, unit, least range, column, and the mission's column beside it.
type Picture = (&'static str, &'static str, f64, &'static str, Option<&'static str>);

/// Plots of the page: NED and body axes, angles in degrees, rotor speeds in the paper's unit.
const PICTURES: [Picture; 11] = [
    ("position error", "m", 0.02, "error", None),
    ("north", "m", 0.5, "x", Some("x_wanted")),
    ("east", "m", 0.5, "y", Some("y_wanted")),
    ("down", "m", 0.5, "z", Some("z_wanted")),
    ("roll φ", DEGREES, 1.0, "phi", None),
    ("pitch θ", DEGREES, 1.0, "theta", None),
    ("yaw ψ", DEGREES, 1.0, "psi", None),
    ("Ω₁", "speed unit", 50.0, "omega1", None),
    ("Ω₂", "speed unit", 50.0, "omega2", None),
    ("Ω₃", "speed unit", 50.0, "omega3", None),
    ("tilt μ", DEGREES, 2.0, "tilt", None),
];
/// Unit of the angles.
const DEGREES: &str = "deg";

/// Flights side by side.
pub struct Comparison {
    flights: Vec<Flight>,
}

/// One flight of a comparison.
struct Flight {
    /// Name in the comparison, which no other flight has.
    title: String,
    recorded: Recorded,
    columns: ReportColumns,
    /// Settings, with the orders given in flight.
    scenario: Scenario,
}

impl Flight {
    /// Returns the timing of the nodes; `None` unless the flight was in real time, because otherwise nothing is late.
    fn timing(&self) -> Option<&Timing> {
        self.recorded.summary.timing.as_ref().filter(|_| self.scenario.run.mode == Mode::Realtime)
    }

    /// Encodes the columns of the pictures; `with_mission` adds those of the mission.
    fn encoded(&self, with_mission: bool) -> FlightColumns {
        let flown = PICTURES.iter().map(|(_, unit, _, name, _)| (*name, *unit == DEGREES));
        let wanted = PICTURES.iter().filter_map(|(.., wanted)| *wanted).filter(|_| with_mission);
        self.columns.encoded(flown.chain(wanted.map(|name| (name, false))), 0.0, self.scenario.sample_s())
    }

    /// Cells of the flight in the table of flights.
    fn cells(&self) -> Vec<String> {
        let Self { title, recorded, scenario, .. } = self;
        let folder = recorded.path.parent().unwrap_or(&recorded.path).display().to_string();
        let ended = &recorded.run.ended;
        let flown = format!("{:.2}", recorded.summary.time_s());
        vec![
            title.clone(),
            name(recorded.run.mode),
            scenario.run.rate_hz.to_string(),
            flown,
            recorded.missing().map_or(ended.clone(), |_| format!("{ended}; its log is not whole")),
            folder,
            recorded.log.written_by.program.to_string(),
        ]
    }
}

impl Comparison {
    /// Reads the flights in these folders.
    ///
    /// # Errors
    /// A flight cannot be read, or is named twice.
    pub fn read(runs: &[PathBuf]) -> anyhow::Result<Self> {
        let begin = |scenario: &Scenario| (Joined::new(scenario, 0), ReportColumns::new(scenario, 0));
        let read = |run: &PathBuf| -> anyhow::Result<(Recorded, ReportColumns)> {
            let mut gathered = None;
            let recorded = Recorded::read_each(run, TimeSpan::ALL, |scenario, record| {
                let (joined, columns) = gathered.get_or_insert_with(|| begin(scenario));
                joined.observe(record, |tick| columns.observe(tick));
            })?;
            let (mut joined, mut columns) = gathered.unwrap_or_else(|| begin(&recorded.scenario));
            joined.finish(|tick| columns.observe(tick));
            Ok((recorded, columns))
        };
        let read = runs.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
        let place = |(recorded, _): &(Recorded, ReportColumns)| -> anyhow::Result<Place> {
            let path = recorded.path.canonicalize();
            let path = path.with_context(|| format!("cannot find {}", recorded.path.display()))?;
            Ok((recorded.run.name.clone(), path))
        };
        let places = read.iter().map(place).collect::<anyhow::Result<Vec<_>>>()?;
        for (i, (_, path)) in places.iter().enumerate() {
            if places[..i].iter().any(|(_, before)| before == path) {
                bail!("{} is named twice; name different runs", runs[i].display());
            }
        }
        let flight = |((recorded, columns), title): ((Recorded, ReportColumns), String)| {
            let scenario = recorded.flown();
            Flight { title, recorded, columns, scenario }
        };
        Ok(Self { flights: read.into_iter().zip(titles(&places)).map(flight).collect() })
    }

    /// Describes what the logs lack, one text for each log that is not whole.
    pub fn missing(&self) -> impl Iterator<Item = String> {
        self.flights.iter().filter_map(|flight| flight.recorded.missing())
    }

    fn titles(&self) -> Vec<&str> {
        self.flights.iter().map(|flight| flight.title.as_str()).collect()
    }

    /// Tables of the flights, their settings, metrics and timing.
    fn tables(&self) -> Vec<Table> {
        let titles = self.titles();
        let scenarios: Vec<_> = self.flights.iter().map(|flight| &flight.scenario).collect();
        let of_flights: Vec<_> = self.flights.iter().map(|flight| flight.recorded.summary.metrics()).collect();
        let what = ["flight", "mode", "Hz", "flown [s]", "ended", "folder", "flown by"];
        let differences = differing_settings::differences(&scenarios);
        let told = if differences.is_empty() { "Settings: all are the same" } else { "Settings that differ" };
        vec![
            Table::new("Flights", &what, self.flights.iter().map(Flight::cells).collect()),
            Table::new(told, &headings("setting", &titles), differences),
            Table { title: self.lengths(), ..metrics(&titles, &of_flights) },
            self.timing(),
        ]
    }

    /// Returns the title of the metrics, with a warning if the flights have different lengths, because extremes do not
    /// compare then.
    fn lengths(&self) -> String {
        let all: Vec<String> =
            self.flights.iter().map(|flight| format!("{:.2}", flight.recorded.summary.time_s())).collect();
        if all.windows(2).all(|pair| pair[0] == pair[1]) {
            "Metrics".into()
        } else {
            format!("Metrics, each over its whole flight, of {} s: extremes of a longer one are larger", all.join(", "))
        }
    }

    /// Makes the table of the timing: wake-up, response and misses of every node, and the age at the actuator.
    fn timing(&self) -> Table {
        let row = |name: String, cell: &dyn Fn(&Timing) -> String| -> Vec<String> {
            let cells = self.flights.iter().map(|flight| flight.timing().map_or("-".into(), cell));
            std::iter::once(name).chain(cells).collect()
        };
        let of_node = |(i, node): (usize, &&str)| {
            let figure = |figure: &'static str| {
                move |timing: &Timing| timing.nodes[i].figures.get(figure).map_or("-".into(), three)
            };
            let wake = if i == 0 { "jitter" } else { "hop" };
            [
                row(format!("{node}, {wake} [us]"), &figure(wake)),
                row(format!("{node}, response [us]"), &figure("response")),
                row(format!("{node}, misses"), &|timing| timing.nodes[i].counts.misses.to_string()),
            ]
        };
        let ages = [
            row("age at the actuator, commands [us]".into(), &|timing| three(&timing.age.per_command)),
            row("age at the actuator, slots [us]".into(), &|timing| three(&timing.age.per_slot)),
        ];
        let known = self.flights.iter().any(|flight| flight.timing().is_some());
        let rows = NODES.iter().enumerate().flat_map(of_node).chain(ages).filter(|_| known).collect();
        let told = if known { "Timing: p50 / p99 / max" } else { "Timing: only flights in real time have one" };
        Table::new(told, &headings("figure", &self.titles()), rows)
    }

    /// Returns text for people: what the logs lack, then the tables.
    pub fn text(&self) -> String {
        let text = |table: Table| if table.rows.is_empty() { format!("{}\n", table.title) } else { table.text() };
        let missing = self.missing().map(|missing| format!("note: {missing}\n"));
        missing.chain(self.tables().into_iter().map(text)).collect::<Vec<_>>().join("\n")
    }

    /// Makes the page: the tables, and the flights laid over each other.
    pub fn page(&self) -> String {
        let title = format!("Compared: {}", self.titles().join(", "));
        let missing = self.missing().map(|missing| format!("<p class=\"warn\">{}.</p>", escape(&missing)));
        let section = |table: Table| {
            let rows = if table.rows.is_empty() { String::new() } else { table.html() };
            format!("<section><h2>{}</h2>{rows}</section>", escape(&table.title))
        };
        let body: String = [format!("<h1>{}</h1>", escape(&title))]
            .into_iter()
            .chain(missing)
            .chain(self.tables().into_iter().map(section))
            .chain([self.pictures()])
            .collect();
        draw::page(&title, &[STYLE, "main { max-width: 80rem; }"].concat(), &body)
    }

    /// Makes the section with the paths, and with every quantity over time.
    fn pictures(&self) -> String {
        let draws_mission = |i: usize| self.mission_drawn_from(i) == i;
        let several_missions = (0..self.flights.len()).filter(|i| draws_mission(*i)).count() > 1;
        let flights = self.flights.iter().enumerate();
        let plot = |&(label, unit, span, column, wanted): &Picture| {
            let of_flights = flights.clone().map(|(i, flight)| Series::new(&flight.title, column, i, i));
            let of_missions = flights.clone().filter(|(i, _)| draws_mission(*i)).filter_map(|(i, flight)| {
                let name = if several_missions { format!("mission of {}", flight.title) } else { "mission".to_owned() };
                Some(Series::wanted(&name, wanted?, i))
            });
            Plot {
                title: Some(label),
                unit,
                span,
                floor: column == "error",
                lines: (column == "error").then_some("error"),
                series: of_flights.chain(of_missions).collect(),
            }
        };
        let bound = |flight: &Flight| {
            let y = bounds(&flight.scenario).max_position_error_m.filter(|bound| bound.is_finite())?;
            Some(json!({ "y": y, "label": format!("bound of {}", flight.title) }))
        };
        let happened: Vec<_> = self.flights.iter().map(|flight| flight.recorded.run.happenings()).collect();
        let happened: Vec<_> =
            self.flights.iter().zip(&happened).map(|(flight, happened)| (flight.title.as_str(), happened)).collect();
        let plots = TimePlots {
            flights: flights.clone().map(|(i, flight)| flight.encoded(draws_mission(i))).collect(),
            happened: draw::happened(&happened),
            lines: json!({ "error": self.flights.iter().filter_map(bound).collect::<Value>() }),
            plots: PICTURES.iter().map(plot).collect(),
            paths: true,
        };
        format!(
            "<section><h2>The flights over each other</h2><p class=\"hint\">True motion. World axes are north, east, down; \
             body axes forward, right, down. Each flight has a colour and a kind of line. Drag across a plot to \
             zoom all of them, double-click to see all again. {}</p>{}</section>",
            draw::HAPPENED_HINT,
            plots.html()
        )
    }

    /// Returns the flight from which the mission of flight `i` is drawn: the longest of those that have it, because
    /// equal missions are drawn once.
    fn mission_drawn_from(&self, i: usize) -> usize {
        let same = |j: &usize| {
            let [one, other] = [i, *j].map(|i| &self.flights[i]);
            one.scenario.mission == other.scenario.mission
        };
        let longest = (0..self.flights.len()).filter(same).rev();
        let flown_s = |flight: &usize| self.flights[*flight].recorded.summary.time_s();
        longest.max_by(|a, b| flown_s(a).total_cmp(&flown_s(b))).unwrap_or(i)
    }
}

/// Formats the 50th and 99th percentile and the maximum \[us\]; `-` if the histogram is empty.
fn three(histogram: &Histogram<u64>) -> String {
    if histogram.is_empty() {
        return "-".into();
    }
    let p = percentiles(histogram);
    [p.p50_us, p.p99_us, p.max_us].map(|us| format!("{us:.0}")).join(" / ")
}

/// The name of a flight, and the path of its log.
type Place = (String, PathBuf);

/// Returns the titles of flights: the name, with the folder if another flight has the same name, or with the whole path
/// if the folders have equal names too.
fn titles(flights: &[Place]) -> Vec<String> {
    let folder = |path: &Path| path.parent().and_then(Path::file_name).unwrap_or_default().display().to_string();
    let ways: [&dyn Fn(&Place) -> String; 3] =
        [&|(name, _)| name.clone(), &|(name, path)| format!("{name} ({})", folder(path)), &|(name, path)| {
            format!("{name} ({})", path.display())
        }];
    let title = |flight: &Place| {
        let is_alone =
            |way: &&&dyn Fn(&Place) -> String| flights.iter().filter(|other| way(other) == way(flight)).count() == 1;
        ways.iter().find(is_alone).unwrap_or(&ways[2])(flight)
    };
    flights.iter().map(title).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn titles_are_no_longer_than_needed_to_tell_flights_apart() {
        let flights = |all: &[(&str, &str)]| -> Vec<String> {
            titles(&all.iter().map(|(name, path)| ((*name).to_owned(), path.into())).collect::<Vec<_>>())
        };
        assert_eq!(flights(&[("a", "/r/1/flight.mcap"), ("b", "/r/2/flight.mcap")]), ["a", "b"]);
        assert_eq!(flights(&[("a", "/r/1/flight.mcap"), ("a", "/r/2/flight.mcap")]), ["a (1)", "a (2)"]);
        let deep = flights(&[("a", "/r/1/flight.mcap"), ("a", "/s/1/flight.mcap"), ("b", "/s/2/flight.mcap")]);
        assert_eq!(deep, ["a (/r/1/flight.mcap)", "a (/s/1/flight.mcap)", "b"]);
    }
}
