//! Values of one setting that varies: a list of which each is flown, or a distribution that is drawn from.
//!
//! Drawn values are quantiles at numbers between 0 and 1, so that every sampling works with every distribution. They
//! are the same on every machine: the elementary functions are those of the crate `libm`, not of the C library.

use std::collections::{BTreeMap, HashSet};

use anyhow::{Context, bail, ensure};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize, Serializer};
use toml::de::{DeTable, DeValue};
use toml::{Spanned, Table, Value};

use crate::normal::Normal;
use crate::table::ColumnType;

/// One setting and its values.
#[derive(Debug, Clone, PartialEq)]
pub struct Factor {
    /// Dotted key, as in a scenario; a number in it is the index of an array element.
    pub key: String,
    pub values: Values,
}

#[derive(Debug, Clone, PartialEq)]
pub enum Values {
    /// List; each value is flown.
    Listed(Vec<Value>),
    /// Distribution; one value is drawn for each sample. A range is listed instead.
    Drawn(Variation),
}

/// Table `[vary]` of a campaign file.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(from = "Table")]
pub struct Vary {
    table: Table,
    /// Keys and values in the order of the file, where the draws depend on it; otherwise empty.
    in_order: Vec<(String, Value)>,
}

/// One setting and its values as in the file, before they are made: a short text can ask for billions of values.
#[derive(Debug)]
pub struct RequestedValues {
    pub key: String,
    values: WantedValues,
}

#[derive(Debug)]
enum WantedValues {
    Listed(Vec<Value>),
    /// Whole numbers from 1 to this one.
    UpTo(u32),
    /// Variation, with its text in the file.
    Varied(Variation, String),
}

/// `{ range = ... }` and the distributions, as in the file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Variation {
    /// Evenly spaced values, each of which is flown.
    Range(ValueRange),
    /// Uniform distribution from the first number to the second.
    Uniform([f64; 2]),
    /// Distribution that is uniform in the logarithm.
    LogUniform([f64; 2]),
    /// Whole numbers of equal probability, both ends included.
    Integer([i64; 2]),
    /// Normal distribution.
    Normal(Normal),
    /// Values of equal probability.
    Choice(#[schemars(with = "Vec<serde_json::Value>")] Vec<Value>),
}

/// Keywords of [`Variation`].
pub const WORDS: [&str; 6] = ["range", "uniform", "log_uniform", "integer", "normal", "choice"];

/// Largest edit distance at which an unknown word is taken for a misspelt keyword.
const MAX_SLIPS: usize = 2;

/// Evenly spaced values, both ends included.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ValueRange {
    /// First value.
    from: f64,
    /// Last value.
    to: f64,
    /// Number of values, 2 or more.
    #[schemars(range(min = 2))]
    steps: u32,
}

impl From<Table> for Vary {
    fn from(table: Table) -> Self {
        Self { table, in_order: vec![] }
    }
}

impl Serialize for Vary {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        match &self.in_order[..] {
            [] => self.table.serialize(to),
            all => to.collect_map(all.iter().map(|(key, value)| (key, value))),
        }
    }
}

impl Vary {
    pub fn is_empty(&self) -> bool {
        self.table.is_empty()
    }

    /// Keeps the order of the keys in `text`, the campaign file, because a TOML table has none.
    ///
    /// # Errors
    /// As for [`RequestedValues::all`].
    pub fn put_in_order(&mut self, text: &str) -> anyhow::Result<()> {
        let mut places = BTreeMap::new();
        if let Ok(file) = DeTable::parse(text)
            && let Some(DeValue::Table(vary)) = file.get_ref().get("vary").map(Spanned::get_ref)
        {
            find_places("", vary, &mut places);
        }
        self.in_order = self.keys()?;
        self.in_order.sort_by_key(|(key, _)| places.get(key).copied());
        Ok(())
    }

    /// Returns the dotted keys with their values: in the order of the file if that is kept, otherwise sorted by key.
    fn keys(&self) -> anyhow::Result<Vec<(String, Value)>> {
        if !self.in_order.is_empty() {
            return Ok(self.in_order.clone());
        }
        let mut keys = vec![];
        collect("", &self.table, &mut keys)?;
        keys.sort_by(|a, b| a.0.cmp(&b.0));
        Ok(keys)
    }
}

impl RequestedValues {
    /// Reads the table `[vary]`; the result has its order.
    ///
    /// # Errors
    /// A value is neither a list nor a variation; the message has its key.
    pub fn all(vary: &Vary) -> anyhow::Result<Vec<Self>> {
        vary.keys()?.iter().map(|(key, value)| Self::new(key, value)).collect()
    }

    /// Lists the values of `list`.
    pub fn listed(key: &str, list: Vec<Value>) -> Self {
        Self { key: key.to_owned(), values: WantedValues::Listed(list) }
    }

    /// Lists the whole numbers from 1 to `count`.
    pub fn up_to(key: &str, count: u32) -> Self {
        Self { key: key.to_owned(), values: WantedValues::UpTo(count) }
    }

