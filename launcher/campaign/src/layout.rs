//! `layout.toml`: the program, campaign and number of shards that a folder belongs to.

use anyhow::{Context, ensure};
use folder::dir::Dir;
use serde::{Deserialize, Serialize};
use settings::file::MAX_TEXT_BYTES;

/// Name of the file.
pub const LAYOUT: &str = "layout.toml";
/// Largest number of shards of a campaign.
pub const MAX_SHARDS: u64 = 99_999;
/// Version that this program reads and writes.
pub const LAYOUT_VERSION: u32 = 1;

/// Contents of `layout.toml`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CampaignLayout {
    pub version: u32,
    /// Program that flies the shards, from [`program`](crate::shard::program).
    pub program: String,
    /// SHA-256 of the campaign.
    pub campaign: String,
    pub flights: u64,
    pub shards: u64,
}

impl CampaignLayout {
    /// Reads the layout of a folder.
    ///
    /// # Errors
    /// The file cannot be read, has another version, or has numbers that no campaign has.
    pub fn read(folder: &Dir) -> anyhow::Result<Self> {
        let path = folder.at(LAYOUT);
        let said = || format!("{} cannot be read; give another folder with --out", path.display());
        let text = folder.read_text(LAYOUT, MAX_TEXT_BYTES).with_context(said)?;
        let version = text.parse::<toml::Table>().ok().and_then(|table| table.get("version")?.as_integer());
        ensure!(
            version == Some(LAYOUT_VERSION.into()),
            "{} is of layout {}, and this program reads {LAYOUT_VERSION}; give another folder with --out",
            path.display(),
            version.map_or("unknown".into(), |version| version.to_string())
        );
        let layout: Self = toml::from_str(&text).with_context(said)?;
        let Self { flights, shards, .. } = layout;
        ensure!(
            (1..=flights.min(MAX_SHARDS)).contains(&shards),
            "{} is damaged: {shards} shards of {flights} flights, and there are 1 to {MAX_SHARDS} of at least one flight each; \
             give another folder with --out",
            path.display()
        );
        Ok(layout)
    }
}
