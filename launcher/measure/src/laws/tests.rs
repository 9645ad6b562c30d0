use super::*;
use crate::findings::Verdict;
use contract::scenario::Profile;
use view::summary::Summary;

const CONE: InnerLoop = LAWS[0];
const ACTIVE_SET: InnerLoop = LAWS[1];

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
        solver: json!(null),
        state_hash: None,
    }
}

fn row(inner_loop: InnerLoop, clamped: [u64; 5]) -> Vec<LawFlight> {
    clamped.map(|clamped| flight(inner_loop, None, 0.0, clamped)).into()
}

#[test]
fn the_shipped_scenarios_are_valid_under_every_inner_loop() {
    let mut names = vec![];
    for (path, text) in AGGRESSIVE {
        let shipped = scenario::from_merged(text, path).unwrap();
        for inner_loop in inner_loops() {
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
fn every_law_flies_with_and_without_the_projection_and_the_first_is_what_ships() {
    let robust = Scenario::from(Profile::Robust);
    let loops = inner_loops();
    assert_eq!(loops.len(), 12);
    for pair in loops.chunks(2) {
        assert_eq!(pair[0], InnerLoop { projection: false, ..pair[1] });
        assert!(pair[1].put_into(&robust).mixer.projection && !pair[0].put_into(&robust).mixer.projection);
    }
    let shipped = loops[1].put_into(&robust);
    assert_eq!((shipped.mpc, shipped.mixer), (robust.mpc, robust.mixer));
}

#[test]
fn a_cell_tells_what_became_of_the_flight() {
    let cell = |diverged_at_s, final_m| flight(CONE, diverged_at_s, final_m, 2).cell();
    assert_eq!(cell(None, 0.1), "ok 33.1 m s, 2");
    assert_eq!(cell(None, 12.34), "out of bounds, 12.3 m");
    assert_eq!(cell(Some(1.56), 0.1), "diverged at 1.56 s");
    assert_eq!(cell(None, f64::NAN), "out of bounds, NaN m");
}

#[test]
fn the_table_has_a_line_for_each_inner_loop() {
    let scenarios = vec![Scenario::from(Profile::Robust)];
    let rows = [vec![flight(CONE, None, 0.0, 0)], vec![flight(LAWS[5], Some(1.56), 9.0, 9)]];
    let text = table(&scenarios, &rows);
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[1], "      survey              survived");
    assert_eq!(lines[2], "cone  ok 33.1 m s, 0           1/1");
    assert_eq!(lines[3], "pid   diverged at 1.56 s       0/1");
}

#[test]
fn the_targets_are_those_of_the_cone() {
    let verdicts = |rows: &[Vec<LawFlight>]| targets(rows).iter().map(|target| target.verdict).collect::<Vec<_>>();
    let good = [row(CONE, [0; 5]), row(CLAMP, [99; 5])];
    assert_eq!(verdicts(&good), [Verdict::Ok; 3]);
    let mut bad = [row(ACTIVE_SET, [0, 1, 0, 0, 0])];
    bad[0][3] = flight(ACTIVE_SET, Some(2.0), 0.0, 0);
    bad[0][4].metrics.negative_squares = 1;
    assert_eq!(verdicts(&bad), [Verdict::Short; 3]);
}

fn random(inner_loop: InnerLoop, survived: &[u8]) -> RandomRow {
    let survived: Vec<bool> = survived.iter().map(|survived| *survived == 1).collect();
    RandomRow { inner_loop, rate: Rate::of(&survived), survived }
}

#[test]
fn the_random_flights_are_compared_with_the_best_law_of_another_kind() {
    let boxed = InnerLoop { projection: true, ..LAWS[2] };
    let rows = [
        random(CONE, &[1, 1, 1, 0]),
        random(ACTIVE_SET, &[1; 4]),
        random(CLAMP, &[0; 4]),
        random(boxed, &[1, 0, 0, 1]),
    ];
    assert_eq!(best_other(&rows, &rows[0]).unwrap().inner_loop, boxed, "the other solver is no other law");
    assert_eq!(best_other(&rows, &rows[3]).unwrap().inner_loop, ACTIVE_SET);
    let text = random_table(7, &rows);
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("4 random flights, seed 7"));
    assert_eq!(
        lines[2].split_whitespace().collect::<Vec<_>>(),
        "cone 3 19.4 to 99.4 % box, projected 2 1".split(' ').collect::<Vec<_>>()
    );
}

#[test]
fn the_cone_may_lose_no_more_than_chance_explains() {
    let verdicts = |cone: &[u8], other: &[u8]| -> Vec<Verdict> {
        of_random(&[random(CONE, cone), random(CLAMP, other)]).iter().map(|target| target.verdict).collect()
    };
    assert_eq!(verdicts(&[1, 1, 0, 0], &[1, 1, 1, 0]), [Verdict::Ok]);
    assert_eq!(verdicts(&[0; 4], &[1; 4]), [Verdict::Short]);
}
