//! Bounds of a campaign: how many flights have each.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Write as _;

use outcome::bounds;
use outcome::metrics::Metrics;
use rayon::iter::{IntoParallelIterator, ParallelIterator};
use view::draw::short;

use crate::plan::Plan;
use crate::row::Standing;
use crate::table::{Cell, FlightTable};

/// Largest number of limits that are listed; with more, only the lowest and the highest are shown.
const NAMED: usize = 4;

/// Bound that flights must stay inside to pass.
#[derive(Debug, Clone, PartialEq)]
pub struct Bound {
    /// Column of the table of flights.
    pub metric: Cow<'static, str>,
    words: [&'static str; 2],
    /// Limits in rising order, with the number of flights that have each.
    limits: Vec<(f64, usize)>,
    /// Number of flights flown, with this bound or without.
    flown: usize,
}

impl Bound {
    /// Returns the limit if all flights have the same.
    pub fn of_all(&self) -> Option<f64> {
        match self.limits[..] {
            [(limit, flights)] if flights == self.flown => Some(limit),
            _ => None,
        }
    }

    /// Describes bound and limits, with the number of flights if not all have the bound.
    fn in_words(&self) -> String {
        let Self { words: [words, unit], limits, flown, .. } = self;
        let have: usize = limits.iter().map(|(_, flights)| flights).sum();
        let mut text = match &limits[..] {
            [(limit, _)] => format!("{words} at most {} {unit}", short(*limit)),
            [(least, _), .., (most, _)] if limits.len() > NAMED => {
                format!("{words} at most {} to {} {unit} by {} limits", short(*least), short(*most), limits.len())
            }
            several => {
                let one = |(limit, flights): &(f64, usize)| format!("{} {unit} in {flights} flights", short(*limit));
                format!("{words} at most {}", several.iter().map(one).collect::<Vec<_>>().join(", "))
            }
        };
        if have < *flown {
            let _ = write!(text, ", in {have} of {flown} flights only");
        }
        text
    }
}

/// Collects the bounds of the flights that were flown.
pub fn of(plan: &Plan, flights: &FlightTable) -> Vec<Bound> {
    let (Some(numbers), Some(verdicts)) = (flights.column("flight"), flights.column("verdict")) else { return vec![] };
    let is_flown = |row: &usize| verdicts.text(*row) != Standing::Invalid.name();
    let rows: Vec<usize> = (0..flights.rows()).filter(is_flown).collect();
    // `check` returns every bound of the scenario, whatever the metrics; only the limits are used.
    let of_row = |row: &usize| match numbers.cell(*row) {
        Cell::Int(number) => {
            plan.flight(number as u64).scenario.map_or(vec![], |s| bounds::check(&s, &Metrics::default()))
        }
        _ => vec![],
    };
    let all: Vec<_> = rows.clone().into_par_iter().map(|row| of_row(&row)).collect();
    let mut found: Vec<(Bound, BTreeMap<u64, usize>)> = vec![];
    for checks in all {
        for check in checks {
            let i = found.iter().position(|(bound, _)| bound.metric == check.metric).unwrap_or_else(|| {
                let (metric, words) = (check.metric, check.words);
                let bound = Bound { metric, words, limits: vec![], flown: rows.len() };
                found.push((bound, BTreeMap::new()));
                found.len() - 1
            });
            *found[i].1.entry(check.limit.to_bits()).or_default() += 1; // limits are not negative, so their bits sort alike
        }
    }
    let with_limits = |(bound, limits): (Bound, BTreeMap<u64, usize>)| Bound {
        limits: limits.into_iter().map(|(bits, flights)| (f64::from_bits(bits), flights)).collect(),
        ..bound
    };
    found.into_iter().map(with_limits).collect()
}

/// Describes when a flight passes.
pub fn passed(bounds: &[Bound]) -> String {
    let inside = match bounds {
        [] => "No bound is set.".to_owned(),
        _ => format!("Its bounds: {}.", bounds.iter().map(Bound::in_words).collect::<Vec<_>>().join("; ")),
    };
    format!(
        "A flight is passed when it is flown to its end or landed, no process is lost, and it stays inside its bounds. {inside}"
    )
}
