//! The folder of a campaign.
//!
//! ```text
//! runs/NAME/
//!     campaign.toml     the campaign with its scenario, which flies it by itself
//!     layout.toml       by what program, how many flights in how many shards
//!     shards/NNNNN.parquet    a shard, whole
//!     flights.parquet   all of them together, written when none is missing
//!     campaign.html     the page
//!     flight-N/         a flight that was flown again
//!     slurm/            what was submitted, and what the tasks said
//!     lock              held while a campaign flies: alone by `launcher campaign`, together by shards
//! ```

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions};
use std::io::{ErrorKind, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use crate::layout::{LAYOUT_VERSION, Layout};
use crate::plan::Plan;
use crate::shard;
use crate::table::Table;

/// Flights of a shard where the number is not said: so many are lost at most when a machine dies.
const SHARD: u64 = 100;
/// Shards where the number is not said: as many tasks an array of Slurm may have, and one more.
const USUAL_SHARDS: u64 = 1000;
/// The most shards of a campaign.
pub const MAX_SHARDS: u64 = 99_999;

/// Who else may write to the folder.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    Alone,
    WithShards,
    /// Nothing is written that another writes too.
    Reading,
}

#[derive(Debug)]
pub struct CampaignFolder {
    pub path: PathBuf,
    pub layout: Layout,
    /// Locked as long as this is open.
    _hold: Option<File>,
}

impl CampaignFolder {
    /// Opens the folder of a plan, or makes it. `shards` says how many there are to be.
    ///
    /// # Errors
    /// A folder of another campaign, program or layout, or one that another campaign flies into.
    pub fn open(path: &Path, plan: &Plan, shards: Option<u64>, access: Access) -> anyhow::Result<Self> {
        let cannot = || format!("cannot use the folder {}", path.display());
        let wanted = Layout {
            version: LAYOUT_VERSION,
            program: shard::program(),
            campaign: plan.campaign.hash(),
            flights: plan.flights(),
            shards: shards
                .unwrap_or(plan.flights().div_ceil(SHARD).min(USUAL_SHARDS))
                .clamp(1, plan.flights().min(MAX_SHARDS)),
        };
        let hold = prepare(path, access).with_context(cannot)?;
        if !Self::is_there(path) {
            put(&path.join("campaign.toml"), &plan.campaign.merged()).with_context(cannot)?;
            put(&path.join("layout.toml"), &toml::to_string(&wanted)?).with_context(cannot)?;
        }
        let layout = Layout::read(path)?;
        let elsewhere = "give this one another folder with --out, or remove the old one";
        let other = |what: &str| format!("the folder {} holds {what}; {elsewhere}", path.display());
        let changed = "another campaign, or this one by another name or before it was changed: see its campaign.toml";
        ensure!(layout.campaign == wanted.campaign, other(changed));
        let by = format!("flights of another program ({}; this is {})", layout.program, wanted.program);
        ensure!(layout.program == wanted.program, other(&by));
        let divided = format!("this campaign in {} shards, not {}", layout.shards, wanted.shards);
        ensure!(shards.is_none() || layout.shards == wanted.shards, other(&divided));
        Ok(Self { path: path.into(), layout, _hold: hold })
    }

    /// Whether a campaign was begun in the folder `path`.
    pub fn is_there(path: &Path) -> bool {
        path.join("layout.toml").exists()
    }

    pub fn shard(&self, index: u64) -> PathBuf {
        self.path.join("shards").join(format!("{index:05}.parquet"))
    }

    /// The shards that are not there. The folder is read anew, because a network file system remembers which files were not
    /// there.
    pub fn missing(&self) -> Vec<u64> {
        let entries = fs::read_dir(self.path.join("shards")).into_iter().flatten().flatten();
        let there: HashSet<OsString> = entries.map(|entry| entry.file_name()).collect();
        let is_there = |index: u64| self.shard(index).file_name().is_some_and(|name| there.contains(name));
        (0..self.layout.shards).filter(|index| !is_there(*index)).collect()
    }

    /// The shard that has a flight, if it is there, and its row there.
    ///
    /// # Errors
    /// It is there and cannot be counted.
    pub fn shard_with(&self, plan: &Plan, flight: u64) -> anyhow::Result<Option<(Table, usize)>> {
        let range = |index| shard::range(self.layout.flights, index, self.layout.shards);
        let index = (0..self.layout.shards).find(|index| range(*index).contains(&flight));
        let Some(index) = index.filter(|index| shard::is_there(&self.shard(*index))) else { return Ok(None) };
        let table = shard::read(&self.shard(index), plan, &self.layout, index)?;
        Ok(Some((table, (flight - range(index).start) as usize)))
    }

