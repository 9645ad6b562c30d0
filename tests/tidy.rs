//! Each equation of the paper is cited in one file, the pages name files and items that exist, and comments keep to the
//! rules of CONTRIBUTING.md.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;
use syn::{Ident, ImplItem, Item, TraitItem, Type};

use crate::harness::{skip, top};

/// Returns every Rust file of the workspace: its path from the top, and its text.
pub fn sources() -> Vec<(PathBuf, String)> {
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
    for member in [
        "qp",
        "airframe",
        "curves",
        "contract",
        "settings",
        "navigation",
        "runtime",
        "plant",
        "guidance",
        "attitude-mpc",
        "mixer",
        "ring",
        "foreign",
        "launcher",
        "tests",
    ] {
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

/// Returns the number in a code line that ends with `// (36)`.
fn cited_equation(line: &str) -> Option<String> {
    let (code, number) = line.trim_end().rsplit_once("// (")?;
    let number = number.strip_suffix(')')?;
    let is_code = !code.trim().is_empty() && !code.trim_start().starts_with("//");
    (is_code && number.bytes().all(|b| b.is_ascii_digit())).then(|| number.to_owned())
}

/// Words that no doc comment may begin with, because they name nothing.
const OPENERS: [&str; 22] = [
    "It", "Its", "This", "They", "Those", "That", "Of", "What", "Whether", "How", "Where", "Who", "Whom", "When",
    "From", "So", "Has", "Does so", "One more", "As many", "As long", "The same",
];
/// Metaphors of an earlier vocabulary, and vague pronouns.
const OLD_WORDS: [&str; 9] =
    ["nobody", "somebody", "whoever", "suffers", "mourn", "undertaker", "newcomer", "newcomers", "seizure"];

/// Returns the first line of every doc comment, with its line number.
fn first_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    fn doc(line: &str) -> Option<&str> {
        let line = line.trim_start();
        line.strip_prefix("/// ").or_else(|| line.strip_prefix("//! "))
    }
    let mut before = false;
    text.lines().zip(1..).filter_map(move |(line, number)| {
        let is_first = !std::mem::replace(&mut before, line.trim_start().starts_with("//"));
        Some((number, doc(line).filter(|_| is_first)?))
    })
}

#[test]
fn a_doc_comment_begins_with_a_verb_or_with_what_it_documents() {
    let begins =
        |line: &str, opener: &str| line.strip_prefix(opener).is_some_and(|rest| rest.starts_with([' ', ',', '.']));
    let mut found = vec![];
    for (path, text) in sources() {
        let riddles = first_lines(&text).filter(|(_, line)| OPENERS.iter().any(|opener| begins(line, opener)));
        found.extend(riddles.map(|(number, line)| format!("{}:{number}: {line}", path.display())));
    }
    assert!(found.is_empty(), "{} doc comments:\n{}", found.len(), found.join("\n"));
}

#[test]
fn comments_are_at_most_120_columns_wide_and_use_the_words_of_the_field() {
    let mut found = vec![];
    for (path, text) in sources() {
        for (line, number) in text.lines().zip(1..).filter(|(line, _)| line.trim_start().starts_with("//")) {
            let is_table = line.contains(" | ");
            let prose = line.replace("`nobody`", ""); // a user of the system
            let is_old = |word: &str| OLD_WORDS.contains(&word.to_lowercase().as_str());
            if prose.split(|c: char| !c.is_alphabetic()).any(is_old) || !is_table && line.chars().count() > 120 {
                found.push(format!("{}:{number}: {}", path.display(), line.trim()));
            }
        }
    }
    assert!(found.is_empty(), "{} lines:\n{}", found.len(), found.join("\n"));
}

/// Returns the targets of relative links, and the paths in backticks, of a page of Markdown.
fn named_files(text: &str) -> Vec<String> {
    let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next());
    let links = links.filter(|link| !link.is_empty() && !link.contains("://"));
    let is_path = |word: &&str| {
        let folder = word.split_once('/').map(|(folder, _)| top().join(folder));
        Path::new(word).extension().is_some_and(|e| e == "rs") && folder.is_some_and(|folder| folder.is_dir())
    };
    let paths = text.split('`').skip(1).step_by(2).filter(is_path);
    links.chain(paths).map(str::to_owned).collect()
}

