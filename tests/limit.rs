//! `[limit]` of a campaign: each row is one search. Who flies it changes nothing, and `fly` gives the same flights.

use std::fs;
use std::path::Path;
use std::process::Output;

use campaign::table::FlightTable;

use crate::campaign::Place;
use crate::harness::fly;

/// Largest rolls from which two controllers catch the vehicle, at rest and at a speed that breaks the bound at any
/// roll. 360 degrees is not the limit, although it passes: smaller rolls fail.
const CAMPAIGN: &str = r#"
name = "limits"
samples = 3

[settings]
run.duration_s = 1.0
mission.trajectory = "hover"
bounds.max_position_error_m = 0.05

[limit]
key = "initial.attitude_deg.0"
from = 0
to = 360
resolution = 1
grid = 9

[vary]
plant.airframe.mass_kg = { uniform = [1.08, 1.12] }
initial.velocity_mps.0 = [0.0, 2.0]

[controller.robust]

[controller.pid]
attitude.law = "pid"

[[promise]]
figure = "{controller}: least roll"
controllers = ["robust"]
at = { "initial.velocity_mps.0" = 0.0 }
metric = "limit"
of = "min"
at_least = 5.0
"#;

fn check(output: &Output, code: i32, parts: &[&str]) -> String {
    let said = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    for part in parts {
        assert!(said.contains(part), "should say '{part}': {said}");
    }
    said
}

