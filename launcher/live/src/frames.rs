//! Frames of the page, and their sources: the columns of the report, its timing, its happenings.

use contract::topic::{NODES, Topic};
use flight::event::{Event, TimedEvent, name};
use flight::log::Record;
use guidance::Trajectory;
use outcome::happenings::Happenings;
use outcome::percentiles::Percentiles;
use outcome::summary::Summary;
use outcome::ticks::{Joined, LoggedTick};
use outcome::timing::Age;
use plant::air::Air;
use serde_json::{Map, Value, json};
use settings::{FaultTarget, Mode, Scenario};
use view::report::columns::{DerivedSources, lines, names, values};

/// Largest number of rows of the plots per second; every n-th tick is shown.
const ROWS_HZ: u32 = 20;
/// Divisor of the rate: a tick stays open for late messages for 1/20 s, but for at least two ticks.
const OPEN_PER_S: u32 = 20;
/// Number of segments of the drawn course of the mission.
const COURSE_POINTS: u32 = 400;
/// Columns besides those of the report: the age at the actuator, and the mean wind.
const MORE: [&str; 4] = ["age_ms", "mean_wind_north", "mean_wind_east", "mean_wind_down"];
/// Number of worst ticks that are shown.
const WORST: usize = 5;
/// Factor for rounding: a number on the page has five decimal places.
const DIGITS: f64 = 1e5;

/// Flight as it is known so far.
pub struct Frames {
    scenario: Scenario,
    summary: Summary,
    /// `None` before the first message.
    joined: Option<Joined>,
    age: Age,
    age_ms: f64,
    derived: DerivedSources,
    wind: Air,
    events: Vec<TimedEvent>,
    rows: Vec<PlotRow>,
}

/// Row of the plots.
pub struct PlotRow {
    pub time_s: f64,
    /// Time and columns, a JSON array.
    pub json: String,
}

