//! Each equation of the paper is cited in one file, the pages name files that exist, and comments keep to the rules of
//! CONTRIBUTING.md.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use crate::harness::{skip, top};

/// Every Rust file of the workspace, by path from the top.
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

/// The number in a code line that ends with `// (36)`.
fn cited_equation(line: &str) -> Option<String> {
    let (code, number) = line.trim_end().rsplit_once("// (")?;
    let number = number.strip_suffix(')')?;
    let is_code = !code.trim().is_empty() && !code.trim_start().starts_with("//");
    (is_code && number.bytes().all(|b| b.is_ascii_digit())).then(|| number.to_owned())
}

/// Words that a comment does not begin with: they say nothing of what they stand before.
const OPENERS: [&str; 22] = [
    "It", "Its", "This", "They", "Those", "That", "Of", "What", "Whether", "How", "Where", "Who", "Whom", "When",
    "From", "So", "Has", "Does so", "One more", "As many", "As long", "The same",
];
/// Words of an earlier vocabulary, and of riddles.
const OLD_WORDS: [&str; 9] =
    ["nobody", "somebody", "whoever", "suffers", "mourn", "undertaker", "newcomer", "newcomers", "seizure"];

/// First line of every doc comment, with its number.
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

/// Targets of relative links, and paths in backticks, of a page of Markdown.
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
fn every_file_that_a_page_names_exists() {
    let listed = std::process::Command::new("git").args(["ls-files", "*.md"]).current_dir(top()).output();
    let Some(listed) = listed.ok().filter(|output| output.status.success()) else {
        return skip("this is no clone, or git is missing");
    };
    let pages = String::from_utf8(listed.stdout).expect("plain names");
    assert!(pages.contains("README.md"), "{pages}");
    for page in pages.lines() {
        let text = std::fs::read_to_string(top().join(page)).expect("a readable page");
        let folder = top().join(page).with_file_name("");
        for name in named_files(&text) {
            assert!(folder.join(&name).exists() || top().join(&name).exists(), "{page} names {name}");
        }
    }
}

/// Numbers of a text, as it writes them.
fn numbers(text: &str) -> impl Iterator<Item = &str> {
    let all = text.split(|c: char| !c.is_ascii_digit() && c != '.').map(|number| number.trim_matches('.'));
    all.filter(|number| !number.is_empty())
}

/// Two runs of one command give two results: a figure among the results is that of the page which has the whole table.
#[test]
fn the_results_have_the_figures_of_the_page_on_faults() {
    let [results, page] = ["docs/results.md", "docs/faults.md"]
        .map(|name| std::fs::read_to_string(top().join(name)).expect("a readable page"));
    let known: Vec<&str> = numbers(&page).collect();
    let mut rows = 0;
    for row in results.lines().filter(|row| row.contains("| `measure faults` |") || row.contains("| `measure kills` |"))
    {
        let unknown: Vec<&str> = numbers(row).filter(|number| !known.contains(number)).collect();
        assert!(unknown.is_empty(), "{unknown:?} not in docs/faults.md: {row}");
        rows += 1;
    }
    assert!(rows >= 4, "{rows}");
}
