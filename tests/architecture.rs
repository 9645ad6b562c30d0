//! Architecture: dependencies between crates and between their files, and what each crate may touch.

mod sources;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::process::Command;

use contract::topic::NODES;
use serde_json::Value;

use crate::harness::top;
use sources::{Crate, Source};

/// Crates, lowest layer first. A crate depends only on crates of earlier entries.
#[rustfmt::skip]
const ORDER: [&[&str]; 21] = [
    &["qp"], &["contract"], &["airframe"], &["curves"], &["settings"], &["navigation"], &["runtime"], &NODES, &["ring"], &["foreign", "trefoil-fmu", "trefoil-browser"],
    &["machine"], &["folder"], &["flight"], &["ground"], &["outcome"], &["trefoil"], &["replay"], &["view"],
    &["campaign"], &["measure", "live"], &["launcher"],
];

/// Returns the packages of the workspace, as `cargo metadata` describes them.
pub fn packages() -> Vec<Value> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".to_owned());
    let arguments = ["metadata", "--no-deps", "--offline", "--format-version", "1"];
    let output = Command::new(cargo).args(arguments).current_dir(top()).output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("metadata is JSON");
    metadata["packages"].as_array().expect("packages").clone()
}

/// Returns the normal dependencies of each package, which are linked into it.
fn links() -> BTreeMap<String, BTreeSet<String>> {
    let word = |value: &Value| value.as_str().expect("a name").to_owned();
    let normal = |package: &Value| {
        let all = package["dependencies"].as_array().expect("dependencies");
        all.iter()
            .filter(|dependency| dependency["kind"].is_null())
            .map(|dependency| word(&dependency["name"]))
            .collect()
    };
    packages().iter().map(|package| (word(&package["name"]), normal(package))).collect()
}

/// Returns the libraries and programs of all packages, parsed.
fn crates() -> Vec<Crate> {
    let targets = packages().into_iter().flat_map(|package| package["targets"].as_array().expect("targets").clone());
    let built =
        targets.filter(|target| target["kind"] == "lib" || ["lib", "bin"].iter().any(|k| target["kind"][0] == *k));
    built.map(|target| Crate::read(Path::new(target["src_path"].as_str().expect("a path")))).collect()
}

fn level(room: &str) -> Option<usize> {
    ORDER.iter().position(|rooms| rooms.contains(&room))
}

#[test]
fn every_package_has_a_layer_and_depends_only_on_lower_layers() {
    for (room, links) in links() {
        let own = level(&room).unwrap_or_else(|| panic!("{room} has no place in the order of rooms"));
        for link in links {
            assert!(level(&link).is_none_or(|below| below < own), "{room} depends on {link}");
        }
    }
}

#[test]
fn the_picture_of_the_crates_has_every_one_in_its_place() {
    let page = std::fs::read_to_string(top().join("docs/architecture.md")).expect("a readable page");
    let picture = page.split("```").nth(1).expect("the picture");
    let words: Vec<&str> = picture.split(|c: char| c.is_whitespace() || c == ':').collect();
    let mut below = usize::MAX;
    for rooms in ORDER {
        // Libraries and programs around a core of the ring stand with `foreign`, in the table below the picture.
        for room in rooms.iter().filter(|room| !room.starts_with("trefoil")) {
            let place = words.iter().position(|word| word == room).unwrap_or_else(|| panic!("no {room}: {picture}"));
            let line = words[..place].iter().filter(|word| **word == "|").count();
            assert!(line <= below, "{room} stands below what it may depend on: {picture}");
            below = below.min(line);
        }
    }
}

#[test]
fn a_controller_links_the_contract_the_settings_and_what_they_stand_on_and_no_other_package() {
    let links = links();
    let mut linked = BTreeSet::new();
    let mut open = vec!["runtime".to_owned()];
    while let Some(room) = open.pop() {
        open.extend(links[&room].iter().filter(|link| level(link).is_some()).cloned());
        linked.insert(room);
    }
    assert_eq!(
        linked,
        BTreeSet::from(["airframe", "contract", "curves", "qp", "runtime", "settings"].map(str::to_owned))
    );
}

