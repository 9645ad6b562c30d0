//! The paper's claims about its simulation results, compared with a run.
//!
//! The paper makes its claims for one flight: the whole minute of the `survey` trajectory, flown by the paper's
//! controllers and vehicle in calm. For any other flight of that trajectory with the paper's profile the page has the
//! measured values, and a claim is `not applicable`. The page of another mission or profile has no claims.

use crate::draw::{DASH, escape, number, table, verdict};
use contract::message::Truth;
use outcome::metrics::Metrics;
use outcome::run_record::RunRecord;
use outcome::ticks::LoggedTick;
use settings::{Profile, Run, Scenario, TrajectoryKind};

/// Upper bound of the position error, exclusive \[m\].
pub const POSITION_M: f64 = 0.7;
/// Upper bound of the altitude error in horizontal flight, exclusive \[m\].
pub const ALTITUDE_HORIZONTAL_M: f64 = 0.1;
/// Upper bound of the altitude error in vertical flight, inclusive \[m\].
pub const ALTITUDE_VERTICAL_M: f64 = 0.2;
/// Times between which the flight is horizontal \[s\].
pub const HORIZONTAL_S: [f64; 2] = [10.0, 50.0];
pub const DURATION_S: f64 = 60.0;

/// One claim: its subject, the paper's bound, and what this flight shows of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Claim {
    pub what: &'static str,
    /// Bound in the paper, as HTML.
    pub paper: &'static str,
    pub measured: String,
    /// `true` if the claim holds; `None` if the claims are for another flight, the flight is incomplete, or nothing was
    /// measured.
    pub holds: Option<bool>,
}

/// Returns the section of the page; empty for a flight of another mission or profile than the paper's.
pub fn section(claims: &[Claim], metrics: &Metrics, scenario: &Scenario) -> String {
    if scenario.profile != Profile::Paper || scenario.mission.trajectory != TrajectoryKind::Survey {
        return String::new();
    }
    let cells = |claim: &Claim| {
        let word = match claim.holds {
            Some(true) => "holds",
            Some(false) => "does not hold",
            None => "not applicable",
        };
        vec![claim.what.into(), claim.paper.into(), escape(&claim.measured), verdict(word)]
    };
    let following: Vec<String> = following(metrics).map(|(name, value)| format!("{name} <b>{value}</b>")).into();
    format!(
        "<section id=\"claims\"><h2>The paper’s claims, and this run</h2><p>Section 5 of Prach and Kayacan claims these \
         for one flight: a minute of the <code>survey</code> trajectory, horizontal from 10 to 50 s.</p>{}<p>It also calls \
         the command following of the inner loop effective (figures 8 to 10) and gives no bound for that. Here it is: {}.\
         </p></section>",
        table(&["claim", "paper", "measured", "verdict"], claims.iter().map(cells)),
        following.join("; ")
    )
}

/// Returns whether the claims are made for this flight: every setting of vehicle, mission and controllers is the
/// paper's, including its sample time of 0.01 s, and nothing goes wrong. Name, mode, duration, seed, bounds,
/// scheduling, deadlines and supervision may differ.
pub fn concerns(scenario: &Scenario) -> bool {
    let Scenario { name, run, bounds, realtime, deadline, supervision, .. } = scenario.clone();
    let paper = Scenario::from(Profile::Paper);
    let Run { mode, duration_s, seed, .. } = run;
    let run = Run { mode, duration_s, seed, ..paper.run };
    *scenario == Scenario { name, run, bounds, realtime, deadline, supervision, ..paper }
}