impl Frames {
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            scenario: scenario.clone(),
            summary: Summary::new(scenario),
            joined: None,
            age: Age::new(scenario.sample_ns()),
            age_ms: f64::NAN,
            derived: DerivedSources::new(scenario),
            wind: Air::new(scenario),
            events: vec![],
            rows: vec![],
        }
    }

    /// Takes in a message.
    pub fn observe(&mut self, record: &Record) {
        self.summary.observe(record);
        if !record.is_intact() {
            return;
        }
        let (rate_hz, first) = (self.scenario.run.rate_hz, record.tick());
        let open = u64::from(rate_hz / OPEN_PER_S).max(2);
        let mut joined = self.joined.take().unwrap_or_else(|| Joined::live(&self.scenario, first, open));
        joined.observe(record, |tick| self.add_row(tick));
        self.joined = Some(joined);
    }

    /// Adds the rows of all open ticks, because no message follows.
    pub fn finish(&mut self) {
        if let Some(mut joined) = self.joined.take() {
            joined.finish(|tick| self.add_row(tick));
        }
    }

    fn add_row(&mut self, tick: &LoggedTick) {
        if let Some(state) = &tick.of.state
            && let Some(ns) = self.age.observe(state).last()
        {
            self.age_ms = *ns as f64 / 1e6;
        }
        let values = values(tick, &mut self.derived); // for every tick, because some values are differences
        let every = u64::from((self.scenario.run.rate_hz / ROWS_HZ).max(1));
        if tick.number.is_multiple_of(every) {
            let json = row(tick, values, self.age_ms, &self.wind);
            self.rows.push(PlotRow { time_s: tick.time_s(), json });
        }
    }

    /// Takes in an event. A fault given or ended in flight becomes part of the scenario.
    pub fn note(&mut self, event: &TimedEvent) {
        if let Some((number, fault)) = event.event.fault.as_deref() {
            let faults = &mut self.scenario.fault;
            if let Some(known) = faults.get_mut(*number) {
                *known = *fault;
            } else if *number == faults.len() {
                faults.push(*fault);
            }
            self.wind.apply_fault(*number, fault);
            self.summary.faults.follow(&self.scenario.fault);
        }
        self.events.push(event.clone());
    }

    /// Returns the rows since the last call.
    pub fn rows(&mut self) -> Vec<PlotRow> {
        std::mem::take(&mut self.rows)
    }

    /// Returns the settings of the flight that the page needs.
    pub fn flight(&self) -> Value {
        let scenario = &self.scenario;
        let (run, vehicle) = (&scenario.run, scenario.flown_airframe());
        let trajectory = Trajectory::new(scenario);
        let at = |i: u32| trajectory.at(run.duration_s * f64::from(i) / f64::from(COURSE_POINTS)).position_m;
        json!({
            "name": scenario.name,
            "mode": run.mode,
            "profile": scenario.profile,
            "rate_hz": run.rate_hz,
            "duration_s": run.duration_s,
            "realtime": run.mode == Mode::Realtime,
            "columns": names().chain(MORE).collect::<Vec<_>>(),
            "lines": lines(scenario),
            "hubs_m": [
                [vehicle.l1_m, 0.0, 0.0],
                [-vehicle.l2_m, vehicle.l3_m, 0.0],
                [-vehicle.l2_m, -vehicle.l3_m, 0.0],
            ],
            "thrust_factor": vehicle.kf,
            "ground_down_m": scenario.plant.height_zero_m(),
            "weight_n": vehicle.mass_kg * vehicle.g_mps2,
            "course_m": (0..=COURSE_POINTS).map(at).collect::<Vec<_>>(),
            "topics": Topic::ALL.map(Topic::name),
            "deadlines_ms": Topic::ALL.map(|topic| scenario.deadline_of(topic as usize).deadline_ns as f64 / 1e6),
            "faults": faults(),
            "swaps": Topic::OF_CONTROLLERS.map(Topic::publisher),
        })
    }

    /// Returns the faults and events of the flight so far.
    pub fn happenings(&self) -> Happenings {
        let events: Vec<Event> = self.events.iter().map(|timed| timed.event.clone()).collect();
        Happenings::new(&self.summary.faults.records(&events), &self.events)
    }

    /// Returns the timing of the nodes with the worst ticks and their causes among what `happened`.
    pub fn timing(&self, happened: &Happenings) -> Value {
        let metrics = self.summary.metrics();
        let errors_m = [metrics.final_position_error_m, metrics.rms_position_error_m, metrics.max_position_error_m];
        let of = |p: &Percentiles| [p.p50_us, p.p99_us, p.max_us].map(round);
        let timing = self.summary.timing.as_ref().map_or(Value::Null, |timing| {
            let record = timing.record(happened);
            let node = |name: &str| {
                let node = record.nodes.get(name)?;
                let figures = [node.wake(), node.execution.as_ref(), node.response.as_ref()];
                Some(json!({
                    "node": name,
                    "deadline_ms": node.deadline_ms,
                    "misses": node.counts.misses,
                    "late": node.counts.late,
                    "slips": node.counts.slips,
                    "figures_us": figures.map(|p| p.map(of)),
                }))
            };
            let worst = record.worst_ticks.iter().take(WORST).map(|tick| {
                json!({
                    "time_s": tick.time_s, "late_ms": round(tick.late_us / 1e3), "node": tick.node,
                    "cause": tick.cause, "in_words": tick.in_words, "known": tick.known,
                })
            });
            let age_us = of(&record.age_at_actuator);
            json!({
                "nodes": NODES.iter().filter_map(|name| node(name)).collect::<Vec<_>>(),
                "age_us": age_us,
                "worst": worst.collect::<Vec<_>>(),
            })
        });
        json!({
            "timing": timing,
            "time_s": self.summary.time_s(),
            "vehicle": self.summary.status().describe(),
            "error_m": errors_m.map(round),
            "seen_none_of": self.summary.missed,
        })
    }
}

/// Returns the kinds of fault that can be given in flight, by target.
fn faults() -> Map<String, Value> {
    let kinds = |target: FaultTarget| target.kinds_in_flight().map(name).collect::<Vec<_>>();
    let all = FaultTarget::ALL.iter().map(|(target, name)| ((*name).to_owned(), kinds(*target)));
    all.filter(|(_, kinds)| !kinds.is_empty()).map(|(name, kinds)| (name, json!(kinds))).collect()
}

