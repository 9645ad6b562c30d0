//! Programs of nodes other than the launcher's own cores: this module finds them, identifies them by their hash, and
//! tries them before a flight.
//!
//! A library is tried in a process of its own, so a constructor that crashes, ends its process or never returns is
//! reported as an error of the settings and costs no flight.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{self, BufRead, BufReader};
use std::iter;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

use contract::Topic;
pub use ring::states::hex;
use rustix::fs::{Access, access};
use settings::{Mode, NodeSettings, ProgramKind, Scenario, ScenarioError, Swap, candidate};
use sha2::{Digest, Sha256};

use crate::{guarded, libraries};

/// Trials of libraries that succeeded in this process: node and program as text, or files and environment variables.
static TRIED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Adds to `program`, the program of the node `name`, the hashes of its files.
///
/// # Errors
/// A file is missing, unreadable or not executable, or has another hash than `files` gives, or `files` names a file
/// that is not in `exec` or `args`.
pub fn pin(program: &mut NodeSettings, name: &str) -> Result<(), ScenarioError> {
    if program.kind() == ProgramKind::Own {
        return Ok(());
    }
    let exec = &program.exec;
    let refused = |what: String, help: &str| Err(ScenarioError::of(what, help.into()));
    let Some(path) = find(exec, program.kind()) else {
        return refused(
            format!("the program `{exec}` of {name} is not there, or cannot be executed"),
            "give `exec` the path of a program, seen from the scenario file or from where the launcher is started; \
             `chmod +x` it if need be",
        );
    };
    if let Some(other) = program.files.keys().find(|file| *file != exec && !program.args.contains(file)) {
        return refused(
            format!("`node.{name}.files` has `{other}`, which is neither `exec` nor a word of `args`"),
            "the files that the program is started with, spelled as there",
        );
    }
    let named = program.args.iter().map(|word| (word, Path::new(word))).filter(|(_, path)| path.is_file());
    for (file, path) in iter::once((exec, path.as_path())).chain(named) {
        let found = sha256_of(path)
            .map_err(|error| ScenarioError::of(format!("cannot read `{file}` of {name}: {error}"), String::new()))?;
        let given = program.files.entry(file.clone()).or_insert_with(|| found.clone());
        if *given != found {
            return refused(
                format!("the file `{file}` of {name} is another file than the settings name: its SHA-256 is {found}"),
                "give the file with the hash of `files`, or remove it there to fly this one",
            );
        }
    }
    Ok(())
}

/// Adds the hashes of its files to each program of `scenario`.
///
/// # Errors
/// Fails if [`pin`] does.
pub fn pin_all(scenario: &mut Scenario) -> Result<(), ScenarioError> {
    Topic::ALL.into_iter().try_for_each(|topic| pin(scenario.node.of_mut(topic), topic.publisher()))
}

/// Adds to the settings of `swap`, in a flight of `run`, the hashes of the files that the candidate's program adds.
///
/// # Errors
/// Fails if [`pin`] does.
pub fn pin_swap(run: &Scenario, swap: &mut Swap) -> Result<(), ScenarioError> {
    let name = swap.node.publisher();
    let own = candidate(run, swap)?;
    let before = own.node.of(swap.node);
    let mut pinned = before.clone();
    pin(&mut pinned, name)?;
    let new_files = pinned.files.iter().filter(|(file, _)| !before.files.contains_key(*file));
    swap.set.extend(new_files.map(|(file, sha256)| format!("node.{name}.files.{file:?}={sha256:?}")));
    Ok(())
}

/// Checks that the program of each node of `scenario` is there, and tries each library in a process of its own.
///
/// # Errors
/// A program is not there, or is another file than the settings name, or a library does not load or fails.
pub fn check(scenario: &Scenario) -> Result<(), ScenarioError> {
    Topic::ALL.into_iter().try_for_each(|topic| check_one(scenario, topic))
}

/// Checks the program of the node that publishes `topic`, as [`check`] does.
pub fn check_one(scenario: &Scenario, topic: Topic) -> Result<(), ScenarioError> {
    let program = scenario.node.of(topic);
    if program.kind() != ProgramKind::Library {
        return pin(&mut program.clone(), topic.publisher());
    }
    try_once(format!("{topic:?} {program:?}"), || {
        pin(&mut program.clone(), topic.publisher())?;
        guarded::try_out(scenario, Some(topic), program.env.clone()).map_err(|why| {
            let file = &program.exec;
            let why = why.strip_prefix(&format!("{file}: ")).unwrap_or(&why);
            let title = format!("the library `{file}` of {} cannot be flown: {why}", topic.publisher());
            ScenarioError::of(title, String::new())
        })
    })
}

/// Checks that all libraries of a flight of `scenario` can be loaded into one process, if the flight is in process.
///
/// # Errors
/// A library cannot be loaded, or fails, beside the others.
pub fn check_together(scenario: &Scenario) -> Result<(), ScenarioError> {
    let files = libraries::files(scenario);
    let env: BTreeMap<String, String> = libraries::env_of(scenario);
    if scenario.run.mode != Mode::Inprocess || files.len() < 2 {
        return Ok(());
    }
    try_once(format!("{files:?} {env:?}"), || {
        guarded::try_out(scenario, None, env).map_err(|why| {
            let names: Vec<String> = files.iter().map(|(exec, _)| format!("`{exec}`")).collect();
            let title = format!("the libraries {} cannot be flown in one process: {why}", names.join(" and "));
            ScenarioError::of(title, String::new())
        })
    })
}

/// Runs the `trial` of `what`, unless the same trial has succeeded in this process before.
fn try_once(what: String, trial: impl FnOnce() -> Result<(), ScenarioError>) -> Result<(), ScenarioError> {
    if !TRIED.lock().is_ok_and(|tried| tried.contains(&what)) {
        trial()?;
        TRIED.lock().map(|mut tried| tried.insert(what)).ok();
    }
    Ok(())
}

/// Finds the file of a program: the file at the path `name`, or, if `name` has no slash, a file in a folder of PATH.
/// The name of a library is always a path.
fn find(name: &str, kind: ProgramKind) -> Option<PathBuf> {
    let is_library = kind == ProgramKind::Library;
    let is_program = |path: &PathBuf| path.is_file() && (is_library || access(path, Access::EXEC_OK).is_ok());
    if name.contains('/') || is_library {
        return Some(PathBuf::from(name)).filter(is_program);
    }
    let folders = std::env::var_os("PATH")?;
    std::env::split_paths(&folders).map(|folder| folder.join(name)).find(is_program)
}

/// Computes the SHA-256 of a file, in hexadecimal digits.
pub fn sha256_of(path: &Path) -> io::Result<String> {
    let mut hash = Sha256::new();
    let mut file = BufReader::with_capacity(1 << 16, File::open(path)?);
    loop {
        let part = file.fill_buf()?;
        if part.is_empty() {
            break;
        }
        hash.update(part);
        let length = part.len();
        file.consume(length);
    }
    Ok(hex(&hash.finalize()))
}
