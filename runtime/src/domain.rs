//! The domain: everything one run owns in shared memory, found by its namespace and wiped as a whole.
//!
//! ```text
//! /dev/shm/trefoil-<user>/        the user's folder, mode 0700; <user> is a number
//!     <namespace>/                a run's folder, locked (flock) by its launcher while the run lives
//!         launcher        process number of the launcher, as its own PID namespace has it
//!         scenario.toml   the merged settings          page       doorbells, roles, phase, faults given while flying
//!         control         the socket on which the launcher answers
//!         <node>.<epoch>.toml                          settings of a candidate
//!         iox/            iceoryx2's root, with all its segments
//! ```
//!
//! A run lives as long as its folder is locked. The kernel takes the lock from a launcher that ends, however it ends, and
//! the lock is seen from every PID namespace and without `/proc`. A launcher that was killed wipes nothing; the user's
//! next one wipes every folder whose lock it gets.
//!
//! In `/dev/shm` anybody can put anything under any name. So it is never listed, and one folder of it is used, opened without
//! following links: one that is this user's and that no other user may enter. A name under which something else stands is
//! passed over for the next of eight. No other user can do anything below the user's folder, whatever the modes there.

mod shm;

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock, fstat};
use rustix::io::Errno;

pub use crate::error::DomainError;
use crate::limits::{NAMESPACE_PAUSE, NAMESPACE_TRIES};
pub use shm::{allocate, check_room};
use shm::{homes, make_home, open_folder};

/// A run's place in shared memory, as seen by any of its processes.
#[derive(Debug, Clone)]
pub struct Domain {
    /// The folder.
    pub folder: PathBuf,
}

/// The launcher's hold on a domain: while it lives the namespace is taken; when it drops everything is wiped.
#[derive(Debug)]
pub struct Hold {
    /// What is held.
    pub domain: Domain,
    _lock: OwnedFd,
}

impl Domain {
    /// The live domain of `namespace`.
    pub fn find(namespace: &str) -> Result<Self, DomainError> {
        check_name(namespace)?;
        let live = Self::all(namespace).find(Self::is_live);
        live.ok_or_else(|| DomainError::NotRunning(namespace.into()))
    }

    /// All domains of this user whose launcher is alive.
    pub fn list() -> Vec<Self> {
        homes().flat_map(|home| folders(&home)).filter(Self::is_live).collect()
    }

    /// What there is of `namespace`, whether it lives or was left by a launcher that was killed.
    pub fn left(namespace: &str) -> Option<Self> {
        Self::all(namespace).find(|domain| domain.folder.is_dir())
    }

    /// Where it can be.
    fn all(namespace: &str) -> impl Iterator<Item = Self> {
        homes().map(move |home| Self { folder: home.join(namespace) })
    }

    /// Whether its launcher is alive, which has it locked.
    pub fn is_live(&self) -> bool {
        let locked = |folder| flock(folder, FlockOperation::NonBlockingLockShared) == Err(Errno::WOULDBLOCK);
        open_folder(&self.folder).is_ok_and(locked)
    }

    /// The namespace.
    pub fn namespace(&self) -> &str {
        self.folder.file_name().and_then(|name| name.to_str()).unwrap_or_default()
    }

    /// Process number of the launcher.
    pub fn launcher_pid(&self) -> Option<i32> {
        fs::read_to_string(self.file("launcher")).ok()?.parse().ok()
    }

    /// Every file that the run has in shared memory now, and its length \[bytes\]; of iceoryx2's root not the nodes' marks.
    pub fn files(&self) -> Vec<(PathBuf, u64)> {
        let folders = [self.folder.clone(), self.file("iox"), self.file("iox/services")];
        let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).into_iter().flatten().flatten());
        let length = |path: PathBuf| fs::metadata(&path).ok().filter(fs::Metadata::is_file).map(|m| (path, m.len()));
        entries.filter_map(|entry| length(entry.path())).collect()
    }

    /// A file of the run's folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Makes a new file of the run's folder that says `text`.
    pub fn write(&self, name: &str, text: &str) -> io::Result<PathBuf> {
        let path = self.file(name);
        let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path)?;
        file.write_all(text.as_bytes())?;
        Ok(path)
    }
}

impl Hold {
    /// Takes `namespace` for this process, after wiping what dead launchers left.
    pub fn take(namespace: &str) -> Result<Self, DomainError> {
        check_name(namespace)?;
        for _ in 0..NAMESPACE_TRIES {
            if let Some(hold) = Self::try_to_take(namespace)? {
                return Ok(hold);
            }
            std::thread::sleep(NAMESPACE_PAUSE);
        }
        Err(DomainError::InUse(namespace.into()))
    }

    /// Nothing when the folder is locked, or was wiped before it could be locked.
    fn try_to_take(namespace: &str) -> Result<Option<Self>, DomainError> {
        let home = make_home()?;
        wipe_the_dead();
        if Domain::left(namespace).is_some() {
            return Ok(None);
        }
        let folder = home.join(namespace);
        let domain = Domain { folder: folder.clone() };
        let failed = |source| DomainError::Io { path: folder.clone(), source };
        match DirBuilder::new().mode(0o700).create(&folder) {
            Ok(()) => {}
            // The user's folder was empty and has just been removed; or another launcher was quicker.
            Err(error) if [ErrorKind::NotFound, ErrorKind::AlreadyExists].contains(&error.kind()) => return Ok(None),
            Err(error) => return Err(failed(error)),
        }
        let Some(lock) = lock(&folder).map_err(|error| failed(error.into()))? else { return Ok(None) };
        domain.write("launcher", &std::process::id().to_string()).map_err(failed)?;
        Ok(Some(Self { domain, _lock: lock }))
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        remove(&self.domain.folder);
    }
}

/// Runs' folders in a user's folder.
fn folders(home: &Path) -> Vec<Domain> {
    let entries = fs::read_dir(home).into_iter().flatten().flatten();
    entries.map(|entry| Domain { folder: entry.path() }).filter(|domain| domain.folder.is_dir()).collect()
}

/// Wipes the folders of this user that no launcher has locked.
fn wipe_the_dead() {
    for Domain { folder } in homes().flat_map(|home| folders(&home)) {
        if let Ok(Some(_lock)) = lock(&folder) {
            remove(&folder);
        }
    }
}

/// Removes a run's folder, and the user's when it was the last in it.
fn remove(folder: &Path) {
    // What is gone already is as it should be.
    let _ = fs::remove_dir_all(folder);
    let _ = folder.parent().map(fs::remove_dir);
}

/// Locks a run's folder; nothing when another launcher has, or the folder is gone.
fn lock(folder: &Path) -> Result<Option<OwnedFd>, Errno> {
    let lock = match open_folder(folder) {
        Err(Errno::NOENT) => return Ok(None),
        opened => opened?,
    };
    match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        Err(Errno::WOULDBLOCK) => return Ok(None),
        locked => locked?,
    }
    // Another process may have removed it between open and lock: then this lock locks nothing.
    let still_there = fs::symlink_metadata(folder)
        .is_ok_and(|now| fstat(&lock).is_ok_and(|locked| (locked.st_ino, locked.st_dev) == (now.ino(), now.dev())));
    Ok(still_there.then_some(lock))
}

fn check_name(namespace: &str) -> Result<(), DomainError> {
    let fits = (1..=40).contains(&namespace.len())
        && namespace.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
    if fits { Ok(()) } else { Err(DomainError::BadName(namespace.into())) }
}

#[cfg(test)]
mod tests;
