//! Programs of nodes other than the launcher's own cores: found, identified by their hash, and tried before a flight.
//!
//! A library is tried in a process of its own: a constructor that crashes, ends its process or never returns is an
//! error of the settings, and costs no flight.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Write as _};
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::Mutex;
use std::sync::atomic::AtomicU32;
use std::time::Duration;

use contract::Topic;
use contract::exit;
use contract::scenario::{self, Mode, NodeSettings, ProgramKind, Scenario, ScenarioError, Swap, candidate, to_toml};
use runtime::console::eprint_line;
use rustix::fs::{Access, access};
use sha2::{Digest, Sha256};

use crate::own_program;
use crate::stack::children::wait;
use crate::strays::Mark;

/// Longest time that a library may take to be loaded and to answer to a few samples.
const TRIAL_LIMIT: Duration = Duration::from_secs(10);

/// Name for the trial of all libraries of a flight in one process, in the place of that of a node.
const TOGETHER: &str = "all";

/// Last line of a trial that went well. A library that ends the process does not write it.
const ANSWERS: &str = "the library answers";

/// Libraries that were tried by this process, each with node and settings.
static TRIED: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());

/// Adds the hash of its file to a `program` of the node `name`.
///
/// # Errors
/// The file is not there, or is another one than the settings name.
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
    let sha256 = match sha256_of(&path) {
        Ok(sha256) => sha256,
        Err(error) => return refused(format!("cannot read the program `{exec}` of {name}: {error}"), ""),
    };
    if !program.sha256.is_empty() && program.sha256 != sha256 {
        return refused(
            format!("the program `{exec}` of {name} is another file than the settings name: its SHA-256 is {sha256}"),
            "give the file with the hash of `sha256`, or remove `sha256` to fly this one",
        );
    }
    program.sha256 = sha256;
    for file in program.args.iter().filter(|word| Path::new(word).is_file()) {
        let found = sha256_of(Path::new(file));
        let found = found
            .map_err(|error| ScenarioError::of(format!("cannot read `{file}` of {name}: {error}"), String::new()))?;
        let given = program.files.entry(file.clone()).or_insert_with(|| found.clone());
        if *given != found {
            return refused(
                format!("the file `{file}` of {name} is another one than the settings name: its SHA-256 is {found}"),
                "give the file with the hash of `files`, or remove it there to fly this one",
            );
        }
    }
    Ok(())
}

/// Adds the hashes of their files to all programs of `scenario`.
///
/// # Errors
/// As for [`pin`].
pub fn pin_all(scenario: &mut Scenario) -> Result<(), ScenarioError> {
    Topic::ALL.into_iter().try_for_each(|topic| pin(scenario.node.of_mut(topic), topic.publisher()))
}

/// Adds the hashes of its files to the settings of a `swap` in a flight of `run`.
///
/// # Errors
/// As for [`pin`].
pub fn pin_swap(run: &Scenario, swap: &mut Swap) -> Result<(), ScenarioError> {
    let name = swap.node.name();
    let Some(topic) = swap.node.topic() else {
        let exec = swap.exec.clone().unwrap_or_default();
        return pin(&mut NodeSettings { exec, ..NodeSettings::default() }, name);
    };
    let own = candidate(run, swap)?;
    let before = own.node.of(topic);
    let mut pinned = before.clone();
    pin(&mut pinned, name)?;
    if pinned.sha256 != before.sha256 {
        swap.set.push(format!("node.{name}.sha256={:?}", pinned.sha256));
    }
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
    let what = format!("{topic:?} {program:?}");
    if TRIED.lock().is_ok_and(|tried| tried.contains(&what)) {
        return Ok(());
    }
    pin(&mut program.clone(), topic.publisher())?;
    try_in_child(scenario, topic.publisher(), &program.env).map_err(|why| {
        let file = &program.exec;
        let why = why.strip_prefix(&format!("{file}: ")).unwrap_or(&why);
        let title = format!("the library `{file}` of {} cannot be flown: {why}", topic.publisher());
        ScenarioError::of(title, String::new())
    })?;
    TRIED.lock().map(|mut tried| tried.insert(what)).ok();
    Ok(())
}

/// Returns the nodes that are libraries in a flight of `scenario`, from the beginning and then by its swaps, each with
/// its settings.
pub fn libraries(scenario: &Scenario) -> Vec<(Topic, Scenario)> {
    let swapped = scenario.swap.iter().filter_map(|swap| Some((swap.node.topic()?, candidate(scenario, swap).ok()?)));
    let own = scenario.node.libraries().map(|topic| (topic, scenario.clone()));
    own.chain(swapped.filter(|(topic, own)| own.node.of(*topic).kind() == ProgramKind::Library)).collect()
}

