//! Words that are not known, and the known ones nearest to them.

/// Words less alike than this are not taken for each other.
const ALIKE: f64 = 0.7;
/// Longer words are not compared, and not told in full \[bytes\].
const LONGEST: usize = 80;

/// That of the `known` words which `word` is most like, if it is like one at all.
pub fn nearest<'a>(word: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    if word.len() > LONGEST {
        return None;
    }
    let rated = known.map(|other| (strsim::jaro_winkler(word, other), other));
    rated.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(likeness, _)| *likeness > ALIKE).map(|(_, nearest)| nearest)
}

/// An error of Serde on a word that it does not know, "unknown variant `x`, expected one of `y`, `z`", with the nearest of
/// those that it expects; any other message as it is.
pub fn suggest(message: &str) -> String {
    let mut quoted = message.split('`').skip(1).step_by(2);
    let unknown = quoted.next().filter(|_| message.starts_with("unknown "));
    match unknown.and_then(|word| nearest(word, quoted)) {
        Some(nearest) => format!("{message}; did you mean `{nearest}`?"),
        None => message.to_owned(),
    }
}

/// `word` as it is told.
pub fn shortened(word: &str) -> String {
    match word.char_indices().find(|(start, _)| *start >= LONGEST) {
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
        assert_eq!([nearest("xyz"), nearest(""), nearest(&"rotor1".repeat(99))], [None; 3]);
        let message = "unknown variant `rotr2`, expected one of `rotor1`, `rotor2`";
        assert_eq!(suggest(message), format!("{message}; did you mean `rotor2`?"));
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
