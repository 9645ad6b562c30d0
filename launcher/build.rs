//! Asks git for the commit of the sources and its date.

#![expect(clippy::disallowed_macros, reason = "it is how a build script speaks to cargo")]

use std::{path::Path, process::Command};

/// Sources that the launcher is built from, seen from the top of the repository.
const SOURCES: [&str; 18] = [
    "Cargo.toml",
    "Cargo.lock",
    "airframe",
    "attitude-mpc",
    "campaigns",
    "contract",
    "curves",
    "foreign",
    "guidance",
    "launcher",
    "mixer",
    "navigation",
    "plant",
    "qp",
    "ring",
    "runtime",
    "scenarios",
    "settings",
];

/// Sets variables for the compiler: the commit, its date, and whether the sources differ from it; none if the sources
/// are not a checkout of the repository.
fn main() {
    let top = Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("launcher/ lies in the repository");
    let git = |arguments: &[&str]| {
        // Without the lock: `git status` would write the index, and another git command at that time would fail.
        let mut told = Command::new("git");
        let told = told.arg("--no-optional-locks").arg("-C").arg(top).args(arguments).env("TZ", "UTC").output().ok()?;
        told.status.success().then(|| String::from_utf8_lossy(&told.stdout).trim().to_owned())
    };
    // Sources that were unpacked within another repository are not of its commit.
    let is_ours = |found: &String| Path::new(found).canonicalize().ok() == top.canonicalize().ok();
    let Some(_) = git(&["rev-parse", "--show-toplevel"]).filter(is_ours) else { return };
    let Some(commit) = git(&["rev-parse", "HEAD"]) else { return };
    let changed = git(&[&["status", "--porcelain", "--"], &SOURCES[..]].concat()).is_none_or(|list| !list.is_empty());
    println!("cargo::rustc-env=TREFOIL_COMMIT={commit}");
    println!("cargo::rustc-env=TREFOIL_CHANGED={changed}");
    let as_utc = "--date=format-local:%Y-%m-%dT%H:%M:%SZ";
    if let Some(date) = git(&["show", "--no-patch", as_utc, "--format=%cd", "HEAD"]) {
        println!("cargo::rustc-env=TREFOIL_DATE={date}");
    }
    let heads = ["HEAD", "logs/HEAD"].iter().filter_map(|name| git(&["rev-parse", "--git-path", name]));
    for path in heads.map(|path| top.join(path)).chain(SOURCES.iter().map(|name| top.join(name))) {
        if path.exists() {
            println!("cargo::rerun-if-changed={}", path.display());
        }
    }
}
