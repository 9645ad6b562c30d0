//! What one setting varies over: values that are all flown, or a distribution that values are drawn from.
//!
//! Drawn values are quantiles of numbers between 0 and 1, by which any sampling has any distribution. They are the same on
//! every machine: the elementary functions are those of the crate `libm`, not of the C library.

use std::collections::HashSet;
use std::f64::consts::SQRT_2;

use anyhow::{Context, bail, ensure};
use serde::{Deserialize, Serialize};
use toml::Value;

use crate::table::Kind;

/// One setting and its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Dotted, as in a scenario; numbers count the elements of an array.
    pub key: String,
    pub values: Values,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// Each of them is flown.
    Listed(Vec<Value>),
    /// One is drawn for each sample.
    Drawn(Distribution),
}

/// `{ range = ... }` and the distributions, as the file has them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Variation {
    Range(Range),
    Uniform([f64; 2]),
    LogUniform([f64; 2]),
    Integer([i64; 2]),
    Normal(Normal),
    Choice(Vec<Value>),
}

/// The words of [`Variation`].
const WORDS: [&str; 6] = ["range", "uniform", "log_uniform", "integer", "normal", "choice"];

/// A word that differs from one of these in so many letters was meant to be it.
const MAX_SLIPS: usize = 2;

/// Evenly spaced values, the ends included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Range {
    from: f64,
    to: f64,
    steps: u32,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Normal {
    pub mean: f64,
    pub deviation: f64,
    /// Only what lies within is drawn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub within: Option<[f64; 2]>,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Distribution {
    /// Evenly from the first to the second.
    Uniform([f64; 2]),
    /// Its logarithm evenly.
    LogUniform([f64; 2]),
    /// A whole number, each with the same chance, both ends included. Of more than 2^53 numbers, so many can be drawn.
    Integer([i64; 2]),
    Normal(Normal),
    /// One of these, each with the same chance.
    Choice(Vec<Value>),
}

impl Factor {
    /// The factors of a table `[vary]`, by their keys in order.
    ///
    /// # Errors
    /// What is neither a list nor a variation, with its key.
    pub fn all(vary: &toml::Table) -> anyhow::Result<Vec<Self>> {
        let mut factors = vec![];
        collect("", vary, &mut factors)?;
        factors.sort_by(|a, b| a.key.cmp(&b.key));
        Ok(factors)
    }

    /// The factor that flies each of `list`.
    ///
    /// # Errors
    /// An empty list, or a value that stands in it twice: its flights would be counted twice.
    pub fn listed(key: &str, list: Vec<Value>) -> anyhow::Result<Self> {
        ensure!(!list.is_empty(), "`{key}`: an empty list; give the values to fly");
        let mut seen = HashSet::new();
        for value in &list {
            ensure!(
                seen.insert(identity(value)),
                "`{key}` lists {value} twice: a copy of a flight is no evidence; leave one of them away"
            );
        }
        Ok(Self { key: key.to_owned(), values: Values::Listed(list) })
    }

    fn new(key: &str, value: &Value) -> anyhow::Result<Self> {
        check_elements(key)?;
        let values = match value {
            Value::Array(list) => return Self::listed(key, list.clone()),
            Value::Table(_) => {
                let variation: Variation = value.clone().try_into().with_context(|| format!("`{key}` = {value}"))?;
                variation.values().with_context(|| format!("`{key}` = {value}"))?
            }
            _ => bail!(
                "`{key}` = {value} in [vary] has one value: give a list of values, or {}; what all flights have in common \
                 belongs into [settings]",
                WORDS.map(|word| format!("{{ {word} = ... }}")).join(", ")
            ),
        };
        Ok(Self { key: key.to_owned(), values })
    }
}