#[test]
fn the_table_of_searches_is_the_same_whatever_flies_it() {
    let place = Place::new(CAMPAIGN);
    let said = check(&place.fly_by(&[], &[], "here"), 0, &["limits: 12 searches", "ok            robust: least roll"]);
    for index in ["2", "0", "1"] {
        check(&place.fly_by(&["shard"], &["--index", index, "--of", "3"], "engine"), 0, &[]);
    }
    check(&place.fly_by(&[], &["--collect"], "engine"), 0, &[]);
    assert_eq!(place.table("engine"), place.table("here"), "in shards, in another order");
    check(&place.fly_by(&[], &["--shard", "2"], "again"), 0, &[]);
    fs::remove_file(place.at("again/shards/00001.parquet")).expect("a shard");
    check(&place.fly_by(&[], &[], "again"), 0, &["10 of 12 searches are there already"]);
    assert_eq!(place.table("again"), place.table("here"), "after a loss");

    let (table, _) = FlightTable::from_parquet(place.table("here"), 12).expect("the table");
    let number = |column: &str, row: usize| table.column(column).expect("a column").number(row);
    let text = |column: &str, row: usize| table.column(column).expect("a column").text(row);
    for row in (0..12).filter(|row| number("initial.velocity_mps.0", *row) == Some(0.0)) {
        let limit = number("limit", row).expect("a limit within");
        assert_eq!((text("limit_end", row), number("limit_fails_at", row)), ("within", Some(limit + 1.0)));
        assert_eq!((text("limit_islands", row), text("verdict", row)), ("360", "passed"), "a whole turn is none");
        let flights = number("limit_flights", row).expect("a number");
        assert!(limit < 45.0 && (14.0..=15.0).contains(&flights), "45 values are bisected: {said}");
    }
    for row in (0..12).filter(|row| number("initial.velocity_mps.0", *row) == Some(2.0)) {
        assert_eq!((text("limit_end", row), number("limit", row), text("verdict", row)), ("below", None, "failed"));
    }
    let page = fs::read_to_string(place.at("here/campaign.html")).expect("the page");
    for part in ["<h2>Limits</h2>", "<h3>Distribution</h3>", "fails at 0 °", "360 (3 draws)", "median limit"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<h2>Which controller passes more</h2>"));
}

#[test]
fn the_flights_at_a_limit_are_those_of_the_launcher() {
    let place = Place::new(CAMPAIGN);
    check(&place.fly_by(&[], &[], "out"), 0, &[]);
    let said = check(&place.fly_by(&[], &["--only", "0"], "out"), 0, &["flight 0 is the one of the table"]);
    let (table, _) = FlightTable::from_parquet(place.table("out"), 12).expect("the table");
    let number = |column: &str| table.column(column).expect("a column").number(0).expect("a number");
    let flown = |roll_deg: f64| {
        let settings = [
            "run.duration_s=1.0".into(),
            "mission.trajectory=\"hover\"".into(),
            "bounds.max_position_error_m=0.05".into(),
            format!("initial.attitude_deg=[{roll_deg:?}, 0.0, 0.0]"),
            format!("plant.airframe.mass_kg={:?}", number("plant.airframe.mass_kg")),
            format!("run.seed={}", number("run.seed")),
        ];
        let arguments = settings.iter().flat_map(|setting| ["--set", setting]);
        fly(&["--mode", "inprocess", "--no-log"].into_iter().chain(arguments).collect::<Vec<_>>())
    };
    let [at_limit, beyond] = [number("limit"), number("limit_fails_at")].map(flown);
    assert_eq!((at_limit.code(), beyond.code()), (Some(0), Some(1)), "{said}");
    assert_eq!(at_limit.run()["metrics"]["max_position_error_m"].as_f64(), Some(number("max_position_error_m")));
}

/// Searches one limit of a hover of half a second; returns the output of the command.
fn searched(settings: &str, limit: &str, arguments: &[&str], code: i32) -> String {
    let text = format!(
        "[settings]\nrun.duration_s = 0.5\nmission.trajectory = 'hover'\nbounds.max_position_error_m = 0.02\n{settings}\n[limit]\n{limit}\n"
    );
    check(&Place::new(&text).fly_by(&[], arguments, "out"), code, &[])
}

#[test]
fn a_limit_beyond_the_range_is_said() {
    let delay = "key = 'run.command_delay_ms'\nfrom = 0.0\nto = 2.0\nresolution = 1.0";
    assert!(searched("", delay, &[], 0).contains("2 ms or more"));
}

/// Profile paper flies the survey with every second CONTROLS and with every fourth, and is lost with every third.
#[test]
fn an_island_of_whole_numbers_is_printed_and_is_not_the_limit() {
    let place = Place::new(
        "[settings]\nprofile = 'paper'\nfault = [{ at_s = 0.0, for_s = 60.0, target = 'controls', kind = 'rate', count = 1 }]\n\
         [settings.bounds]\nfinal_position_error_m = 1.0\nmax_position_error_m = inf\nmax_fallback_s = inf\n\
         [limit]\nkey = 'fault.0.count'\nfrom = 1\nto = 4\nresolution = 1\n",
    );
    let said = check(&place.fly_by(&[], &[], "out"), 0, &["from 1 to 4 by 1"]);
    let row: Vec<&str> =
        said.lines().find(|line| line.starts_with("scenario")).expect("a row").split_whitespace().collect();
    assert_eq!(row, ["scenario", "1", "2", "-", "2", "4"], "one draw, median, interval, worst, islands: {said}");
}

#[test]
fn a_promise_on_limits_is_held_against_what_is_known() {
    let promised = |promise: &str| {
        let delay = "key = 'run.command_delay_ms'\nfrom = 0.0\nto = 2.0\nresolution = 1.0";
        format!("{delay}\n[[promise]]\nfigure = 'delay'\nmetric = 'limit'\nof = 'min'\nunit = 'ms'\n{promise}")
    };
    for (promise, code, verdict) in [
        ("at_least = 2.0", 0, "ok            delay"),
        ("at_least = 2.5", 0, "inconclusive  delay"),
        ("at_most = 1.0", 1, "short         delay"),
        ("at_most = 2.0", 0, "inconclusive  delay"),
    ] {
        let said = searched("", &promised(promise), &[], code);
        assert!(said.contains(verdict) && said.contains("or more: the range ends there"), "{promise}: {said}");
    }
}

/// Writes the run.json of a flight in lockstep, changed to say that it was flown in `mode` with known times.
fn realtime_run(folder: &Path, mode: &str) {
    let mut run = fly(&["--mode", "lockstep", "--no-log", "--set", "run.duration_s=0.1"]).run();
    run["mode"] = mode.into();
    let timing = &mut run["timing"];
    (timing["age_at_actuator"]["p50_us"], timing["age_at_actuator"]["p99_us"]) = (240.0.into(), 1350.0.into());
    let mixer = &mut timing["nodes"]["mixer"];
    (mixer["response"]["n"], mixer["misses"], mixer["slips"]) = (498.into(), 5.into(), 2.into());
    fs::write(folder.join("run.json"), run.to_string()).expect("can be written");
}

#[test]
fn a_flight_in_real_time_stands_beside_the_limits() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let observed = ["--observed", folder.path().to_str().expect("a plain path")];
    let limit = |key: &str, to: f64| format!("key = '{key}'\nfrom = 0.0\nto = {to:?}\nresolution = {to:?}");
    let missing = searched("", &limit("run.command_delay_ms", 2.0), &observed, 2);
    assert!(missing.contains("run.json; give the folder of a run with --observed"), "{missing}");
    realtime_run(folder.path(), "realtime");
    for (key, words) in [
        ("run.command_delay_ms", "Observed in real time: 1.35 ms, the 99th percentile of the age at the actuator."),
        ("run.command_jitter_ms", "Observed in real time: 1.11 ms, the 99th percentile less the median"),
        ("run.command_drop_probability", "Observed in real time: 0.01, the share of ticks on which the mixer missed"),
    ] {
        let said = searched("", &limit(key, 0.5), &observed, 0);
        assert!(said.contains(words) && said.contains("below "), "{said}");
    }
    let other = searched("", &limit("plant.rotor_lag_s", 0.5), &observed, 2);
    assert!(other.contains("shows nothing of `plant.rotor_lag_s`"), "{other}");
    realtime_run(folder.path(), "lockstep");
    let lockstep = searched("", &limit("run.command_delay_ms", 2.0), &observed, 2);
    assert!(lockstep.contains("lockstep") && lockstep.contains("--mode realtime"), "{lockstep}");
}

