//! `layout.toml`: of what the shards of a folder are.

use std::path::Path;

use anyhow::{Context, ensure};
use contract::scenario::file::{MAX_TEXT_BYTES, read_text};
use serde::{Deserialize, Serialize};

/// Version of the layout.
pub const LAYOUT_VERSION: u32 = 1;

/// `layout.toml`
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Layout {
    pub version: u32,
    /// What flies it.
    pub program: String,
    /// SHA-256 of the campaign.
    pub campaign: String,
    pub flights: u64,
    pub shards: u64,
}

impl Layout {
    /// The layout of a folder.
    pub fn read(folder: &Path) -> anyhow::Result<Self> {
        let path = folder.join("layout.toml");
        let said = || format!("{} cannot be read; give another folder with --out", path.display());
        let text = read_text(&path, MAX_TEXT_BYTES).with_context(said)?;
        let version = text.parse::<toml::Table>().ok().and_then(|table| table.get("version")?.as_integer());
        ensure!(
            version == Some(LAYOUT_VERSION.into()),
            "{} is of layout {}, and this program reads {LAYOUT_VERSION}; give another folder with --out",
            path.display(),
            version.map_or("unknown".into(), |version| version.to_string())
        );
        toml::from_str(&text).with_context(said)
    }
}
