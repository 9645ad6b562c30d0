//! Words of a scenario file: values of enums, keys, and the known word nearest to an unknown word.

use serde::Serialize;
use toml::{Table, Value};

/// Jaro-Winkler likeness above which a known word is suggested.
const MIN_LIKENESS: f64 = 0.7;
/// Length above which words are neither compared nor printed in full \[bytes\].
const MAX_WORD_BYTES: usize = 80;

/// Finds the `known` word most like `word`, if above `MIN_LIKENESS`. A `word` that is a whole part of a known word with
/// hyphens has likeness 1.
pub fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > MAX_WORD_BYTES {
        return None;
    }
    let likeness = |other: &str| {
        if other.split('-').any(|part| part == word) { 1.0 } else { strsim::jaro_winkler(word, other) }
    };
    let rated = known.map(|other| (likeness(other), other));
    rated
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(likeness, _)| *likeness > MIN_LIKENESS)
        .map(|(_, nearest)| nearest)
}

/// Adds a suggestion to Serde's error for an unknown word, "unknown variant `x`, expected one of `y`, `z`": the nearest
/// of the expected words, before all of them. Returns any other message unchanged.
pub fn suggest(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let unknown = quoted.next().filter(|_| message.starts_with("unknown "));
    match unknown.and_then(|word| nearest(word, quoted)) {
        Some(nearest) => {
            let (unknown, expected) = message.split_once(", ").unwrap_or((message, ""));
            format!("{unknown}; did you mean `{nearest}`? {expected}")
        }
        None => message.to_owned(),
    }
}

/// Returns the word by which a file spells a value of an enum.
pub fn word(value: impl Serialize) -> String {
    Value::try_from(value).ok().and_then(|value| value.as_str().map(str::to_owned)).unwrap_or_default()
}

/// Returns the keys of a table that were given, except `others`.
pub fn given_keys(table: impl Serialize, others: &[&str]) -> Vec<String> {
    let table = Table::try_from(table).unwrap_or_default();
    table.into_iter().map(|(key, _)| key).filter(|key| !others.contains(&key.as_str())).collect()
}

/// Returns `word`, cut after [`MAX_WORD_BYTES`] if it is longer.
pub fn shortened(word: &str) -> String {
    match word.char_indices().find(|(start, _)| *start >= MAX_WORD_BYTES) {
        Some((end, _)) => format!("{}...", &word[..end]),
        None => word.to_owned(),
    }
}

/// Returns the value at a dotted key of a table; the rest of the key after a value that is no table is ignored.
pub fn at<'a>(table: &'a Table, key: &str) -> Option<&'a Value> {
    let Some((first, rest)) = key.split_once('.') else { return table.get(key) };
    let value = table.get(first)?;
    value.as_table().map_or(Some(value), |table| at(table, rest))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_is_suggested_if_it_is_near() {
        let known = ["rotor1", "rotor2", "attitude-mpc", "iteration-cap"];
        let nearest = |word| nearest(word, known.into_iter());
        assert_eq!(nearest("iteration_cap"), Some("iteration-cap"));
        assert_eq!(nearest("atitude"), Some("attitude-mpc"));
        assert_eq!(nearest("mpc"), Some("attitude-mpc"));
        assert_eq!([nearest("xyz"), nearest(""), nearest(&"rotor1".repeat(99))], [None; 3]);
        let message = "unknown variant `rotr2`, expected one of `rotor1`, `rotor2`";
        let expected = "unknown variant `rotr2`; did you mean `rotor2`? expected one of `rotor1`, `rotor2`";
        assert_eq!(suggest(message), expected);
        for message in ["unknown variant `xyz`, expected `rotor1`", "missing field `rotor`", "", "unknown"] {
            assert_eq!(suggest(message), message);
        }
    }

    #[test]
    fn long_words_are_cut_between_characters() {
        assert_eq!(shortened("key"), "key");
        assert_eq!(shortened(&"\u{fc}".repeat(100)), "\u{fc}".repeat(40) + "...");
    }
}
