//! 95 % interval of the mean of independent draws that lie between two known ends.
//!
//! If all draws are at their ends, as passed and failed flights are, the interval is that of Clopper and Pearson
//! (Biometrika 26, 1934). It is exact: it covers the true mean with a probability of at least 95 %.
//!
//! Otherwise it is the Bayesian bootstrap (Rubin, Annals of Statistics 9, 1981): the draws get random weights with sum
//! 1 (Dirichlet, uniform), and an end is a quantile of the weighted mean. Half a draw is added for what was not
//! observed: with the least value for the lower end, with the greatest for the upper one. A whole added draw gives the
//! bound of Gaffke (Mathematical Methods of Statistics 14, 2005), conjectured to cover at least as often as it says;
//! for draws at their ends it equals Clopper and Pearson's. Half a draw covers about 95 % (`coverage.rs`). Draws that
//! are all equal do not show how they scatter; for them a whole draw is added.

use std::f64::consts::PI;

use statrs::distribution::{Beta, ContinuousCDF};

/// Confidence of an interval is 1 - `ALPHA`.
pub const ALPHA: f64 = 0.05;
/// Accuracy of the probability of a quantile, at which the search for the quantile ends.
const ACCURACY: f64 = 1e-9;
/// Largest number of steps of the search for a quantile.
const MAX_STEPS: usize = 100;
/// Step of the quadrature, small enough for an error below 1e-9.
const STEP: f64 = 0.05;
/// Decay at which the quadrature ends: an integrand below `exp(-NOTHING)` adds nothing.
const NOTHING: f64 = 30.0;

/// Returns the ends of the 95 % interval of the mean of `draws`, which all lie within `ends`.
pub fn interval(mut draws: Vec<f64>, ends: [f64; 2]) -> [f64; 2] {
    draws.sort_by(f64::total_cmp);
    let counts: Vec<(f64, f64)> =
        draws.chunk_by(|one, other| one == other).map(|same| (same[0], same.len() as f64)).collect();
    let mirrored: Vec<(f64, f64)> = counts.iter().map(|(value, count)| (-value, *count)).collect();
    [lower_end(counts, ends), -lower_end(mirrored, [-ends[1], -ends[0]])]
}

/// Returns the lower end; `counts` has each value with the number of draws that have it.
fn lower_end(mut counts: Vec<(f64, f64)>, [least, most]: [f64; 2]) -> f64 {
    let is_end = |value: f64| value == least || value == most;
    if counts.iter().all(|(value, _)| is_end(*value)) {
        let of = |end: f64| counts.iter().filter(|(value, _)| *value == end).map(|(_, count)| count).sum::<f64>();
        let beta = Beta::new(of(most), of(least) + 1.0);
        return least + (most - least) * beta.map_or(0.0, |beta| beta.inverse_cdf(ALPHA / 2.0));
    }
    counts.push((least, if counts.len() == 1 { 1.0 } else { 0.5 }));
    quantile(&counts, ALPHA / 2.0)
}

/// Returns the value below which the mean of `counts` lies with probability `p` under Dirichlet weights.
fn quantile(counts: &[(f64, f64)], p: f64) -> f64 {
    let all: f64 = counts.iter().map(|(_, count)| count).sum();
    let mean = counts.iter().map(|(value, count)| value * count).sum::<f64>() / all;
    let spread = counts.iter().map(|(value, count)| count * (value - mean) * (value - mean)).sum::<f64>() / all;
    let deviation = (spread / (all + 1.0)).sqrt();
    // The quantile lies between these two ends by Cantelli's inequality.
    let odds = (1.0 / p - 1.0).sqrt();
    let excess = |t: f64| (t, chance_below(counts, t) - p);
    let (mut low, mut high) = (excess(mean - deviation * odds), excess(mean + deviation / odds));
    // Regula falsi with the Illinois rule: the value at the end that stays is halved.
    for _ in 0..MAX_STEPS {
        let t = low.0 - low.1 * (high.0 - low.0) / (high.1 - low.1);
        let next = excess(t);
        match next.1 {
            e if e.abs() < ACCURACY => return t,
            e if e < 0.0 => (low, high.1) = (next, high.1 / 2.0),
            _ => (high, low.1) = (next, low.1 / 2.0),
        }
    }
    f64::midpoint(low.0, high.0)
}