#[test]
fn every_package_and_test_of_a_printed_cargo_command_exists() {
    let Some(pages) = pages() else { return };
    let packages = crate::architecture::packages();
    let targets = |package: &Value| package["targets"].as_array().expect("targets").clone();
    let read = |page| std::fs::read_to_string(top().join(page)).expect("a readable page");
    let texts = pages.lines().map(|page| (page.to_owned(), read(page)));
    let sources = sources().into_iter().map(|(path, text)| (path.display().to_string(), text));
    let (mut checked, mut wrong) = (0, vec![]);
    for (place, text) in texts.chain(sources) {
        for command in text.split("cargo ").skip(1).filter_map(|rest| rest.split(['`', '\n', '"']).next()) {
            let after = |flag: &str| command.split_once(flag).and_then(|(_, rest)| rest.split(' ').next());
            let (package, test) = (after(" -p "), after(" --test "));
            let is_meant = |of: &&Value| package.is_none_or(|package| of["name"] == package);
            let has = |of: &Value| test.is_none_or(|test| targets(of).iter().any(|target| target["name"] == test));
            if package.or(test).is_some() {
                checked += 1;
                if !packages.iter().filter(is_meant).any(has) {
                    wrong.push(format!("{place}: cargo {command}"));
                }
            }
        }
    }
    assert!(wrong.is_empty() && checked > 20, "{checked} checked: {wrong:#?}");
}

/// Returns the paths of the pages of the repository, one per line; `None`, and a note, without a repository.
fn pages() -> Option<String> {
    let listed = std::process::Command::new("git").args(["ls-files", "*.md"]).current_dir(top()).output();
    let Some(listed) = listed.ok().filter(|output| output.status.success()) else {
        skip("this is no clone, or git is missing");
        return None;
    };
    let pages = String::from_utf8(listed.stdout).expect("plain names");
    assert!(pages.contains("README.md"), "{pages}");
    Some(pages)
}

#[test]
fn every_file_that_a_page_names_exists() {
    let Some(pages) = pages() else { return };
    for page in pages.lines() {
        let text = std::fs::read_to_string(top().join(page)).expect("a readable page");
        let folder = top().join(page).with_file_name("");
        for name in named_files(&text) {
            assert!(folder.join(&name).exists() || top().join(&name).exists(), "{page} names {name}");
        }
    }
}

/// Adds the names of the items of a file to `found`, each after the names of the modules and types that it stands in.
fn collect(items: &[Item], module: &[String], found: &mut BTreeSet<Vec<String>>) {
    let add = |found: &mut BTreeSet<_>, names: &[&Ident]| {
        let path = module.iter().cloned().chain(names.iter().map(ToString::to_string)).collect();
        found.insert(path);
    };
    for item in items {
        match item {
            Item::Const(i) => add(found, &[&i.ident]),
            Item::Fn(i) => add(found, &[&i.sig.ident]),
            Item::Static(i) => add(found, &[&i.ident]),
            Item::Type(i) => add(found, &[&i.ident]),
            Item::Struct(i) => {
                add(found, &[&i.ident]);
                i.fields
                    .iter()
                    .filter_map(|field| field.ident.as_ref())
                    .for_each(|field| add(found, &[&i.ident, field]));
            }
            Item::Enum(i) => {
                add(found, &[&i.ident]);
                i.variants.iter().for_each(|variant| add(found, &[&i.ident, &variant.ident]));
            }
            Item::Trait(i) => {
                add(found, &[&i.ident]);
                for member in &i.items {
                    match member {
                        TraitItem::Fn(member) => add(found, &[&i.ident, &member.sig.ident]),
                        TraitItem::Type(member) => add(found, &[&i.ident, &member.ident]),
                        _ => {}
                    }
                }
            }
            Item::Impl(i) => {
                let Type::Path(of) = &*i.self_ty else { continue };
                let of = of.path.segments.last().map(|segment| &segment.ident);
                for (of, member) in of.iter().flat_map(|of| i.items.iter().map(move |member| (*of, member))) {
                    match member {
                        ImplItem::Fn(member) => add(found, &[of, &member.sig.ident]),
                        ImplItem::Const(member) => add(found, &[of, &member.ident]),
                        _ => {}
                    }
                }
            }
            // The tests in a `proptest!` are functions that only its expansion has.
            Item::Macro(i) => {
                let words: Vec<String> = i.mac.tokens.clone().into_iter().map(|token| token.to_string()).collect();
                let named = words.windows(2).filter(|pair| pair[0] == "fn").map(|pair| pair[1].clone());
                found.extend(named.map(|name| [module, &[name]].concat()));
            }
            Item::Mod(i) => {
                let inner = [module, &[i.ident.to_string()]].concat();
                found.insert(inner.clone());
                i.content.iter().for_each(|(_, items)| collect(items, &inner, found));
            }
            _ => {}
        }
    }
}

