//! The house rules that a program can check.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::harness::top;

/// Every Rust file of the workspace, by path from the top.
fn sources() -> Vec<(PathBuf, String)> {
    fn walk(folder: &Path, found: &mut Vec<PathBuf>) {
        for entry in std::fs::read_dir(folder).expect("a folder").flatten() {
            let path = entry.path();
            if path.is_dir() {
                walk(&path, found);
            } else if path.extension().is_some_and(|e| e == "rs") {
                found.push(path);
            }
        }
    }
    let mut found = vec![];
    for member in
        ["qp", "airframe", "contract", "runtime", "plant", "guidance", "attitude-mpc", "mixer", "launcher", "tests"]
    {
        walk(&top().join(member), &mut found);
    }
    assert!(found.len() > 30, "the walk found the workspace");
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).expect("a readable file");
        (path.strip_prefix(top()).expect("below the top").to_owned(), text)
    };
    found.into_iter().map(read).collect()
}

#[test]
fn each_equation_of_code_stands_in_one_file() {
    let mut homes: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for (path, text) in sources() {
        let mut here: Vec<String> = text.lines().filter_map(cited_equation).collect();
        here.sort();
        here.dedup();
        for equation in here {
            homes.entry(equation).or_default().push(path.clone());
        }
    }
    assert!(homes.len() > 25, "equations are cited: {homes:?}");
    for (equation, files) in &homes {
        assert_eq!(files.len(), 1, "({equation}) is cited in {files:?}");
    }
}

/// The number in a code line that ends with `// (36)`.
fn cited_equation(line: &str) -> Option<String> {
    let (code, number) = line.trim_end().rsplit_once("// (")?;
    let number = number.strip_suffix(')')?;
    let is_code = !code.trim().is_empty() && !code.trim_start().starts_with("//");
    (is_code && number.bytes().all(|b| b.is_ascii_digit())).then(|| number.to_owned())
}

#[test]
fn unsafe_code_stays_in_its_room() {
    for (path, text) in sources() {
        let lifts = text.contains("expect(unsafe_code") || text.contains("allow(unsafe_code");
        let is_here = path.ends_with("tests/tidy.rs") || path == Path::new("runtime/src/realtime/mod.rs");
        assert!(!lifts || is_here, "{} lifts the ban on unsafe code", path.display());
    }
}

#[test]
fn only_port_names_iceoryx2() {
    for (path, text) in sources() {
        let names = (text.contains("use iceoryx2::") || text.contains("use iceoryx2_cal"))
            && !path.starts_with("runtime/src/port");
        let is_here = path == Path::new("runtime/src/port.rs") || path == Path::new("tests/tidy.rs");
        assert!(!names || is_here, "{} names iceoryx2", path.display());
    }
}

#[test]
fn no_node_reads_the_clock_or_knows_another() {
    let nodes = ["plant", "guidance", "attitude-mpc", "mixer"];
    for (path, text) in sources() {
        let Some(home) = nodes.iter().find(|node| path.starts_with(Path::new(node).join("src"))) else { continue };
        for word in ["std::env", "std::time", "Instant::now", "SystemTime", "runtime::realtime", "println!", "std::fs"]
        {
            assert!(!text.contains(word), "{} uses {word}", path.display());
        }
        for other in nodes.iter().chain(&["launcher"]).filter(|other| *other != home) {
            let import = format!("use {}::", other.replace('-', "_"));
            assert!(!text.contains(&import), "{} knows {other}", path.display());
        }
    }
}

#[test]
fn files_are_short_enough_to_read() {
    for (path, text) in sources() {
        let lines = text.lines().count();
        assert!(lines <= 400, "{} has {lines} lines", path.display());
    }
}
