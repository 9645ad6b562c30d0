//! Shipped campaigns, compiled in so that their commands work in any folder.

use std::fs;
use std::path::Path;

use anyhow::Context;
use campaign::page::{Page, promises};
use campaign::table::Table;
use campaign::{Campaign, Plan, local};
use outcome::target::Target;

/// Paths in the repository, and contents.
const FILES: [(&str, &str); 10] = [
    ("campaigns/aggressive.toml", include_str!("../../../campaigns/aggressive.toml")),
    ("campaigns/conditions.toml", include_str!("../../../campaigns/conditions.toml")),
    ("campaigns/conditions-estimated.toml", include_str!("../../../campaigns/conditions-estimated.toml")),
    ("campaigns/laws.toml", include_str!("../../../campaigns/laws.toml")),
    ("scenarios/fast-legs.toml", include_str!("../../../scenarios/fast-legs.toml")),
    ("scenarios/aggressive/step.toml", include_str!("../../../scenarios/aggressive/step.toml")),
    ("scenarios/aggressive/upset.toml", include_str!("../../../scenarios/aggressive/upset.toml")),
    ("scenarios/aggressive/yaw.toml", include_str!("../../../scenarios/aggressive/yaw.toml")),
    ("scenarios/aggressive/weak-step.toml", include_str!("../../../scenarios/aggressive/weak-step.toml")),
    ("scenarios/aggressive/weak-yaw.toml", include_str!("../../../scenarios/aggressive/weak-yaw.toml")),
];

/// Flights of a shipped campaign.
pub struct Flown {
    pub plan: Plan,
    pub flights: Table,
}

/// Flies the campaign `campaigns/NAME.toml` in process on all cores, with the scenario files `more` as further cases.
///
/// # Errors
/// A file of `more` cannot be read or flown, or has the name of another case.
pub fn fly(name: &str, more: &[impl AsRef<Path>]) -> anyhow::Result<Flown> {
    let folder = tempfile::tempdir()?;
    for (path, text) in FILES {
        let path = folder.path().join(path);
        fs::create_dir_all(path.parent().unwrap_or(folder.path()))?;
        fs::write(path, text)?;
    }
    let campaigns = folder.path().join("campaigns");
    let path = campaigns.join(name).with_extension("toml");
    let mut text = fs::read_to_string(path)?;
    for path in more.iter().map(AsRef::as_ref) {
        let absolute = path.canonicalize().with_context(|| format!("cannot read {}", path.display()))?;
        let [name, path] = [path.file_stem(), Some(absolute.as_os_str())]
            .map(|part| toml::Value::from(&*part.unwrap_or_default().to_string_lossy()));
        text.extend(["\n[case.", &name.to_string(), "]\nscenario = ", &path.to_string(), "\n"]);
    }
    let plan = Plan::new(Campaign::read(&text, &format!("campaigns/{name}.toml"), name, &campaigns)?)?;
    let flights = local::fly_all(&plan);
    Ok(Flown { plan, flights })
}

impl Flown {
    /// Returns the verdicts on the campaign's promises.
    pub fn targets(&self) -> Vec<Target> {
        promises::targets(&Page::new(&self.plan, &self.flights))
    }

    /// Returns a number of a row; NaN if it has none.
    pub fn number(&self, row: usize, column: &str) -> f64 {
        self.flights.column(column).and_then(|column| column.number(row)).unwrap_or(f64::NAN)
    }

    /// Returns a text of a row.
    pub fn text(&self, row: usize, column: &str) -> &str {
        self.flights.column(column).map_or("", |column| column.text(row))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_shipped_campaign_can_be_flown() {
        for (path, _) in FILES.iter().filter(|(path, _)| path.starts_with("campaigns/")) {
            let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path);
            Plan::new(Campaign::load(&path).unwrap()).unwrap().check().unwrap();
        }
    }
}