/// Text that equal values have in common, of which 1 and 1.0 are two.
fn identity(value: &Value) -> String {
    match value {
        Value::Integer(n) => format!("{:?}", *n as f64),
        Value::Float(x) => format!("{:?}", x + 0.0), // -0 is 0
        Value::Array(all) => format!("[{}]", all.iter().map(identity).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

/// Refuses a second way to write the number of an element, which would be a column of its own.
fn check_elements(key: &str) -> anyhow::Result<()> {
    for name in key.split('.') {
        if let Ok(number) = name.parse::<usize>() {
            ensure!(
                name == number.to_string(),
                "`{key}` in [vary]: the element `{name}` of an array is written `{number}`"
            );
        }
    }
    Ok(())
}

/// Goes down the tables of dotted keys to what varies.
fn collect(path: &str, table: &toml::Table, factors: &mut Vec<Factor>) -> anyhow::Result<()> {
    for (name, value) in table {
        let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value {
            Value::Table(inner) if !inner.keys().any(|word| WORDS.contains(&word.as_str())) => {
                ensure!(!inner.is_empty(), "`{key}` in [vary] is empty");
                for (word, meant) in inner.keys().flat_map(|word| WORDS.map(|meant| (word, meant))) {
                    let is_slip = strsim::osa_distance(word, meant) <= MAX_SLIPS && !inner[word].is_table();
                    ensure!(!is_slip, "`{key}` in [vary]: unknown word `{word}`; did you mean `{meant}`?");
                }
                collect(&key, inner, factors)?;
            }
            _ => factors.push(Factor::new(&key, value)?),
        }
    }
    Ok(())
}

impl Variation {
    fn values(self) -> anyhow::Result<Values> {
        let rises = |[low, high]: [f64; 2]| {
            ensure!(
                low.is_finite() && high.is_finite() && low < high,
                "give two finite numbers, the smaller one first"
            );
            Ok(())
        };
        Ok(match self {
            Self::Range(Range { from, to, steps }) => {
                ensure!(steps >= 2 && from.is_finite() && to.is_finite(), "give finite ends, and at least 2 steps");
                let step = (to - from) / f64::from(steps - 1);
                let at = |i: u32| if i + 1 == steps { to } else { from + step * f64::from(i) };
                Values::Listed((0..steps).map(|i| Value::Float(at(i))).collect())
            }
            Self::Uniform(ends) => {
                rises(ends)?;
                Values::Drawn(Distribution::Uniform(ends))
            }
            Self::LogUniform(ends) => {
                rises(ends)?;
                ensure!(ends[0] > 0.0, "the logarithm is of numbers above 0");
                Values::Drawn(Distribution::LogUniform(ends))
            }
            Self::Integer(ends) => {
                ensure!(ends[0] < ends[1], "give two whole numbers, the smaller one first");
                Values::Drawn(Distribution::Integer(ends))
            }
            Self::Normal(normal) => {
                let Normal { mean, deviation, within } = normal;
                ensure!(mean.is_finite() && deviation.is_finite() && deviation > 0.0, "give a deviation above 0");
                within.map_or(Ok(()), rises)?;
                let [low, high] = normal.shares();
                ensure!(low != high, "no values lie within; widen it");
                Values::Drawn(Distribution::Normal(normal))
            }
            Self::Choice(choices) => {
                ensure!(!choices.is_empty(), "give the values to choose from");
                Values::Drawn(Distribution::Choice(choices))
            }
        })
    }
}

impl Values {
    /// The values that a reader of the file sees: all of a list, the ends of a distribution.
    pub fn ends(&self) -> Vec<Value> {
        match self {
            Self::Listed(all) | Self::Drawn(Distribution::Choice(all)) => all.clone(),
            Self::Drawn(Distribution::Uniform(ends) | Distribution::LogUniform(ends)) => ends.map(Value::Float).into(),
            Self::Drawn(Distribution::Integer(ends)) => ends.map(Value::Integer).into(),
            Self::Drawn(distribution @ Distribution::Normal(_)) => vec![distribution.quantile(0.5)],
        }
    }

    /// What a column of them holds.
    pub fn kind(&self) -> Kind {
        let all = self.ends();
        match () {
            () if all.iter().all(Value::is_integer) => Kind::Int,
            () if all.iter().all(|value| value.is_integer() || value.is_float()) => Kind::Real,
            () if all.iter().all(Value::is_bool) => Kind::Bool,
            () => Kind::Text,
        }
    }
}

impl Normal {
    /// The sign of the tail in which `within` lies: -1 below the mean, 1 above it. Shares of the upper tail are counted from
    /// above, because those from below are all 1 there but for rounding.
    fn tail(&self) -> f64 {
        if self.within.is_some_and(|[low, _]| low > self.mean) { 1.0 } else { -1.0 }
    }

    /// The shares of all values beyond the ends of `within`, counted from the end of the [`tail`](Self::tail).
    fn shares(&self) -> [f64; 2] {
        let beyond = |x: f64| 0.5 * libm::erfc(self.tail() * (x - self.mean) / (self.deviation * SQRT_2));
        self.within.map_or([0.0, 1.0], |ends| ends.map(beyond))
    }
}

impl Distribution {
    /// The value below which the share `u` of all values lies, 0 < u < 1.
    pub fn quantile(&self, u: f64) -> Value {
        let between = |[low, high]: [f64; 2]| low + (high - low) * u;
        // The differences of two whole numbers have 65 bits.
        let index = |count: i128| ((u * count as f64) as i128).min(count - 1);
        match self {
            Self::Uniform(ends) => Value::Float(between(*ends)),
            Self::LogUniform(ends) => {
                let [low, high] = *ends;
                Value::Float(libm::exp(between(ends.map(libm::log))).clamp(low, high))
            }
            Self::Integer(ends) => {
                let [low, high] = ends.map(i128::from);
                Value::Integer((low + index(high - low + 1)) as i64)
            }
            Self::Normal(normal) => {
                let [low, high] = normal.within.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                let z = -normal.tail() * normal_quantile(between(normal.shares()));
                let x = normal.mean + normal.deviation * z;
                Value::Float(x.clamp(low, high))
            }
            Self::Choice(choices) => choices[index(choices.len() as i128) as usize].clone(),
        }
    }
}

/// The quantile of the standard normal distribution, exact to 1e-15: algorithm AS 241, PPND16 (Wichura, Applied
/// Statistics 37, 1988).
fn normal_quantile(p: f64) -> f64 {
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
        return q * f64::INFINITY; // where rounding has reached an end
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

    fn factors(text: &str) -> anyhow::Result<Vec<Factor>> {
        Factor::all(&text.parse().unwrap())
    }

    fn drawn(text: &str) -> Distribution {
        match factors(&format!("x = {text}")).unwrap().remove(0).values {
            Values::Drawn(distribution) => distribution,
            Values::Listed(list) => panic!("{list:?}"),
        }
    }

    /// The values that Wichura's paper and R's `qnorm` give.
    #[test]
    fn val_the_normal_quantile_is_that_of_the_tables() {
        for (p, expected) in [
            (0.5, 0.0),
            (0.25, -0.674_489_750_196_081_7),
            (0.975, 1.959_963_984_540_054),
            (0.001, -3.090_232_306_167_813_5),
            (1e-20, -9.262_340_089_798_408),
        ] {
            assert!((normal_quantile(p) - expected).abs() < 1e-14, "{p}: {}", normal_quantile(p));
        }
    }

    #[test]
    fn a_quantile_lies_where_its_distribution_has_it() {
        assert_eq!(drawn("{ uniform = [2, 4] }").quantile(0.25), Value::Float(2.5));
        assert_eq!(drawn("{ integer = [1, 6] }").quantile(0.999_999), Value::Integer(6));
        assert_eq!(drawn("{ integer = [1, 6] }").quantile(0.16), Value::Integer(1));
        assert_eq!(drawn("{ choice = ['a', 'b'] }").quantile(0.5), Value::from("b"));
        let near = |value: Value, expected: f64| (value.as_float().unwrap() - expected).abs() < 1e-12;
        assert!(near(drawn("{ log_uniform = [0.01, 100.0] }").quantile(0.5), 1.0));
        assert!(near(
            drawn("{ normal = { mean = 3.0, deviation = 2.0 } }").quantile(0.975),
            3.0 + 2.0 * 1.959_963_984_540_054
        ));
        let within = drawn("{ normal = { mean = 0.0, deviation = 1.0, within = [0.0, 1.0] } }");
        assert!(near(within.quantile(1e-15), 0.0) && within.quantile(1.0 - 1e-16).as_float().unwrap() <= 1.0);
    }

    /// Against R: `qnorm(p, lower.tail = FALSE)` between the shares beyond both ends.
    #[test]
    fn val_every_draw_within_a_far_tail_is_a_number_within() {
        for (text, [low, high]) in [
            ("{ normal = { mean = 0.0, deviation = 1.0, within = [9.0, 10.0] } }", [9.0, 10.0]),
            ("{ normal = { mean = 0.0, deviation = 1.0, within = [-10.0, -9.0] } }", [-10.0, -9.0]),
            ("{ normal = { mean = 1.1, deviation = 0.01, within = [1.0, 9.0] } }", [1.0, 9.0]),
        ] {
            let distribution = drawn(text);
            let at = |u: f64| distribution.quantile(u).as_float().unwrap();
            let drawn: Vec<f64> = (1..1000).map(|i| at(f64::from(i) / 1000.0)).collect();
            assert!(drawn.iter().all(|x| (low..=high).contains(x)), "{text}: {drawn:?}");
            assert!(drawn.windows(2).all(|two| two[0] < two[1]), "{text}: they rise");
            assert!(at(f64::EPSILON) >= low && at(1.0 - f64::EPSILON) <= high, "{text}: the ends");
        }
        let upper = drawn("{ normal = { mean = 0.0, deviation = 1.0, within = [9.0, 10.0] } }");
        let lower = drawn("{ normal = { mean = 0.0, deviation = 1.0, within = [-10.0, -9.0] } }");
        for u in [0.001, 0.25, 0.5] {
            let [above, below] = [upper.quantile(u), lower.quantile(1.0 - u)].map(|x| x.as_float().unwrap());
            assert!((above + below).abs() < 1e-12, "{above} and {below} are mirrored");
        }
    }

    #[test]
    fn whole_numbers_are_drawn_from_any_range() {
        for [low, high] in [[0, i64::MAX], [i64::MIN, i64::MAX], [i64::MIN, 0], [-1, 1]] {
            let integers = Distribution::Integer([low, high]);
            let at = |u: f64| integers.quantile(u).as_integer().unwrap();
            let drawn: Vec<i64> = (0..1000).map(|i| at((f64::from(i) + 0.5) / 1000.0)).collect();
            assert!(drawn.iter().all(|n| (low..=high).contains(n)), "{low} to {high}");
            assert!(drawn.is_sorted() && drawn[0] < drawn[999], "{low} to {high}: {drawn:?}");
        }
    }

    #[test]
    fn dotted_keys_lead_to_lists_and_ranges_in_order() {
        let found = factors("b.x = [1, 2]\na.0.y = { range = { from = 0, to = 1, steps = 3 } }").unwrap();
        assert_eq!(found.iter().map(|factor| factor.key.as_str()).collect::<Vec<_>>(), ["a.0.y", "b.x"]);
        assert_eq!(found[0].values, Values::Listed([0.0, 0.5, 1.0].map(Value::Float).to_vec()));
    }

    /// Else a table of a scenario would be taken for a slip.
    #[test]
    fn no_key_of_a_scenario_is_near_a_word() {
        fn keys(table: &toml::Table) -> Vec<String> {
            table
                .iter()
                .flat_map(|(key, value)| [vec![key.clone()], value.as_table().map_or(vec![], keys)].concat())
                .collect()
        }
        let all = keys(&contract::scenario::to_toml(&contract::Scenario::default()).parse().unwrap());
        assert!(all.len() > 100);
        for (key, word) in all.iter().flat_map(|key| WORDS.map(|word| (key, word))) {
            assert!(strsim::osa_distance(key, word) > MAX_SLIPS, "{key} {word}");
        }
    }

    #[test]
    fn what_does_not_vary_is_refused_with_its_key() {
        for (text, expected) in [
            ("mpc.np = 3", "belongs into [settings]"),
            ("mpc.np = []", "an empty list"),
            ("mpc.np = { uniform = [2, 1] }", "the smaller one first"),
            ("mpc.np = { uniform = [1, 2], within = [1, 2] }", "mpc.np"),
            ("mpc.np = { log_uniform = [0, 1] }", "above 0"),
            ("mpc.np = { normal = { mean = 0, deviation = 0 } }", "deviation above 0"),
            ("mpc.np = { range = { from = 0, to = 1, steps = 1 } }", "at least 2 steps"),
            ("mpc.np = {}", "empty"),
            ("mpc.np = [20, 30, 20]", "lists 20 twice"),
            ("mpc.np = [1.0, 1]", "lists 1 twice"),
            ("mpc.np.00 = [20, 30]", "written `0`"),
            ("mpc.np.'+0' = [20, 30]", "written `0`"),
            ("mpc.np = { unifrom = [1, 2] }", "did you mean `uniform`?"),
        ] {
            let said = format!("{:#}", factors(text).unwrap_err());
            assert!(said.contains("mpc.np") && said.contains(expected), "{text}: {said}");
        }
    }
}
