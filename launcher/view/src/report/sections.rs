//! The parts of the page that are text and tables. A dash stands for a value that the run does not have.

use contract::exit;
use flight::event::name;
use flight::log::LogOutcome;
use outcome::bounds::BoundCheck;
use outcome::metrics::Metrics;
use outcome::run_record::RunRecord;
use serde_json::json;
use settings::{Mode, Scenario, to_toml};

use super::claims;
use super::timing::in_short;
use crate::draw::{DASH, any, escape, leaves, list, number, table, verdict};

/// One metric as a page shows it.
pub struct ShownMetric {
    pub of: fn(&Metrics) -> f64,
    pub name: &'static str,
    pub unit: &'static str,
    pub decimals: usize,
}

const fn shown(of: fn(&Metrics) -> f64, name: &'static str, unit: &'static str, decimals: usize) -> ShownMetric {
    ShownMetric { of, name, unit, decimals }
}

/// Metrics of a flight. The first four are the key figures.
pub const METRICS: [ShownMetric; 13] = [
    shown(|m| m.max_position_error_m, "position error, maximum", "m", 3),
    shown(|m| m.rms_position_error_m, "position error, RMS", "m", 3),
    shown(|m| m.max_altitude_error_m, "altitude error, maximum", "m", 3),
    shown(|m| m.final_position_error_m, "position error, at the end", "m", 3),
    shown(|m| m.position_error_integral_ms, "position error, integral", "m s", 3),
    shown(|m| m.max_rate_radps, "body rate, maximum", "rad/s", 3),
    shown(|m| m.rotor_speed_min, "rotor speed, lowest", "", 1),
    shown(|m| m.rotor_speed_max, "rotor speed, highest", "", 1),
    shown(|m| m.tilt_max_deg, "tilt, largest", "deg", 2),
    shown(|m| m.demand_effort, "control effort, mean u'Ru", "", 3),
    shown(|m| m.fallback_s, "time without a demand at the mixer", "s", 2),
    shown(|m| m.commands_saturated as f64, "commands clipped at a limit", "", 0),
    shown(|m| m.negative_squares as f64, "commands that ask a rotor to pull down", "", 0),
];
const KEY_FIGURES: usize = 4;

/// Returns the verdict on the run: its style in the page, and one line for people.
pub fn result(run: &RunRecord) -> (&'static str, String) {
    if run.diverged {
        return ("bad", format!("diverged at {:.2} s", run.flown_s));
    }
    match run.exit_code {
        exit::PROCESS_LOST => ("bad", run.ended.clone()),
        exit::BUDGET_BROKEN => ("bad", "the timing budget was broken".into()),
        exit::INTERRUPTED => ("warn", format!("interrupted at {:.2} s", run.flown_s)),
        _ if run.bounds.iter().any(|bound| !bound.ok) => ("warn", "flown, outside its bounds".into()),
        exit::FLOWN => ("good", "flown".into()),
        _ => ("warn", run.ended.clone()),
    }
}

/// Returns the end of the flight by its record, without the words that `result` has already.
pub fn ended(run: &RunRecord, result: &str) -> String {
    escape(run.ended.strip_prefix(result).unwrap_or(&run.ended).trim_start_matches([':', ' ']))
}

/// Returns warnings for the page: on a damaged log, and the reservations of the verdict
/// ([`outcome::judge::Verdict::reservations`]).
pub fn warnings(run: &RunRecord) -> [String; 2] {
    let warning = |about: &str, words: &str| match words {
        "" => String::new(),
        words => format!("<p class=\"warn\">{about}: {}.</p>", escape(words)),
    };
    let defect = run.log.as_ref().and_then(|log| log.error.as_deref()).unwrap_or_default();
    [warning("The log is not whole", defect), warning("Note", &run.reservations.join("; "))]
}

/// Describes in one line which flight was flown, and how.
pub fn facts(run: &RunRecord, scenario: &Scenario) -> String {
    let facts = [
        ("trajectory", name(scenario.mission.trajectory)),
        ("profile", name(run.profile)),
        ("mode", name(run.mode)),
        ("flown", format!("{:.2} of {:.2} s", run.flown_s, run.duration_s)),
    ];
    let ground = run.ground.as_ref().map(|ground| ("at the end", escape(ground)));
    let all = facts.into_iter().chain(ground);
    all.fold(String::new(), |line, (name, value)| line + &format!("<span>{name} <b>{value}</b></span>"))
}

/// Key figures: errors of position and altitude, and the age at the actuator.
pub fn key_figures(run: &RunRecord) -> String {
    let tile = |name: &str, value: String, unit: &str| (name.to_owned(), format!("{value} <small>{unit}</small>"));
    let errors = METRICS[..KEY_FIGURES]
        .iter()
        .map(|ShownMetric { of, name, unit, decimals }| tile(name, number(of(&run.metrics), *decimals), unit));
    // An age is measured only in real time.
    let timing = run.timing.as_ref().filter(|_| run.mode == Mode::Realtime);
    let age_ms = timing.map(|timing| timing.age_at_actuator.p99_us / 1e3);
    list(errors.chain([tile("age at the actuator, p99", number(age_ms, 2), "ms")]))
}

