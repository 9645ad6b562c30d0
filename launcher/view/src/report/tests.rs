//! Whole pages, from invented flights.

use std::collections::BTreeMap;

use contract::exit;
use contract::message::{ActuationMsg, Actuators, Controls, Message, Reference, State, Truth};
use flight::event::{Event, TimedEvent, What};
use flight::log::Log;
use flight::log::LogOutcome;
use flight::provenance::{Provenance, host, provenance};
use flight::stack::Ended;
use outcome::bounds::BoundCheck;
use outcome::faults::FaultRecord;
use outcome::judge::{Circumstances, Verdict};
use outcome::percentiles::Percentiles;
use outcome::run_record::{Account, RunRecord};
use outcome::solves::{Iterations, SolverRecord};
use outcome::summary::Summary;
use outcome::timing::{CycleRecord, TimingRecord, WorstTick};
use serde_json::{Value, json};
use settings::{Fault, FaultKind, FaultTarget, Late, Mode, Profile, Scenario, TrajectoryKind};

use super::claims::{ALTITUDE_HORIZONTAL_M, ALTITUDE_VERTICAL_M, judge};
use super::sections::{bounds, metrics};
use super::{Figures, OfAll, TEMPLATE};

const TRIM: ActuationMsg = ActuationMsg { rotor_speed: [1441.0, 1338.0, 1338.0], tilt_rad: 0.5 };

/// A hover with its reference, tick by tick.
fn hover(ticks: u64) -> Log {
    let mut log = Log::default();
    for tick in 0..ticks {
        log.states.push(at(tick, State::default()));
        log.truths.push(Truth { tick, sequence: tick + 1, actuators: TRIM, ..Truth::default() }.with_checksum());
        log.references.push(at(tick, Reference { position_m: [0.0, 3.0, 4.0], ..Reference::default() }));
        log.controls.push(at(tick, Controls::default()));
        log.actuators.push(at(tick, Actuators { command: TRIM, ..Actuators::default() }));
    }
    log
}

/// A flight of the survey with these altitude errors from 10 to 50 s and in the rest \[m\].
fn on_survey(ticks: u64, [horizontal_m, vertical_m]: [f64; 2]) -> Log {
    let trajectory = guidance::Trajectory::new(&Scenario::from(Profile::Paper));
    with_truths(hover(ticks), |truth| {
        let [north_m, east_m, down_m] = trajectory.at(truth.tick as f64 * 0.01).position_m;
        let error_m = if (1000..=5000).contains(&truth.tick) { horizontal_m } else { vertical_m };
        truth.actual.position_m = [north_m, east_m, down_m + error_m];
    })
}

fn at<M: Message>(tick: u64, mut message: M) -> M {
    let stamp = message.stamp_mut();
    (stamp.tick, stamp.sequence, stamp.epoch) = (tick, tick.saturating_add(1), 1);
    message.with_checksum()
}

/// Changes every TRUTH of a flight.
fn with_truths(mut log: Log, change: impl Fn(&mut Truth)) -> Log {
    for truth in &mut log.truths {
        change(truth);
        *truth = truth.with_checksum();
    }
    log
}

/// Changes every state of a flight.
fn with_states(mut log: Log, change: impl Fn(&mut State)) -> Log {
    for state in &mut log.states {
        change(state);
        *state = state.with_checksum();
    }
    log
}

fn robust() -> Scenario {
    Scenario::from(Profile::Robust)
}

/// Record of a flight in process in which every claim holds, by a little.
fn survey() -> RunRecord {
    let mut scenario = Scenario { name: "survey".into(), ..robust() };
    scenario.run.mode = Mode::Inprocess;
    let mut run = record(&hover(2), &scenario);
    (run.duration_s, run.flown_s, run.exit_code, run.bounds) = (60.0, 60.0, exit::FLOWN, vec![]);
    run.metrics.max_position_error_m = 0.699;
    run
}

/// Record of a flight from its messages.
fn record(log: &Log, scenario: &Scenario) -> RunRecord {
    let summary = &summary(log, scenario);
    let how = Circumstances {
        ended: Ended::Flown,
        log: None,
        events: vec![],
        refused: vec![],
        port_failures: vec![],
        observers: vec![],
    };
    let verdict = Verdict::of(summary, scenario, &how);
    RunRecord::of(Account { summary, scenario, how: &how, verdict: &verdict, wall_s: 1.0, provenance: None })
}

