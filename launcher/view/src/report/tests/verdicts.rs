//! What the page claims of a flight, and what it does not.

use super::*;

#[test]
fn a_flight_that_ended_early_has_kept_no_bound() {
    let bound = |metric: &str, ok: bool| json!({ "metric": metric, "limit": 0.5, "measured": 0.2, "ok": ok });
    let mut run = survey();
    run["bounds"] = json!([bound("max_position_error_m", true), bound("max_altitude_error_vertical_m", false)]);
    assert!(super::super::sections::bounds(&run).contains("kept"));
    for (key, value) in [("exit_code", json!(130)), ("exit_code", json!(3)), ("diverged", json!(true))] {
        let mut early = run.clone();
        (early["flown_s"], early[key]) = (5.85.into(), value);
        let told = super::super::sections::bounds(&early);
        assert!(!told.contains("kept") && told.contains("not judged") && told.contains("exceeded"), "{told}");
    }
}

#[test]
fn the_hash_of_a_flight_in_real_time_is_not_shown() {
    let mut run = survey();
    run["state_hash"] = "0123abcd".into();
    for (mode, shown) in [("realtime", false), ("lockstep", true)] {
        run["mode"] = mode.into();
        assert_eq!(super::super::sections::metrics(&run).contains("0123abcd"), shown, "{mode}");
    }
}

#[test]
fn what_is_missing_of_the_log_is_told_at_the_top() {
    let mut run = survey();
    run["log"] = json!({ "records": 7, "dropped": 3, "error": "flight.2.mcap is missing" });
    let page = render(&hover(1), &run, &hovering());
    assert!(page.contains("The log is not whole: flight.2.mcap is missing."));
}

#[test]
fn claims_hold_up_to_their_bound_and_not_beyond() {
    let (log, scenario) = (hover(6001), Scenario::of(Profile::Paper));
    assert_eq!(verdicts(&claims(&log, &survey(), &scenario)), [Some(true); 4]);
    let page = render(&log, &survey(), &scenario);
    assert!(page.contains("href=\"#claims\"") && page.contains("<dt>altitude error, 10 to 50 s</dt>"));
    let mut run = survey();
    run["metrics"] = json!({
        "max_position_error_m": 0.7,
        "max_altitude_error_horizontal_m": 0.1,
        "max_altitude_error_vertical_m": 0.201,
    });
    assert_eq!(verdicts(&claims(&log, &run, &scenario)), [Some(false), Some(false), Some(false), Some(true)]);
}

#[test]
fn a_command_at_its_limit_breaks_the_constraint_claim() {
    let scenario = Scenario::from(Profile::Paper);
    let limits = scenario.limits();
    let at_limit = [
        ActuationMsg { rotor_speed: [limits.rotor_speed_max[0], 1338.0, 1338.0], tilt_rad: 0.5 },
        ActuationMsg { rotor_speed: [1441.0, 1338.0, 0.0], tilt_rad: 0.5 },
        ActuationMsg { rotor_speed: [1441.0, 1338.0, 1338.0], tilt_rad: -limits.tilt_max_rad },
    ];
    for command in at_limit {
        let mut log = hover(100);
        log.actuators[50] = at(50, Actuators { command, ..Actuators::default() });
        assert_eq!(claims(&log, &survey(), &scenario)[3].holds, Some(false), "{command:?}");
    }
}

#[test]
fn a_lost_vehicle_contradicts_every_tracking_claim() {
    let mut run = survey();
    run["diverged"] = true.into();
    run["flown_s"] = 5.8.into();
    let claims = claims(&hover(580), &run, &Scenario::of(Profile::Paper));
    assert_eq!(verdicts(&claims)[..3], [Some(false); 3]);
    assert!(claims[0].measured.contains("lost"));
    // The summary's maximum over an empty stretch of time is not a measurement.
    assert_eq!(claims[1].measured, crate::draw::DASH);
    run["bounds"] = json!([{ "metric": "max_altitude_error_horizontal_m", "limit": 0.1, "measured": 0.0, "ok": true }]);
    assert!(!super::super::sections::bounds(&run).contains("kept"));
}

#[test]
fn other_flights_are_not_judged() {
    let log = hover(3000);
    let mut scenario = Scenario::from(Profile::Paper);
    let mut interrupted = survey();
    interrupted["flown_s"] = 30.0.into();
    assert_eq!(verdicts(&claims(&log, &interrupted, &scenario)), [None; 4]);
    scenario.mission.trajectory = TrajectoryKind::Circle;
    assert_eq!(verdicts(&claims(&log, &survey(), &scenario)), [None; 4]);
    let page = render(&log, &survey(), &scenario);
    assert!(!page.contains("id=\"claims\"") && !page.contains("#claims") && !page.contains("not applicable"));
    assert!(page.contains("<dt>altitude error, maximum</dt>") && !page.contains("<dt>altitude error, 10 to 50 s</dt>"));
    assert!(!data(&page)["lines"]["error"].to_string().contains("paper"));
}
