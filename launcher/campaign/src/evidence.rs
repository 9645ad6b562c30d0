//! Draws of a campaign, on which its shares are based, and copies among its flights.
//!
//! | a campaign with | has as draws | and flights of one draw differ by |
//! |---|---|---|
//! | `samples` | the samples | listed values, `seeds` among them, and controllers |
//! | `seeds` alone | the seeds | listed values and controllers |
//! | neither | none: shares only count the listed flights | |
//!
//! Copies are found by the hashes of the flights. They come from controllers that fly alike, from values without
//! effect, and from draws that change nothing.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::fmt::Write as _;

use crate::difference::{Difference, MetricDifference};
use crate::file::SEED;
use crate::plan::{Plan, PlanAxis};
use crate::rate::Rate;
use crate::sampling::Sampling;
use crate::table::{Cell, FlightTable};

/// Number of draws below which the page calls them too few.
pub const FEW: u64 = 20;
/// Least ratio of the number of draws to the number of flights in each draw. Below it, intervals cover more than 95 %,
/// because the half draw that they add for what was not observed ([`mean`](crate::mean)) weighs too much.
const DRAWS_PER_FLIGHT: u64 = 15;

/// Relation of the draws of a campaign to each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Draws {
    Independent,
    /// Spread evenly over each axis.
    LatinHypercube,
    /// Points of one Sobol sequence, which are not independent.
    Sobol,
    /// More than one draw, but all flew the same flights.
    Alike,
    /// Nothing is drawn.
    None,
}

/// Draws of a campaign, and copies among its flights.
#[derive(Debug, Clone)]
pub struct Evidence {
    pub draws: Draws,
    /// Axis along which the draws lie, if there are any.
    axis: Option<PlanAxis>,
    /// For each controller, index of the first one that flew every flight alike; its own index if there is none.
    pub same_as: Vec<usize>,
    /// Keys of listed values without effect, each with the controllers under which no flight changed.
    pub idle: Vec<(String, Vec<usize>)>,
    /// Number of flights flown, and of different flights among them.
    pub flown: usize,
    pub distinct: usize,
}

impl Evidence {
    /// Evaluates the flights of a plan that are in `flights`.
    pub fn of(plan: &Plan, flights: &FlightTable) -> Self {
        let flown = fingerprints(flights);
        let controllers = plan.campaign.controllers.len();
        let axis = draws_axis(plan);
        let draws = match (axis, plan.campaign.samples().map(|_| plan.campaign.sampling())) {
            (None, _) => Draws::None,
            (Some(axis), _) if is_idle(&flown, axis, |_| true) => Draws::Alike,
            (_, Some(Sampling::LatinHypercube)) => Draws::LatinHypercube,
            (_, Some(Sampling::Sobol)) => Draws::Sobol,
            _ => Draws::Independent,
        };
        let of = |controller: usize| move |number: u64| number % controllers as u64 == controller as u64;
        let idle = plan.listed_axes().into_iter().filter_map(|(key, axis)| {
            let under: Vec<usize> = (0..controllers).filter(|i| is_idle(&flown, axis, of(*i))).collect();
            (!under.is_empty()).then_some((key.to_owned(), under))
        });
        let mut same_as: Vec<usize> = vec![];
        for controller in 0..controllers {
            let is_same = |first: &usize| are_same(&flown, controllers as u64, [*first, controller]);
            let first = (0..controller).filter(|first| same_as[*first] == *first).find(is_same);
            same_as.push(first.unwrap_or(controller));
        }
        let distinct = flown.values().map(|[hash, _]| hash).collect::<HashSet<_>>().len();
        Self { draws, axis, same_as, idle: idle.collect(), flown: flown.len(), distinct }
    }

    /// Returns whether the flights are a sample, so that intervals and tests apply.
    pub fn is_sample(&self) -> bool {
        matches!(self.draws, Draws::Independent | Draws::LatinHypercube)
    }