/// Returns the probability that the mean of `counts` under Dirichlet weights is below `t`: the probability that a sum
/// of independent gamma variables, each times the distance of its value from `t`, is below 0. The characteristic
/// function is inverted (Imhof, Biometrika 48, 1961) by the double exponential quadrature of Takahasi and Mori (1974).
fn chance_below(counts: &[(f64, f64)], t: f64) -> f64 {
    let squares: f64 = counts.iter().map(|(value, count)| count * (value - t) * (value - t)).sum();
    let mut sum = 0.0;
    for step in 0.. {
        let x = -4.0 + STEP * f64::from(step);
        let u = libm::exp(x - libm::exp(-x)) / squares.sqrt();
        let (mut angle, mut decay) = (0.0, 0.0);
        for (value, count) in counts {
            let turn = (value - t) * u;
            angle += count * libm::atan(turn);
            decay += 0.5 * count * libm::log1p(turn * turn);
        }
        sum += libm::sin(angle) * libm::exp(-decay) * (1.0 + libm::exp(-x));
        if decay > NOTHING {
            break;
        }
    }
    0.5 - sum * STEP / PI
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(is: [f64; 2], expected: [f64; 2], within: f64) {
        let apart = is.iter().zip(expected).map(|(is, expected)| (is - expected).abs()).fold(0.0, f64::max);
        assert!(apart < within, "{is:?}, not {expected:?}");
    }

    /// Reference: quantiles of the Beta distribution, which the weights of two values have.
    #[test]
    fn val_with_two_values_the_quantile_is_that_of_beta() {
        for (ones, others) in [(1.0, 1.0), (3.0, 1.0), (45.0, 6.0), (999.0, 2.0), (1700.0, 1635.0)] {
            let beta = Beta::new(ones, others).unwrap().inverse_cdf(0.025);
            let is = quantile(&[(1.0, ones), (0.0, others)], 0.025);
            assert!((is - beta).abs() < 1e-7, "{ones} and {others}: {is}, not {beta}");
        }
    }

    /// Reference: with one draw each at 0, 1/2 and 1 the weighted mean has the triangular distribution.
    #[test]
    fn val_with_three_values_the_quantile_is_that_of_the_triangle() {
        let is = quantile(&[(0.0, 1.0), (0.5, 1.0), (1.0, 1.0)], 0.02);
        assert!((is - 0.1).abs() < 1e-7, "2 t^2 = 0.02 at t = {is}");
    }

    #[test]
    fn the_interval_of_equal_draws_allows_for_unseen_ones() {
        let all = libm::pow(0.025, 1.0 / 50.0);
        near(interval(vec![1.0; 50], [0.0, 1.0]), [all, 1.0], 1e-6);
        let thirds = 2.0 / 3.0;
        near(interval(vec![thirds; 50], [0.0, 1.0]), [thirds * all, 1.0 - (1.0 - thirds) * all], 1e-6);
        near(interval(vec![0.0; 50], [-1.0, 1.0]), [all - 1.0, 1.0 - all], 1e-6);
    }

    #[test]
    fn an_interval_mirrors_shifts_and_scales_with_its_draws() {
        let draws = vec![0.0, 1.0, 0.5, 0.5, 1.0, 1.0, 0.25];
        let [low, high] = interval(draws.clone(), [0.0, 1.0]);
        near(interval(draws.iter().map(|x| 1.0 - x).collect(), [0.0, 1.0]), [1.0 - high, 1.0 - low], 1e-8);
        near(
            interval(draws.iter().map(|x| 2.0 * x - 1.0).collect(), [-1.0, 1.0]),
            [2.0 * low - 1.0, 2.0 * high - 1.0],
            1e-8,
        );
    }
}
