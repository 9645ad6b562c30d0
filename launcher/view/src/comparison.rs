//! `compare`: several flights side by side. What differs between their settings, what they came to, and when their
//! nodes worked, as tables for terminal and page; on the page their courses too, laid over each other.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use contract::Scenario;
use contract::message::State;
use contract::scenario::Mode;
use contract::topic::NODES;
use flight::event::name;
use flight::log::Record;
use hdrhistogram::Histogram;

use crate::draw::{self, Line, STYLE, escape};
use crate::report::sections::{METRICS, Shown};
use crate::settings;
use crate::table::Table;
use crate::thinning::Thinned;
use outcome::metrics::Metrics;
use outcome::percentiles::percentiles;
use outcome::recorded::{Part, Recorded};
use outcome::ticks::{Joined, LoggedTick};
use outcome::timing::Timing;

/// Table with a row for each metric and a column for each flight, named by `titles`.
pub fn metrics(titles: &[&str], flights: &[(&Scenario, Metrics)]) -> Table {
    let row = |metric: &Shown| {
        let values: Vec<f64> = flights.iter().map(|(scenario, of)| metric.of(of, scenario)).collect();
        let cell = |value: &f64| if value.is_nan() { "-".into() } else { format!("{value:.*}", metric.decimals + 1) };
        let unit = if metric.unit.is_empty() { String::new() } else { format!(" [{}]", metric.unit) };
        let cells = std::iter::once(format!("{}{unit}", metric.name)).chain(values.iter().map(cell));
        values.iter().any(|value| !value.is_nan()).then(|| cells.collect())
    };
    Table::new("Metrics", &headings("", titles), METRICS.iter().filter_map(row).collect())
}

