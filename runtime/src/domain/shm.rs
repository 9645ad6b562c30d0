//! Shared memory of the system: `/dev/shm`, the user's folder in it, and the free space.

use std::fs::{self, DirBuilder, File};
use std::io::{self, ErrorKind};
use std::os::fd::OwnedFd;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{FallocateFlags, Mode, OFlags, StatVfs, fallocate, fstat, open, statvfs};
use rustix::io::Errno;

use crate::error::DomainError;
use crate::limits::{FILES_NEEDED, HOME_NAMES};

/// File system of shared memory.
pub const SHM: &str = "/dev/shm";
const MEGABYTE: u64 = 1 << 20;

/// Checks that shared memory, at `folder`, has room for a flight of `bytes`.
pub fn check_room(folder: &Path, bytes: u64) -> Result<(), DomainError> {
    let StatVfs { f_blocks, f_bavail, f_frsize, f_files, f_favail, .. } =
        statvfs(folder).map_err(|error| DomainError::Io { path: folder.into(), source: error.into() })?;
    let free = f_bavail * f_frsize;
    // A file system without a limit reports a size of 0.
    if f_blocks > 0 && free < bytes {
        return Err(DomainError::Full { need_mb: bytes.div_ceil(MEGABYTE), free_mb: free / MEGABYTE });
    }
    // A file system that counts no files reports 0.
    if f_files > 0 && f_favail < FILES_NEEDED { Err(DomainError::NoFiles(f_favail)) } else { Ok(()) }
}

/// Sets the length of a file in shared memory and allocates all its memory now. Otherwise the first write to a page for
/// which no memory is left would end the process (SIGBUS).
pub fn allocate(file: &File, bytes: u64) -> io::Result<()> {
    match fallocate(file, FallocateFlags::empty(), 0, bytes) {
        Err(Errno::OPNOTSUPP) => file.set_len(bytes), // in a file system other than tmpfs
        done => Ok(done?),
    }
}

/// Iterates over the paths that the user's folder can have.
fn names() -> impl Iterator<Item = PathBuf> {
    let first = format!("{SHM}/trefoil-{}", rustix::process::geteuid().as_raw());
    (0..HOME_NAMES).map(move |i| if i == 0 { first.clone() } else { format!("{first}.{i}") }.into())
}

/// Iterates over the user's folders. There is one, or several if another user's file stood in the way at times.
pub fn homes() -> impl Iterator<Item = PathBuf> {
    names().filter(|path| is_private(path))
}

/// Returns whether `path` is a folder of this user that no other user may enter.
fn is_private(path: &Path) -> bool {
    let own = rustix::process::geteuid().as_raw();
    let stat = open_folder(path).and_then(fstat);
    stat.is_ok_and(|stat| stat.st_uid == own && stat.st_mode & 0o777 == 0o700)
}

/// Returns the user's folder, created if it is not there.
pub fn make_home() -> Result<PathBuf, DomainError> {
    let failed = |path: &Path, source| DomainError::Io { path: path.into(), source };
    let mode = fs::metadata(SHM).map_err(|error| failed(Path::new(SHM), error))?.mode();
    if mode & 0o022 != 0 && mode & 0o1000 == 0 {
        let why = "other users may rename what is in it; forbid it, as root: `chmod +t /dev/shm`";
        return Err(failed(Path::new(SHM), io::Error::other(why)));
    }
    for path in names() {
        match DirBuilder::new().mode(0o700).create(&path) {
            Err(error) if error.kind() != ErrorKind::AlreadyExists => return Err(failed(&path, error)),
            _ if is_private(&path) => return Ok(path),
            _ => {}
        }
    }
    Err(DomainError::Crowded(names().next().unwrap_or_default()))
}

/// Opens a folder, without following a link or waiting for the other end of a FIFO. An error if `path` is no folder.
pub fn open_folder(path: &Path) -> Result<OwnedFd, Errno> {
    open(path, OFlags::RDONLY | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC, Mode::empty())
}