fn summary(log: &Log, scenario: &Scenario) -> Summary {
    let mut summary = Summary::new(scenario);
    log.tick_by_tick().for_each(|record| summary.observe(&record));
    summary
}

/// Page of a flight, without costs of disturbed ticks.
fn render(log: &Log, run: &RunRecord, scenario: &Scenario) -> String {
    let summary = summary(log, scenario);
    let of_all = OfAll { timing: summary.timing.as_ref(), costs: String::new() };
    super::render(figures(log, scenario), run, scenario, Some(of_all))
}

fn figures(log: &Log, scenario: &Scenario) -> Figures {
    let mut figures = Figures::new(scenario, 0);
    log.tick_by_tick().for_each(|record| figures.observe(&record));
    figures
}

/// Page of a flight of two ticks.
fn page(run: &RunRecord) -> String {
    render(&hover(2), run, &robust())
}

/// Checks that a page contains all of `told`, after the attributes `data-label` of its cells are removed.
fn check_tells(page: &str, told: &[&str]) {
    let mut parts = page.split("<td data-label=\"");
    let first = parts.next().unwrap_or_default().to_owned();
    let page = parts.fold(first, |text, part| text + "<td>" + part.split_once("\">").map_or(part, |(_, rest)| rest));
    for told in told {
        assert!(page.contains(told), "{told}");
    }
}

/// The script's input, as it stands in the page.
fn data(page: &str) -> Value {
    let (_, rest) = page.split_once("id=\"flight\">").expect("the page has a data element");
    let (text, _) = rest.split_once("</script>").expect("the data element is closed");
    serde_json::from_str(text).expect("the data is JSON")
}

#[test]
fn an_empty_flight_is_still_a_page() {
    let page = render(&Log::default(), &record(&Log::default(), &robust()), &robust());
    assert!(page.ends_with("</html>\n"));
    // The flight can be repeated from its page.
    check_tells(&page, &["profile = &quot;robust&quot;"]);
    assert_eq!(data(&page)["rows"], 0);
}

#[test]
fn every_slot_of_the_template_is_filled_and_a_value_that_looks_like_one_is_text() {
    let page = page(&RunRecord { name: "{{data}}".into(), ..survey() });
    let slots: Vec<_> = TEMPLATE.split("{{").skip(1).filter_map(|part| part.split_once("}}")).collect();
    assert!(slots.len() > 15);
    for (slot, _) in slots {
        assert!(slot == "data" || !page.contains(&format!("{{{{{slot}}}}}")), "{slot}");
    }
    assert!(page.contains("<h1>{{data}}</h1>"));
}

#[test]
fn text_of_the_record_cannot_become_markup() {
    let evil = "</script></pre><script>alert('x')</script>".to_owned();
    let mut run = survey();
    let all =
        [&mut run.name, &mut run.ended, run.state_hash.get_or_insert_default(), run.ground.get_or_insert_default()];
    for text in all {
        text.clone_from(&evil);
    }
    let mut host = host();
    (host.cpu, host.command) = (Some(evil.clone()), vec![evil.clone()]);
    run.provenance = Some(Provenance { host, scheduling: BTreeMap::new(), scenario: evil.clone() });
    run.bounds = vec![BoundCheck { metric: evil.clone().into(), ..bound(true) }];
    run.reservations = vec![evil.clone()];
    run.events = TimedEvent::all(&[Event::new(1, &evil, 1, What::Died).because(&evil)], 100);
    run.refused = BTreeMap::from([(evil.clone(), BTreeMap::from([("epoch".into(), 1)]))]);
    run.timing = Some(timing());
    run.timing.as_mut().unwrap().worst_ticks[0].in_words.clone_from(&evil);
    run.timing.as_mut().unwrap().clock_contradictions.insert(evil.clone(), 1);
    let scenario = Scenario { name: evil, ..robust() };
    for run in [run, record(&hover(2), &scenario)] {
        let page = render(&hover(3), &run, &scenario);
        assert!(!page.contains("<script>alert"));
        assert!(page.contains("&lt;/script&gt;"));
    }
}