fn headings<'a>(first: &'a str, titles: &[&'a str]) -> Vec<&'a str> {
    std::iter::once(first).chain(titles.iter().copied()).collect()
}

/// Pictures of every flight: a title with the unit, the quantity at a tick, and the axis of the mission's position
/// beside it.
type Picture = (&'static str, Quantity, Option<usize>);
type Quantity = fn(&LoggedTick) -> Option<f64>;

/// NED and body axes; angles in degrees, rotor speeds in the paper's unit.
const PICTURES: [Picture; 11] = [
    ("position error [m]", |tick| tick.distance_m(), None),
    ("x, north [m]", |tick| Some(state(tick)?.actual.position_m[0]), Some(0)),
    ("y, east [m]", |tick| Some(state(tick)?.actual.position_m[1]), Some(1)),
    ("z, down [m]", |tick| Some(state(tick)?.actual.position_m[2]), Some(2)),
    ("roll φ [deg]", |tick| Some(state(tick)?.actual.attitude_rad[0].to_degrees()), None),
    ("pitch θ [deg]", |tick| Some(state(tick)?.actual.attitude_rad[1].to_degrees()), None),
    ("yaw ψ [deg]", |tick| Some(state(tick)?.actual.attitude_rad[2].to_degrees()), None),
    ("rotor speed Ω1", |tick| Some(state(tick)?.actuators.rotor_speed[0]), None),
    ("rotor speed Ω2", |tick| Some(state(tick)?.actuators.rotor_speed[1]), None),
    ("rotor speed Ω3", |tick| Some(state(tick)?.actuators.rotor_speed[2]), None),
    ("tilt μ [deg]", |tick| Some(state(tick)?.actuators.tilt_rad.to_degrees()), None),
];

fn state(tick: &LoggedTick) -> Option<&State> {
    tick.of.state.as_ref()
}

/// Course of a flight, gathered tick by tick: each picture's quantity, and the position that the mission asks for.
struct Course {
    joined: Joined,
    quantities: [Thinned; PICTURES.len()],
    wanted: [Thinned; 3],
    end_s: f64,
}

impl Course {
    fn new(scenario: &Scenario) -> Self {
        let (quantities, wanted) = Default::default();
        Self { joined: Joined::new(scenario, 0), quantities, wanted, end_s: 0.0 }
    }

    fn observe(&mut self, record: &Record) {
        let Self { joined, quantities, wanted, end_s } = self;
        joined.observe(record, |tick| push(tick, quantities, wanted, end_s));
    }

    /// Takes in the remaining ticks.
    fn finish(&mut self) {
        let Self { joined, quantities, wanted, end_s } = self;
        joined.finish(|tick| push(tick, quantities, wanted, end_s));
    }
}

fn push(tick: &LoggedTick, quantities: &mut [Thinned], wanted: &mut [Thinned], end_s: &mut f64) {
    for (series, (_, quantity, _)) in quantities.iter_mut().zip(PICTURES) {
        series.push(quantity(tick).map_or(f32::NAN, |value| value as f32));
    }
    wanted.iter_mut().zip(tick.wanted_m).for_each(|(series, wanted_m)| series.push(wanted_m as f32));
    *end_s = tick.time_s();
}

/// Points of a series: time \[s\] and value.
fn points(series: &Thinned, scenario: &Scenario) -> Vec<(f64, f64)> {
    let step_s = series.step() * scenario.sample_s();
    (0..).zip(series.values()).map(|(i, value)| (f64::from(i) * step_s, f64::from(value))).collect()
}

/// Flights side by side.
pub struct Comparison {
    flights: Vec<Flight>,
}

/// One flight of a comparison.
struct Flight {
    /// Name in the comparison, which no other flight has.
    title: String,
    recorded: Recorded,
    course: Course,
    /// Settings, with what was ordered while it flew.
    scenario: Scenario,
}

impl Flight {
    /// Returns the timing of the nodes; `None` unless the flight was in real time, because otherwise nothing is late.
    fn timing(&self) -> Option<&Timing> {
        self.recorded.summary.timing.as_ref().filter(|_| self.scenario.run.mode == Mode::Realtime)
    }

    /// Name, mode and end of the flight.
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
        let read = |run: &PathBuf| -> anyhow::Result<(Recorded, Course)> {
            let mut course = None;
            let recorded = Recorded::read_each(run, Part::ALL, |scenario, record| {
                course.get_or_insert_with(|| Course::new(scenario)).observe(record);
            })?;
            let mut course = course.unwrap_or_else(|| Course::new(&recorded.scenario));
            course.finish();
            Ok((recorded, course))
        };
        let read = runs.iter().map(read).collect::<anyhow::Result<Vec<_>>>()?;
        let place = |(recorded, _): &(Recorded, Course)| -> anyhow::Result<Place> {
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
        let flight = |((recorded, course), title): ((Recorded, Course), String)| {
            let scenario = recorded.flown();
            Flight { title, recorded, course, scenario }
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
        let of_flights: Vec<_> =
            self.flights.iter().map(|flight| (&flight.scenario, flight.recorded.summary.metrics())).collect();
        let what = ["flight", "mode", "Hz", "flown [s]", "ended", "folder", "flown by"];
        let differences = settings::differences(&scenarios);
        let told = if differences.is_empty() { "Settings: all are the same" } else { "Settings that differ" };
        vec![
            Table::new("Flights", &what, self.flights.iter().map(Flight::cells).collect()),
            Table::new(told, &headings("setting", &titles), differences),
            metrics(&titles, &of_flights),
            self.timing(),
        ]
    }

    /// Wake-up and response of every node, deadlines missed, and the age at the actuator.
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
        Table::new(told, &headings("", &self.titles()), rows)
    }

    /// Text for people: what the logs lack, then the tables.
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
            .chain([format!(
                "<section><h2>The flights over each other</h2><p class=\"hint\">True motion. World axes are north, east, down; \
                 body axes forward, right, down.</p>{}</section>",
                self.pictures().concat()
            )])
            .collect();
        draw::page(&title, STYLE, &body)
    }

    fn pictures(&self) -> Vec<String> {
        // Equal missions are drawn once, from the longest flight.
        let mut missions: Vec<&Flight> = vec![];
        for flight in &self.flights {
            match missions.iter_mut().find(|known| known.scenario.mission == flight.scenario.mission) {
                Some(known) if known.course.end_s < flight.course.end_s => *known = flight,
                Some(_) => {}
                None => missions.push(flight),
            }
        }
        let names: Vec<String> = match missions.as_slice() {
            [_] => vec!["mission".into()],
            several => several.iter().map(|flight| format!("mission of {}", flight.title)).collect(),
        };
        let picture = |(i, (title, _, axis)): (usize, Picture)| {
            let of_flight =
                |flight: &Flight| (flight.title.clone(), points(&flight.course.quantities[i], &flight.scenario));
            let wanted = |axis: usize| {
                let missions = missions.iter().zip(&names);
                missions
                    .map(move |(flight, name)| (name.clone(), points(&flight.course.wanted[axis], &flight.scenario)))
            };
            let lines: Vec<(String, Vec<(f64, f64)>)> =
                self.flights.iter().map(of_flight).chain(axis.into_iter().flat_map(wanted)).collect();
            let lines: Vec<Line> = lines.iter().map(|(name, points)| Line { name, points: points.clone() }).collect();
            draw::lines(&lines, "time [s]", title)
        };
        PICTURES.into_iter().enumerate().map(picture).collect()
    }
}

/// The 50th and 99th percentile and the maximum \[us\].
fn three(histogram: &Histogram<u64>) -> String {
    if histogram.is_empty() {
        return "-".into();
    }
    let p = percentiles(histogram);
    [p.p50_us, p.p99_us, p.max_us].map(|us| format!("{us:.0}")).join(" / ")
}

/// The name of a flight, and the path of its log.
type Place = (String, PathBuf);

/// Titles of flights: their names, with the folder where another has the same name, or the whole path where that does
/// not tell them apart either.
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
