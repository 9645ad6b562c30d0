//! The parts of the page that are text and tables. Every value may be missing from the summary; then a dash stands
//! there.

use contract::Scenario;
use contract::scenario::{Mode, TrajectoryKind, to_toml};
use serde_json::{Value, json};

use super::claims;
use crate::draw::{DASH, any, escape, leaves, list, number, table, verdict};

/// Metrics of the summary: key, name for people, unit, decimals. The first five are the key figures.
pub const METRICS: [(&str, &str, &str, usize); 12] = [
    ("max_position_error_m", "position error, maximum", "m", 3),
    ("rms_position_error_m", "position error, RMS", "m", 3),
    ("max_altitude_error_horizontal_m", "altitude error, 10 to 50 s", "m", 3),
    ("max_altitude_error_vertical_m", "altitude error, otherwise", "m", 3),
    ("final_position_error_m", "position error, at the end", "m", 3),
    ("position_error_integral_ms", "position error, integral", "m s", 3),
    ("max_rate_radps", "body rate, maximum", "rad/s", 3),
    ("rotor_speed_min", "rotor speed, lowest", "", 1),
    ("rotor_speed_max", "rotor speed, highest", "", 1),
    ("tilt_max_deg", "tilt, largest", "deg", 2),
    ("commands_saturated", "commands clipped at a limit", "", 0),
    ("negative_squares", "roots of negative squares avoided", "", 0),
];
const KEY_FIGURES: usize = 5;

/// The verdict on the run: its style in the page, and one line for people.
pub fn result(run: &Value) -> (&'static str, String) {
    let exit_code = run["exit_code"].as_i64();
    let out_of_bounds = run["bounds"].as_array().is_some_and(|all| all.iter().any(|b| b["ok"] == Value::Bool(false)));
    if run["diverged"] == Value::Bool(true) {
        return ("bad", format!("diverged at {} s", number(&run["flown_s"], 2)));
    }
    let ended = run["ended"].as_str().unwrap_or("its end is unknown").to_owned();
    match exit_code {
        Some(3) => ("bad", ended),
        Some(4) => ("bad", "the timing budget was broken".into()),
        Some(130) => ("warn", format!("interrupted at {} s", number(&run["flown_s"], 2))),
        Some(0 | 1) | None if out_of_bounds => ("warn", "flown, outside its bounds".into()),
        Some(1) => ("warn", ended),
        Some(0) => ("good", "flown".into()),
        _ => ("warn", "result unknown".into()),
    }
}

/// Says what the summary tells of the end, beyond what `result` says already.
pub fn ended(run: &Value, result: &str) -> String {
    let words = run["ended"].as_str().unwrap_or_default();
    escape(words.strip_prefix(result).unwrap_or(words).trim_start_matches([':', ' ']))
}

