//! Folder of a campaign.
//!
//! ```text
//! runs/NAME/
//!     campaign.toml     the campaign with its scenario merged in, enough to fly it again
//!     layout.toml       the program, the campaign's hash, the numbers of flights and shards
//!     shards/NNNNN.parquet    a shard, complete
//!     flights.parquet   all shards together, written when none is missing
//!     campaign.html     the page
//!     flight-N/         a flight that was flown again
//!     slurm/            the submitted script, and the logs of the tasks
//!     lock              held while a campaign flies: exclusive by a local campaign, shared by the tasks of a cluster
//! ```

use std::collections::HashSet;
use std::ffi::OsString;
use std::fs::File;
use std::path::Path;

use anyhow::{Context, ensure};
use folder::dir::Dir;
use rustix::fs::FlockOperation;

use crate::layout::{CampaignLayout, LAYOUT, LAYOUT_VERSION, MAX_SHARDS};
use crate::plan::Plan;
use crate::shard;
use crate::table::FlightTable;

/// Default number of flights of a shard: the most that a killed task loses.
const SHARD: u64 = 100;
/// Largest default number of shards; Slurm's default allows array indices 0 to 1000, which are 1001 tasks.
const USUAL_SHARDS: u64 = 1000;
/// Name of the folder of the shards.
const SHARDS: &str = "shards";

/// Access to the folder: exclusive, shared with the tasks of other shards, or reading without a lock.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FolderAccess {
    Alone,
    WithShards,
    Reading,
}

#[derive(Debug)]
pub struct CampaignFolder {
    pub dir: Dir,
    pub layout: CampaignLayout,
    shards: Dir,
    /// Open lock file; the lock is held as long as it is open.
    _hold: Option<File>,
}

impl CampaignFolder {
    /// Opens the folder of a plan, or creates it with `shards` shards; `None` takes the default number.
    ///
    /// # Errors
    /// The folder belongs to another campaign, program or layout, or another process flies a campaign into it.
    pub fn open(path: &Path, plan: &Plan, shards: Option<u64>, access: FolderAccess) -> anyhow::Result<Self> {
        let cannot = || format!("cannot use the folder {}", path.display());
        let wanted = CampaignLayout {
            version: LAYOUT_VERSION,
            program: shard::program().to_owned(),
            campaign: plan.campaign.hash(),
            flights: plan.flights(),
            shards: shards
                .unwrap_or(plan.flights().div_ceil(SHARD).min(USUAL_SHARDS))
                .clamp(1, plan.flights().min(MAX_SHARDS)),
        };
        let (dir, hold) = prepare(path, access).with_context(cannot)?;
        let cannot_shards = || format!("cannot use the folder {}", dir.at(SHARDS).display());
        let of_shards = if access == FolderAccess::Reading { dir.folder(SHARDS) } else { dir.make_folder(SHARDS) };
        let of_shards = of_shards.with_context(cannot_shards)?;
        if access == FolderAccess::Alone {
            remove_parts(&of_shards).with_context(cannot_shards)?;
        }
        if !dir.has(LAYOUT) {
            dir.write_new("campaign.toml", plan.campaign.merged().as_bytes())?;
            dir.write_new(LAYOUT, toml::to_string(&wanted)?.as_bytes())?;
        }
        let layout = CampaignLayout::read(&dir)?;
        let elsewhere = "give this one another folder with --out, or remove the old one";
        let other = |what: &str| format!("the folder {} holds {what}; {elsewhere}", path.display());
        let changed = "another campaign, or an earlier or renamed version of this one: see its campaign.toml";
        ensure!(layout.campaign == wanted.campaign && layout.flights == wanted.flights, other(changed));
        let by = format!("flights of another program ({}; this is {})", layout.program, wanted.program);
        ensure!(layout.program == wanted.program, other(&by));
        let divided = format!("this campaign in {} shards, not {}", layout.shards, wanted.shards);
        ensure!(shards.is_none() || layout.shards == wanted.shards, other(&divided));
        Ok(Self { dir, layout, shards: of_shards, _hold: hold })
    }

    /// Returns whether a campaign was begun in the folder `path`.
    pub fn is_there(path: &Path) -> bool {
        Dir::open(path).is_ok_and(|dir| dir.has(LAYOUT))
    }

    /// Lists the missing shards.
    ///
    /// # Errors
    /// The folder of the shards cannot be read.
    pub fn missing(&self) -> anyhow::Result<Vec<u64>> {
        let names = self.shards.names();
        let names = names.with_context(|| format!("cannot read the folder {}", self.dir.at(SHARDS).display()))?;
        let there: HashSet<OsString> = names.into_iter().collect();
        Ok((0..self.layout.shards).filter(|index| !there.contains(&OsString::from(shard::name(*index)))).collect())
    }

    /// Writes the rows of a shard, completely or not at all.
    pub fn write(&self, index: u64, rows: &FlightTable) -> anyhow::Result<()> {
        shard::write(&self.shards, &self.layout, index, rows)
    }