#[test]
fn a_hole_in_the_log_is_nan_at_its_tick() {
    let mut log = with_truths(hover(10), |truth| truth.actual.position_m = [0.0, -3.0, -4.0]);
    log.truths.remove(4);
    let mut scenario = robust();
    scenario.mission.trajectory = TrajectoryKind::Hover; // which asks for the start position
    let data = data(&render(&log, &survey(), &scenario));
    assert_eq!(data["rows"], 10);
    // 5 m as f32, little-endian, is 00 00 a0 40: four of them, then NaN, 00 00 c0 7f.
    let error = data["columns"]["error"].as_str().unwrap();
    assert!(error.starts_with("AACgQAAAoEAAAKBAAACgQAAAwH8AAKBA"), "{error}");
}

#[test]
fn a_minute_is_drawn_tick_by_tick_and_no_page_exceeds_a_megabyte_and_a_half() {
    for ticks in [6001, 6401, 360_001] {
        let mut scenario = robust();
        scenario.run.duration_s = ticks as f64 * scenario.sample_s();
        let page = render(&hover(ticks), &survey(), &scenario);
        assert!(page.len() < 1_500_000, "{} bytes", page.len());
        let rows = data(&page)["rows"].as_u64().unwrap();
        assert!(if ticks == 6001 { rows == 6001 } else { rows <= 6402 }, "{rows}");
    }
}

fn bound(ok: bool) -> BoundCheck {
    BoundCheck { metric: "max_position_error_m".into(), limit: 0.5, measured: 0.699, ok, words: [""; 2] }
}

#[test]
fn the_head_names_how_the_run_ended_and_what_its_log_lacks() {
    let log = LogOutcome { records: 7, dropped: 3, error: Some("flight.2.mcap is missing".into()) };
    let mut run = RunRecord { ended: "flown to the end, 60.00 s".into(), log: Some(log), ..survey() };
    let flown = "<p class=\"result good\">flown</p> <span class=\"ended\">to the end, 60.00 s</span>";
    check_tells(&page(&run), &[flown, "The log is not whole: flight.2.mcap is missing."]);
    run.bounds = vec![bound(false)];
    check_tells(&page(&run), &["outside its bounds"]);
    (run.diverged, run.flown_s) = (true, 5.8);
    check_tells(&page(&run), &["<p class=\"result bad\">diverged at 5.80 s</p>"]);
}

#[test]
fn the_work_of_the_solver_is_told() {
    let quiet = page(&survey());
    check_tells(&quiet, &["<dt>time of a solve, p50 / p99 / maximum</dt><dd>– / – / – µs</dd>"]);
    let solve_us = Percentiles { n: 590, p50_us: 91.2, p99_us: 201.7, max_us: 234.4, ..Percentiles::default() };
    let solver = SolverRecord {
        explicit: 5410,
        solved: 590,
        limit_reached: 1,
        fallback: 2,
        iterations: Iterations { max: 14, mean: Some(6.25) },
        solve_us: Some(solve_us),
        ..SolverRecord::default()
    };
    let told = [
        "<dt>ticks on which a constraint was solved for</dt><dd>590</dd>",
        "<dt>solves stopped at a limit</dt><dd>1</dd>",
        "<dt>solves that fell back</dt><dd>2</dd>",
        "<dt>iterations, mean / maximum</dt><dd>6.2 / 14</dd>",
        "<dt>time of a solve, p50 / p99 / maximum</dt><dd>91 / 202 / 234 µs</dd>",
    ];
    check_tells(&page(&RunRecord { solver, ..survey() }), &told);
}

#[test]
fn bounds_of_the_scenario_are_lines_in_the_figures() {
    let mut scenario = robust();
    scenario.bounds.max_position_error_m = Some(0.25);
    scenario.bounds.max_altitude_error_m = Some(0.15);
    let lines = data(&render(&hover(1), &survey(), &scenario))["lines"].clone();
    assert!(lines["error"].to_string().contains("0.25") && lines["error_z"].to_string().contains("-0.15"));
    let default = data(&render(&hover(1), &survey(), &robust()))["lines"]["error"].clone();
    assert_eq!(default[0]["y"], 1.5, "the default bound, which the flight is judged by too");
}

/// Counts of refused messages.
fn refused(node: &str, epoch: u32) -> (String, BTreeMap<String, u32>) {
    (node.into(), BTreeMap::from([("epoch".into(), epoch), ("order".into(), 0)]))
}

