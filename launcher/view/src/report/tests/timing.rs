//! The timing section, and the age beside the error.

use super::*;

#[test]
fn the_timing_of_nodes_is_told_and_drawn() {
    let mut log = hover(3);
    for state in &mut log.states {
        state.stamp.start_ns = 50_000;
        *state = state.with_checksum();
    }
    let mut run = survey();
    let node = json!({ "release_us": 0.0, "start_us": 50.0, "publish_us": 12_000.0, "slips": 0 });
    let us = |p50: f64| json!({ "n": 3, "p50_us": p50, "p99_us": 60.0, "max_us": 70.0 });
    run["timing"] = json!({
        "nodes": { "plant": { "jitter": us(50.0), "misses": 4, "late": 3, "slips": 1, "longest_run_of_misses": 2 } },
        "age_at_actuator": us(800.0),
        "worst_ticks": [{
            "tick": 2, "time_s": 0.02, "late_us": 12_000.0, "node": "plant", "part": "execution",
            "in_words": "plant: its own work", "position_error_m": 5.0, "nodes": { "plant": node },
        }],
    });
    let page = unlabelled(&render(&log, &run, &Scenario::from(Profile::Robust)));
    for told in [
        "<td>plant</td><td>–</td><td>–</td><td>4</td><td>3</td><td>1</td><td>2</td><td>50 / 60 / 70</td><td>– / – / –</td>",
        "<b>800 / 60 / 70</b> µs over 3 commands applied; <b>– / – / –</b> µs over – slots held",
        "aria-label=\"plant, release jitter: p50, p99, max 50 / 50 / 50 µs of 3 values\"",
        "<b>12.00 ms</b> tick 2, 0.02 s, position error 5.000&nbsp;m</p><p class=\"hint\">plant: its own work</p>",
        "<rect class=\"runs fault\"",
    ] {
        assert!(page.contains(told), "{told}");
    }
    assert!(!render(&log, &survey(), &Scenario::from(Profile::Robust)).contains("class=\"histogram\""));
}

#[test]
fn a_command_held_ages_slot_by_slot() {
    let mut log = hover(5);
    for state in &mut log.states {
        (state.applied_sequence, state.applied_age_ns) = if state.stamp.tick > 0 { (1, 500_000) } else { (0, 0) };
        *state = state.with_checksum();
    }
    let page = render(&log, &Value::Null, &Scenario::from(Profile::Robust));
    // NaN, then 0.5, 10.5, 20.5, 30.5 ms as f32.
    assert_eq!(data(&page)["columns"]["age_ms"], "AADAfwAAAD8AAChBAACkQQAA9EE=");
}