#[test]
fn the_commit_of_a_program_counts_as_changed_if_any_room_is() {
    let script = std::fs::read_to_string(top().join("launcher/build.rs")).expect("a readable script");
    for package in packages() {
        let manifest = Path::new(package["manifest_path"].as_str().expect("a path"));
        let room = manifest.strip_prefix(top()).expect("below the top").iter().next().expect("a folder");
        assert!(script.contains(&format!("    {room:?},")), "{room:?} is missing in launcher/build.rs");
    }
}

#[test]
fn the_contract_links_no_other_package_and_nothing_that_reads_files() {
    let links = &links()["contract"];
    let allowed = ["bytemuck", "iceoryx2-bb-derive-macros", "iceoryx2-bb-elementary-traits", "libm", "serde"];
    assert!(links.iter().all(|link| allowed.contains(&link.as_str())), "{links:?}");
}

#[test]
fn runtime_alone_depends_on_iceoryx2_and_the_contract_on_the_trait_of_its_messages() {
    for (room, links) in links() {
        let iceoryx2: Vec<&str> =
            links.iter().filter(|link| link.starts_with("iceoryx2")).map(String::as_str).collect();
        match room.as_str() {
            "runtime" => assert!(iceoryx2.contains(&"iceoryx2")),
            "contract" => {
                assert_eq!(iceoryx2, ["iceoryx2-bb-derive-macros", "iceoryx2-bb-elementary-traits"]);
            }
            _ => assert!(iceoryx2.is_empty(), "{room} depends on {iceoryx2:?}"),
        }
    }
}

#[test]
fn no_files_or_folders_of_a_crate_use_each_other_in_a_circle() {
    let crates = crates();
    assert!(crates.iter().map(|c| c.sources.len()).sum::<usize>() > 100, "the sources were found");
    let circles: BTreeSet<String> = crates.iter().flat_map(Crate::circles).collect();
    assert!(circles.is_empty(), "arrows in circles: {circles:#?}");
}

/// Public types that each platform defines separately.
const OF_THE_PLATFORM: [&str; 2] = ["ControlPage", "ThisProcess"];

#[test]
fn a_public_type_has_a_name_that_no_other_has() {
    let all = crates();
    let mut homes: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for source in all.iter().flat_map(|c| &c.sources) {
        for name in &source.types {
            homes.entry(name).or_default().insert(&source.path);
        }
    }
    assert!(homes.len() > 500, "the types were found");
    homes.retain(|name, homes| homes.len() > 1 && !OF_THE_PLATFORM.contains(name));
    assert!(homes.is_empty(), "a name for each: {homes:#?}");
}

#[test]
fn unsafe_code_stays_in_its_listed_folders() {
    let all = crates();
    let unsafe_files: Vec<&Source> = all.iter().flat_map(|c| &c.sources).filter(|source| source.is_unsafe).collect();
    assert!(!unsafe_files.is_empty(), "the operating system is called somewhere");
    for source in unsafe_files {
        let rooms = [
            "runtime/src/realtime",
            "foreign/src",
            "foreign/fmu/src",
            "foreign/browser/src",
            "launcher/libtrefoil/src",
        ];
        assert!(rooms.iter().any(|room| source.path.starts_with(room)), "{} holds unsafe code", source.path);
    }
}

#[test]
fn no_node_reads_the_clock_the_disk_or_the_environment() {
    let forbidden = ["std::env", "std::fs", "std::io", "std::net", "std::process", "std::thread", "std::time"];
    let all = crates();
    let is_node = |source: &&Source| NODES.iter().any(|node| source.path.starts_with(&format!("{node}/src/")));
    for source in all.iter().flat_map(|c| &c.sources).filter(is_node) {
        for path in source.foreign_paths() {
            let is_forbidden = forbidden.iter().any(|word| path == *word || path.starts_with(&format!("{word}::")));
            let is_main = source.path.ends_with("main.rs") || source.path.ends_with("process.rs");
            assert!(!is_forbidden || (is_main && path == "std::process::ExitCode"), "{} uses {path}", source.path);
            assert!(!path.starts_with("runtime::realtime"), "{} uses {path}", source.path);
        }
    }
}
