//! The pages of docs/results: each block of commands prints what the page says.
//!
//! A fenced block marked `console` has commands (`$ `), which run in bash one after the other, with what they print.
//! `trefoil` is the program just built, or `LAUNCHER`, a path. `RESULTS` in the environment names the pages to fly, or
//! is `all`; blocks marked `console slow` are flown only with it or with `REWRITE=1`, which writes what the blocks
//! print, and the commit, into the pages. Blocks marked `console once` print times, which no two runs share: they are
//! flown only with `REWRITE=1` and the name of their page in `RESULTS`, and compared with nothing.

use std::env;
use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

use crate::harness::{launcher, top};

const BEGIN: &str = "```console";
const SLOW: &str = "```console slow";
const ONCE: &str = "```console once";
const END: &str = "```";
/// Words before the commit that flew a page.
const COMMIT: &str = "Flown by commit ";

/// Returns the pages with their texts, in the order of their names.
fn pages() -> Vec<(PathBuf, String)> {
    let folder = fs::read_dir(top().join("docs/results")).expect("a folder");
    let mut pages: Vec<PathBuf> = folder.map(|entry| entry.expect("readable").path()).collect();
    pages.sort();
    let read = |path: PathBuf| {
        let text = fs::read_to_string(&path).expect("a readable page");
        (path, text)
    };
    pages.into_iter().map(read).collect()
}

/// Returns the name by which `RESULTS` asks for a page.
fn name(path: &Path) -> &str {
    path.file_stem().and_then(|name| name.to_str()).expect("a plain name")
}

/// Returns the commands of a block; a line that ends with a backslash continues on the next one.
fn commands(block: &str) -> Vec<String> {
    let mut commands: Vec<String> = vec![];
    let mut goes_on = false;
    for line in block.lines() {
        match (goes_on, line.strip_prefix("$ ")) {
            (true, _) => {
                let command = commands.last_mut().expect("it began");
                command.push('\n');
                command.push_str(line);
            }
            (false, Some(command)) => commands.push(command.to_owned()),
            (false, None) => continue, // a printed line
        }
        goes_on = line.ends_with('\\');
    }
    commands
}

/// Flies a block in a folder of its own; returns its commands, each with its output without the lines of speed and
/// place.
fn flown(block: &str) -> String {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in ["scenarios", "campaigns"] {
        symlink(top().join(name), folder.path().join(name)).expect("a link");
    }
    let built = PathBuf::from(launcher().get_program());
    let program = env::var_os("LAUNCHER").map_or(built, |path| top().join(path));
    let path = format!("{}:{}", program.parent().expect("a folder").display(), env::var("PATH").unwrap_or_default());
    let fly = |command: String| {
        let mut bash = Command::new("bash");
        bash.args(["-c", &format!("({command}) 2>&1")]).current_dir(folder.path()).env("PATH", &path);
        let output = bash.output().expect("bash runs");
        let said = String::from_utf8_lossy(&output.stdout).into_owned();
        let of_one_run =
            |line: &&str| !["speed ", "written to "].iter().any(|word| line.trim_start().starts_with(word));
        let lines = said.lines().filter(of_one_run).map(str::trim_end);
        let lines: String = lines.flat_map(|line| [line, "\n"]).collect();
        assert!(!lines.lines().any(|line| line.starts_with("error: ")), "{command}\n{lines}");
        format!("$ {command}\n{lines}")
    };
    commands(block).into_iter().map(fly).collect()
}

/// Returns a page with the blocks flown that `flies` selects by their first line.
fn again(page: &str, flies: impl Fn(&str) -> bool) -> String {
    let mut new = String::new();
    let mut lines = page.split_inclusive('\n');
    while let Some(line) = lines.next() {
        new.push_str(line);
        if line.starts_with(BEGIN) {
            let block: String = lines.by_ref().take_while(|line| line.trim_end() != END).collect();
            new.push_str(&if flies(line.trim_end()) { flown(&block) } else { block });
            new.push_str(END);
            new.push('\n');
        }
    }
    new
}

/// Writes the present commit into a page.
fn with_commit(page: &str) -> String {
    let output = Command::new("git").args(["rev-parse", "--short=8", "HEAD"]).current_dir(top()).output();
    let commit = String::from_utf8(output.expect("git runs").stdout).expect("text");
    let (before, after) = page.split_once(COMMIT).expect("a page names the commit that flew it");
    let rest = after.trim_start_matches(|c: char| c.is_ascii_hexdigit());
    format!("{before}{COMMIT}{}{rest}", commit.trim())
}

/// Flies the selected blocks of a page again; returns the difference, or rewrites the page.
fn check((path, page): &(PathBuf, String), wanted: &str) -> Option<String> {
    let rewrites = env::var_os("REWRITE").is_some();
    let is_named = wanted.split(',').any(|word| word == name(path));
    if !(wanted.is_empty() || wanted == "all" || is_named) {
        return None;
    }
    let flies = |first: &str| match first {
        ONCE => rewrites && is_named,
        SLOW => rewrites || !wanted.is_empty(),
        _ => true,
    };
    let new = again(page, flies);
    let place = path.strip_prefix(top()).map_or("", |path| path.to_str().unwrap_or_default());
    match (new == *page, rewrites) {
        (true, _) => None,
        (false, true) => fs::write(path, with_commit(&new)).err().map(|error| format!("{place}: {error}")),
        (false, false) => {
            let lines = new.lines().filter(|line| !page.lines().any(|of_page| of_page == *line));
            Some(format!("{place} does not have:\n{}", lines.collect::<Vec<_>>().join("\n")))
        }
    }
}

#[test]
fn every_command_of_the_results_prints_what_its_page_says() {
    let pages = pages();
    for (path, page) in &pages {
        assert!(page.contains(BEGIN) && page.contains(COMMIT), "{}: no command, or no commit", path.display());
    }
    let wanted = env::var("RESULTS").unwrap_or_default();
    for word in wanted.split(',').filter(|word| !["", "all"].contains(word)) {
        assert!(pages.iter().any(|(path, _)| name(path) == word), "RESULTS: there is no page docs/results/{word}.md");
    }
    let differences: Vec<String> = thread::scope(|scope| {
        let two = [0, 1].map(|one| {
            let (pages, wanted) = (&pages, &wanted);
            scope.spawn(move || {
                pages.iter().skip(one).step_by(2).filter_map(|page| check(page, wanted)).collect::<Vec<_>>()
            })
        });
        two.into_iter().flat_map(|flown| flown.join().expect("flights end")).collect()
    });
    assert!(differences.is_empty(), "{}", differences.join("\n\n"));
}

#[test]
fn a_command_continues_after_a_backslash_and_output_is_no_command() {
    assert_eq!(
        commands("$ for a in 1; \\\n  do echo $a; done\n1\n$ true\n"),
        ["for a in 1; \\\n  do echo $a; done", "true"]
    );
    let page =
        "Flown by commit 00000000.\n```console\n$ echo a; echo speed 1\nb\n```\n```console slow\n$ false\nc\n```\n";
    let new = again(page, |first| first != SLOW);
    assert_eq!(new, page.replace("\nb\n", "\na\n"));
    assert!(!with_commit(&new).contains("00000000"));
}