    /// Number of values that are flown, each with each value of the other settings; 1 if they are drawn.
    pub fn count(&self) -> u64 {
        match &self.values {
            WantedValues::Listed(list) => list.len() as u64,
            WantedValues::UpTo(count) => (*count).into(),
            WantedValues::Varied(Variation::Range(range), _) => range.steps.into(),
            WantedValues::Varied(..) => 1,
        }
    }

    /// Checks and makes the values.
    ///
    /// # Errors
    /// An empty list, a value listed twice (its flights would be counted twice), or a variation with invalid numbers.
    pub fn factor(self) -> anyhow::Result<Factor> {
        let key = self.key;
        let values = match self.values {
            WantedValues::Listed(list) => listed(&key, list)?,
            WantedValues::UpTo(count) => Values::Listed((1..=count).map(|n| Value::Integer(n.into())).collect()),
            WantedValues::Varied(variation, text) => variation.values().with_context(|| format!("`{key}` = {text}"))?,
        };
        Ok(Factor { key, values })
    }

    fn new(key: &str, value: &Value) -> anyhow::Result<Self> {
        check_elements(key)?;
        let values = match value {
            Value::Array(list) => WantedValues::Listed(list.clone()),
            Value::Table(_) => {
                let variation = value.clone().try_into().with_context(|| format!("`{key}` = {value}"))?;
                WantedValues::Varied(variation, value.to_string())
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

fn listed(key: &str, list: Vec<Value>) -> anyhow::Result<Values> {
    ensure!(!list.is_empty(), "`{key}`: an empty list; give the values to fly");
    let mut seen = HashSet::new();
    for value in &list {
        ensure!(
            seen.insert(identity(value)),
            "`{key}` lists {value} twice: a copy of a flight is no evidence; remove one of them"
        );
    }
    Ok(Values::Listed(list))
}

/// Returns equal text for equal values; 1 and 1.0 are equal.
fn identity(value: &Value) -> String {
    match value {
        Value::Integer(n) => format!("{:?}", *n as f64),
        Value::Float(x) => format!("{:?}", x + 0.0), // -0 is 0
        Value::Array(all) => format!("[{}]", all.iter().map(identity).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

/// Refuses leading zeros and signs in the index of an element, because the same element would get a second column.
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

/// Joins a path and a name to a dotted key.
fn dotted(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}

/// Finds the places in the file of all keys in `table`.
fn find_places(path: &str, table: &DeTable<'_>, places: &mut BTreeMap<String, usize>) {
    for (name, value) in table {
        let key = dotted(path, name.get_ref());
        if let DeValue::Table(inner) = value.get_ref() {
            find_places(&key, inner, places);
        }
        places.insert(key, name.span().start);
    }
}

/// Collects dotted keys and values from nested tables; an empty table or a misspelt keyword is an error.
fn collect(path: &str, table: &Table, keys: &mut Vec<(String, Value)>) -> anyhow::Result<()> {
    for (name, value) in table {
        let key = dotted(path, name);
        match value {
            Value::Table(inner) if !inner.keys().any(|word| WORDS.contains(&word.as_str())) => {
                ensure!(!inner.is_empty(), "`{key}` in [vary] is empty");
                for (word, meant) in inner.keys().flat_map(|word| WORDS.map(|meant| (word, meant))) {
                    let is_slip = strsim::osa_distance(word, meant) <= MAX_SLIPS && !inner[word].is_table();
                    ensure!(!is_slip, "`{key}` in [vary]: unknown word `{word}`; did you mean `{meant}`?");
                }
                collect(&key, inner, keys)?;
            }
            _ => keys.push((key, value.clone())),
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
        match &self {
            Self::Range(range) => {
                let ValueRange { from, to, steps } = *range;
                ensure!(steps >= 2 && from.is_finite() && to.is_finite(), "give finite ends, and at least 2 steps");
                return Ok(Values::Listed((0..steps).map(|i| range.value(i)).collect()));
            }
            Self::Uniform(ends) => rises(*ends)?,
            Self::LogUniform(ends) => {
                rises(*ends)?;
                ensure!(ends[0] > 0.0, "the logarithm is of numbers above 0");
            }
            Self::Integer(ends) => ensure!(ends[0] < ends[1], "give two whole numbers, the smaller one first"),
            Self::Normal(normal) => {
                let Normal { mean, deviation, within } = *normal;
                ensure!(mean.is_finite() && deviation.is_finite() && deviation > 0.0, "give a deviation above 0");
                within.map_or(Ok(()), rises)?;
                ensure!(normal.has_values(), "no values lie within; widen it");
            }
            Self::Choice(choices) => ensure!(!choices.is_empty(), "give the values to choose from"),
        }
        Ok(Values::Drawn(self))
    }

    /// Returns the value below which the share `u` of all values lies, 0 < u < 1.
    pub fn quantile(&self, u: f64) -> Value {
        let between = |[low, high]: [f64; 2]| low + (high - low) * u;
        // Needs 128 bits: the number of values of the widest range is 2^64, of which 2^53 can be drawn.
        let index = |count: i128| ((u * count as f64) as i128).min(count - 1);
        match self {
            Self::Range(range) => range.value(index(range.steps.into()) as u32),
            Self::Uniform(ends) => Value::Float(between(*ends)),
            Self::LogUniform(ends) => {
                let [low, high] = *ends;
                Value::Float(libm::exp(between(ends.map(libm::log))).clamp(low, high))
            }
            Self::Integer(ends) => {
                let [low, high] = ends.map(i128::from);
                Value::Integer((low + index(high - low + 1)) as i64)
            }
            Self::Normal(normal) => Value::Float(normal.quantile(u)),
            Self::Choice(choices) => choices[index(choices.len() as i128) as usize].clone(),
        }
    }
}

impl ValueRange {
    /// Returns value `i`, from 0; the last is `to` without rounding.
    fn value(&self, i: u32) -> Value {
        let step = (self.to - self.from) / f64::from(self.steps - 1);
        Value::Float(if i + 1 == self.steps { self.to } else { self.from + step * f64::from(i) })
    }
}

impl Values {
    /// Returns the values that the file shows: all of a list, the ends of a distribution, the median of a normal one.
    pub fn ends(&self) -> Vec<Value> {
        match self {
            Self::Listed(all) | Self::Drawn(Variation::Choice(all)) => all.clone(),
            Self::Drawn(Variation::Uniform(ends) | Variation::LogUniform(ends)) => ends.map(Value::Float).into(),
            Self::Drawn(Variation::Integer(ends)) => ends.map(Value::Integer).into(),
            Self::Drawn(variation) => vec![variation.quantile(0.5)],
        }
    }

    /// Returns the type of a column of these values.
    pub fn kind(&self) -> ColumnType {
        let all = self.ends();
        match () {
            () if all.iter().all(Value::is_integer) => ColumnType::Int,
            () if all.iter().all(|value| value.is_integer() || value.is_float()) => ColumnType::Real,
            () if all.iter().all(Value::is_bool) => ColumnType::Bool,
            () => ColumnType::Text,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn factors(text: &str) -> anyhow::Result<Vec<Factor>> {
        RequestedValues::all(&text.parse::<Table>().unwrap().into())?.into_iter().map(RequestedValues::factor).collect()
    }

    fn drawn(text: &str) -> Variation {
        match factors(&format!("x = {text}")).unwrap().remove(0).values {
            Values::Drawn(variation) => variation,
            Values::Listed(list) => panic!("{list:?}"),
        }
    }

    #[test]
    fn a_quantile_is_that_of_its_distribution() {
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

    #[test]
    fn whole_numbers_are_drawn_from_any_range() {
        for [low, high] in [[0, i64::MAX], [i64::MIN, i64::MAX], [i64::MIN, 0], [-1, 1]] {
            let integers = Variation::Integer([low, high]);
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

    /// A key near a keyword would be refused as a misspelt keyword.
    #[test]
    fn no_key_of_a_scenario_is_near_a_word() {
        fn keys(table: &toml::Table) -> Vec<String> {
            table
                .iter()
                .flat_map(|(key, value)| [vec![key.clone()], value.as_table().map_or(vec![], keys)].concat())
                .collect()
        }
        let all = keys(&settings::to_toml(&settings::Scenario::default()).parse().unwrap());
        assert!(all.len() > 100);
        for (key, word) in all.iter().flat_map(|key| WORDS.map(|word| (key, word))) {
            assert!(strsim::osa_distance(key, word) > MAX_SLIPS, "{key} {word}");
        }
    }

    #[test]
    fn an_invalid_variation_is_refused_with_its_key() {
        for (text, expected) in [
            ("attitude.mpc.q = 3", "belongs into [settings]"),
            ("attitude.mpc.q = []", "an empty list"),
            ("attitude.mpc.q = { uniform = [2, 1] }", "the smaller one first"),
            ("attitude.mpc.q = { uniform = [1, 2], within = [1, 2] }", "attitude.mpc.q"),
            ("attitude.mpc.q = { log_uniform = [0, 1] }", "above 0"),
            ("attitude.mpc.q = { normal = { mean = 0, deviation = 0 } }", "deviation above 0"),
            ("attitude.mpc.q = { range = { from = 0, to = 1, steps = 1 } }", "at least 2 steps"),
            ("attitude.mpc.q = {}", "empty"),
            ("attitude.mpc.q = [20, 30, 20]", "lists 20 twice"),
            ("attitude.mpc.q = [1.0, 1]", "lists 1 twice"),
            ("attitude.mpc.q.00 = [20, 30]", "written `0`"),
            ("attitude.mpc.q.'+0' = [20, 30]", "written `0`"),
            ("attitude.mpc.q = { unifrom = [1, 2] }", "did you mean `uniform`?"),
        ] {
            let said = format!("{:#}", factors(text).unwrap_err());
            assert!(said.contains("attitude.mpc.q") && said.contains(expected), "{text}: {said}");
        }
    }
}
