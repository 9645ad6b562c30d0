//! Any scenario, snapshot or run folder gives an error or a result, never a panic.
//!
//! Few cases are tried by default; `PROPTEST_CASES=100000 cargo test --workspace --test stack fuzz::` tries more, in
//! the dev profile, where an overflow panics.

mod flights;
mod folder;
mod folders;
mod memories;
mod replays;
mod snapshots;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use attitude_mpc::AttitudeMpc;
use flight::scenario;
use guidance::Guidance;
use mixer::Mixer;
use plant::Plant;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::select;
use settings::{Scenario, from_merged, load, to_toml};

use crate::harness::top;

/// Configuration with `PROPTEST_CASES` cases if that is set, else with `few`.
fn cases(few: u32) -> ProptestConfig {
    let default = ProptestConfig { failure_persistence: None, ..ProptestConfig::default() };
    if std::env::var_os("PROPTEST_CASES").is_some() { default } else { ProptestConfig { cases: few, ..default } }
}

/// Edit of bytes; places are shares of the length of all bytes.
#[derive(Debug, Clone)]
enum Edit {
    Flip(f64, u8),
    Delete(f64, usize),
    Double(f64, usize),
    Splice(f64, f64, usize),
    Insert(f64, &'static str),
}

/// Words to insert into a text, which change its meaning slightly.
const WORDS: [&str; 24] = [
    "9",
    "-",
    ".",
    "e",
    "e9",
    "e300",
    "e-300",
    "\n",
    "=",
    "[",
    "]",
    "{",
    "}",
    "\"",
    ",",
    "#",
    "\\",
    "\0",
    "\u{3bc}",
    "nan",
    "inf",
    "null",
    "[[fault]]",
    "true",
];

fn edits() -> impl Strategy<Value = Vec<Edit>> {
    let place = || 0.0..1.0_f64;
    let edit = prop_oneof![
        (place(), 0..8_u8).prop_map(|(at, bit)| Edit::Flip(at, bit)),
        (place(), 1..40_usize).prop_map(|(at, length)| Edit::Delete(at, length)),
        (place(), 1..40_usize).prop_map(|(at, length)| Edit::Double(at, length)),
        (place(), place(), 1..40_usize).prop_map(|(from, to, length)| Edit::Splice(from, to, length)),
        (place(), select(WORDS.to_vec())).prop_map(|(at, word)| Edit::Insert(at, word)),
    ];
    vec(edit, 1..4)
}

/// Returns `bytes` after all `edits`.
fn edited(mut bytes: Vec<u8>, edits: &[Edit]) -> Vec<u8> {
    for edit in edits {
        let all = bytes.len();
        let place = |share: f64| (share * all as f64) as usize;
        let span = |share: f64, length: usize| place(share)..(place(share) + length).min(all);
        match *edit {
            _ if all == 0 => {}
            Edit::Flip(at, bit) => bytes[place(at)] ^= 1 << bit,
            Edit::Delete(at, length) => drop(bytes.drain(span(at, length))),
            Edit::Double(at, length) => drop(bytes.splice(place(at)..place(at), bytes[span(at, length)].to_vec())),
            Edit::Splice(from, to, length) => {
                drop(bytes.splice(span(to, length), bytes[span(from, length)].to_vec()));
            }
            Edit::Insert(at, word) => drop(bytes.splice(place(at)..place(at), word.bytes())),
        }
    }
    bytes
}

/// Shipped scenarios.
static SHIPPED: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for path in std::fs::read_dir(folder).expect("a folder").flatten().map(|entry| entry.path()) {
            if path.is_dir() { walk(&path, found) } else { found.push(path) }
        }
    }
    let mut files = vec![];
    walk(&top().join("scenarios"), &mut files);
    files.sort();
    files.iter().map(|path| std::fs::read(path).expect("a readable scenario")).collect()
});

/// Loads a file with this content. If the scenario is accepted, checks that it is the same after writing and reading,
/// and that its nodes can be built.
fn check_scenario(content: &[u8], overrides: &[String]) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("scenario.toml");
    std::fs::write(&path, content).expect("can be written");
    match load(Some(&path), overrides) {
        Ok(scenario) => check_accepted(&scenario),
        Err(error) => assert!(!error.to_string().is_empty()),
    }
}

fn check_accepted(scenario: &Scenario) {
    let again = from_merged(&to_toml(scenario), "merged").unwrap_or_else(|error| panic!("{error}\n{scenario:?}"));
    assert_eq!(&again, scenario);
    // Larger controllers take seconds to build.
    if scenario.np() * scenario.nu() <= 500 && scenario::check(scenario).is_ok() {
        let _ = (Plant::new(scenario), Guidance::new(scenario), AttitudeMpc::new(scenario), Mixer::new(scenario));
    }
}

proptest! {
    #![proptest_config(cases(48))]

    #[test]
    fn a_text_is_a_scenario_or_an_error(text in "\\PC{0,200}") {
        check_scenario(text.as_bytes(), &[]);
    }

    #[test]
    fn words_of_a_scenario_in_any_order(
        words in vec(prop_oneof![
            select(WORDS.to_vec()),
            select(vec![
                "[run]\n", "[attitude.mpc]\n", "[mpc]\n", "prediction_horizon_s", "control_horizon_s", "np", "q", "seed",
                "fault", "at_s", "target", "kind", "\"mixer\"", "1",
            ]),
        ], 0..30),
    ) {
        check_scenario(words.concat().as_bytes(), &[]);
        check_scenario(b"", &[words.concat()]);
    }

    #[test]
    fn a_shipped_scenario_with_changes(which in any::<prop::sample::Index>(), edits in edits()) {
        check_scenario(&edited(which.get(&SHIPPED).clone(), &edits), &[]);
    }

    #[test]
    fn the_whole_of_a_scenario_with_changes(edits in edits()) {
        check_scenario(&edited(to_toml(&Scenario::default()).into_bytes(), &edits), &[]);
    }
}
