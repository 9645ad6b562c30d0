//! Scenarios and campaigns of the repository. They are part of the program, so that an installed program has them too.
//!
//! | a user writes | is |
//! |---|---|
//! | a path at which there is anything but a folder | that file |
//! | `survey`, `faults/swap-law`, `scenarios/survey.toml` | the shipped scenario, if no file is there |
//! | `laws`, `campaigns/laws.toml` | the shipped campaign, if no file is there |
//! | `shipped:/scenarios/survey.toml` | the shipped file, always: as shipped campaigns name their scenarios |

use std::path::{Component, Path};

use settings::{Scenario, ScenarioError, SettingsText, nearest, to_toml};
use toml::Table;

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
pub enum ShippedKind {
    Scenario,
    Campaign,
}

impl ShippedKind {
    /// Name of the kind in a sentence.
    fn word(self) -> &'static str {
        match self {
            Self::Scenario => "scenario",
            Self::Campaign => "campaign",
        }
    }

    fn folder(self) -> &'static str {
        match self {
            Self::Scenario => "scenarios",
            Self::Campaign => "campaigns",
        }
    }
}

impl Shipped {
    /// Lists the shipped files of a kind, by path.
    pub fn all(kind: ShippedKind) -> impl Iterator<Item = Self> {
        let is_of_kind = move |path: &str| Path::new(path).starts_with(kind.folder());
        FILES.iter().filter(move |(path, _)| is_of_kind(path)).map(|&(path, text)| Self { path, text })
    }

    /// Finds the shipped file that `path` names; `None` if a file of the user has that path.
    pub fn find(kind: ShippedKind, path: &Path) -> Option<Self> {
        let words = match path.strip_prefix(ROOT) {
            Ok(inside) => inside,
            Err(_) if path.symlink_metadata().is_ok() && !path.is_dir() => return None,
            Err(_) => path,
        };
        let name = without_parents(words)?;
        Self::all(kind).find(|shipped| name == shipped.name() || name == shipped.path)
    }

    /// Returns whether `path` may have been meant for a file of the user: it is neither the short name of the shipped
    /// file nor below [`ROOT`].
    pub fn may_be_mistaken(self, path: &Path) -> bool {
        path != Path::new(self.name()) && !path.starts_with(ROOT)
    }

    /// Name that users write for the file: its path in the folder of its kind, without the ending.
    pub fn name(self) -> &'static str {
        let name = self.path.split_once('/').map_or(self.path, |(_, name)| name);
        name.strip_suffix(".toml").unwrap_or(name)
    }

    /// Text of the file, without the comment that names its schema by a path of the repository.
    pub fn text(self) -> &'static str {
        if self.text.starts_with(SCHEMA) { self.text.split_once('\n').map_or("", |(_, rest)| rest) } else { self.text }
    }

    /// First comment of the file, as one line.
    pub fn comment(self) -> String {
        let lines = self.text().lines().map_while(|line| line.strip_prefix("# "));
        lines.collect::<Vec<_>>().join(" ")
    }

    /// Path by which [`find`](Self::find) always finds the shipped file.
    pub fn origin(self) -> String {
        format!("{ROOT}/{}", self.path)
    }
}

/// Reads the scenario at `path`, or the shipped scenario of that name.
///
/// # Errors
/// There is no such scenario, the file cannot be read, or it is a campaign.
pub fn scenario(path: &Path) -> Result<SettingsText, ScenarioError> {
    if let Some(shipped) = Shipped::find(ShippedKind::Scenario, path) {
        return Ok(SettingsText { path: Some(shipped.origin()), text: shipped.text().into() });
    }
    let shown = path.display();
    if let Some(advice) = advice(ShippedKind::Scenario, path) {
        let help = format!("{advice}, or give the path of a scenario file; `trefoil scenarios` lists the shipped ones");
        return Err(ScenarioError::of(format!("there is no scenario `{shown}`"), help));
    }
    let source = SettingsText::read(path)?;
    if kind_of(&source.text) == Some(ShippedKind::Campaign) {
        let help = format!("`trefoil campaign {shown}` flies it, and `--only N` its flight N with log and report");
        return Err(ScenarioError::of(format!("`{shown}` is a campaign, which has many flights"), help));
    }
    Ok(source)
}

/// Suggests a shipped file for a `name` that is neither a file nor a shipped file of this `kind`: a shipped file of the
/// other kind, or the file with the nearest name; `None` for a path, and if no name is near.
pub fn advice(kind: ShippedKind, name: &Path) -> Option<String> {
    if name.symlink_metadata().is_ok() || Path::new(&format!("{}.toml", name.display())).is_file() {
        return None;
    }
    let (other, command) = match kind {
        ShippedKind::Scenario => (ShippedKind::Campaign, "campaign"),
        ShippedKind::Campaign => (ShippedKind::Scenario, "fly"),
    };
    if let Some(shipped) = Shipped::find(other, name) {
        let name = shipped.name();
        return Some(format!("`trefoil {command} {name}` flies the shipped {} of that name", other.word()));
    }
    let word = name.strip_prefix(kind.folder()).unwrap_or(name);
    let word = word.to_str().filter(|word| word.len() < name.as_os_str().len() || word.split('.').count() == 1)?;
    let nearest = nearest(word.strip_suffix(".toml").unwrap_or(word), Shipped::all(kind).map(Shipped::name))?;
    Some(format!("did you mean `{nearest}`"))
}

