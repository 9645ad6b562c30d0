//! The domain: everything one run owns in shared memory, found by its namespace and wiped as a whole.
//!
//! ```text
//! /dev/shm/trefoil.<namespace>.lock               held (flock) by the launcher while the run lives
//! /dev/shm/trefoil.<namespace>.<pid>.<start>/     this run's folder, mode 0700
//!     scenario.toml   the merged settings          board       bells, offices, phase, faults given while flying
//!     control         the socket on which the launcher answers
//!     <node>.<epoch>.toml                          settings of a newcomer
//!     iox/            iceoryx2's root              iceoryx2.toml   lets the iox2 tool and Python attach
//! /dev/shm/trefoil.<namespace>.<pid>.<start>.*    iceoryx2's segments, by prefix
//! ```
//!
//! All of it is its user's alone: folders 0700, files 0600. A folder of such a name that another user made is passed over.
//!
//! `<pid>` and `<start>` (the kernel's start time) name the launcher's process beyond reuse of the number. A launcher
//! that was killed wipes nothing; the next one, of any namespace, wipes what dead launchers left.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, OpenOptionsExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

const SHM: &str = "/dev/shm";
const MARK: &str = "trefoil.";

/// Why a domain cannot be had.
#[derive(Debug, thiserror::Error)]
pub enum DomainError {
    /// Another launcher holds the namespace.
    #[error(
        "namespace '{0}' is in use by another stack; stop it with `launcher stop --namespace {0}` or fly under another --namespace"
    )]
    InUse(String),
    /// Nobody flies there.
    #[error("no stack runs in namespace '{0}'; `launcher status` lists those that do")]
    NotRunning(String),
    /// Somebody else flies there.
    #[error(
        "the stack in namespace '{0}' is another user's, and a stack is for its own user only; fly under another --namespace"
    )]
    NotYours(String),
    /// A name that cannot stand in a file name.
    #[error("'{0}' cannot be a namespace: use 1 to 40 letters, digits, '-' or '_'")]
    BadName(String),
    /// Shared memory refused.
    #[error("shared memory at {path}: {source}")]
    Io {
        /// Where.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

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
    lock: PathBuf,
    _lock_file: File,
}

impl Domain {
    /// The live domain of `namespace`.
    pub fn find(namespace: &str) -> Result<Self, DomainError> {
        check_name(namespace)?;
        let named = Self::of_anybody().into_iter().filter(|domain| domain.namespace() == namespace);
        let (own, others): (Vec<_>, Vec<_>) = named.partition(Self::is_own);
        let none = if others.is_empty() { DomainError::NotRunning } else { DomainError::NotYours };
        own.into_iter().next().ok_or_else(|| none(namespace.into()))
    }

    /// All domains of this user whose launcher is alive.
    pub fn list() -> Vec<Self> {
        Self::of_anybody().into_iter().filter(Self::is_own).collect()
    }

    fn of_anybody() -> Vec<Self> {
        let folders = entries().into_iter().filter(|path| path.is_dir());
        folders.filter(|path| Owner::of(path).is_some_and(|o| o.alive())).map(|folder| Self { folder }).collect()
    }

    /// Whether this user made it: anybody can make a folder of such a name.
    fn is_own(&self) -> bool {
        fs::symlink_metadata(&self.folder).is_ok_and(|m| m.uid() == rustix::process::geteuid().as_raw())
    }

    /// The namespace.
    pub fn namespace(&self) -> &str {
        Owner::of(&self.folder).map_or("", |o| o.namespace)
    }

    /// Process number of the launcher.
    pub fn launcher_pid(&self) -> Option<i32> {
        Owner::of(&self.folder).and_then(|o| o.pid.parse().ok())
    }

    /// Prefix of this run's segments in `/dev/shm`.
    pub fn prefix(&self) -> String {
        format!("{}.", file_name(&self.folder))
    }

    /// Every file that the run has in shared memory now, and its length \[bytes\]; of iceoryx2's root only the services.
    pub fn files(&self) -> Vec<(PathBuf, u64)> {
        let prefix = self.prefix();
        let segments = entries().into_iter().filter(|path| file_name(path).starts_with(&prefix));
        let own = [self.folder.clone(), self.file("iox/services")];
        let own = own.iter().flat_map(|folder| fs::read_dir(folder).into_iter().flatten().flatten()).map(|e| e.path());
        let length = |path: PathBuf| fs::metadata(&path).ok().filter(fs::Metadata::is_file).map(|m| (path, m.len()));
        segments.chain(own).filter_map(length).collect()
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
        sweep();
        let lock = Path::new(SHM).join(format!("{MARK}{namespace}.lock"));
        let lock_file = loop {
            let file = open_lock(&lock).map_err(|source| DomainError::Io { path: lock.clone(), source })?;
            match lock_patiently(&file) {
                Ok(()) => {}
                Err(Errno::WOULDBLOCK) => return Err(DomainError::InUse(namespace.into())),
                Err(error) => return Err(DomainError::Io { path: lock, source: error.into() }),
            }
            // Somebody may have unlinked the file between open and lock: then this lock locks nothing.
            if same_file(&file, &lock) {
                break file;
            }
        };
        let pid = std::process::id().to_string();
        let start = start_time(&pid).unwrap_or_default();
        let folder = Path::new(SHM).join(format!("{MARK}{namespace}.{pid}.{start}"));
        let made = fs::DirBuilder::new().mode(0o700).create(&folder);
        made.map_err(|source| DomainError::Io { path: folder.clone(), source })?;
        Ok(Self { domain: Domain { folder }, lock, _lock_file: lock_file })
    }

