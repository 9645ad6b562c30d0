//! Section "Which controller passes more": each pair of controllers over the cases that both have flown.
//!
//! The controllers fly the same draws, so a draw that both pass or both fail does not tell which controller is better.
//! Controllers that flew every flight alike are one law, and have one comparison.

use view::draw::{escape, short, table};

use super::data::CampaignPage;
use crate::difference::Difference;

/// Number of comparisons that are shown; the others are folded.
const OPEN: usize = 8;

/// Two controllers, and counts of the cases that both have flown.
#[derive(Debug, Clone, PartialEq)]
struct Pair {
    /// Indices of the controllers; the one that passes more cases comes first.
    names: [usize; 2],
    /// Numbers of the cases that only the first passes, only the second, both, and neither.
    counts: [u64; 4],
    /// Difference of the shares; `None` if the flights are no sample.
    difference: Option<Difference>,
}

/// Returns the section; empty with one law only, and with `[limit]`, because a limit is no share.
pub fn section(page: &CampaignPage) -> String {
    let pairs = compare(page);
    if pairs.is_empty() || page.plan.campaign.limit().is_some() {
        return String::new();
    }
    let probabilities: Option<Vec<f64>> = pairs.iter().map(|pair| Some(pair.difference?.p)).collect();
    let several = pairs.len() > 1;
    let mut headings = vec!["A", "B", "only A passes", "only B passes", "both", "neither"];
    let mut rows: Vec<Vec<String>> = pairs
        .iter()
        .map(|pair| {
            let counts = pair.counts.map(|count| count.to_string());
            [pair.names.map(|i| law(page, i)).to_vec(), counts.to_vec()].concat()
        })
        .collect();
    let mut words = String::new();
    if let Some(probabilities) = probabilities {
        headings.extend(["A less B", "95 % interval", "p"]);
        headings.extend(several.then_some("p, Holm"));
        for ((row, pair), adjusted) in rows.iter_mut().zip(&pairs).zip(holm(&probabilities)) {
            let Some(Difference { share, low, high, p }) = pair.difference else { continue };
            let [share, low, high] = [share, low, high].map(|share| format!("{:+.1}", 100.0 * share + 0.0));
            row.extend([format!("{share} %"), format!("{low} to {high} %"), probability(p)]);
            row.extend(several.then(|| probability(adjusted)));
        }
        words = explained(page, pairs.len());
    }
    let folded = match rows.len() {
        0..=OPEN => String::new(),
        all => {
            let others = table(&headings, rows[OPEN..].iter().cloned());
            format!("<details><summary>{} more pairs</summary>{others}</details>", all - OPEN)
        }
    };
    let open = table(&headings, rows.into_iter().take(OPEN));
    format!(
        "<section id=\"pairs\"><h2>Which controller passes more</h2><p>All controllers fly the same cases: the same values, seeds \
         and faults.{words}</p>{open}{folded}</section>"
    )
}

/// Describes interval and tests of `pairs` pairs in sentences.
fn explained(page: &CampaignPage, pairs: usize) -> String {
    let test = if page.each() > 1 {
        "exact two-sided permutation test, which flips the sign of each draw's difference"
    } else {
        "McNemar's test, exact, two-sided"
    };
    let coverage = page.evidence.coverage(page.each());
    let several = if pairs > 1 {
        format!(
            " Each interval and each <i>p</i> is for one pair alone. Of {pairs} such tests some may fall below 0.05 by chance; the \
             last column allows for that."
        )
    } else {
        String::new()
    };
    format!(
        " So they are compared in pairs, draw by draw. The table has how much larger A's share of passed flights is, with its \
         interval over the draws (Bayesian bootstrap, {coverage}), and <i>p</i>, the probability of a difference at least this \
         large if the two were equally good ({test}).{several}"
    )
}

/// Compares every pair of controllers; sorted by p-value, the smallest first.
fn compare(page: &CampaignPage) -> Vec<Pair> {
    let cases = page.by_case(|_| true);
    let pair = |a: usize, b: usize| {
        let flown =
            || cases.iter().filter_map(|(case, rows)| Some((*case, [page.passed[rows[a]?]?, page.passed[rows[b]?]?])));
        let count = |meant: [bool; 2]| flown().filter(|(_, passed)| *passed == meant).count() as u64;
        let mut counts = [[true, false], [false, true], [true, true], [false, false]].map(count);
        let is_turned = counts[0] < counts[1];
        if is_turned {
            counts.swap(0, 1);
        }
        let turn = |[one, other]: [bool; 2]| if is_turned { [other, one] } else { [one, other] };
        let first_of_case = |case: u64| case * page.names.len() as u64;
        Pair {
            names: if is_turned { [b, a] } else { [a, b] },
            counts,
            difference: page.evidence.difference(flown().map(|(case, passed)| (first_of_case(case), turn(passed)))),
        }
    };
    let laws: Vec<usize> = (0..page.names.len()).filter(|i| page.evidence.same_as[*i] == *i).collect();
    let mut pairs: Vec<Pair> =
        laws.iter().enumerate().flat_map(|(i, a)| laws[i + 1..].iter().map(|b| pair(*a, *b))).collect();
    let p = |pair: &Pair| pair.difference.map_or(1.0, |difference| difference.p);
    pairs.sort_by(|one, other| p(one).total_cmp(&p(other)));
    pairs
}

/// Returns the names of all controllers that flew as `first` did.
fn law(page: &CampaignPage, first: usize) -> String {
    let same = (0..page.names.len()).filter(|i| page.evidence.same_as[*i] == first);
    same.map(|i| escape(page.names[i])).collect::<Vec<_>>().join(" = ")
}

/// Adjusts p-values, given in rising order, so that the probability that any falls below a level by chance is at most
/// that of one test (Holm, Scandinavian Journal of Statistics 6, 1979).
pub fn holm(rising: &[f64]) -> Vec<f64> {
    let step = |(i, p): (usize, &f64)| ((rising.len() - i) as f64 * p).min(1.0);
    let stepped = rising.iter().enumerate().map(step);
    stepped
        .scan(0.0, |most: &mut f64, p| {
            *most = most.max(p);
            Some(*most)
        })
        .collect()
}

/// Formats a p-value, bold below 0.05.
fn probability(p: f64) -> String {
    let word = short(p);
    if p < 0.05 { format!("<b>{word}</b>") } else { word }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn val_p_values_of_several_tests_are_adjusted_by_holm() {
        let adjusted = holm(&[0.01, 0.02, 0.022, 0.5]);
        for (is, expected) in adjusted.iter().zip([0.04, 0.06, 0.06, 0.5]) {
            assert!((is - expected).abs() < 1e-12, "{adjusted:?}");
        }
    }
}
