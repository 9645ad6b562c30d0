//! Normal distribution, whole or truncated to a range.

use std::f64::consts::SQRT_2;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Normal distribution, as a campaign file gives it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    /// Mean, in the unit of the setting.
    pub mean: f64,
    /// Standard deviation, above 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub deviation: f64,
    /// Ends of the truncated distribution; `None` = not truncated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<[f64; 2]>,
}

impl Normal {
    /// Sign of the tail in which `within` lies: 1 if all of it is above the mean, else -1. Shares of the upper tail are
    /// counted from above, because counted from below they would all round to 1.
    fn tail(&self) -> f64 {
        if self.within.is_some_and(|[low, _]| low > self.mean) { 1.0 } else { -1.0 }
    }

    /// Returns whether the truncated range has a probability above 0.
    pub fn has_values(&self) -> bool {
        let [one, other] = self.shares();
        one != other
    }

    /// Returns the value below which the share `u` of all values lies, 0 < u < 1.
    pub fn quantile(&self, u: f64) -> f64 {
        let [first, last] = self.shares();
        let z = -self.tail() * standard_quantile(first + (last - first) * u);
        let [low, high] = self.within.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        (self.mean + self.deviation * z).clamp(low, high)
    }

    /// Shares of all values beyond the ends of `within`, counted from the end of the [`tail`](Self::tail).
    fn shares(&self) -> [f64; 2] {
        let beyond = |x: f64| 0.5 * libm::erfc(self.tail() * (x - self.mean) / (self.deviation * SQRT_2));
        self.within.map_or([0.0, 1.0], |ends| ends.map(beyond))
    }
}

/// Quantile of the standard normal distribution, by bisection down to neighbouring numbers. `erfc` is that of `libm`,
/// so that a draw has the same bits on every processor.
fn standard_quantile(p: f64) -> f64 {
    if p > 0.5 {
        return -standard_quantile(1.0 - p);
    }
    let (mut low, mut high) = (-40.0, 0.0); // below -38.5 the share rounds to 0
    loop {
        let z = f64::midpoint(low, high);
        if z == low || z == high {
            return z;
        }
        *if 0.5 * libm::erfc(-z / SQRT_2) < p { &mut low } else { &mut high } = z;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: values of Wichura's paper (algorithm AS 241, Applied Statistics 37, 1988) and of R's `qnorm`.
    #[test]
    fn val_the_standard_quantile_is_that_of_the_tables() {
        for (p, expected) in [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_081_7),
            (0.975, 1.959_963_984_540_054),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
        ] {
            assert!((standard_quantile(p) - expected).abs() < 1e-14, "{p}: {}", standard_quantile(p));
        }
    }

    #[test]
    fn every_draw_of_a_truncated_tail_is_within_its_ends() {
        for (mean, deviation, [low, high]) in
            [(0.0, 1.0, [9.0, 10.0]), (0.0, 1.0, [-10.0, -9.0]), (1.1, 0.01, [1.0, 9.0])]
        {
            let normal = Normal { mean, deviation, within: Some([low, high]) };
            let at = |u: f64| normal.quantile(u);
            let drawn: Vec<f64> = (1..1000).map(|i| at(f64::from(i) / 1000.0)).collect();
            assert!(drawn.iter().all(|x| (low..=high).contains(x)), "{normal:?}: {drawn:?}");
            assert!(drawn.windows(2).all(|two| two[0] < two[1]), "{normal:?}: they rise");
            assert!(at(f64::EPSILON) >= low && at(1.0 - f64::EPSILON) <= high, "{normal:?}: the ends");
        }
        let within = |ends| Normal { mean: 0.0, deviation: 1.0, within: Some(ends) };
        for u in [0.001, 0.25, 0.5] {
            let (above, below) = (within([9.0, 10.0]).quantile(u), within([-10.0, -9.0]).quantile(1.0 - u));
            assert!((above + below).abs() < 1e-12, "{above} and {below} are mirrored");
        }
    }
}