/// Returns the names of all items in the workspace, from the crate down; of a test, from its file down.
fn names() -> BTreeSet<Vec<String>> {
    let mut found = BTreeSet::new();
    for (path, text) in sources() {
        let parts: Vec<String> =
            path.with_extension("").iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let mut module: Vec<String> = match parts.iter().rposition(|part| part == "src") {
            Some(src) => [&parts[src - 1..src], &parts[src + 1..]].concat(),
            None => parts.iter().skip_while(|part| *part != "tests").skip(1).cloned().collect(),
        };
        module.pop_if(|last| ["lib", "main", "mod"].contains(&last.as_str()));
        for name in &mut module {
            *name = name.replace('-', "_");
        }
        found.insert(module.clone());
        // Templates of `trefoil new` have places to be filled in.
        let Ok(file) = syn::parse_file(&text) else { continue };
        collect(&file.items, &module, &mut found);
    }
    found
}

/// Returns the paths in backticks, `a::b`, each with the text that it stands in.
fn named_items(text: &str) -> Vec<(&str, Vec<&str>)> {
    let spans = text.split('`').skip(1).step_by(2);
    let words = spans.flat_map(|span| {
        span.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':').map(move |word| (span, word))
    });
    let paths = words.map(|(span, word)| (span, word.split("::").collect::<Vec<_>>()));
    paths
        .filter(|(_, path)| path.len() > 1 && path.iter().all(|name| !name.is_empty() && !name.contains(':')))
        .collect()
}

#[test]
fn every_item_that_a_page_names_exists() {
    let names = names();
    assert!(names.len() > 3_000, "the items were found: {}", names.len());
    let lock = std::fs::read_to_string(top().join("Cargo.lock")).expect("Cargo.lock");
    let is_of_others =
        |name: &str| name == "std" || lock.contains(&format!("name = \"{name}\"\nversion = \"")) && !is_ours(name);
    let Some(pages) = pages() else { return };
    let (mut checked, mut wrong) = (0, vec![]);
    for page in pages.lines() {
        let text = std::fs::read_to_string(top().join(page)).expect("a readable page");
        for (span, path) in named_items(&text).into_iter().filter(|(_, path)| !is_of_others(path[0])) {
            // The filter of a test is the beginning of its name.
            let is_filter = span.contains("cargo test");
            let is_meant = |name: &Vec<String>| {
                let from = name.len().checked_sub(path.len());
                from.is_some_and(|from| {
                    let mut pairs = name[from..].iter().zip(&path).rev();
                    let last = pairs.next().is_some_and(|(is, said)| is == said || is_filter && is.starts_with(said));
                    last && pairs.all(|(is, said)| is == said)
                })
            };
            checked += 1;
            if !names.iter().any(is_meant) {
                wrong.push(format!("{page} names {}", path.join("::")));
            }
        }
    }
    assert!(checked > 10 && wrong.is_empty(), "{checked} names on the pages, of which there are not: {wrong:#?}");
}