    /// All flights of the shards that are there, in order; which shards are missing.
    ///
    /// # Errors
    /// A shard that is there and cannot be counted.
    pub fn collect(&self, plan: &Plan) -> anyhow::Result<(Table, Vec<u64>)> {
        let missing = self.missing();
        let mut all = Table::new(&shard::columns(plan));
        for index in (0..self.layout.shards).filter(|index| !missing.contains(index)) {
            all.append(shard::read(&self.shard(index), plan, &self.layout, index)?)?;
        }
        Ok((all, missing))
    }
}

/// Makes the folder, and locks it as far as `access` wants.
fn prepare(path: &Path, access: Access) -> anyhow::Result<Option<File>> {
    if access == Access::Reading {
        ensure!(CampaignFolder::is_there(path), "there is no campaign in it");
        return Ok(None);
    }
    let is_ours = CampaignFolder::is_there(path) || path.join("lock").exists();
    let is_flight = |entry: fs::DirEntry| entry.file_name().to_string_lossy().starts_with("flight-");
    let has_flights_only = fs::read_dir(path).map_or(true, |entries| entries.flatten().all(is_flight));
    ensure!(is_ours || has_flights_only, "it has something else in it; give another with --out");
    fs::create_dir_all(path.join("shards"))?;
    let lock = OpenOptions::new().create(true).truncate(false).write(true).open(path.join("lock"))?;
    let how = match access {
        Access::Alone => FlockOperation::NonBlockingLockExclusive,
        _ => FlockOperation::NonBlockingLockShared,
    };
    // A file system without locks is taken as it is: a shard is renamed into its place, and is the same whatever process flew it.
    if flock(&lock, how) == Err(Errno::WOULDBLOCK) {
        bail!("another campaign is flying into it; wait for it, or give another with --out");
    }
    if access == Access::Alone {
        // What was being written when an earlier one was killed.
        for entry in fs::read_dir(path.join("shards"))?.flatten() {
            let is_part = entry.path().extension().is_some_and(|extension| extension == "part");
            let _ = if is_part { fs::remove_file(entry.path()) } else { Ok(()) }; // it does no harm
        }
    }
    Ok(Some(lock))
}

/// Writes a file whole, if it is not there: of two that do, one has written it.
fn put(path: &Path, text: &str) -> anyhow::Result<()> {
    let folder = path.parent().context("a file in a folder")?;
    let mut part = tempfile::Builder::new();
    let part = part.prefix(".").suffix(".part").permissions(fs::Permissions::from_mode(0o666));
    let mut part = part.tempfile_in(folder)?;
    part.write_all(text.as_bytes())?;
    part.as_file().sync_all()?;
    match part.persist_noclobber(path) {
        Err(failed) if failed.error.kind() != ErrorKind::AlreadyExists => Err(failed.error.into()),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Campaign;

    fn plan(text: &str) -> Plan {
        Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap()
    }

    #[test]
    fn a_folder_is_of_one_campaign_and_one_layout() {
        let top = tempfile::tempdir().unwrap();
        let path = top.path().join("a/b");
        let ours = plan("seeds = 10");
        let open = |plan: &Plan, shards, access| CampaignFolder::open(&path, plan, shards, access);
        let said = |plan: &Plan, shards| format!("{:#}", open(plan, shards, Access::Alone).unwrap_err());
        assert!(open(&ours, None, Access::Reading).is_err() && !path.exists(), "nothing is made by looking");
        let folder = open(&ours, Some(4), Access::Alone).unwrap();
        assert_eq!((folder.layout.shards, folder.missing()), (4, vec![0, 1, 2, 3]));
        assert!(said(&ours, None).contains("another campaign is flying"), "it is held");
        drop(folder);
        let [one, two] =
            [open(&ours, None, Access::WithShards).unwrap(), open(&ours, None, Access::WithShards).unwrap()];
        assert_eq!(one.layout, two.layout);
        drop((one, two));
        assert!(said(&plan("seeds = 11"), None).contains("another campaign, or this one by another name"));
        assert!(said(&ours, Some(5)).contains("in 4 shards, not 5"));
        let merged = Campaign::load(&path.join("campaign.toml")).unwrap();
        assert_eq!(merged.hash(), ours.campaign.hash(), "the folder's own file flies the same");

        let layout = fs::read_to_string(path.join("layout.toml")).unwrap();
        fs::write(path.join("layout.toml"), layout.replace("program = \"", "program = \"0.0 ")).unwrap();
        assert!(said(&ours, None).contains("another program"), "{}", said(&ours, None));
        fs::write(path.join("layout.toml"), layout.replace("version = 1", "version = 9")).unwrap();
        assert!(said(&ours, None).contains("layout 9"));
    }

    #[test]
    fn a_folder_of_something_else_is_left_alone() {
        let top = tempfile::tempdir().unwrap();
        fs::write(top.path().join("thesis.tex"), "").unwrap();
        let refused = CampaignFolder::open(top.path(), &plan(""), None, Access::Alone).unwrap_err();
        assert!(format!("{refused:#}").contains("something else in it"));
        assert_eq!(fs::read_dir(top.path()).unwrap().count(), 1);
    }
}