    /// Takes from other users what they may do with the files that are there: iceoryx2 makes one that anybody can write.
    pub fn tighten(&self) -> Result<(), DomainError> {
        self.domain.files().into_iter().try_for_each(|(path, _)| {
            let mode = fs::metadata(&path).map(|m| m.mode() & 0o700);
            let done = mode.and_then(|mode| fs::set_permissions(&path, fs::Permissions::from_mode(mode)));
            done.map_err(|source| DomainError::Io { path, source })
        })
    }
}

impl Drop for Hold {
    fn drop(&mut self) {
        for path in entries() {
            if file_name(&path).starts_with(&self.domain.prefix()) {
                remove(&path);
            }
        }
        remove(&self.lock);
        // Last, because `stop` takes its absence for the end.
        remove(&self.domain.folder);
    }
}

/// Wipes what launchers that are no more have left in shared memory.
pub fn sweep() {
    for path in entries() {
        match Owner::of(&path) {
            Some(owner) if !owner.alive() => remove(&path),
            // A lock file that nobody holds: unlinked while held, so that nobody can lock it in between.
            None if path.extension().is_some_and(|e| e == "lock") => {
                if let Ok(file) = File::open(&path)
                    && flock(&file, FlockOperation::NonBlockingLockExclusive).is_ok()
                    && same_file(&file, &path)
                {
                    remove(&path);
                }
            }
            _ => {}
        }
    }
}

/// Who made an entry, read from its name.
struct Owner<'a> {
    namespace: &'a str,
    pid: &'a str,
    start: &'a str,
}

impl<'a> Owner<'a> {
    fn of(path: &'a Path) -> Option<Self> {
        let mut parts = path.file_name()?.to_str()?.strip_prefix(MARK)?.split('.');
        let (namespace, pid, start) = (parts.next()?, parts.next()?, parts.next()?);
        pid.parse::<u32>().ok()?;
        Some(Self { namespace, pid, start })
    }

    fn alive(&self) -> bool {
        start_time(self.pid).as_deref() == Some(self.start)
    }
}

/// Start time of a process in clock ticks since boot: field 22 of `/proc/<pid>/stat`. A zombie counts as dead.
fn start_time(pid: &str) -> Option<String> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // The name in field 2 may hold blanks; fields are counted after its closing bracket.
    let mut fields = stat.rsplit_once(')')?.1.split_whitespace();
    let state = fields.next()?;
    if state == "Z" || state == "X" { None } else { fields.nth(18).map(Into::into) }
}

fn entries() -> Vec<PathBuf> {
    let Ok(all) = fs::read_dir(SHM) else { return vec![] };
    all.flatten().map(|e| e.path()).filter(|p| file_name(p).starts_with(MARK)).collect()
}

fn remove(path: &Path) {
    // What is gone already, or is another user's, is left as it is.
    let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
}

fn open_lock(path: &Path) -> io::Result<File> {
    OpenOptions::new().read(true).write(true).create(true).truncate(false).mode(0o600).open(path)
}

/// Locks, or waits a moment for somebody who only looked whether the lock is held ([`sweep`]).
fn lock_patiently(file: &File) -> Result<(), Errno> {
    let mut tries = 0;
    loop {
        match flock(file, FlockOperation::NonBlockingLockExclusive) {
            Err(Errno::WOULDBLOCK) if tries < 20 => std::thread::sleep(Duration::from_millis(5)),
            result => return result,
        }
        tries += 1;
    }
}

fn same_file(file: &File, path: &Path) -> bool {
    matches!((file.metadata(), fs::metadata(path)), (Ok(a), Ok(b)) if a.ino() == b.ino() && a.dev() == b.dev())
}

fn file_name(path: &Path) -> String {
    path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default()
}

fn check_name(namespace: &str) -> Result<(), DomainError> {
    let fits = (1..=40).contains(&namespace.len())
        && namespace.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'-' || b == b'_');
    if fits { Ok(()) } else { Err(DomainError::BadName(namespace.into())) }
}
