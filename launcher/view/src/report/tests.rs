//! Whole pages, from invented flights.

use contract::Scenario;
use contract::message::{ActuationMsg, Actuators, Controls, Message, Reference, State};
use contract::scenario::{Profile, TrajectoryKind};
use serde_json::{Value, json};

use super::claims::{Claim, judge};
use super::{TEMPLATE, render};
use crate::ticks::logged;
use flight::log::Log;

mod faults;
mod timing;
mod verdicts;

/// A hover with its reference, tick by tick.
fn hover(ticks: u64) -> Log {
    let command = ActuationMsg { rotor_speed: [1441.0, 1338.0, 1338.0], tilt_rad: 0.5 };
    let mut log = Log::default();
    for tick in 0..ticks {
        log.states.push(at(tick, State { actuators: command, ..State::default() }));
        log.references.push(at(tick, Reference { position_m: [0.0, 3.0, 4.0], ..Reference::default() }));
        log.controls.push(at(tick, Controls::default()));
        log.actuators.push(at(tick, Actuators { command, ..Actuators::default() }));
    }
    log
}

fn claims(log: &Log, run: &Value, scenario: &Scenario) -> [Claim; 4] {
    judge(run, &logged(log, scenario), scenario)
}

fn at<M: Message>(tick: u64, mut message: M) -> M {
    let stamp = message.stamp_mut();
    (stamp.tick, stamp.sequence, stamp.epoch) = (tick, tick.saturating_add(1), 1);
    message.with_checksum()
}

/// A mission that wants the vehicle where it starts.
fn hovering() -> Scenario {
    let mut scenario = Scenario::from(Profile::Paper);
    scenario.mission.trajectory = TrajectoryKind::Hover;
    scenario
}

/// A summary in which every claim holds, by a little.
fn survey() -> Value {
    json!({
        "name": "survey", "diverged": false, "exit_code": 0, "duration_s": 60.0, "flown_s": 60.0,
        "metrics": {
            "max_position_error_m": 0.699,
            "max_altitude_error_horizontal_m": 0.099,
            "max_altitude_error_vertical_m": 0.2,
        },
    })
}

fn verdicts(claims: &[Claim; 4]) -> [Option<bool>; 4] {
    claims.each_ref().map(|claim| claim.holds)
}

/// The page without the headings that cells bear for narrow pages.
fn unlabelled(page: &str) -> String {
    let mut parts = page.split("<td data-label=\"");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |text, part| text + "<td>" + part.split_once("\">").map_or(part, |(_, rest)| rest))
}

/// The script's input, as it stands in the page.
fn data(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"flight\">").expect("the page has a data element");
    let (text, _) = rest.split_once("</script>").expect("the data element is closed");
    serde_json::from_str(text).expect("the data is JSON")
}

#[test]
fn an_empty_flight_and_an_empty_summary_are_still_a_page() {
    let nothing = Log::default();
    for run in [Value::Null, json!({}), json!({ "metrics": 3, "timing": { "nodes": [] }, "bounds": [null] })] {
        let page = render(&nothing, &run, &Scenario::from(Profile::Robust));
        assert!(page.ends_with("</html>\n"));
        assert!(page.contains("result unknown"));
        assert!(page.contains("profile = &quot;robust&quot;"), "the flight can be repeated from its page");
        assert_eq!(data(&page)["rows"], 0);
    }
}

#[test]
fn every_slot_of_the_template_is_filled() {
    let page = render(&hover(2), &survey(), &Scenario::from(Profile::Paper));
    let slots: Vec<_> = TEMPLATE.split("{{").skip(1).filter_map(|part| part.split_once("}}")).collect();
    assert!(slots.len() > 15);
    for (slot, _) in slots {
        assert!(!page.contains(&format!("{{{{{slot}}}}}")), "{slot}");
    }
}

#[test]
fn a_value_that_looks_like_a_slot_is_text() {
    let mut run = survey();
    run["name"] = "{{data}}".into();
    let page = render(&hover(2), &run, &Scenario::from(Profile::Paper));
    assert!(page.contains("<h1>{{data}}</h1>"));
}

#[test]
fn text_of_the_summary_cannot_become_markup() {
    let evil = "</script></pre><script>alert('x')</script>";
    let mut run = survey();
    for path in ["name", "mode", "profile", "ended", "state_hash"] {
        run[path] = evil.into();
    }
    run["provenance"] = json!({ "scenario": evil, "cpu": evil, evil: 1, "scheduling": { "policy": evil } });
    run["bounds"] = json!([{ "metric": evil, "limit": 1.0, "measured": 2.0, "ok": false }]);
    run["faults"] = json!([{ "target": evil, evil: evil }]);
    run["timing"] = json!({ "worst_ticks": [{ "in_words": evil, "node": evil, "tick": evil }] });
    let mut scenario = Scenario::from(Profile::Robust);
    scenario.name = evil.into();
    for run in [run, Value::Null] {
        let page = render(&hover(3), &run, &scenario);
        assert!(!page.contains("<script>alert"));
        assert!(page.contains("&lt;/script&gt;"));
    }
}