/// Makes the row of a tick: time, columns of the report, and [`MORE`]. Unknown values are null.
fn row(tick: &LoggedTick, values: Vec<f64>, age_ms: f64, wind: &Air) -> String {
    let down_m = tick.of.truth.map_or(0.0, |truth| truth.actual.position_m[2]);
    let wind_mps = wind.mean_wind_mps(tick.number.saturating_mul(tick.period_ns), down_m);
    let all = [tick.time_s()].into_iter().chain(values).chain([age_ms]).chain(wind_mps);
    json!(all.map(round).collect::<Vec<_>>()).to_string()
}

/// Rounds to the decimal places of the page; NaN and infinities become null in JSON.
fn round(value: f64) -> f64 {
    (value * DIGITS).round() / DIGITS
}

#[cfg(test)]
mod tests {
    use flight::guarded;
    use settings::SensorPreset;

    use super::*;

    /// Flies in process, and returns the frames of the flight.
    fn flown(settings: impl FnOnce(&mut Scenario)) -> Frames {
        let mut scenario = Scenario::default();
        scenario.run.mode = Mode::Inprocess;
        scenario.run.duration_s = 2.0;
        settings(&mut scenario);
        let mut frames = Frames::new(&scenario);
        let watch = |record: &Record| {
            frames.observe(record);
            true
        };
        guarded::fly(&scenario, true, watch, |_| {}).unwrap();
        frames
    }

    #[test]
    fn a_row_has_a_value_for_every_column_twenty_times_a_second() {
        let mut frames = flown(|scenario| {
            scenario.plant.wind_ned_mps = vec![(1.0, [2.0, 0.0, 0.0])];
            scenario.plant.sensors = SensorPreset::Typical.into();
        });
        let columns = frames.flight()["columns"].as_array().unwrap().len();
        frames.finish();
        let rows = frames.rows();
        let rows: Vec<Vec<Option<f64>>> = rows.iter().map(|row| serde_json::from_str(&row.json).unwrap()).collect();
        assert!((40..=41).contains(&rows.len()), "{}", rows.len());
        assert!(rows.iter().all(|row| row.len() == 1 + columns));
        let times: Vec<f64> = rows.iter().filter_map(|row| row[0]).collect();
        assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 0.05).abs() < 1e-9), "{times:?}");
        let wind = |row: &[Option<f64>]| row[1 + columns - 3];
        assert_eq!((wind(&rows[0]), wind(&rows[30])), (Some(0.0), Some(2.0)));
        assert!(
            rows[10..40].iter().all(|row| row[..columns - 3].iter().all(Option::is_some)),
            "all is known in flight"
        );
        assert!(frames.rows().is_empty(), "each is told once");
    }

    #[test]
    fn a_fault_given_in_flight_belongs_to_the_flight() {
        let mut frames = Frames::new(&Scenario::default());
        let fault = settings::Fault {
            vector: Some([0.0, 3.0, 0.0]),
            ..settings::Fault::new(FaultTarget::Wind, settings::FaultKind::Step, 0.0, None)
        };
        let event =
            Event { fault: Some(Box::new((0, fault))), ..Event::new(3, "wind", 0, flight::event::What::Injected) };
        frames.note(&TimedEvent { at_s: 0.03, cold: false, event });
        assert_eq!(frames.wind.mean_wind_mps(1_000_000_000, 0.0), [0.0, 3.0, 0.0]);
        assert_eq!(frames.happenings().events[0].node, "wind");
    }

    #[test]
    fn the_page_offers_no_fault_that_the_launcher_refuses_in_flight() {
        let offered = faults();
        assert!(
            offered.contains_key("attitude-mpc") && !offered.contains_key("clock") && !offered.contains_key("host")
        );
        assert!(!json!(offered).to_string().contains("second-publisher"));
    }
}
