//! docs/tutorial.md: its files are written, its commands run in order, and the output is that of the page.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::Command;

use crate::harness::{PATIENT, skip, top, write_script};

/// Shell function in the place of `sleep`: it also waits until the controller flies.
const SLEEP: &str = "sleep() { command sleep $1; until trefoil status | grep -Eq 'attitude-mpc +[0-9]+ +- +[0-9]+'; do \
                     command sleep 0.1; done; }";

/// Fenced block of the page: the word after its fence, its text, and the paragraph before it.
struct Block<'a> {
    kind: &'a str,
    text: &'a str,
    before: &'a str,
}

/// Returns the fenced blocks of a page.
fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut parts = page.split("```");
    let mut blocks = vec![];
    while let (Some(prose), Some(fenced)) = (parts.next(), parts.next()) {
        let (kind, text) = fenced.split_once('\n').expect("a word after the fence");
        let before = prose.trim_end().rsplit("\n\n").next().unwrap_or_default();
        blocks.push(Block { kind, text, before });
    }
    blocks
}

/// Returns the file that a paragraph tells the reader to save the next block as.
fn saved_as(paragraph: &str) -> Option<&str> {
    paragraph.split("Save this as `").nth(1)?.split('`').next()
}

/// Returns whether `line` is the `expected` one, in which `...` stands for any text.
fn is_like(line: &str, expected: &str) -> bool {
    let mut parts = expected.trim_end().split("...");
    let first = parts.next().unwrap_or_default();
    let Some(mut rest) = line.trim_end().strip_prefix(first) else { return false };
    let parts: Vec<&str> = parts.collect();
    if parts.is_empty() {
        return rest.is_empty();
    }
    for part in &parts {
        let Some(at) = rest.rfind(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    parts.last().is_some_and(|last| last.is_empty()) || rest.is_empty()
}

/// Checks that `said` has the lines of the page in this order; a line `...` allows other lines between.
fn compare(said: &str, page: &str) {
    let mut lines = said.lines();
    let mut may_skip = false;
    for expected in page.lines() {
        if expected == "..." {
            may_skip = true;
            continue;
        }
        let found = if may_skip { lines.find(|line| is_like(line, expected)) } else { lines.next() };
        assert!(found.is_some_and(|line| is_like(line, expected)), "expected `{expected}`, not {found:?}, in\n{said}");
        may_skip = false;
    }
    assert!(may_skip || lines.next().is_none(), "more than the page has:\n{said}");
}

/// Writes a `trefoil` into `folder` that flies in a namespace of its own, and bears a machine that stalls processes.
fn write_launcher(folder: &Path) {
    let namespace = format!("tutorial-{}", std::process::id());
    let binary = env!("CARGO_BIN_EXE_trefoil");
    let script = format!(
        "#!/bin/sh\ncase $1 in\n\
         fly) exec {binary} \"$@\" --namespace {namespace} --set '{PATIENT}';;\n\
         swap) exec {binary} \"$@\" --namespace {namespace} --bounds ticks=1000;;\n\
         inject|status|stop) exec {binary} \"$@\" --namespace {namespace};;\n\
         *) exec {binary} \"$@\";;\nesac\n"
    );
    write_script(&folder.join("trefoil"), &script);
}

#[test]
fn the_commands_of_the_tutorial_print_what_it_says() {
    if Command::new("make").arg("--version").output().is_err() {
        return skip("make is not here");
    }
    let page = fs::read_to_string(top().join("docs/tutorial.md")).expect("the page");
    let folder = tempfile::tempdir().expect("a temporary folder");
    symlink(top().join("scenarios"), folder.path().join("scenarios")).expect("a link");
    write_launcher(folder.path());
    let path = format!("{}:{}", folder.path().display(), std::env::var("PATH").unwrap_or_default());
    let (mut commands, mut files) = (0, 0);
    for Block { kind, text, before } in blocks(&page) {
        if let Some(file) = saved_as(before).filter(|_| kind == "toml") {
            fs::write(folder.path().join(file), text).expect("a file");
            files += 1;
        }
        if kind != "console" {
            continue;
        }
        let of_page = text.lines().filter_map(|line| line.strip_prefix("$ "));
        commands += of_page.clone().count();
        // All commands of a block run in one shell, so that `wait` knows the flight.
        let script: Vec<&str> = of_page.collect();
        let mut shell = Command::new("sh");
        shell.args(["-c", &format!("exec 2>/dev/null; {SLEEP}; {}", script.join("\n"))]).current_dir(folder.path());
        let output = shell.env("PATH", &path).env_remove("MAKEFLAGS").output().expect("a shell");
        let said = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{}: {script:?}\n{said}", output.status);
        let expected: Vec<&str> = text.lines().filter(|line| !line.starts_with("$ ")).collect();
        compare(&said, &expected.join("\n"));
    }
    assert_eq!((commands, files), (17, 2), "every command and file of the page was found");
}

#[test]
fn dots_stand_for_any_text() {
    assert!(is_like("a 1.5 s, b", "a ... s, ..."));
    assert!(is_like("a 1.5 s", "a ... s"));
    assert!(!is_like("a 1.5 s, b", "a ... s"));
    assert!(!is_like("b", "a ..."));
}