/// Errors of the inner loop against its references: names and figures.
pub fn following(metrics: &Metrics) -> [(&'static str, String); 3] {
    let three = |errors: [f64; 3], unit: &str| format!("{} {unit}", errors.map(|error| number(error, 2)).join(" / "));
    [
        ("RMS error of φ, θ, ψ", three(metrics.rms_attitude_error_deg, "deg")),
        ("RMS error of p, q, r", three(metrics.rms_rates_error_dps, "deg/s")),
        ("RMS error of w", format!("{} m/s", number(metrics.rms_w_error_mps, 3))),
    ]
}

/// Extremes of altitude errors, states and actuators in a flight, gathered tick by tick.
#[derive(Debug, Clone)]
pub struct Reach {
    /// Largest angles \[deg\] and rates \[deg/s\]; `None` without a TRUTH.
    state: Option<[f64; 6]>,
    /// Lowest rotor speed, highest share of the limit, largest tilt \[rad\], of commands and positions.
    low: f64,
    share: f64,
    tilt_rad: f64,
    limits: airframe::ActuatorLimits,
    /// Largest altitude errors in the horizontal part of the paper's flight and in the rest \[m\]; NaN if not reached.
    pub altitude_m: [f64; 2],
}

impl Reach {
    pub fn new(scenario: &Scenario) -> Self {
        let limits = airframe::ActuatorLimits::new(&scenario.airframe, 0.0, 2.0, std::f64::consts::FRAC_PI_2);
        Self { state: None, low: f64::INFINITY, share: 0.0, tilt_rad: 0.0, limits, altitude_m: [f64::NAN; 2] }
    }

    /// Takes in the next tick.
    pub fn observe(&mut self, tick: &LoggedTick) {
        if let Some(Truth { actual, .. }) = &tick.of.truth {
            let ([phi, theta, psi], [p, q, r]) = (actual.attitude_rad, actual.rates_radps);
            let sizes = [phi, theta, psi, p, q, r].map(|x| x.abs().to_degrees());
            self.state = Some(self.state.map_or(sizes, |before| std::array::from_fn(|i| larger(before[i], sizes[i]))));
        }
        if let Some([_, _, down_m]) = tick.error_m {
            let [from, to] = HORIZONTAL_S;
            let part = &mut self.altitude_m[usize::from(!(from..=to).contains(&tick.time_s()))];
            *part = part.max(down_m.abs()); // `max` replaces NaN, the first value, by any number
        }
        let position = tick.of.truth.as_ref().map(|truth| &truth.actuators);
        let command = tick.of.actuators.as_ref().map(|actuators| &actuators.command);
        for actuation in position.into_iter().chain(command) {
            for (omega, max) in actuation.rotor_speed.into_iter().zip(self.limits.rotor_speed_max) {
                self.low = self.low.min(omega);
                self.share = self.share.max(omega / max);
            }
            self.tilt_rad = self.tilt_rad.max(actuation.tilt_rad.abs());
        }
    }
}

/// Judges a run by its record, and by the extremes of its ticks. Only the flight that the claims are made for is
/// judged, if it is complete or was lost.
pub fn judge(run: &RunRecord, reach: &Reach, scenario: &Scenario) -> [Claim; 5] {
    let lost = concerns(scenario) && run.diverged;
    let whole = run.flown_s > DURATION_S - 2.0 * scenario.sample_s();
    let judged = lost || (concerns(scenario) && whole);
    let error = |what, paper, value: f64, within: fn(f64) -> bool| {
        let holds = if lost { Some(false) } else { Some(within(value)).filter(|_| !value.is_nan()) };
        let unit = match (value.is_nan(), lost) {
            (true, _) => "",
            (false, true) => " m until the vehicle was lost",
            (false, false) => " m",
        };
        Claim { what, paper, measured: number(value, 3) + unit, holds: holds.filter(|_| judged) }
    };
    let [horizontal_m, vertical_m] = reach.altitude_m;
    [
        error("maximum position error", "below 0.7 m", run.metrics.max_position_error_m, |e| e < POSITION_M),
        error("altitude error, 10 to 50 s", "below 0.1 m", horizontal_m, |e| e < ALTITUDE_HORIZONTAL_M),
        error("altitude error in vertical flight", "not above 0.2 m", vertical_m, |e| e <= ALTITUDE_VERTICAL_M),
        states(reach, judged, scenario),
        actuators(reach, judged),
    ]
}

/// Claim on the states: the true angles and rates must lie strictly inside the limits.
fn states(reach: &Reach, judged: bool, scenario: &Scenario) -> Claim {
    let kept = reach.state.map(|sizes| {
        let limits = scenario.attitude.mpc.attitude_limit_deg.iter().chain(&scenario.attitude.mpc.rates_limit_dps);
        sizes.iter().zip(limits).all(|(size, limit)| size < limit)
    });
    let words = reach.state.map(|[phi, theta, psi, rates @ ..]| {
        let rate = rates.into_iter().fold(0.0, larger);
        format!("|φ| ≤ {phi:.1}°, |θ| ≤ {theta:.1}°, |ψ| ≤ {psi:.1}°, rates ≤ {rate:.0} °/s")
    });
    Claim {
        what: "state constraints (49) to (51)",
        paper: "|φ|,&nbsp;|θ|&nbsp;&lt;&nbsp;90°, |ψ|&nbsp;&lt;&nbsp;360°, |p|,&nbsp;|q|,&nbsp;|r|&nbsp;&lt;&nbsp;360&nbsp;°/s",
        measured: words.unwrap_or_else(|| DASH.to_owned()),
        holds: kept.filter(|_| judged),
    }
}

/// The larger of two numbers; NaN is larger than any.
fn larger(a: f64, b: f64) -> f64 {
    if a > b || a.is_nan() { a } else { b }
}

/// Claim on the actuators: commands and positions must lie strictly inside the limits; a command at its limit was
/// clipped.
fn actuators(reach: &Reach, judged: bool) -> Claim {
    let Reach { low, share, tilt_rad, limits, .. } = reach;
    let kept = *low > 0.0 && *share < 1.0 && *tilt_rad < limits.tilt_max_rad;
    let unmeasured = low.is_infinite();
    let extremes = format!("{low:.0} ≤ Ω ≤ {:.0} % of its limit, |μ| ≤ {:.1}°", 100.0 * share, tilt_rad.to_degrees());
    Claim {
        what: "actuator constraints (52), (53)",
        paper: "0&nbsp;&lt;&nbsp;Ω<sub>i</sub>&nbsp;&lt;&nbsp;2&nbsp;Ω<sub>i,trim</sub>, |μ|&nbsp;&lt;&nbsp;90°",
        measured: if unmeasured { DASH.to_owned() } else { extremes },
        holds: (!unmeasured && judged).then_some(kept),
    }
}