#[test]
fn a_limit_that_cannot_be_searched_is_refused_before_a_flight() {
    let delay = "key = 'run.command_delay_ms'\nfrom = 0.0\nto = 2.0\nresolution = 1.0\n";
    let iterations = "key = 'attitude.mpc.max_iterations'\nfrom = 1\nto = 2\nresolution = 0.5\n[controller.a]\nattitude.mpc.constraints = 'cone'";
    for (limit, part) in [
        ("key = 'run.command_delay'\nfrom = 0\nto = 2\nresolution = 1", "did you mean `run.command_delay_ms`?"),
        ("key = 'run.command_delay_ms'\nfrom = 0\nto = 2000\nresolution = 1", "`run.command_delay_ms` = 2000"),
        ("key = 'attitude.law'\nfrom = 0\nto = 2\nresolution = 1", "[limit] `attitude.law` = 0"),
        (iterations, "[limit] `attitude.mpc.max_iterations` = 1.5"),
        ("key = 'run.seed'\nfrom = 0\nto = 2\nresolution = 1", "`run.seed` has no safe end"),
        ("key = 'run.command_delay_ms'\nfrom = 0\nto = 2\nresolution = 3", "[limit]: `resolution` = 3"),
        (&format!("{delay}[vary]\nrun.command_delay_ms = [0.0, 1.0]"), "vary the same setting"),
        (&format!("{delay}[controller.a]\nrun.command_delay_ms = 1.0"), "stands in [controller.a] too"),
        (&format!("{delay}[controller.a]\n[controller.b]\n[compare]\nwith = 'a'\nmetrics = ['flown_s']"), "[compare]"),
        (
            &format!("{delay}[[promise]]\nfigure = 'x'\nmetric = 'limit'\nat_least = 1.0"),
            "\"min\", \"max\" or \"median\"",
        ),
        (
            &format!("{delay}[[promise]]\nfigure = 'x'\nmetric = 'limit'\nof = 'mean'\nat_least = 1.0"),
            "a limit beyond the range has no value",
        ),
    ] {
        let said = searched("", limit, &[], 2);
        assert!(said.contains(part), "{limit}: should say '{part}': {said}");
    }
    let place = Place::new("[vary]\nrun.command_delay_ms = [0.0, 1.0]\n");
    check(&place.fly_by(&[], &["--observed", "runs/none"], "out"), 2, &["the campaign has no [limit]"]);
}
