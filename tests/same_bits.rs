//! Every shipped scenario flies the same bits on every processor: the state hashes of docs/hashes.md.
//!
//! `REWRITE=1 cargo test --workspace --test stack same_bits` writes that page anew. `LAUNCHER` in the environment is a
//! command that flies in place of the launcher just built: `.ci/processors` sets it to emulators of other processors.

use std::process::Command;

use serde_json::Value;

use crate::harness::{launcher, skip, top};
use crate::tidy::sources;

/// Variable that hides fused multiply-add and wide vectors from the C library.
const OLDER: (&str, &str) = ("GLIBC_TUNABLES", "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2,-AVX512F");

const PAGE: &str = "docs/hashes.md";
const HEAD: &str = "\
# The bits of every flight

The state hash of each shipped scenario, in process or in lockstep, on every processor.
[The same bits](architecture.md#the-same-bits) says how they are kept, and what compares this page.

A change that is meant to change a flight writes it anew: `REWRITE=1 cargo test -p launcher --test stack same_bits`.
A change that is not must leave it as it is.

| `fly` | state hash |
|---|---|
";

/// Returns the shipped scenarios, from the top of the repository.
fn scenarios() -> Vec<String> {
    let mut found = vec![];
    let mut open = vec![top().join("scenarios")];
    while let Some(folder) = open.pop() {
        for path in std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("readable").path()) {
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path.strip_prefix(top()).expect("below the top").display().to_string());
            }
        }
    }
    found.sort();
    assert!(found.len() > 20, "{found:?}");
    found
}

/// Returns the line of the page for a flight in process by `launcher`.
fn row(mut launcher: Command, scenario: &str) -> String {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let arguments = ["fly", scenario, "--mode", "inprocess", "--no-log", "--json", "--out"];
    launcher.args(arguments).arg(folder.path().join("run"));
    let output = launcher.output().unwrap_or_else(|e| panic!("{launcher:?}: {e}"));
    let run: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|e| panic!("{launcher:?}: {e}; {}", String::from_utf8_lossy(&output.stderr)));
    let hash = run["state_hash"].as_str().unwrap_or_else(|| panic!("{launcher:?}: no state hash"));
    format!("| `{scenario}` | `{hash}` |\n")
}

/// Makes the page from flights by `launcher`, two at a time.
fn flown(launcher: impl Fn() -> Command + Sync) -> String {
    let scenarios = scenarios();
    let (launcher, half) = (&launcher, scenarios.len().div_ceil(2));
    std::thread::scope(|scope| {
        let fly = |half: &[String]| half.iter().map(|scenario| row(launcher(), scenario)).collect::<String>();
        let halves: Vec<_> = scenarios.chunks(half).map(|half| scope.spawn(move || fly(half))).collect();
        halves.into_iter().fold(HEAD.to_owned(), |page, half| page + &half.join().expect("flights end"))
    })
}

fn rewrites() -> bool {
    std::env::var_os("REWRITE").is_some()
}

/// Asserts that `flown` equals the page in the repository.
fn check(flown: &str) {
    let page = std::fs::read_to_string(top().join(PAGE)).expect("docs/hashes.md is readable");
    let others: Vec<&str> = flown.lines().filter(|line| !page.lines().any(|row| row == *line)).collect();
    assert!(others.is_empty(), "{PAGE} says otherwise; flown:\n{}", others.join("\n"));
    assert_eq!(flown, page, "{PAGE} has lines of no flight");
}

#[test]
fn every_scenario_flies_the_bits_of_the_page() {
    let flown = flown(|| {
        let Ok(words) = std::env::var("LAUNCHER") else { return launcher() };
        let mut words = words.split_whitespace();
        let mut command = Command::new(words.next().expect("LAUNCHER names a program"));
        command.args(words).current_dir(top());
        command
    });
    if rewrites() {
        return std::fs::write(top().join(PAGE), flown).expect("the page can be written");
    }
    check(&flown);
}

#[test]
fn an_older_processor_flies_the_same_bits() {
    if !rewrites() {
        check(&flown(|| {
            let mut launcher = launcher();
            launcher.env(OLDER.0, OLDER.1);
            launcher
        }));
    }
}

/// Functions of `f64` that the C library has, or whose rounding Rust leaves open.
const OF_THE_PLATFORM: [&str; 27] = [
    "acos()",
    "acosh()",
    "asin()",
    "asinh()",
    "atan()",
    "atan2(x)",
    "atanh()",
    "cbrt()",
    "cos()",
    "cosh()",
    "exp()",
    "exp2()",
    "exp_m1()",
    "hypot(x)",
    "ln()",
    "ln_1p()",
    "log(x)",
    "log10()",
    "log2()",
    "mul_add(x, x)",
    "powf(x)",
    "powi(2)",
    "sin()",
    "sin_cos()",
    "sinh()",
    "tan()",
    "tanh()",
];

#[test]
fn clippy_refuses_every_function_of_the_platform() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let source = folder.path().join("lib.rs");
    let calls = OF_THE_PLATFORM.map(|call| format!("let _ = x.{call};\n")).concat();
    std::fs::write(&source, format!("pub fn f(x: f64) {{ {calls} }}")).expect("a file can be written");
    let output = Command::new("clippy-driver")
        .args(["--edition", "2024", "--crate-type", "lib", "--emit", "metadata", "-D", "clippy::disallowed_methods"])
        .arg("--out-dir")
        .arg(folder.path())
        .arg(&source)
        .env("CLIPPY_CONF_DIR", top())
        .output();
    let Ok(output) = output else { return skip("clippy is missing") };
    let said = String::from_utf8_lossy(&output.stderr);
    for call in OF_THE_PLATFORM {
        let name = call.split('(').next().expect("a name");
        assert!(said.contains(&format!("disallowed method `f64::{name}`")), "{name} is allowed: {said}");
    }
    assert!(!output.status.success());
}

#[test]
fn no_flight_lifts_that_rule_and_nothing_asks_the_processor_for_matrix_kernels() {
    for (path, text) in sources() {
        let lifts = text.lines().filter(|line| line.contains("disallowed_methods"));
        let of_tests = |line: &str| line.starts_with("#![cfg_attr(test,");
        let is_free = ["tests", "mixer/tests", "launcher/view/src/draw"].iter().any(|free| path.starts_with(free));
        let lifts: Vec<&str> = lifts.filter(|line| !is_free && !of_tests(line)).collect();
        assert!(lifts.is_empty(), "{} has {lifts:?}", path.display());
    }
    let lock = std::fs::read_to_string(top().join("Cargo.lock")).expect("Cargo.lock is readable");
    assert!(lock.contains("name = \"libm\""));
    // The search for gains (cmaes) brings a nalgebra of its own, which no flight computes with.
    let ours = lock.split("[[package]]").filter(|package| package.contains("name = \"nalgebra\"\nversion = \"0.35"));
    let kernels = ours.clone().filter(|package| package.contains("\"matrixmultiply\"")).count();
    assert_eq!((ours.count(), kernels), (1, 0), "a dependency turns on the feature `std` of nalgebra");
}
