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

/// Quantile of the standard normal distribution, exact to 1e-15: algorithm AS 241, PPND16 (Wichura, Applied Statistics
/// 37, 1988).
fn standard_quantile(p: f64) -> f64 {
    const A: [f64; 8] = [
        3.387_132_872_796_366_5,
        1.331_416_678_917_843_8e2,
        1.971_590_950_306_551_3e3,
        1.373_169_376_550_946e4,
        4.592_195_393_154_987e4,
        6.726_577_092_700_87e4,
        3.343_057_558_358_813e4,
        2.509_080_928_730_122_7e3,
    ];
    const B: [f64; 8] = [
        1.0,
        4.231_333_070_160_091e1,
        6.871_870_074_920_579e2,
        5.394_196_021_424_751e3,
        2.121_379_430_158_659_7e4,
        3.930_789_580_009_271e4,
        2.872_908_573_572_194_3e4,
        5.226_495_278_852_854e3,
    ];
    const C: [f64; 8] = [
        1.423_437_110_749_683_5,
        4.630_337_846_156_546,
        5.769_497_221_460_691,
        3.647_848_324_763_204_5,
        1.270_458_252_452_368_4,
        2.417_807_251_774_506e-1,
        2.272_384_498_926_918_4e-2,
        7.745_450_142_783_414e-4,
    ];
    const D: [f64; 8] = [
        1.0,
        2.053_191_626_637_759,
        1.676_384_830_183_803_8,
        6.897_673_349_851e-1,
        1.481_039_764_274_800_8e-1,
        1.519_866_656_361_645_7e-2,
        5.475_938_084_995_345e-4,
        1.050_750_071_644_416_9e-9,
    ];
    const E: [f64; 8] = [
        6.657_904_643_501_103,
        5.463_784_911_164_114,
        1.784_826_539_917_291_3,
        2.965_605_718_285_048_7e-1,
        2.653_218_952_657_612_4e-2,
        1.242_660_947_388_078_4e-3,
        2.711_555_568_743_487_6e-5,
        2.010_334_399_292_288_1e-7,
    ];
    const F: [f64; 8] = [
        1.0,
        5.998_322_065_558_88e-1,
        1.369_298_809_227_358e-1,
        1.487_536_129_085_061_5e-2,
        7.868_691_311_456_133e-4,
        1.846_318_317_510_054_7e-5,
        1.421_511_758_316_446e-7,
        2.044_263_103_389_939_8e-15,
    ];
    let polynomial = |of: &[f64; 8], x: f64| of.iter().rev().fold(0.0, |sum, c| sum * x + c);
    let ratio = |over: &[f64; 8], under: &[f64; 8], x: f64| polynomial(over, x) / polynomial(under, x);
    let q = p - 0.5;
    if p == 0.0 || p == 1.0 {
        return q * f64::INFINITY; // rounded to 0 or 1
    }
    if q.abs() <= 0.425 {
        return q * ratio(&A, &B, 0.180_625 - q * q);
    }
    let r = (-libm::log(if q < 0.0 { p } else { 1.0 - p })).sqrt();
    let size = if r <= 5.0 { ratio(&C, &D, r - 1.6) } else { ratio(&E, &F, r - 5.0) };
    if q < 0.0 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reference: values of Wichura's paper and of R's `qnorm`.
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