#[test]
fn a_flight_without_faults_has_no_section_on_them() {
    let page = page(&RunRecord { refused: [refused("mixer", 0)].into(), ..survey() });
    assert!(!page.contains("#faults") && !page.contains("id=\"faults\""));
    assert_eq!(data(&page)["happened"], json!({ "faults": [], "absences": [], "phases": [], "events": [] }));
}

#[test]
fn faults_and_events_are_told_and_drawn() {
    let fault = |target, kind, injected_at_s, ended_at_s, detected_after_s| FaultRecord {
        injected_at_s,
        ended_at_s,
        detected_after_s,
        ..FaultRecord::of(&Fault::new(target, kind, 0.0, None))
    };
    let step = fault(FaultTarget::Wind, FaultKind::Step, Some(5.0), None, None);
    let faults = vec![
        fault(FaultTarget::Mixer, FaultKind::Kill, Some(2.0), Some(2.3), Some(0.0)),
        FaultRecord { size: Some("(3, 0, 0) m/s".into()), ..step },
        fault(FaultTarget::Tilt, FaultKind::Off, None, None, None),
    ];
    let events =
        [Event::new(200, "mixer", 1, What::Died), Event::new(231, "mixer", 2, What::Rejected).because("too <slow>")];
    let refused = [refused("mixer", 3), refused("guidance", 0)].into();
    let page = page(&RunRecord { faults, events: TimedEvent::all(&events, 100), refused, ..survey() });
    let drawn = &data(&page)["happened"];
    let faults = json!([
        { "number": 1, "what": "mixer kill", "from_s": 2.0, "to_s": 2.3 },
        { "number": 2, "what": "wind step (3, 0, 0) m/s", "from_s": 5.0, "to_s": null },
    ]);
    assert_eq!(drawn["faults"], faults);
    assert_eq!(drawn["absences"], json!([{ "number": 0, "what": "mixer was down", "from_s": 2.0, "to_s": null }]));
    assert_eq!(drawn["events"][1], json!({ "at_s": 2.31, "node": "mixer", "what": "rejected", "why": "too <slow>" }));
    let told = [
        "<a href=\"#faults\">What happened</a>",
        "<td>1</td><td>mixer</td><td>kill</td><td>–</td><td>2.00</td><td>2.30</td><td>0.00</td><td>not recovered</td>",
        "<td>2</td><td>wind</td><td>step</td><td>(3, 0, 0) m/s</td><td>5.00</td><td>the end</td><td>not detected</td><td>–</td>",
        "<td>3</td><td>tilt</td><td>off</td><td>–</td><td>not struck</td><td>–</td><td>–</td><td>–</td>",
        "<td>2.00</td><td>mixer</td><td>1</td><td>died</td><td>–</td>",
        "<td>2.31</td><td>mixer</td><td>2</td><td>rejected</td><td>too &lt;slow&gt;</td>",
        "<td>mixer</td><td>3</td><td>–</td><td>–</td><td>–</td><td>–</td>",
    ];
    check_tells(&page, &told);
    assert!(!page.contains(">guidance</td>"), "it refused nothing");
}

#[test]
fn a_kill_without_an_end_is_a_moment_and_not_a_stretch_to_the_end() {
    let kill = Fault::new(FaultTarget::Mixer, FaultKind::Kill, 2.0, None);
    let faults = vec![FaultRecord { injected_at_s: Some(2.0), ..FaultRecord::of(&kill) }];
    let page = page(&RunRecord { faults, ..survey() });
    assert_eq!(data(&page)["happened"]["faults"][0]["to_s"], 2.0);
    check_tells(&page, &["<td>kill</td><td>–</td><td>2.00</td><td>2.00</td>"]);
}

#[test]
fn columns_without_information_are_left_out() {
    let names = |log: &Log, scenario: &Scenario| {
        let columns = data(&render(log, &survey(), scenario))["columns"].clone();
        let is_there = |name: &str| columns.get(name).is_some();
        ["x", "rung", "effort", "x_measured", "wind_north", "estimate_ahead", "unexplained_ahead"].map(is_there)
    };
    let usual = [true, true, true, false, false, false, false];
    assert_eq!(names(&hover(5), &robust()), usual, "a calm flight with true measurements");
    let noisy = with_states(hover(5), |state| state.measured.position_m[0] = 0.01);
    assert_eq!(names(&noisy, &robust())[3..], [true, false, false, false]);
    let mut windy = robust();
    (windy.plant.wind_ned_mps, windy.plant.drag_linear_nspm) = (vec![(0.02, [3.0, 0.0, 0.0])], [0.1; 3]);
    assert_eq!(names(&hover(5), &windy)[3..], [false, true, false, true]);
}