#[test]
fn a_hole_in_the_log_is_nan_at_its_tick() {
    let mut log = hover(10);
    log.states.remove(4);
    log.states.iter_mut().for_each(|state| {
        state.actual.position_m = [0.0, -3.0, -4.0];
        *state = state.with_checksum();
    });
    let scenario = hovering();
    let page = render(&log, &Value::Null, &scenario);
    assert_eq!(data(&page)["rows"], 10);
    // 5 m as f32, little-endian, is 00 00 a0 40: four of them, then NaN, 00 00 c0 7f.
    let error = data(&page)["columns"]["error"].as_str().map(str::to_owned).unwrap_or_default();
    assert!(error.starts_with("AACgQAAAoEAAAKBAAACgQAAAwH8AAKBA"), "{error}");
}

#[test]
fn a_minute_stays_below_a_megabyte_and_a_half_and_so_does_an_hour() {
    for ticks in [6001, 360_001] {
        let mut scenario = Scenario::from(Profile::Robust);
        scenario.run.duration_s = ticks as f64 * scenario.sample_s();
        let page = render(&hover(ticks), &survey(), &scenario);
        assert!(page.len() < 1_500_000, "{} bytes", page.len());
        let rows = data(&page)["rows"].as_u64();
        assert!(rows <= Some(6402) && rows >= Some(6001), "{rows:?}");
    }
}

#[test]
fn the_head_names_how_the_run_ended() {
    let scenario = Scenario::from(Profile::Robust);
    let head = |run: &Value| render(&hover(1), run, &scenario);
    let mut run = survey();
    run["ended"] = "flown to the end, 60.00 s".into();
    assert!(head(&run).contains("<p class=\"result good\">flown</p> <span class=\"ended\">to the end, 60.00 s</span>"));
    run["bounds"] = json!([{ "metric": "max_position_error_m", "limit": 0.5, "measured": 0.699, "ok": false }]);
    assert!(head(&run).contains("outside its bounds"));
    run["diverged"] = true.into();
    run["flown_s"] = 5.8.into();
    assert!(head(&run).contains("<p class=\"result bad\">diverged at 5.80 s</p>"));
}

#[test]
fn the_solver_and_the_faults_are_told_from_the_summary() {
    let scenario = Scenario::from(Profile::Robust);
    let mut run = survey();
    let page = render(&hover(1), &run, &scenario);
    assert!(page.contains("<dt>solves that fell back</dt><dd>–</dd>") && !page.contains("id=\"faults\""));
    run["solver"] = json!({
        "explicit": 5410, "solved": 590, "limit_reached": 1, "fallback": 2, "bad_input": 0,
        "iterations": { "max": 14, "mean": 6.25 }, "solve_us": { "p50_us": 91.2, "p99_us": 201.7, "max_us": 234.4 },
    });
    run["faults"] = json!([{
        "target": "mpc", "kind": "iteration-cap", "at_s": 2.0, "for_s": null,
        "injected_at_s": 2.0, "ended_at_s": null, "detected_after_s": 0.01, "recovered_after_s": null,
    }]);
    let page = unlabelled(&render(&hover(1), &run, &scenario));
    for told in [
        "<dt>ticks on which a constraint was solved for</dt><dd>590</dd>",
        "<dt>solves stopped at a limit</dt><dd>1</dd>",
        "<dt>iterations, mean / maximum</dt><dd>6.2 / 14</dd>",
        "<dt>time of a solve, p50 / p99 / maximum</dt><dd>91 / 202 / 234 µs</dd>",
        "<td>1</td><td>mpc</td><td>iteration-cap</td><td>2.00</td><td>the end</td><td>0.01</td><td>not recovered</td>",
    ] {
        assert!(page.contains(told), "{told}");
    }
}

#[test]
fn bounds_of_the_scenario_are_lines_in_the_figures() {
    let mut scenario = Scenario::from(Profile::Robust);
    scenario.bounds.max_position_error_m = Some(0.25);
    scenario.bounds.max_altitude_error_vertical_m = Some(0.15);
    let lines = data(&render(&hover(1), &Value::Null, &scenario))["lines"].clone();
    assert!(lines["error"].to_string().contains("0.25"));
    assert!(lines["error_z"].to_string().contains("-0.15"));
}
