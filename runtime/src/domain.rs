//! The domain: everything one run owns in shared memory, found by its namespace and wiped as a whole.
//!
//! ```text
//! /dev/shm/trefoil-<user>/        the user's folder, mode 0700; <user> is a number
//!     <namespace>/                a run's folder, locked (flock) by its launcher while the run lives
//!         launcher        process number of the launcher, as its own PID namespace has it
//!         scenario.toml   the merged settings          page       doorbells, roles, phase, faults given in flight
//!         control         the socket on which the launcher answers
//!         observer.<n>    locked (flock) by an observer of the run while it looks
//!         <node>.<epoch>.toml                          settings of a candidate
//!         iox/            iceoryx2's root, with all its segments
//! ```
//!
//! A run lives as long as its folder is locked. The kernel releases the lock when the launcher ends, for whatever
//! reason, and the lock is seen from every PID namespace and without `/proc`. A killed launcher wipes nothing; the
//! user's next launcher wipes every folder whose lock it gets.
//!
//! Every user can create any file in `/dev/shm`. So `/dev/shm` is never listed, and one folder in it is used, opened
//! without following links: the folder must be this user's, and no other user may enter it. If another file has its
//! name, the next of eight names is tried. No other user can do anything below the user's folder, whatever the modes
//! there.

mod shm;

use std::fs::{self, DirBuilder, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock, fstat};
use rustix::io::Errno;
use settings::file::MAX_TEXT_BYTES;
use settings::{Scenario, file};

pub use crate::error::DomainError;
use crate::error::SessionError;
use crate::limits::{NAMESPACE_PAUSE, NAMESPACE_TRIES};
pub use shm::{SHM, allocate, check_room};
use shm::{homes, make_home, open_folder};

/// Folder of a run in shared memory, as seen by any of its processes.
#[derive(Debug, Clone)]
pub struct Domain {
    /// Path of the folder.
    pub folder: PathBuf,
}

/// Hold of the launcher on a domain. While it lives the namespace is taken; dropping it wipes the domain.
#[derive(Debug)]
pub struct Hold {
    /// Domain that is held.
    pub domain: Domain,
    _lock: OwnedFd,
}

impl Domain {
    /// Finds the live domain of `namespace`.
    pub fn find(namespace: &str) -> Result<Self, DomainError> {
        check_name(namespace)?;
        let live = Self::all(namespace).find(Self::is_live);
        live.ok_or_else(|| DomainError::NotRunning(namespace.into()))
    }

    /// Reads the merged settings of the run.
    ///
    /// # Errors
    /// The settings cannot be read.
    pub fn scenario(&self) -> Result<Scenario, SessionError> {
        let file = self.file("scenario.toml");
        let text = file::read_text(&file, MAX_TEXT_BYTES);
        let text = text.map_err(|why| SessionError::Io { what: file.display().to_string(), why })?;
        Ok(settings::from_merged(&text, "the run's merged scenario")?)
    }

    /// Lists all domains of this user whose launcher is alive.
    pub fn list() -> Vec<Self> {
        homes().flat_map(|home| folders(&home)).filter(Self::is_live).collect()
    }

    /// Finds the folder of `namespace`, live or left behind by a killed launcher; `None` if there is none.
    pub fn left(namespace: &str) -> Option<Self> {
        Self::all(namespace).find(|domain| domain.folder.is_dir())
    }

    /// Iterates over the folders that a domain can have.
    fn all(namespace: &str) -> impl Iterator<Item = Self> {
        homes().map(move |home| Self { folder: home.join(namespace) })
    }

    /// Returns whether the launcher is alive, that is, whether the folder is locked.
    pub fn is_live(&self) -> bool {
        let locked = |folder| flock(folder, FlockOperation::NonBlockingLockShared) == Err(Errno::WOULDBLOCK);
        open_folder(&self.folder).is_ok_and(locked)
    }

    /// Name of the namespace.
    pub fn namespace(&self) -> &str {
        self.folder.file_name().and_then(|name| name.to_str()).unwrap_or_default()
    }

    /// Process number of the launcher; `None` if it cannot be read.
    pub fn launcher_pid(&self) -> Option<i32> {
        fs::read_to_string(self.file("launcher")).ok()?.parse().ok()
    }

    /// Lists the run's files in shared memory with their lengths \[bytes\], except iceoryx2's marks of nodes.
    pub fn files(&self) -> Vec<(PathBuf, u64)> {
        let folders = [self.folder.clone(), self.file("iox"), self.file("iox/services")];
        let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).into_iter().flatten().flatten());
        let length = |path: PathBuf| fs::metadata(&path).ok().filter(fs::Metadata::is_file).map(|m| (path, m.len()));
        entries.filter_map(|entry| length(entry.path())).collect()
    }

    /// Path of a file in the run's folder.
    pub fn file(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// Creates a file with the content `text` in the run's folder; an error if the file exists.
    pub fn write(&self, name: &str, text: &str) -> io::Result<PathBuf> {
        let path = self.file(name);
        let mut file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path)?;
        file.write_all(text.as_bytes())?;
        Ok(path)
    }
}

impl Hold {
    /// Takes `namespace` for this process, after wiping the folders of dead launchers.
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

    /// Tries once to take `namespace`; `None` if the folder exists, or was wiped before it could be locked.
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
            // Either the user's folder was empty and has just been removed, or another launcher was faster.
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

/// Lists the runs' folders in a user's folder.
fn folders(home: &Path) -> Vec<Domain> {
    let entries = fs::read_dir(home).into_iter().flatten().flatten();
    entries.map(|entry| Domain { folder: entry.path() }).filter(|domain| domain.folder.is_dir()).collect()
}

/// Wipes the folders of this user that no launcher has locked.
pub fn wipe_the_dead() {
    for Domain { folder } in homes().flat_map(|home| folders(&home)) {
        if let Ok(Some(_lock)) = lock(&folder) {
            remove(&folder);
        }
    }
}

/// Removes a run's folder, and the user's folder if it is then empty.
fn remove(folder: &Path) {
    // Errors are ignored: the folder may be gone already.
    let _ = fs::remove_dir_all(folder);
    let _ = folder.parent().map(fs::remove_dir);
}

/// Locks a run's folder; `None` if another launcher has locked it, or the folder is gone.
fn lock(folder: &Path) -> Result<Option<OwnedFd>, Errno> {
    let lock = match open_folder(folder) {
        Err(Errno::NOENT) => return Ok(None),
        opened => opened?,
    };
    match flock(&lock, FlockOperation::NonBlockingLockExclusive) {
        Err(Errno::WOULDBLOCK) => return Ok(None),
        locked => locked?,
    }
    // Another process may have removed the folder between open and lock; then the lock is worthless.
    let still_there = fs::symlink_metadata(folder)
        .is_ok_and(|now| fstat(&lock).is_ok_and(|locked| (locked.st_ino, locked.st_dev) == (now.ino(), now.dev())));
    Ok(still_there.then_some(lock))
}

/// Returns an error unless `namespace` consists of 1 to 40 letters, digits, `-` and `_`.
pub fn check_name(namespace: &str) -> Result<(), DomainError> {
    let fits = (1..=40).contains(&namespace.len())
        && namespace.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
    if fits { Ok(()) } else { Err(DomainError::BadName(namespace.into())) }
}

#[cfg(test)]
mod tests;