/// Timing of a flight whose worst tick is the plant's.
fn timing() -> TimingRecord {
    let log = with_states(hover(3), |state| state.stamp.start_ns = 50_000);
    let mut scenario = robust();
    scenario.run.mode = Mode::Realtime;
    let mut timing = record(&log, &scenario).timing.expect("a flight in real time has a timing");
    let us = |p50_us: f64| Percentiles { n: 3, p50_us, p99_us: 60.0, max_us: 70.0, ..Percentiles::default() };
    let plant = timing.nodes.get_mut("plant").unwrap();
    (plant.jitter, plant.deadline_ms, plant.policy) = (Some(us(50.0)), 9.0, Late::Skip);
    let counts = &mut plant.counts;
    (counts.misses, counts.late, counts.slips, counts.longest_run_of_misses) = (4, 3, 1, 2);
    (timing.age_at_actuator, timing.age_at_actuator_per_slot) = (us(800.0), Percentiles::default());
    let (start_us, publish_us) = (50.0, 12_000.0);
    let cycle = CycleRecord { release_us: 0.0, start_us, publish_us, cpu_us: None, slips: 0, withheld: 0, silent: 0 };
    timing.worst_ticks = vec![WorstTick {
        tick: 2,
        time_s: 0.02,
        late_us: 12_000.0,
        node: "plant".into(),
        part: "execution".into(),
        in_words: "plant: its own work".into(),
        position_error_m: Some(5.0),
        nodes: [("plant".into(), cycle)].into(),
        ..WorstTick::default()
    }];
    timing
}

#[test]
fn the_timing_of_nodes_is_told_and_drawn() {
    let log = with_states(hover(3), |state| state.stamp.start_ns = 50_000);
    let run = RunRecord { timing: Some(timing()), ..survey() };
    let told = [
        "<td>plant</td><td>9.0</td><td>skip</td><td>4</td><td>3</td><td>1</td><td>2</td><td>50 / 60 / 70</td>",
        "<b>800 / 60 / 70</b> µs over 3 commands applied; <b>0 / 0 / 0</b> µs over 0 slots held",
        "aria-label=\"plant, release jitter: p50, p99, max 50 / 50 / 50 µs of 3 values\"",
        "<b>12.00 ms</b> tick 2, 0.02 s, position error 5.000&nbsp;m</p><p class=\"hint\">plant: its own work</p>",
        "<rect class=\"runs fault\"",
    ];
    check_tells(&render(&log, &run, &robust()), &told);
    assert!(!render(&log, &survey(), &robust()).contains("class=\"histogram\""));
}

#[test]
fn a_command_held_ages_slot_by_slot() {
    let log = with_states(hover(5), |state| {
        (state.applied_sequence, state.applied_age_ns) = if state.stamp.tick > 0 { (1, 500_000) } else { (0, 0) };
    });
    let page = render(&log, &survey(), &robust());
    // NaN, then 0.5, 10.5, 20.5, 30.5 ms as f32.
    assert_eq!(data(&page)["columns"]["age_ms"], "AADAfwAAAD8AAChBAACkQQAA9EE=");
}

/// Verdict and measured value of each claim.
fn claims(log: &Log, run: &RunRecord, scenario: &Scenario) -> ([Option<bool>; 5], [String; 5]) {
    let claims = judge(run, &figures(log, scenario).finish().1, scenario);
    (claims.each_ref().map(|claim| claim.holds), claims.map(|claim| claim.measured))
}

#[test]
fn a_flight_that_ended_early_has_kept_no_bound() {
    let run = RunRecord { bounds: vec![bound(true), bound(false)], ..survey() };
    assert!(bounds(&run).contains("kept"));
    let early = |diverged, exit_code| RunRecord { flown_s: 5.85, diverged, exit_code, ..run.clone() };
    for run in [early(false, exit::INTERRUPTED), early(false, exit::PROCESS_LOST), early(true, exit::FLOWN)] {
        let told = bounds(&run);
        assert!(!told.contains("kept") && told.contains("not judged") && told.contains("exceeded"), "{told}");
    }
}