    /// Computes the rate of flights, each given by its number and whether it passed.
    pub fn rate(&self, flights: impl Iterator<Item = (u64, bool)>) -> Rate {
        let passed = |draw: &Vec<bool>| draw.iter().filter(|passed| **passed).count();
        let draws = self.by_draw(flights);
        if self.is_sample() {
            return Rate::over(draws.iter().map(|draw| (passed(draw), draw.len())));
        }
        Rate::counted(draws.iter().map(passed).sum(), draws.iter().map(Vec::len).sum())
    }

    /// Computes the difference of two controllers over flights that both have flown, each given by its number and
    /// whether the first and the second passed. `None` if the flights are no sample, or there are none.
    pub fn difference(&self, flights: impl Iterator<Item = (u64, [bool; 2])>) -> Option<Difference> {
        let more = |[one, other]: &[bool; 2]| i64::from(*one) - i64::from(*other);
        let draw = |flights: Vec<[bool; 2]>| (flights.iter().map(more).sum(), flights.len());
        let draws: Vec<(i64, usize)> = self.by_draw(flights).into_iter().map(draw).collect();
        (self.is_sample() && !draws.is_empty()).then(|| Difference::over(&draws))
    }

    /// Computes the difference of a metric of two controllers over flights that both have flown, each given by its
    /// number and the first controller's metric less the second's. `None` if the flights are no sample, or too few.
    pub fn metric_difference(&self, flights: impl Iterator<Item = (u64, f64)>) -> Option<MetricDifference> {
        let draws = self.by_draw(flights);
        let means: Vec<f64> = draws.iter().map(|draw| draw.iter().sum::<f64>() / draw.len() as f64).collect();
        self.is_sample().then(|| MetricDifference::over(&means)).flatten()
    }

    /// Groups values of flights, each given with the number of its flight, by draw.
    fn by_draw<T>(&self, flights: impl Iterator<Item = (u64, T)>) -> Vec<Vec<T>> {
        let mut draws: BTreeMap<u64, Vec<T>> = BTreeMap::new();
        flights.for_each(|(number, known)| draws.entry(self.draw(number)).or_default().push(known));
        draws.into_values().collect()
    }

    /// Returns whether intervals over draws with `each` flights of a controller cover more than 95 %.
    pub fn is_conservative(&self, each: u64) -> bool {
        each > 1 && self.all_draws() < DRAWS_PER_FLIGHT * each
    }

