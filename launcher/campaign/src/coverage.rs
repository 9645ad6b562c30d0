//! Checks the intervals against a known truth: in about 95 % of 2000 simulated campaigns of each shipped kind the
//! interval covers the truth, or in more where the page says so.

use std::fs;
use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::evidence::{Draws, Evidence, FEW};
use crate::plan::PlanAxis;
use crate::sampling::{Points, Sampling};
use crate::table::{Cell, ColumnType, FlightTable};
use crate::{Campaign, Plan, Rate};

const CAMPAIGNS: u32 = 2000;
/// True shares that two controllers pass.
const TRUTH: [f64; 2] = [0.8, 0.75];
/// Samples of a Latin hypercube in these tests; more samples behave alike.
const HYPERCUBE: u64 = 500;
/// Keys of the hypercube's coordinates.
const KEYS: [&str; 5] = ["a", "b", "c", "d", "e"];

/// Evidence of a campaign in which no flight is a copy.
fn evidence_of(plan: &Plan) -> Evidence {
    let columns = [("flight", ColumnType::Int), ("hash", ColumnType::Text), ("verdict", ColumnType::Text)];
    let mut table = FlightTable::new(&columns.map(|(name, kind)| (name.to_owned(), kind)));
    for number in 0..plan.flights() {
        table.push(vec![Cell::Int(number as i64), Cell::Text(number.to_string()), Cell::Text("passed".into())]);
    }
    Evidence::of(plan, &table)
}

/// Counts of the intervals that cover the truth, over many campaigns.
#[derive(Debug, Default)]
struct Covered {
    pooled: u32,
    listed: u32,
    difference: u32,
}

/// Counts the intervals of one campaign that cover the truth. `cases` has, for each case, which of the two controllers
/// pass; `listed` is an axis of listed values, if there is one.
fn look(covered: &mut Covered, evidence: &Evidence, laws: u64, cases: &[[bool; 2]], listed: Option<PlanAxis>) {
    let first = || cases.iter().enumerate().map(|(case, passed)| (case as u64 * laws, passed[0]));
    let covers = |low: f64, high: f64, truth: f64| u32::from((low..=high).contains(&truth));
    let pooled = evidence.rate(first());
    covered.pooled += covers(pooled.low, pooled.high, TRUTH[0]);
    if let Some(axis) = listed {
        let rate = evidence.rate(first().filter(|(number, _)| axis.place(*number) == 0));
        assert_eq!(rate.draws, rate.flights, "one flight a draw");
        covered.listed += covers(rate.low, rate.high, TRUTH[0]);
    }
    let pairs = cases.iter().enumerate().map(|(case, passed)| (case as u64 * laws, *passed));
    let difference = evidence.difference(pairs).expect("it is a sample");
    covered.difference += covers(difference.low, difference.high, TRUTH[0] - TRUTH[1]);
}

/// Simulates which of two controllers pass each case of independent draws: in half of the draws all cases share one
/// random number, and each flight has a number of its own with a probability of 10 %.
fn independent(rng: &mut ChaCha8Rng, evidence: &Evidence, controllers: u64, cases: u64) -> Vec<[bool; 2]> {
    let draws: Vec<Option<f64>> =
        (0..evidence.all_draws()).map(|_| rng.random::<bool>().then(|| rng.random())).collect();
    let one = |case: u64| {
        let common = draws[evidence.draw(case * controllers) as usize].unwrap_or_else(|| rng.random());
        TRUTH.map(|truth| if rng.random_bool(0.1) { rng.random_bool(truth) } else { common < truth })
    };
    (0..cases).map(one).collect()
}

/// Returns a message if an interval covers the truth in less than 93.5 % of the campaigns, or in more than 97 %
/// although it is not said to be conservative.
fn outside(name: &str, what: &str, covered: u32, is_conservative: bool) -> Option<String> {
    let percent = 100.0 * f64::from(covered) / f64::from(CAMPAIGNS);
    let words = || format!("{name}: {what} covers the truth in {percent:.2} % of {CAMPAIGNS} campaigns");
    let most = if is_conservative { 100.0 } else { 97.0 };
    (!(93.5..=most).contains(&percent)).then(words)
}

/// Simulates a response on which a Latin hypercube has no advantage: the fractional part of the sum of all coordinates,
/// which is uniform with or without the hypercube.
fn hypercube(seed: u64, dimensions: usize) -> Vec<[bool; 2]> {
    let points = Points::new(Sampling::LatinHypercube, seed, HYPERCUBE, &KEYS[..dimensions]);
    let sum = |sample: u64| points.point(sample).iter().sum::<f64>();
    (0..HYPERCUBE)
        .map(|sample| [0.0, 0.1].map(|ahead| (sum(sample) + ahead).fract()))
        .map(|[one, other]| [one < TRUTH[0], other < TRUTH[1]])
        .collect()
}

#[test]
fn val_intervals_of_the_shipped_campaigns_cover_the_truth_as_often_as_they_say() {
    let (mut kinds, mut found) = (0, vec![]);
    for entry in
        fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns")).expect("the campaigns").flatten()
    {
        let name = entry.file_name().to_string_lossy().into_owned();
        let mut campaign = Campaign::load(&entry.path()).expect("a campaign");
        if campaign.sampling() == Sampling::LatinHypercube {
            campaign = campaign.drawn_anew(1, HYPERCUBE);
        }
        let plan = Plan::new(campaign).expect("a plan");
        let evidence = evidence_of(&plan);
        if !matches!(evidence.draws, Draws::LatinHypercube | Draws::Independent) || evidence.all_draws() < FEW {
            continue; // the page has no interval, or says that its draws are too few
        }
        let controllers = plan.campaign.controllers.len() as u64;
        let cases = plan.flights() / controllers;
        let is_pooled = cases > evidence.all_draws();
        let is_conservative = evidence.is_conservative(cases / evidence.all_draws());
        let others = plan.listed_axes().into_iter().filter(|(key, _)| *key != "run.seed").map(|(_, axis)| axis);
        let listed = others.clone().next().filter(|_| others.count() == 1);
        let mut covered = Covered::default();
        for campaign in 0..CAMPAIGNS {
            let passed = if evidence.draws == Draws::LatinHypercube {
                assert!(!is_pooled, "{name}: this test has no truth for it");
                hypercube(campaign.into(), 5)
            } else {
                independent(&mut ChaCha8Rng::seed_from_u64(campaign.into()), &evidence, controllers, cases)
            };
            look(&mut covered, &evidence, controllers, &passed, listed);
        }
        found.extend(outside(
            &name,
            if is_pooled { "the share over listed values" } else { "the share" },
            covered.pooled,
            is_conservative,
        ));
        if controllers > 1 {
            found.extend(outside(&name, "the difference of two controllers", covered.difference, is_conservative));
        }
        if listed.is_some() {
            found.extend(outside(&name, "the share at one listed value", covered.listed, is_conservative));
        }
        kinds += 1;
    }
    assert!(kinds >= 3);
    assert!(found.is_empty(), "{found:#?}");
}

/// With a response of one coordinate, the share passed scatters far less than the interval says.
#[test]
fn val_the_interval_of_a_latin_hypercube_is_conservative() {
    let covers = |seed: u32| {
        let points = Points::new(Sampling::LatinHypercube, seed.into(), HYPERCUBE, &KEYS);
        let passed = (0..HYPERCUBE).filter(|sample| points.point(*sample)[0] < TRUTH[0]).count();
        let rate = Rate::of(passed, HYPERCUBE as usize);
        (rate.low..=rate.high).contains(&TRUTH[0])
    };
    assert!((0..200).all(covers));
}