#[test]
fn the_state_hash_is_shown_if_a_repeat_or_a_replay_gives_it_again() {
    for (mode, replays, shown) in
        [(Mode::Realtime, false, false), (Mode::Realtime, true, true), (Mode::Lockstep, false, true)]
    {
        let run = RunRecord { state_hash: Some("0123abcd".into()), mode, replays, ..survey() };
        assert_eq!(metrics(&run).contains("0123abcd"), shown, "{mode:?} {replays}");
        assert_eq!(page(&run).contains("trefoil replay RUN"), replays, "{mode:?} {replays}");
    }
}

#[test]
fn claims_hold_up_to_their_bound_and_not_beyond() {
    let scenario = Scenario::from(Profile::Paper);
    let within = on_survey(6001, [0.099, 0.199]);
    assert_eq!(claims(&within, &survey(), &scenario).0, [Some(true); 5]);
    check_tells(&render(&within, &survey(), &scenario), &["href=\"#claims\"", "<td>altitude error, 10 to 50 s</td>"]);
    let mut beyond = survey();
    beyond.metrics.max_position_error_m = 0.7;
    let (verdicts, measured) = claims(&on_survey(6001, [0.101, 0.201]), &beyond, &scenario);
    assert_eq!(verdicts, [Some(false), Some(false), Some(false), Some(true), Some(true)]);
    assert_eq!(measured[1..3], ["0.101 m", "0.201 m"]);
    // No sum of floats reaches the bounds themselves: the horizontal one is exclusive, the vertical one inclusive.
    let mut reach = figures(&within, &scenario).finish().1;
    reach.altitude_m = [ALTITUDE_HORIZONTAL_M, ALTITUDE_VERTICAL_M];
    assert_eq!(
        judge(&survey(), &reach, &scenario).each_ref().map(|claim| claim.holds)[1..3],
        [Some(false), Some(true)]
    );
}

#[test]
fn a_command_at_its_limit_breaks_the_constraint_claim() {
    let scenario = Scenario::from(Profile::Paper);
    let limits = scenario.limits();
    let at_limit = [
        ActuationMsg { rotor_speed: [limits.rotor_speed_max[0], 1338.0, 1338.0], ..TRIM },
        ActuationMsg { rotor_speed: [1441.0, 1338.0, 0.0], ..TRIM },
        ActuationMsg { tilt_rad: -limits.tilt_max_rad, ..TRIM },
    ];
    for command in at_limit {
        let mut log = hover(100);
        log.actuators[50] = at(50, Actuators { command, ..Actuators::default() });
        assert_eq!(claims(&log, &survey(), &scenario).0[4], Some(false), "{command:?}");
    }
}

#[test]
fn a_state_at_its_limit_breaks_the_constraint_claim() {
    let scenario = Scenario::from(Profile::Paper);
    let verdict = |change: fn(&mut Truth)| claims(&with_truths(hover(100), change), &survey(), &scenario).0[3];
    assert_eq!(verdict(|truth| truth.actual.attitude_rad = [1.56, -1.56, 6.27]), Some(true));
    assert_eq!(verdict(|truth| truth.actual.rates_radps = [-6.27, 6.27, 6.27]), Some(true));
    assert_eq!(verdict(|truth| truth.actual.attitude_rad[0] = 1.58), Some(false));
    assert_eq!(verdict(|truth| truth.actual.attitude_rad[1] = -1.58), Some(false));
    assert_eq!(verdict(|truth| truth.actual.attitude_rad[2] = 6.29), Some(false));
    assert_eq!(verdict(|truth| truth.actual.rates_radps[1] = -6.29), Some(false));
    assert_eq!(verdict(|truth| truth.actual.rates_radps[2] = f64::NAN), Some(false), "nothing is known of it");
    assert_eq!(claims(&Log::default(), &survey(), &scenario).0[3], None);
}

#[test]
fn command_following_is_told_without_a_verdict() {
    let mut run = survey();
    run.metrics.rms_attitude_error_deg = [0.5, 0.25, 1.0];
    (run.metrics.rms_rates_error_dps, run.metrics.rms_w_error_mps) = ([f64::NAN; 3], 0.0625);
    let log = hover(6001);
    let told = "RMS error of φ, θ, ψ <b>0.50 / 0.25 / 1.00 deg</b>";
    let following = |scenario: &Scenario| {
        let page = render(&log, &run, scenario);
        check_tells(
            &page,
            &["<dt>RMS error of φ, θ, ψ</dt><dd>0.50 / 0.25 / 1.00 deg</dd>", "0.062 m/s", "– / – / – deg/s"],
        );
        page.contains(told)
    };
    assert!(following(&Scenario::from(Profile::Paper)) && !following(&robust()));
}

