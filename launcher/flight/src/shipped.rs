//! Scenarios and campaigns of the repository, part of the program, so that an installed one has them too.
//!
//! | a user writes | is |
//! |---|---|
//! | a path at which there is anything but a folder | that file |
//! | `survey`, `faults/swap-law`, `scenarios/survey.toml` | the shipped scenario, if no file is there |
//! | `laws`, `campaigns/laws.toml` | the shipped campaign, likewise |
//! | `shipped:/scenarios/survey.toml` | the shipped file, always: as shipped campaigns name their scenarios |

use std::path::{Component, Path};

use contract::scenario::{ScenarioError, Source};

// `FILES`: the shipped files, made by `build.rs`.
include!(concat!(env!("OUT_DIR"), "/shipped.rs"));

/// Folder of the shipped files, as paths name it.
pub const ROOT: &str = "shipped:";
/// First letters of the comment that names a file's schema for editors.
const SCHEMA: &str = "#:schema ";

/// Scenario or campaign of the repository.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shipped {
    /// Path from the top of the repository.
    pub path: &'static str,
    text: &'static str,
}

/// Kind of a shipped file, and its folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    Scenario,
    Campaign,
}

impl Kind {
    fn folder(self) -> &'static str {
        match self {
            Self::Scenario => "scenarios",
            Self::Campaign => "campaigns",
        }
    }
}

impl Shipped {
    /// Lists the shipped files of a kind, by path.
    pub fn all(kind: Kind) -> impl Iterator<Item = Self> {
        let is_of_kind = move |path: &str| Path::new(path).starts_with(kind.folder());
        FILES.iter().filter(move |(path, _)| is_of_kind(path)).map(|&(path, text)| Self { path, text })
    }

    /// Finds the shipped file that `path` names; `None` if a file of the user has that path.
    pub fn find(kind: Kind, path: &Path) -> Option<Self> {
        let words = match path.strip_prefix(ROOT) {
            Ok(inside) => inside,
            Err(_) if path.symlink_metadata().is_ok() && !path.is_dir() => return None,
            Err(_) => path,
        };
        let name = without_parents(words)?;
        Self::all(kind).find(|shipped| name == shipped.name() || name == shipped.path)
    }

    /// Returns whether `path` may have been meant for a file of the user: it is no name that only a shipped file has.
    pub fn may_be_mistaken(self, path: &Path) -> bool {
        path != Path::new(self.name()) && !path.starts_with(ROOT)
    }

    /// Name by which users call it: the path in its folder, without the ending.
    pub fn name(self) -> &'static str {
        let name = self.path.split_once('/').map_or(self.path, |(_, name)| name);
        name.strip_suffix(".toml").unwrap_or(name)
    }

    /// Text of the file, without the comment that names its schema: that is a path of the repository.
    pub fn text(self) -> &'static str {
        if self.text.starts_with(SCHEMA) { self.text.split_once('\n').map_or("", |(_, rest)| rest) } else { self.text }
    }

    /// First comment of the file, as one line.
    pub fn comment(self) -> String {
        let lines = self.text().lines().map_while(|line| line.strip_prefix("# "));
        lines.collect::<Vec<_>>().join(" ")
    }

    /// Path by which [`find`](Self::find) always finds it.
    pub fn origin(self) -> String {
        format!("{ROOT}/{}", self.path)
    }
}

/// Reads the scenario at `path`, or the shipped one of that name.
///
/// # Errors
/// There is neither, or the file cannot be read.
pub fn scenario(path: &Path) -> Result<Source, ScenarioError> {
    match Shipped::find(Kind::Scenario, path) {
        Some(shipped) => Ok(Source { path: Some(shipped.origin()), text: shipped.text().into() }),
        None => Source::read(path),
    }
}

/// Returns `path` with `..` resolved by its words alone; `None` if it is absolute, or leaves the folder.
fn without_parents(path: &Path) -> Option<String> {
    let mut words = vec![];
    for component in path.components() {
        match component {
            Component::Normal(word) => words.push(word.to_str()?),
            Component::ParentDir => _ = words.pop()?,
            Component::CurDir => {}
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(words.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(kind: Kind, path: &str) -> Option<&'static str> {
        Shipped::find(kind, Path::new(path)).map(|shipped| shipped.path)
    }

    #[test]
    fn a_name_finds_the_shipped_file_and_a_path_wins() {
        assert_eq!(found(Kind::Scenario, "survey"), Some("scenarios/survey.toml"));
        assert_eq!(found(Kind::Scenario, "faults/swap-law"), Some("scenarios/faults/swap-law.toml"));
        assert_eq!(found(Kind::Scenario, "scenarios/survey.toml"), Some("scenarios/survey.toml"));
        assert_eq!(found(Kind::Campaign, "shipped:/scenarios/../campaigns/laws.toml"), Some("campaigns/laws.toml"));
        assert_eq!([found(Kind::Campaign, "survey"), found(Kind::Scenario, "/survey")], [None, None]);
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("survey");
        std::fs::write(&own, "name = \"mine\"").unwrap();
        assert_eq!(scenario(&own).unwrap().text, "name = \"mine\"");
        assert_eq!(found(Kind::Scenario, folder.path().to_str().unwrap()), None);
    }

    #[test]
    fn only_a_path_may_be_meant_for_a_file() {
        for (path, expected) in [
            ("wind", false),
            ("faults/swap-law", false),
            ("shipped:/scenarios/wind.toml", false),
            ("scenarios/wind.toml", true),
            ("./wind", true),
        ] {
            let shipped = Shipped::find(Kind::Scenario, Path::new(path)).unwrap();
            assert_eq!(shipped.may_be_mistaken(Path::new(path)), expected, "{path}");
        }
    }

    #[test]
    fn every_shipped_file_names_its_schema_and_says_what_it_shows() {
        for kind in [Kind::Scenario, Kind::Campaign] {
            assert!(Shipped::all(kind).count() > 10);
            for shipped in Shipped::all(kind) {
                let up = "../".repeat(shipped.path.matches('/').count());
                let schema = if kind == Kind::Scenario { "scenario" } else { "campaign" };
                let line = format!("{SCHEMA}{up}docs/schema/{schema}.json");
                assert_eq!(shipped.text.lines().next(), Some(line.as_str()), "{}", shipped.path);
                assert!(shipped.comment().len() > 20, "{}", shipped.path);
            }
        }
    }
}