/// Returns whether the workspace has a crate of this name.
fn is_ours(name: &str) -> bool {
    let folders = [name.to_owned(), format!("launcher/{name}"), format!("foreign/{name}")];
    folders.iter().any(|folder| top().join(folder).join("Cargo.toml").is_file())
}

#[test]
fn the_pages_have_the_sizes_of_the_messages() {
    use contract::message::{Actuators, Controls, Reference, State};
    let sizes = [size_of::<State>(), size_of::<Reference>(), size_of::<Controls>(), size_of::<Actuators>()];
    for page in ["docs/architecture.md", "docs/decisions/0001-ring-and-doorbell.md"] {
        let text = std::fs::read_to_string(top().join(page)).expect("a readable page");
        let sentence = text.split(". ").find(|sentence| sentence.contains("STATE") && sentence.contains("bytes"));
        let sentence = sentence.unwrap_or_else(|| panic!("{page} says how large a message is"));
        let said: Vec<usize> = numbers(sentence).filter_map(|number| number.parse().ok()).collect();
        assert!(said.windows(sizes.len()).any(|run| run == sizes), "{page}: {said:?}, and they have {sizes:?}");
    }
}

#[test]
fn the_page_for_developers_names_every_measurement() {
    let help = crate::harness::launcher().args(["measure", "--help"]).output().expect("the launcher runs");
    let help = String::from_utf8(help.stdout).expect("UTF-8");
    let commands = help.split("Commands:\n").nth(1).expect("a list of commands").lines();
    let commands: Vec<&str> = commands.map_while(|line| line.strip_prefix("  ")?.split_whitespace().next()).collect();
    let page = std::fs::read_to_string(top().join("CONTRIBUTING.md")).expect("a readable page");
    let section = page.split("\n## ").find(|section| section.starts_with("Measure")).expect("a section");
    assert!(commands.contains(&"timing"), "{help}");
    for command in commands.into_iter().filter(|command| *command != "help") {
        let is_named =
            [format!("`{command}`"), format!("measure {command}`")].iter().any(|name| section.contains(name));
        assert!(is_named, "CONTRIBUTING.md does not name `measure {command}`");
    }
}

#[test]
fn the_checks_count_and_name_what_they_skip() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let log = folder.path().join("log");
    let said = "test a ... ok\nskipped: needs root: b::c\ntest d ... skipped: no node: d\nskipped: needs root: b::c\n";
    for (said, expected) in
        [(said, "skipped: 2\n  needs root: b::c\n  no node: d\n"), ("test a ... ok\n", "skipped: 0\n")]
    {
        std::fs::write(&log, said).expect("can be written");
        let output = std::process::Command::new(top().join(".ci/skipped")).arg(&log).output().expect("a shell runs");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(String::from_utf8_lossy(&output.stdout), expected);
    }
    let checks = std::fs::read_to_string(top().join(".ci/run")).expect(".ci/run");
    assert!(checks.contains("| tee -a \"$log\"") && checks.contains(".ci/skipped \"$log\""), "they are used");
}

/// Returns the numbers in a text, as written.
fn numbers(text: &str) -> impl Iterator<Item = &str> {
    let all = text.split(|c: char| !c.is_ascii_digit() && c != '.').map(|number| number.trim_matches('.'));
    all.filter(|number| !number.is_empty())
}

/// A feature of `mcap` or `parquet` would bring such libraries back.
#[test]
fn nothing_compresses_by_a_library_in_c() {
    let lock = std::fs::read_to_string(top().join("Cargo.lock")).expect("Cargo.lock");
    for name in ["zstd-sys", "lz4-sys", "libz-sys", "bzip2-sys", "lzma-sys"] {
        assert!(!lock.contains(&format!("name = \"{name}\"")), "{name} is in Cargo.lock");
    }
}