#[test]
fn the_end_on_the_ground_is_told_only_if_there_is_a_ground() {
    let ground = Some("crashed".into());
    check_tells(&page(&RunRecord { ground, ..survey() }), &["<span>at the end <b>crashed</b></span>"]);
    assert!(!page(&survey()).contains("at the end <b>"));
}

#[test]
fn a_lost_vehicle_contradicts_every_tracking_claim() {
    let run = RunRecord { diverged: true, flown_s: 5.8, bounds: vec![bound(true)], ..survey() };
    let (verdicts, measured) = claims(&hover(580), &run, &Scenario::from(Profile::Paper));
    assert_eq!(verdicts[..3], [Some(false); 3]);
    assert!(measured[0].contains("lost"));
    // A maximum over no time at all is not a measurement.
    assert_eq!(measured[1], crate::draw::DASH);
    assert!(!bounds(&run).contains("kept"));
}

#[test]
fn other_flights_are_not_judged() {
    let (log, mut scenario) = (hover(3000), Scenario::from(Profile::Paper));
    assert_eq!(claims(&log, &RunRecord { flown_s: 30.0, ..survey() }, &scenario).0, [None; 5]);
    scenario.mission.trajectory = TrajectoryKind::Parts;
    assert_eq!(claims(&log, &survey(), &scenario).0, [None; 5]);
    let page = render(&log, &survey(), &scenario);
    check_tells(&page, &["<dt>altitude error, maximum</dt>"]);
    check_speaks_of_no_claim(&page);
}

fn check_speaks_of_no_claim(page: &str) {
    for absent in ["id=\"claims\"", "#claims"] {
        assert!(!page.contains(absent), "{absent}");
    }
    assert!(!data(page)["lines"]["error"].to_string().contains("paper"));
}

/// Checks that every claim is `not applicable`, and that no line of the figures is the paper's.
fn check_judges_no_claim(page: &str) {
    assert_eq!(page.matches("not applicable").count(), 5);
    assert!(!data(page)["lines"]["error"].to_string().contains("paper"));
}

#[test]
fn only_the_papers_flight_in_calm_is_judged_by_its_claims() {
    let log = hover(6001);
    let paper = Scenario::from(Profile::Paper);
    let mut same = Scenario { name: "another".into(), ..paper.clone() };
    (same.run.seed, same.run.mode) = (7, settings::Mode::Lockstep);
    assert!(render(&log, &survey(), &same).contains("id=\"claims\""));
    let with = |settings: &[&str]| {
        let settings: Vec<String> = ["profile=paper"].iter().chain(settings).map(|&set| set.to_owned()).collect();
        settings::load(None, &settings).unwrap()
    };
    let others = vec![
        with(&["mission.ramp_s=0.0"]),
        with(&["initial.position_m=[0.0,0.1,0.0]"]),
        with(&["airframe.mass_kg=1.2"]),
        with(&["plant.airframe.mass_kg=1.2"]),
        with(&["plant.drag_quadratic_ns2pm2=0.05", "plant.wind_ned_mps=[[5.0,[1.0,0.0,0.0]]]"]),
        with(&["guidance.kp_phi=0.4"]),
        with(&["attitude.mpc.constraints=box"]),
        with(&["mixer.projection=true"]),
        with(&["run.rate_hz=200"]),
        with(&["run.command_delay_ms=4.0"]),
        with(&["fault=[{at_s=5.0, target=\"mixer\", kind=\"kill\"}]"]),
        with(&["swap=[{at_s=5.0, node=\"mixer\"}]"]),
    ];
    for scenario in &others {
        check_judges_no_claim(&render(&log, &survey(), scenario));
    }
    check_speaks_of_no_claim(&render(&log, &survey(), &robust()));
    // Orders given in flight count too.
    let ordered = provenance(&others[9], &[]);
    check_judges_no_claim(&render(&log, &RunRecord { provenance: Some(ordered), ..survey() }, &paper));
}
