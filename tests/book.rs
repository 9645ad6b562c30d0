//! The book's page that flies the survey: its module flies to the state hash of docs/hashes.md, and the page shows it.
//!
//! `.ci/book` builds the book and gives its folder in `BOOK`; without it these tests are skipped.

use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::harness::{skip, top};

/// Returns the folder of the book; prints a note if there is none.
fn book() -> Option<PathBuf> {
    let book = std::env::var_os("BOOK").map(PathBuf::from);
    if book.is_none() {
        skip("no book is given: .ci/book builds and checks it");
    }
    book
}

/// Returns the hash of a shipped scenario in docs/hashes.md.
fn hash(scenario: &str) -> String {
    let page = std::fs::read_to_string(top().join("docs/hashes.md")).expect("docs/hashes.md is readable");
    let row = page.lines().find_map(|row| row.strip_prefix(&format!("| `scenarios/{scenario}.toml` | `")));
    row.expect("the page has the scenario").trim_end_matches("` |").to_owned()
}

/// Returns the JSON that a script of `tests/book` prints; prints a note if node is missing.
fn node(script: &str, folder: &Path, arguments: &[&Path]) -> Option<Value> {
    let output =
        Command::new("node").arg(top().join("tests/book").join(script)).args(arguments).current_dir(folder).output();
    let Ok(output) = output else {
        skip("node is missing");
        return None;
    };
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{script}: {said}");
    Some(serde_json::from_slice(&output.stdout).unwrap_or_else(|error| panic!("{script}: {error}: {said}")))
}

#[test]
fn the_module_flies_the_bits_of_the_page_and_imports_nothing() {
    let Some(book) = book() else { return };
    let Some(told) = node("module.mjs", &book, &[&book]) else { return };
    assert_eq!(told["untouched"]["state_hash"], hash("survey").as_str());
    assert_eq!(told["imports"], 0);
    assert!(told["refused"]["error"].as_str().is_some_and(|why| why.contains("at least 0")), "{}", told["refused"]);
}

#[test]
fn the_page_flies_when_it_opens_and_when_a_slider_moves() {
    let Some(book) = book() else { return };
    let folder = tempfile::tempdir().expect("a temporary folder");
    let npm = ["install", "--silent", "--no-audit", "--no-fund", "playwright-core@1.65.1", "axe-core@4.14.1"];
    match Command::new("npm").args(npm).current_dir(folder.path()).output() {
        Err(_) => return skip("npm is missing"),
        Ok(output) if !output.status.success() => {
            return skip(&format!(
                "npm cannot install playwright-core and axe-core: {}",
                String::from_utf8_lossy(&output.stderr)
            ));
        }
        Ok(_) => {}
    }
    if !Path::new("/usr/bin/chromium").exists() {
        return skip("Chromium is missing");
    }
    let shots = book.with_file_name("book-screenshots");
    std::fs::create_dir_all(&shots).expect("a folder for the screenshots");
    let Some(told) = node("page.mjs", folder.path(), &[&book, &shots]) else { return };
    for kind in ["errors", "elsewhere"] {
        assert_eq!(told[kind].as_array().map(Vec::len), Some(0), "{}", told[kind]);
    }
    let pages = told["pages"].as_array().expect("pages");
    assert_eq!(pages.len(), 4);
    for page in pages {
        let [untouched, late, windy] = ["untouched", "late", "windy"].map(|state| &page[state]);
        assert_eq!(untouched["hash"], hash("survey").as_str(), "{page}");
        assert_eq!(windy["hash"], hash("wind").as_str(), "{page}");
        assert_ne!(untouched["hash"], late["hash"]);
        assert_eq!(late["delay"], "20 ms");
        assert!(late["command"].as_str().is_some_and(|c| c.contains("--set 'run.command_delay_ms=20'")), "{late}");
        assert_eq!(page["violations"], serde_json::json!([]), "axe-core");
        for state in [untouched, late, windy] {
            assert_eq!((&state["paths"], &state["plots"]), (&2.into(), &4.into()), "{state}");
            assert!(state["tooWide"].as_f64() <= Some(0.0), "{page}");
        }
    }
}
