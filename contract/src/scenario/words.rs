//! Suggestion of the known word nearest to an unknown one.

/// Jaro-Winkler likeness above which a known word is suggested.
const MIN_LIKENESS: f64 = 0.7;
/// Length above which words are neither compared nor printed in full \[bytes\].
const MAX_WORD_BYTES: usize = 80;

/// Finds the `known` word most like `word`, if above `MIN_LIKENESS`. A part of a word with hyphens has likeness 1.
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

/// Finds the value of `all` named `word`, for a Serde enum whose errors offer other names, `told`, than it accepts.
pub fn named<T: Copy, E: serde::de::Error>(
    word: &str,
    all: &[(T, &str)],
    told: &'static [&'static str],
) -> Result<T, E> {
    let known = all.iter().find(|(_, name)| *name == word);
    known.map(|(value, _)| *value).ok_or_else(|| E::unknown_variant(word, told))
}

/// Returns `word`, cut after [`MAX_WORD_BYTES`] if it is longer.
pub fn shortened(word: &str) -> String {
    match word.char_indices().find(|(start, _)| *start >= MAX_WORD_BYTES) {
        Some((end, _)) => format!("{}...", &word[..end]),
        None => word.to_owned(),
    }
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