/// Remaining metrics of the flight, its solver, its log and its speed.
pub fn metrics(run: &RunRecord) -> String {
    let solver = &run.solver;
    let measured = METRICS[KEY_FIGURES..].iter().map(|ShownMetric { of, name, unit, decimals }| {
        ((*name).to_owned(), format!("{} {unit}", number(of(&run.metrics), *decimals)))
    });
    let of_log = |of: fn(&LogOutcome) -> u64| run.log.as_ref().map_or(DASH.into(), |log| of(log).to_string());
    let more = [
        ("ticks on the explicit path", solver.explicit.to_string()),
        ("ticks on which a constraint was solved for", solver.solved.to_string()),
        ("solves stopped at a limit", solver.limit_reached.to_string()),
        ("solves that fell back", solver.fallback.to_string()),
        ("iterations, mean / maximum", format!("{} / {}", number(solver.iterations.mean, 1), solver.iterations.max)),
        ("time of a solve, p50 / p99 / maximum", format!("{} µs", in_short(solver.solve_us.as_ref()))),
        ("wall time", format!("{} s", number(run.speed.wall_s, 2))),
        ("times real time", number(run.speed.times_realtime, 1)),
        ("log records", of_log(|log| log.records)),
        ("log records dropped", of_log(|log| log.dropped)),
    ];
    let hash = run.state_hash.as_deref().filter(|_| repeats(run)).map(|hash| ("state hash", escape(hash)));
    let more = claims::following(&run.metrics).into_iter().chain(more).chain(hash);
    list(measured.chain(more.map(|(name, value)| (name.to_owned(), value))))
}

/// Hover of the vehicle and its control loops; a sentence if the record does not have them.
pub fn hover(run: &RunRecord) -> String {
    let Some(hover) = &run.hover else { return "<p>Not computed: there is no run.json.</p>".into() };
    list(hover.rows().into_iter().map(|(name, value)| (name.to_owned(), escape(&value))))
}

/// Returns whether another flight can have the same state hash: in real time only a replay can.
fn repeats(run: &RunRecord) -> bool {
    run.mode != Mode::Realtime || run.replays
}

pub fn repeat(run: &RunRecord) -> &'static str {
    match run.mode {
        Mode::Realtime if repeats(run) => {
            "In real time no two flights are alike. <code>trefoil replay RUN</code> flies this one again from its log, bit \
             for bit: compare the state hash."
        }
        Mode::Realtime => "In real time no two flights are alike; in lockstep and in process they are, bit for bit.",
        Mode::Lockstep | Mode::Inprocess => "Every repeat gives the same flight, bit for bit: compare the state hash.",
    }
}

/// Table of the flight's bounds. A bound that a shortened flight did not exceed is not judged.
pub fn bounds(run: &RunRecord) -> String {
    if run.bounds.is_empty() {
        return "<p>All bounds were lifted, or none could be judged.</p>".into();
    }
    let whole = !ended_early(run);
    let row = |bound: &BoundCheck| {
        let metric = escape(&bound.metric);
        let reached = whole || bound.metric != "final_position_error_m";
        let word = match bound.ok {
            _ if !reached => DASH.into(),
            false => verdict("exceeded"),
            true if whole => verdict("kept"),
            true => verdict("not judged"),
        };
        let measured = number(reached.then_some(bound.measured), 3);
        vec![format!("<code>{metric}</code>"), number(bound.limit, 3), measured, word]
    };
    let told = !whole && run.bounds.iter().any(|bound| bound.ok);
    let hint = "<p class=\"hint\">The flight ended early: what it had not exceeded until then is not judged.</p>";
    table(&["metric", "bound", "measured", "verdict"], run.bounds.iter().map(row)) + if told { hint } else { "" }
}

/// Returns whether the flight was shorter than its scenario.
fn ended_early(run: &RunRecord) -> bool {
    let stopped = matches!(run.exit_code, exit::PROCESS_LOST | exit::BUDGET_BROKEN | exit::INTERRUPTED);
    run.diverged || stopped && run.flown_s < run.duration_s - 0.001
}

/// Origin of the run, without its settings.
pub fn provenance(run: &RunRecord) -> String {
    let provenance = json!(run.provenance);
    let mut facts = Vec::new();
    leaves("", &provenance, &mut facts);
    let shown = facts.into_iter().filter(|(name, _)| name != "scenario");
    list(shown.map(|(name, value)| {
        let told = any(value);
        // A command or a path, which may break anywhere.
        let told = if told.contains('/') { format!("<code>{told}</code>") } else { told };
        (escape(&name.replace('_', " ")), told)
    }))
}

/// Returns the merged scenario as text: that of the record, or else `scenario`.
pub fn settings(run: &RunRecord, scenario: &Scenario) -> String {
    escape(&run.provenance.as_ref().map_or_else(|| to_toml(scenario), |provenance| provenance.scenario.clone()))
}