/// Returns the kind of a text by its top-level keys; `None` if it has keys of both kinds, or of neither.
pub fn kind_of(text: &str) -> Option<ShippedKind> {
    let table = text.parse::<Table>().ok()?;
    let known = to_toml(&Scenario::default()).parse::<Table>().unwrap_or_default();
    let is_of_a_scenario = |key: &String| key != "name" && (known.contains_key(key) || key == "fault" || key == "swap");
    let is_of_a_campaign = |key: &String| OF_A_CAMPAIGN.contains(&key.as_str());
    match (table.keys().any(is_of_a_scenario), table.keys().any(is_of_a_campaign)) {
        (true, false) => Some(ShippedKind::Scenario),
        (false, true) => Some(ShippedKind::Campaign),
        _ => None,
    }
}

/// Top-level keys of a campaign.
const OF_A_CAMPAIGN: [&str; 14] = [
    "scenario",
    "seed",
    "seeds",
    "samples",
    "sampling",
    "settings",
    "vary",
    "controller",
    "controllers",
    "case",
    "random_faults",
    "compare",
    "promise",
    "tune",
];

/// Returns `path` with `..` resolved, without a look at the disk; `None` if the path is absolute, or leaves the folder.
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

    fn found(kind: ShippedKind, path: &str) -> Option<&'static str> {
        Shipped::find(kind, Path::new(path)).map(|shipped| shipped.path)
    }

    #[test]
    fn a_name_finds_the_shipped_file_and_a_path_wins() {
        assert_eq!(found(ShippedKind::Scenario, "survey"), Some("scenarios/survey.toml"));
        assert_eq!(found(ShippedKind::Scenario, "faults/swap-law"), Some("scenarios/faults/swap-law.toml"));
        assert_eq!(found(ShippedKind::Scenario, "scenarios/survey.toml"), Some("scenarios/survey.toml"));
        assert_eq!(
            found(ShippedKind::Campaign, "shipped:/scenarios/../campaigns/laws.toml"),
            Some("campaigns/laws.toml")
        );
        assert_eq!([found(ShippedKind::Campaign, "survey"), found(ShippedKind::Scenario, "/survey")], [None, None]);
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join("survey");
        std::fs::write(&own, "name = \"mine\"").unwrap();
        assert_eq!(scenario(&own).unwrap().text, "name = \"mine\"");
        assert_eq!(found(ShippedKind::Scenario, folder.path().to_str().unwrap()), None);
    }

    #[test]
    fn a_name_that_is_not_shipped_gets_the_nearest_and_a_campaign_its_command() {
        let advice = |kind, name: &str| advice(kind, Path::new(name)).unwrap_or_default();
        for (name, expected) in [
            ("survy", "did you mean `survey`"),
            ("scenarios/survy.toml", "did you mean `survey`"),
            ("faults/swap-low", "did you mean `faults/swap-law`"),
            ("laws", "`trefoil campaign laws` flies the shipped campaign of that name"),
            ("mine.toml", ""),
            ("qqqq", ""),
        ] {
            assert_eq!(advice(ShippedKind::Scenario, name), expected, "{name}");
        }
        assert_eq!(advice(ShippedKind::Campaign, "lows"), "did you mean `laws`");
        assert_eq!(advice(ShippedKind::Campaign, "wind"), "`trefoil fly wind` flies the shipped scenario of that name");

        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("mine.toml");
        std::fs::write(&file, "seeds = 3\n[settings]\nrun.duration_s = 2.0").unwrap();
        let said = scenario(&file).err().unwrap().to_string();
        assert!(said.contains("is a campaign") && said.contains("`trefoil campaign /"), "{said}");
        for shipped in Shipped::all(ShippedKind::Campaign) {
            assert_eq!(kind_of(shipped.text()), Some(ShippedKind::Campaign), "{}", shipped.path);
        }
        for shipped in Shipped::all(ShippedKind::Scenario) {
            assert_eq!(kind_of(shipped.text()), Some(ShippedKind::Scenario), "{}", shipped.path);
        }
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
            let shipped = Shipped::find(ShippedKind::Scenario, Path::new(path)).unwrap();
            assert_eq!(shipped.may_be_mistaken(Path::new(path)), expected, "{path}");
        }
    }

    #[test]
    fn every_shipped_file_names_its_schema_and_says_what_it_shows() {
        for kind in [ShippedKind::Scenario, ShippedKind::Campaign] {
            assert!(Shipped::all(kind).count() > 10);
            for shipped in Shipped::all(kind) {
                let up = "../".repeat(shipped.path.matches('/').count());
                let schema = if kind == ShippedKind::Scenario { "scenario" } else { "campaign" };
                let line = format!("{SCHEMA}{up}docs/schema/{schema}.json");
                assert_eq!(shipped.text.lines().next(), Some(line.as_str()), "{}", shipped.path);
                assert!(shipped.comment().len() > 20, "{}", shipped.path);
            }
        }
    }
}
