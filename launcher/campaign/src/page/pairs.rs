//! Every two controllers over the draws that both have flown.
//!
//! The controllers fly the same draws, so a draw that both pass or both lose says nothing of which is better: the test is over
//! the draws that tell them apart.

use view::draw::{escape, short, table};

use crate::rate::mcnemar;

/// So many comparisons stand open; the others are folded.
const OPEN: usize = 8;

/// Two controllers, and what became of the draws that both have flown.
#[derive(Debug, Clone, PartialEq)]
struct Pair {
    /// The one that passes more of them comes first.
    names: [usize; 2],
    only: [u64; 2],
    both: u64,
    neither: u64,
    p: f64,
}

/// The section of the comparisons. `draws` has for each draw whether each controller passes it; `None` was not flown.
pub fn section(names: &[&str], draws: &[Vec<Option<bool>>]) -> String {
    let pairs = compare(names.len(), draws);
    if pairs.is_empty() {
        return String::new();
    }
    let adjusted = holm(&pairs.iter().map(|pair| pair.p).collect::<Vec<_>>());
    let several = pairs.len() > 1;
    let rows: Vec<Vec<String>> = pairs
        .iter()
        .zip(adjusted)
        .map(|(pair, adjusted)| {
            let mut row = pair.names.map(|i| escape(names[i])).to_vec();
            row.extend([pair.only[0], pair.only[1], pair.both, pair.neither].map(|count| count.to_string()));
            row.push(probability(pair.p));
            row.extend(several.then(|| probability(adjusted)));
            row
        })
        .collect();
    let mut headings = vec!["A", "B", "only A passes", "only B passes", "both", "neither", "p"];
    let (mut of_several, mut folded) = (String::new(), String::new());
    if several {
        headings.push("p, Holm");
        of_several =
            format!(" Of {} such tests some fall below 0.05 by chance; the last column allows for that.", pairs.len());
    }
    if rows.len() > OPEN {
        let others = table(&headings, rows[OPEN..].iter().cloned());
        folded = format!("<details><summary>{} more pairs</summary>{others}</details>", rows.len() - OPEN);
    }
    let open = table(&headings, rows.into_iter().take(OPEN));
    format!(
        "<section id=\"pairs\"><h2>Which controller passes more</h2><p>All controllers fly the same draws: the same values, seeds \
         and faults. So two of them are compared draw by draw, and only the draws count that one passes and the other loses. \
         <i>p</i> is the chance that these split at least so unevenly were the two alike (McNemar's test, exact, \
         two-sided).{of_several}</p>{open}{folded}</section>"
    )
}

/// All pairs, those that differ most surely first.
fn compare(controllers: usize, draws: &[Vec<Option<bool>>]) -> Vec<Pair> {
    let pair = |a: usize, b: usize| {
        let flown = draws.iter().filter_map(|draw| Some((draw[a]?, draw[b]?)));
        let (mut only, mut both, mut neither) = ([0, 0], 0, 0);
        for passed in flown {
            match passed {
                (true, true) => both += 1,
                (true, false) => only[0] += 1,
                (false, true) => only[1] += 1,
                (false, false) => neither += 1,
            }
        }
        let p = mcnemar(only[0], only[1]);
        if only[0] < only[1] {
            Pair { names: [b, a], only: [only[1], only[0]], both, neither, p }
        } else {
            Pair { names: [a, b], only, both, neither, p }
        }
    };
    let mut pairs: Vec<Pair> = (0..controllers).flat_map(|a| (a + 1..controllers).map(move |b| pair(a, b))).collect();
    pairs.sort_by(|one, other| one.p.total_cmp(&other.p));
    pairs
}

/// The probabilities of several tests, in rising order, so that any of them falls below a level by chance as rarely as one
/// test would (Holm, Scandinavian Journal of Statistics 6, 1979).
fn holm(rising: &[f64]) -> Vec<f64> {
    let step = |(i, p): (usize, &f64)| ((rising.len() - i) as f64 * p).min(1.0);
    let stepped = rising.iter().enumerate().map(step);
    stepped
        .scan(0.0, |most: &mut f64, p| {
            *most = most.max(p);
            Some(*most)
        })
        .collect()
}

/// Bold where it is below 0.05.
fn probability(p: f64) -> String {
    let word = short(p);
    if p < 0.05 { format!("<b>{word}</b>") } else { word }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_of_the_draws_that_both_have_flown() {
        let draw = |a, b| vec![Some(a), b];
        let mut draws = vec![draw(true, Some(true)); 7];
        draws.extend(vec![draw(false, Some(true)); 5]);
        draws.extend([draw(false, Some(false)), draw(true, None), draw(false, None)]);
        let pairs = compare(2, &draws);
        assert_eq!(pairs, [Pair { names: [1, 0], only: [5, 0], both: 7, neither: 1, p: pairs[0].p }]);
        let html = section(&["lqr", "mpc"], &draws);
        assert!((pairs[0].p - 0.0625).abs() < 1e-12 && html.contains(">0.0625</td>"), "{html}");
        assert_eq!(section(&["alone"], &[vec![Some(true)]]), "");
    }

    #[test]
    fn val_several_tests_are_adjusted_as_holm_does() {
        let adjusted = holm(&[0.01, 0.02, 0.022, 0.5]);
        for (is, expected) in adjusted.iter().zip([0.04, 0.06, 0.06, 0.5]) {
            assert!((is - expected).abs() < 1e-12, "{adjusted:?}");
        }
    }
}