/// Warns of what is missing of the log, and of what else a reader must know: see
/// [`outcome::judge::Verdict::reservations`].
pub fn warnings(run: &Value) -> [String; 2] {
    let warning = |about: &str, words: &str| match words {
        "" => String::new(),
        words => format!("<p class=\"warn\">{about}: {}.</p>", escape(words)),
    };
    let told: Vec<&str> = run["but"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    let defect = run["log"]["error"].as_str().unwrap_or_default();
    [warning("The log is not whole", defect), warning("Note", &told.join("; "))]
}

/// Says what was flown and how, on one line.
pub fn facts(run: &Value, scenario: &Scenario) -> String {
    let trajectory = format!("{:?}", scenario.mission.trajectory).to_lowercase();
    let duration = format!("{} of {} s", number(&run["flown_s"], 2), number(&run["duration_s"], 2));
    let facts = [
        ("trajectory", trajectory),
        ("profile", any(&run["profile"])),
        ("mode", any(&run["mode"])),
        ("flown", duration),
    ];
    // Without a ground the vehicle cannot land.
    let ground = run["ground"].is_string().then(|| ("at the end", any(&run["ground"])));
    let all = facts.into_iter().chain(ground);
    all.fold(String::new(), |line, (name, value)| line + &format!("<span>{name} <b>{value}</b></span>"))
}

/// Key figures: errors of position and altitude, and the age at the actuator.
pub fn key_figures(run: &Value, scenario: &Scenario) -> String {
    let tile = |name: &str, value: String, unit: &str| (name.to_owned(), format!("{value} <small>{unit}</small>"));
    // Only the survey is horizontal from 10 to 50 s.
    let altitude = |key: &str| key.starts_with("max_altitude_error");
    let survey = scenario.mission.trajectory == TrajectoryKind::Survey;
    let shown = METRICS[..KEY_FIGURES].iter().filter(|(key, ..)| survey || !altitude(key));
    let errors = shown.map(|(key, name, unit, decimals)| tile(name, number(claims::metric(run, key), *decimals), unit));
    let keys = ["max_altitude_error_horizontal_m", "max_altitude_error_vertical_m"];
    let highest = keys.iter().filter_map(|key| run["metrics"][*key].as_f64()).reduce(f64::max);
    let whole = (!survey).then(|| tile("altitude error, maximum", number(&json!(highest), 3), "m"));
    // Only in real time is an age measured.
    let age = if run["mode"] == "realtime" { &run["timing"]["age_at_actuator"]["p99_us"] } else { &Value::Null };
    let age_ms = age.as_f64().map_or(DASH.into(), |us| format!("{:.2}", us / 1e3));
    list(errors.chain(whole).chain([tile("age at the actuator, p99", age_ms, "ms")]))
}

pub fn metrics(run: &Value) -> String {
    let (solver, speed) = (&run["solver"], &run["speed"]);
    let iterations = &solver["iterations"];
    let solve_us = ["p50_us", "p99_us", "max_us"].map(|key| number(&solver["solve_us"][key], 0)).join(" / ");
    let measured = METRICS[KEY_FIGURES..].iter().map(|(key, name, unit, decimals)| {
        ((*name).to_owned(), format!("{} {unit}", number(claims::metric(run, key), *decimals)))
    });
    let more = [
        ("ticks on the explicit path", number(&solver["explicit"], 0)),
        ("ticks on which a constraint was solved for", number(&solver["solved"], 0)),
        ("solves stopped at a limit", number(&solver["limit_reached"], 0)),
        ("solves that fell back", number(&solver["fallback"], 0)),
        (
            "iterations, mean / maximum",
            format!("{} / {}", number(&iterations["mean"], 1), number(&iterations["max"], 0)),
        ),
        ("time of a solve, p50 / p99 / maximum", format!("{solve_us} µs")),
        ("wall time", format!("{} s", number(&speed["wall_s"], 2))),
        ("times real time", number(&speed["times_realtime"], 1)),
        ("log records", number(&run["log"]["records"], 0)),
        ("log records dropped", number(&run["log"]["dropped"], 0)),
    ];
    let hash = repeats(run).then(|| ("state hash", any(&run["state_hash"])));
    let more = claims::following(run).into_iter().chain(more).chain(hash);
    list(measured.chain(more.map(|(name, value)| (name.to_owned(), value))))
}

/// Returns whether anything gives the state hash of the flight again: in real time only a replay can.
fn repeats(run: &Value) -> bool {
    run["mode"] != "realtime" || run["replays"] == Value::Bool(true)
}

pub fn repeat(run: &Value, scenario: &Scenario) -> &'static str {
    match scenario.run.mode {
        Mode::Realtime if repeats(run) => {
            "In real time no two flights are alike. <code>launcher replay RUN</code> flies this one again from its log, bit \
             for bit: compare the state hash."
        }
        Mode::Realtime => "In real time no two flights are alike; in lockstep and in process they are, bit for bit.",
        Mode::Lockstep | Mode::Inprocess => "Every repeat gives the same flight, bit for bit: compare the state hash.",
    }
}

/// Table of the flight's bounds. A bound that a shortened flight did not exceed is not judged.
pub fn bounds(run: &Value) -> String {
    let Some(bounds) = run["bounds"].as_array().filter(|all| !all.is_empty()) else {
        return "<p>All bounds were lifted, or none could be judged.</p>".into();
    };
    let whole = !ended_early(run);
    let judged = |ok: &Value| match ok.as_bool() {
        Some(false) => verdict("exceeded"),
        Some(true) if whole => verdict("kept"),
        Some(true) => verdict("not judged"),
        None => DASH.into(),
    };
    let row = |b: &Value| {
        let metric = any(&b["metric"]);
        let flown = !claims::never_flown(run, &metric) && (whole || metric != "final_position_error_m");
        let [measured, ok] = if flown { [&b["measured"], &b["ok"]] } else { [&Value::Null; 2] };
        vec![format!("<code>{metric}</code>"), number(&b["limit"], 3), number(measured, 3), judged(ok)]
    };
    let told = !whole && bounds.iter().any(|bound| bound["ok"] != Value::Bool(false));
    let hint = "<p class=\"hint\">The flight ended early: what it had not exceeded until then is not judged.</p>";
    table(&["metric", "bound", "measured", "verdict"], bounds.iter().map(row)) + if told { hint } else { "" }
}

/// Returns whether the flight was shorter than its scenario.
fn ended_early(run: &Value) -> bool {
    let [flown_s, duration_s] = ["flown_s", "duration_s"].map(|key| run[key].as_f64().unwrap_or(0.0));
    let cut_short = matches!(run["exit_code"].as_i64(), Some(3 | 4 | 130)) && flown_s < duration_s - 0.001;
    cut_short || run["diverged"] == Value::Bool(true)
}

pub fn provenance(run: &Value) -> String {
    let mut facts = Vec::new();
    leaves("", &run["provenance"], &mut facts);
    let shown = facts.into_iter().filter(|(name, _)| name != "scenario" && !name.starts_with("scenario."));
    list(shown.map(|(name, value)| (escape(&name.replace('_', " ")), any(value))))
}

/// Returns the merged scenario as text: that of the summary, or else `scenario`.
pub fn settings(run: &Value, scenario: &Scenario) -> String {
    match &run["provenance"]["scenario"] {
        Value::Null => escape(&to_toml(scenario)),
        Value::String(toml) => escape(toml),
        other => escape(&serde_json::to_string_pretty(other).unwrap_or_default()),
    }
}
