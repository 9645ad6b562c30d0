use super::*;
use crate::findings::Verdict;
use contract::scenario::Profile;
use outcome::summary::Summary;

fn shipped() -> Campaign {
    Campaign::read(CAMPAIGN.1, CAMPAIGN.0, "laws", Path::new("")).unwrap()
}

/// Finds an inner loop by name.
fn named(name: &str) -> InnerLoop {
    inner_loops(&shipped()).unwrap().into_iter().find(|one| one.name == name).unwrap()
}

fn flight(inner_loop: InnerLoop, diverged_at_s: Option<f64>, final_m: f64, clamped: u64) -> LawFlight {
    let mut metrics = Summary::new(&Scenario::from(Profile::Robust)).metrics();
    metrics.final_position_error_m = final_m;
    metrics.commands_saturated = clamped;
    metrics.position_error_integral_ms = 33.14;
    let survived = diverged_at_s.is_none() && final_m <= SURVIVED_M;
    LawFlight {
        inner_loop,
        scenario: "step".into(),
        survived,
        diverged_at_s,
        metrics,
        solver: SolverRecord::default(),
        state_hash: None,
    }
}

fn row(inner_loop: &InnerLoop, clamped: [u64; 5]) -> Vec<LawFlight> {
    clamped.map(|clamped| flight(inner_loop.clone(), None, 0.0, clamped)).into()
}

#[test]
fn the_shipped_scenarios_are_valid_under_every_inner_loop() {
    let campaign = shipped();
    let mut names = vec![];
    for (path, text) in AGGRESSIVE {
        let shipped = scenario::from_merged(text, path).unwrap();
        for inner_loop in inner_loops(&campaign).unwrap() {
            let flown = scenario::to_toml(&inner_loop.put_into(&shipped));
            scenario::from_merged(&flown, path).unwrap();
        }
        names.push(shipped.name);
    }
    names.sort();
    names.dedup();
    assert_eq!(names.len(), AGGRESSIVE.len(), "each column has a name of its own");
}

#[test]
fn a_cell_tells_the_outcome_of_the_flight() {
    let cell = |diverged_at_s, final_m| flight(named("cone"), diverged_at_s, final_m, 2).cell();
    assert_eq!(cell(None, 0.1), "ok 33.1 m s, 2");
    assert_eq!(cell(None, 12.34), "out of bounds, 12.3 m");
    assert_eq!(cell(Some(1.56), 0.1), "diverged at 1.56 s");
    assert_eq!(cell(None, f64::NAN), "out of bounds, NaN m");
}

#[test]
fn the_table_has_a_line_for_each_inner_loop() {
    let scenarios = vec![Scenario::from(Profile::Robust)];
    let rows = [vec![flight(named("cone"), None, 0.0, 0)], vec![flight(named("pid"), Some(1.56), 9.0, 9)]];
    let text = table(&scenarios, &rows);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[1], "      survey              survived");
    assert_eq!(lines[2], "cone  ok 33.1 m s, 0           1/1");
    assert_eq!(lines[3], "pid   diverged at 1.56 s       0/1");
}

#[test]
fn only_inner_loops_with_the_cone_have_targets() {
    let verdicts = |rows: &[Vec<LawFlight>]| targets(rows).iter().map(|target| target.verdict).collect::<Vec<_>>();
    let good = [row(&named("cone"), [0; 5]), row(&named("clamp"), [99; 5])];
    assert_eq!(verdicts(&good), [Verdict::Ok; 3]);
    let mut bad = [row(&named("cone-tuned"), [0, 1, 0, 0, 0])];
    bad[0][3] = flight(named("cone-tuned"), Some(2.0), 0.0, 0);
    bad[0][4].metrics.negative_squares = 1;
    assert_eq!(verdicts(&bad), [Verdict::Short; 3]);
}