/// Returns the files of the libraries in a flight of `scenario`, each with its hash.
pub fn files(scenario: &Scenario) -> BTreeSet<(String, String)> {
    let all = libraries(scenario).into_iter();
    all.map(|(topic, own)| own.node.of(topic).clone()).map(|program| (program.exec, program.sha256)).collect()
}

/// Checks that all libraries of a flight of `scenario` can be loaded into one process, if the flight is in process.
///
/// # Errors
/// One of them would get a file of another, or fails beside it.
pub fn check_together(scenario: &Scenario) -> Result<(), ScenarioError> {
    let files = files(scenario);
    let env = scenario.node.libraries().flat_map(|topic| scenario.node.of(topic).env.clone()).collect();
    let what = format!("{TOGETHER} {files:?} {env:?}");
    let is_known = || TRIED.lock().is_ok_and(|tried| tried.contains(&what));
    if scenario.run.mode != Mode::Inprocess || files.len() < 2 || is_known() {
        return Ok(());
    }
    try_in_child(scenario, TOGETHER, &env).map_err(|why| {
        let names: Vec<String> = files.iter().map(|(exec, _)| format!("`{exec}`")).collect();
        let title = format!("the libraries {} cannot be flown in one process: {why}", names.join(" and "));
        ScenarioError::of(title, String::new())
    })?;
    TRIED.lock().map(|mut tried| tried.insert(what)).ok();
    Ok(())
}

/// Tries the library of the node `name` in a child with the variables `env`, or all of them, if it is [`TOGETHER`];
/// returns why it cannot be flown.
fn try_in_child(scenario: &Scenario, name: &str, env: &BTreeMap<String, String>) -> Result<(), String> {
    let mut command = own_program();
    command.args(["try-library", name]).envs(env);
    let command = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
    let mark = Mark::on(command);
    let mut child = command.spawn().map_err(|error| format!("no process to try it in: {error}"))?;
    // A child that ends before it has read its settings says why on stderr.
    let _ = child.stdin.take().map(|mut stdin| stdin.write_all(to_toml(scenario).as_bytes()));
    let stderr = child.stderr.take();
    let said = std::thread::spawn(move || {
        let mut text = String::new();
        let _ = stderr.map(|stderr| stderr.take(1 << 16).read_to_string(&mut text)); // what cannot be read is left out
        text
    });
    let ended = wait(&mut child, "trial of a library", TRIAL_LIMIT, &AtomicU32::new(0));
    mark.kill_all(); // before what it said is read: a process that it left may hold its stderr open
    let Some(status) = ended else {
        return Err(format!("it did not load and answer within {} s", TRIAL_LIMIT.as_secs()));
    };
    let text = said.join().unwrap_or_default();
    let last = text.lines().last().unwrap_or_default();
    match status.code() {
        Some(code) if code == i32::from(exit::FLOWN) && last == ANSWERS => Ok(()),
        Some(code) if code == i32::from(exit::USAGE) => Err(last.into()),
        _ => {
            Err(format!("it ended the process that tried it ({status}){}", if last.is_empty() { "" } else { ": " })
                + last)
        }
    }
}

/// Tries the library that the settings on stdin name for the node `name`, or all, in this process; returns the exit
/// code.
pub fn try_library(name: &str) -> u8 {
    let tried = || -> Result<(), String> {
        let text = io::read_to_string(io::stdin()).map_err(|error| error.to_string())?;
        let scenario = scenario::from_merged(&text, "stdin").map_err(|error| error.to_string())?;
        let topic = Topic::ALL.into_iter().find(|topic| topic.publisher() == name);
        let tried = match topic {
            Some(topic) => vec![(topic, scenario)],
            None if name == TOGETHER => libraries(&scenario),
            None => return Err("no such node".into()),
        };
        let mut tried = tried.iter();
        tried.try_for_each(|(topic, own)| foreign::try_out(*topic, own)).map_err(|error| error.to_string())
    };
    match tried() {
        Ok(()) => {
            eprint_line(ANSWERS);
            exit::FLOWN
        }
        Err(why) => {
            eprint_line(&why);
            exit::USAGE
        }
    }
}

/// Finds the file of a program: that at the path `name`, or, without a slash in `name`, one in a folder of PATH.
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

/// Formats bytes in hexadecimal.
pub fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut digits, byte| {
        let _ = write!(digits, "{byte:02x}"); // writing to a string does not fail
        digits
    })
}
