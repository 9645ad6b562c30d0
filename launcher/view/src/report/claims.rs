//! The paper's claims about its simulation results, held against a run.
//!
//! They are made for one flight: the whole minute of the `survey` trajectory. Anything else is `not applicable`, and a page
//! on which none applies does not speak of them.

use contract::Scenario;
use contract::scenario::TrajectoryKind;
use serde_json::Value;

use super::flight::Row;
use super::html::{escape, number, table};
use super::sections;

/// The position error stays below this \[m\].
pub const POSITION_M: f64 = 0.7;
/// The altitude error stays below this in horizontal flight \[m\].
pub const ALTITUDE_HORIZONTAL_M: f64 = 0.1;
/// The altitude error does not exceed this in vertical flight \[m\].
pub const ALTITUDE_VERTICAL_M: f64 = 0.2;
/// When the flight is horizontal \[s\].
pub const HORIZONTAL_S: [f64; 2] = [10.0, 50.0];
/// How long the flight of the claims lasts \[s\].
pub const DURATION_S: f64 = 60.0;

/// What became of a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// This flight agrees.
    Holds,
    /// This flight contradicts it.
    DoesNotHold,
    /// Another trajectory, an incomplete flight, or nothing measured.
    NotApplicable,
}

/// One claim: what this flight shows of it, for people, and the verdict.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    /// With its unit.
    pub measured: String,
    /// See [`Verdict`].
    pub verdict: Verdict,
}

/// The four claims.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claims {
    /// Maximum position error.
    pub position: Claim,
    /// Altitude error in horizontal flight.
    pub altitude_horizontal: Claim,
    /// Altitude error in vertical flight.
    pub altitude_vertical: Claim,
    /// Hard constraints of the actuators.
    pub actuators: Claim,
}

impl Claims {
    /// The section of the page, and its entry in the list of sections; both empty where none applies.
    pub fn section(&self) -> (String, &'static str) {
        let rows = [
            ("maximum position error", "below 0.7 m", &self.position),
            ("altitude error, 10 to 50 s", "below 0.1 m", &self.altitude_horizontal),
            ("altitude error in vertical flight", "not above 0.2 m", &self.altitude_vertical),
            (
                "actuator constraints (52), (53)",
                "0&nbsp;&lt;&nbsp;Ω<sub>i</sub>&nbsp;&lt;&nbsp;2&nbsp;Ω<sub>i,trim</sub>, |μ|&nbsp;&lt;&nbsp;90°",
                &self.actuators,
            ),
        ];
        if rows.iter().all(|(_, _, claim)| claim.verdict == Verdict::NotApplicable) {
            return (String::new(), "");
        }
        let cells = |(what, paper, claim): (&str, &str, &Claim)| {
            vec![what.into(), paper.into(), escape(&claim.measured), sections::verdict(claim.verdict.describe())]
        };
        let html = format!(
            "<section id=\"claims\"><h2>The paper’s claims, and this run</h2><p>Section 5 of Prach and Kayacan claims these \
             for one flight: a minute of the <code>survey</code> trajectory, horizontal from 10 to 50 s.</p>{}</section>",
            table(&["claim", "paper", "measured", "verdict"], rows.map(cells))
        );
        (html, "<a href=\"#claims\">Claims</a>")
    }
}

/// Whether the claims are about this scenario's trajectory.
pub fn concerns(scenario: &Scenario) -> bool {
    scenario.mission.trajectory == TrajectoryKind::Survey
}

/// A metric of the run, or nothing where its part of the flight was never flown.
pub fn metric<'a>(run: &'a Value, name: &str) -> &'a Value {
    if never_flown(run, name) { &Value::Null } else { &run["metrics"][name] }
}

/// Whether the run ended before this metric began: a maximum over nothing is not a measured zero.
pub fn never_flown(run: &Value, metric: &str) -> bool {
    let before_horizontal = run["flown_s"].as_f64().is_some_and(|flown_s| flown_s < HORIZONTAL_S[0]);
    before_horizontal && metric == "max_altitude_error_horizontal_m"
}

/// Judges a run by its summary, and by its rows for the actuators.
pub fn judge(run: &Value, rows: &[Row], scenario: &Scenario) -> Claims {
    let flight = Extent::of(run, scenario);
    let error = |name: &str, within: fn(f64) -> bool| {
        let value = metric(run, name);
        let verdict = match flight {
            Extent::Other => Verdict::NotApplicable,
            Extent::Lost => Verdict::DoesNotHold,
            Extent::Whole => value.as_f64().map_or(Verdict::NotApplicable, |e| verdict(within(e))),
        };
        let unit = match flight {
            _ if value.is_null() => "",
            Extent::Lost => " m until the vehicle was lost",
            Extent::Whole | Extent::Other => " m",
        };
        Claim { measured: number(value, 3) + unit, verdict }
    };
    Claims {
        position: error("max_position_error_m", |e| e < POSITION_M),
        altitude_horizontal: error("max_altitude_error_horizontal_m", |e| e < ALTITUDE_HORIZONTAL_M),
        altitude_vertical: error("max_altitude_error_vertical_m", |e| e <= ALTITUDE_VERTICAL_M),
        actuators: actuators(rows, flight, scenario),
    }
}

impl Verdict {
    /// For people.
    pub fn describe(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::DoesNotHold => "does not hold",
            Self::NotApplicable => "not applicable",
        }
    }
}

/// How much of the flight of the claims this run is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Extent {
    /// All of it.
    Whole,
    /// The vehicle was lost on the way.
    Lost,
    /// Another flight, or an unfinished one.
    Other,
}

impl Extent {
    fn of(run: &Value, scenario: &Scenario) -> Self {
        let flown_s = run["flown_s"].as_f64().unwrap_or(0.0);
        if !concerns(scenario) {
            Self::Other
        } else if run["diverged"].as_bool() == Some(true) {
            Self::Lost
        } else if flown_s > DURATION_S - 2.0 * scenario.sample_s() {
            Self::Whole
        } else {
            Self::Other
        }
    }
}

/// Commands and positions both must lie strictly inside: a command at its limit is one that was clipped.
fn actuators(rows: &[Row], flight: Extent, scenario: &Scenario) -> Claim {
    let limits = airframe::Limits::new(&scenario.airframe, 0.0, 2.0, std::f64::consts::FRAC_PI_2);
    let positions = rows.iter().filter_map(|row| Some(row.state?.actuators));
    let commands = rows.iter().filter_map(|row| Some(row.actuators?.command));
    let (mut low, mut share, mut tilt) = (f64::INFINITY, 0.0_f64, 0.0_f64);
    for actuation in positions.chain(commands) {
        for (omega, max) in actuation.rotor_speed.into_iter().zip(limits.rotor_speed_max) {
            low = low.min(omega);
            share = share.max(omega / max);
        }
        tilt = tilt.max(actuation.tilt_rad.abs());
    }
    if low.is_infinite() {
        return Claim { measured: number(&Value::Null, 0), verdict: Verdict::NotApplicable };
    }
    let kept = low > 0.0 && share < 1.0 && tilt < limits.tilt_max_rad;
    let measured = format!("{low:.0} ≤ Ω ≤ {:.0} % of its limit, |μ| ≤ {:.1}°", 100.0 * share, tilt.to_degrees());
    Claim { measured, verdict: if flight == Extent::Other { Verdict::NotApplicable } else { verdict(kept) } }
}

fn verdict(holds: bool) -> Verdict {
    if holds { Verdict::Holds } else { Verdict::DoesNotHold }
}