    /// Describes how often intervals over draws with `each` flights of a controller cover the truth.
    pub fn coverage(&self, each: u64) -> &'static str {
        if self.is_conservative(each) { "more than 95 %, with so few draws of so many flights" } else { "about 95 %" }
    }

    /// Returns the draw of a flight; 0 if nothing is drawn.
    pub fn draw(&self, number: u64) -> u64 {
        self.axis.map_or(0, |axis| axis.place(number))
    }

    /// Returns the number of the first flight with the same settings as `number`, in the first draw.
    pub fn in_first_draw(&self, number: u64) -> u64 {
        number - self.axis.map_or(0, |axis| axis.place(number) * axis.step)
    }

    /// Number of draws of the campaign.
    pub fn all_draws(&self) -> u64 {
        self.axis.map_or(0, |axis| axis.values)
    }

    /// Describes in sentences the basis of the intervals and their limits; `each` = flights of a controller per draw.
    pub fn sentences(&self, each: u64) -> String {
        let all = self.all_draws();
        let mut words = match self.draws {
            Draws::None => {
                return "Nothing is drawn: shares count what was listed, without interval or test.".to_owned();
            }
            Draws::Alike => {
                return format!(
                    "All {all} draws flew the same flights bit for bit: they are one observation, without interval or test."
                );
            }
            Draws::Sobol => {
                return "The points of one Sobol sequence are not independent: there is no interval and no test."
                    .to_owned();
            }
            Draws::Independent | Draws::LatinHypercube if each > 1 => format!(
                "The {each} flights that a controller has of each of the {all} draws are one observation. Intervals are over the \
                 shares of the draws (Bayesian bootstrap, {}); with one flight a draw, as at one listed value, they are \
                 those of Clopper and Pearson, which cover the true share in at least 95 % of all campaigns.",
                self.coverage(each)
            ),
            Draws::Independent | Draws::LatinHypercube => format!(
                "Intervals are those of Clopper and Pearson over the {all} draws, which cover the true share in at least 95 % of \
                 all campaigns."
            ),
        };
        if self.draws == Draws::LatinHypercube {
            words += " The draws are a Latin hypercube, whose shares scatter at most as those of one independent draw less \
                      (Owen, Annals of Statistics 25, 1997): the intervals are conservative, not exact.";
        }
        if all < FEW {
            let _ = write!(words, " {all} draws are too few to say much.");
        }
        words
    }

    /// Returns a sentence for each kind of copy among the flights; `names` are those of the controllers.
    pub fn copies(&self, names: &[&str]) -> Vec<String> {
        let mut words = vec![];
        if self.distinct < self.flown {
            words.push(format!(
                "Of {} flights {} differ; the others are copies bit for bit.",
                self.flown, self.distinct
            ));
        }
        for first in (0..names.len()).filter(|first| self.same_as[*first] == *first) {
            let same: Vec<&str> = (0..names.len()).filter(|i| self.same_as[*i] == first).map(|i| names[i]).collect();
            if same.len() > 1 {
                words.push(format!("{} flew every flight alike: they are one law.", same.join(" and ")));
            }
        }
        for (key, under) in &self.idle {
            let under: Vec<&str> = under.iter().map(|i| names[*i]).collect();
            let under =
                if under.len() == names.len() { String::new() } else { format!(" under {}", under.join(" and ")) };
            words.push(format!(
                "`{key}` had no effect{under}: its values flew the same flights, which are no further evidence."
            ));
        }
        words
    }
}

/// Returns the axis along which the draws of a plan lie.
fn draws_axis(plan: &Plan) -> Option<PlanAxis> {
    match plan.campaign.samples() {
        Some(samples) => Some(PlanAxis { values: samples, step: plan.flights() / samples }),
        None => plan.listed_axes().into_iter().find(|(key, _)| *key == SEED).map(|(_, axis)| axis),
    }
}

/// Hash and verdict of each flown flight, by number.
type Fingerprints<'a> = HashMap<u64, [&'a str; 2]>;

fn fingerprints(flights: &FlightTable) -> Fingerprints<'_> {
    let columns = ["flight", "hash", "verdict"].map(|name| flights.column(name));
    let [Some(numbers), Some(hashes), Some(verdicts)] = columns else { return HashMap::new() };
    let one = |row: usize| match (numbers.cell(row), hashes.text(row)) {
        (Cell::Int(number), hash) if !hash.is_empty() => Some((number as u64, [hash, verdicts.text(row)])),
        _ => None,
    };
    (0..flights.rows()).filter_map(one).collect()
}

/// Returns whether flights that differ only along `axis` are equal, among the numbers for which `meant` is true;
/// `false` without a pair.
fn is_idle(flown: &Fingerprints, axis: PlanAxis, meant: impl Fn(u64) -> bool) -> bool {
    let mut compared = false;
    for (number, is) in flown.iter().filter(|(number, _)| meant(**number) && axis.place(**number) > 0) {
        match flown.get(&(number - axis.place(*number) * axis.step)) {
            Some(first) if first == is => compared = true,
            Some(_) => return false,
            None => {}
        }
    }
    compared
}

/// Returns whether two of `controllers` controllers flew every flight alike.
fn are_same(flown: &Fingerprints, controllers: u64, [first, second]: [usize; 2]) -> bool {
    let of = |controller: usize| flown.keys().filter(move |number| **number % controllers == controller as u64);
    let is_same = |number: &u64| flown.get(&(number + (second - first) as u64)) == flown.get(number);
    of(first).count() > 0 && of(first).count() == of(second).count() && of(first).all(is_same)
}