    /// Reads the rows of a shard; `None` if it is not there.
    ///
    /// # Errors
    /// The shard is there but damaged, or belongs to another plan.
    pub fn read(&self, plan: &Plan, index: u64) -> anyhow::Result<Option<FlightTable>> {
        let is_there = self.shards.has(&shard::name(index));
        is_there.then(|| shard::read(&self.shards, plan, &self.layout, index)).transpose()
    }

    /// Reads the shard with the flight `flight`, and returns it with the flight's row in it; `None` if the shard is
    /// missing.
    ///
    /// # Errors
    /// The shard is there but damaged, or belongs to another plan.
    pub fn shard_with(&self, plan: &Plan, flight: u64) -> anyhow::Result<Option<(FlightTable, usize)>> {
        let range = |index| shard::range(self.layout.flights, index, self.layout.shards);
        let Some(index) = (0..self.layout.shards).find(|index| range(*index).contains(&flight)) else {
            return Ok(None);
        };
        Ok(self.read(plan, index)?.map(|table| (table, (flight - range(index).start) as usize)))
    }

    /// Reads all flights of the shards that are there, in order; also returns the missing shards.
    ///
    /// # Errors
    /// A shard is there but damaged, or belongs to another plan.
    pub fn collect(&self, plan: &Plan) -> anyhow::Result<(FlightTable, Vec<u64>)> {
        let missing = self.missing()?;
        let is_missing: HashSet<&u64> = missing.iter().collect();
        let mut all = FlightTable::new(&shard::columns_of(plan));
        for index in (0..self.layout.shards).filter(|index| !is_missing.contains(index)) {
            all.append(shard::read(&self.shards, plan, &self.layout, index)?)?;
        }
        Ok((all, missing))
    }
}

/// Opens the folder, or creates it unless it is only read, and takes the lock that `access` needs.
fn prepare(path: &Path, access: FolderAccess) -> anyhow::Result<(Dir, Option<File>)> {
    if access == FolderAccess::Reading {
        let dir = Dir::open(path).ok().filter(|dir| dir.has(LAYOUT)).context("there is no campaign in it")?;
        return Ok((dir, None));
    }
    let dir = Dir::make(path)?;
    let is_ours = dir.has(LAYOUT) || dir.has("lock");
    let is_flight = |name: &OsString| name.to_string_lossy().starts_with("flight-");
    ensure!(is_ours || dir.names()?.iter().all(is_flight), "it has something else in it; give another with --out");
    let how = match access {
        FolderAccess::Alone => FlockOperation::NonBlockingLockExclusive,
        _ => FlockOperation::NonBlockingLockShared,
    };
    // A file system without locks does no harm: a shard is renamed into place, and is equal whatever process flew it.
    let lock = dir.lock("lock", how).with_context(|| format!("cannot lock {}", dir.at("lock").display()))?;
    let lock = lock.context("another campaign is flying into it; wait for it, or give another with --out")?;
    Ok((dir, Some(lock)))
}

/// Removes unfinished shards that a killed campaign left.
fn remove_parts(shards: &Dir) -> anyhow::Result<()> {
    let names = shards.names()?;
    for name in names.iter().filter(|name| Path::new(name).extension().is_some_and(|extension| extension == "part")) {
        let _ = shards.remove(name); // a file that stays does no harm
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::Campaign;

    fn plan(text: &str) -> Plan {
        Plan::new(Campaign::read(text, "x.toml", "x", Path::new("")).unwrap()).unwrap()
    }

    #[test]
    fn a_folder_accepts_one_campaign_and_one_layout_only() {
        let top = tempfile::tempdir().unwrap();
        let path = top.path().join("a/b");
        let ours = plan("seeds = 10");
        let open = |plan: &Plan, shards, access| CampaignFolder::open(&path, plan, shards, access);
        let said = |plan: &Plan, shards| format!("{:#}", open(plan, shards, FolderAccess::Alone).unwrap_err());
        assert!(open(&ours, None, FolderAccess::Reading).is_err() && !path.exists(), "nothing is made by looking");
        let folder = open(&ours, Some(4), FolderAccess::Alone).unwrap();
        assert_eq!((folder.layout.shards, folder.missing().unwrap()), (4, vec![0, 1, 2, 3]));
        assert!(said(&ours, None).contains("another campaign is flying"), "it is held");
        drop(folder);
        let [one, two] = [
            open(&ours, None, FolderAccess::WithShards).unwrap(),
            open(&ours, None, FolderAccess::WithShards).unwrap(),
        ];
        assert_eq!(one.layout, two.layout);
        drop((one, two));
        assert!(
            said(&plan("seeds = 11"), None).contains("another campaign, or an earlier or renamed version of this one")
        );
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
        let refused = CampaignFolder::open(top.path(), &plan(""), None, FolderAccess::Alone).unwrap_err();
        assert!(format!("{refused:#}").contains("something else in it"));
        assert_eq!(fs::read_dir(top.path()).unwrap().count(), 1);
    }
}
