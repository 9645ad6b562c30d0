//! A folder that is held open, and safe access to its files.
//!
//! Folders of runs and campaigns come from archives, shared disks and other users. So a folder is held by a descriptor,
//! and its files are opened relative to the descriptor (`openat`), even if another folder takes its name. Inside the
//! folder no link is followed, no open waits for a FIFO or device, no file is read beyond its limit, and files of other
//! users are noted.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{Error, ErrorKind, Result, Write};
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::ffi::OsStringExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, Ordering};

use anyhow::Context;
use runtime::console::eprint_line;
use rustix::fs::{
    AtFlags, CWD, FileType, FlockOperation, Mode, OFlags, RenameFlags, flock, fstat, linkat, mkdirat, openat, renameat,
    renameat_with, statat, unlinkat,
};
use rustix::io::Errno;
use rustix::process::geteuid;
use settings::file;

/// Flags of every open: no link is followed, and the call never waits.
const NEVER_WAIT: OFlags = OFlags::NOFOLLOW.union(OFlags::NONBLOCK).union(OFlags::NOCTTY).union(OFlags::CLOEXEC);

/// A folder, held by its descriptor. Every `name` in the methods is one path component.
#[derive(Debug)]
pub struct Dir {
    fd: OwnedFd,
    /// Path by which the folder was opened, for messages.
    path: PathBuf,
}

impl Dir {
    /// Opens the folder that a user named. Links on the way to the folder are followed, links inside it are not.
    pub fn open(path: &Path) -> Result<Self> {
        let path = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        let fd = openat(CWD, path, OFlags::DIRECTORY | OFlags::CLOEXEC, Mode::empty())?;
        Ok(Self { fd, path: path.into() })
    }

    /// Opens the folder at `path`; creates it, and its missing parents, if it does not exist.
    pub fn make(path: &Path) -> Result<Self> {
        std::fs::create_dir_all(path)?;
        Self::open(path)
    }

    /// Opens the folder `name` in this folder; an error if it is a link.
    pub fn folder(&self, name: impl AsRef<Path>) -> Result<Self> {
        let fd = openat(&self.fd, name.as_ref(), NEVER_WAIT | OFlags::DIRECTORY, Mode::empty());
        let fd = fd.map_err(|error| self.refusal(name.as_ref(), FileType::Directory, error))?;
        Ok(Self { fd, path: self.at(name) })
    }

    /// Opens the folder `name` in this folder; creates it if nothing has the name.
    pub fn make_folder(&self, name: &str) -> Result<Self> {
        match mkdirat(&self.fd, name, Mode::from_raw_mode(0o777)) {
            Err(Errno::EXIST) | Ok(()) => self.folder(name),
            Err(error) => Err(error.into()),
        }
    }

    /// Locks the folder itself as long as it is open; returns false if another process holds the lock. Never waits.
    pub fn hold(&self) -> bool {
        is_locked(&self.fd, FlockOperation::NonBlockingLockExclusive)
    }

    /// Returns whether the path by which the folder was opened still leads to it.
    pub fn is_in_its_place(&self) -> bool {
        let own = fstat(&self.fd).map(|found| (found.st_dev, found.st_ino));
        let named = statat(CWD, &self.path, AtFlags::empty()).map(|found| (found.st_dev, found.st_ino));
        own.is_ok() && own == named
    }

    /// Returns the path by which the folder was opened, for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the path of `name` in this folder, for messages.
    pub fn at(&self, name: impl AsRef<Path>) -> PathBuf {
        self.path.join(name)
    }

    /// Returns whether any entry, even a dangling link, has this name.
    pub fn has(&self, name: &str) -> bool {
        self.kind(Path::new(name)).is_some()
    }

    /// Reads the names of the entries. Each call reads them anew, because a network file system caches which files were
    /// missing.
    pub fn names(&self) -> Result<Vec<OsString>> {
        let own = |name: &std::ffi::CStr| ![c".", c".."].contains(&name);
        let entries =
            rustix::fs::Dir::read_from(&self.fd)?.filter(|entry| !matches!(entry, Ok(e) if !own(e.file_name())));
        entries.map(|entry| Ok(OsString::from_vec(entry?.file_name().to_bytes().to_vec()))).collect()
    }

    /// Opens the regular file `name`, and returns it with its size; an error if it has more than `limit` bytes.
    pub fn file(&self, name: impl AsRef<Path>, limit: u64) -> Result<(File, u64)> {
        let file = self.open_regular(name.as_ref(), OFlags::RDONLY)?;
        file::checked(file, limit)
    }

    /// Reads the regular file `name`; an error if it has more than `limit` bytes.
    pub fn read(&self, name: impl AsRef<Path>, limit: u64) -> Result<Vec<u8>> {
        file::read_all(self.file(name, limit)?, limit)
    }

    /// Reads the text of the regular file `name`; an error if it has more than `limit` bytes.
    pub fn read_text(&self, name: impl AsRef<Path>, limit: u64) -> Result<String> {
        file::text(self.read(name, limit)?)
    }

    /// Opens the regular file `name` and empties it, for writing; creates it if nothing has the name.
    pub fn create(&self, name: impl AsRef<Path>) -> Result<File> {
        let file = self.open_regular(name.as_ref(), OFlags::WRONLY | OFlags::CREATE)?;
        file.set_len(0)?; // emptied only now, when it is known to be a regular file
        Ok(file)
    }

    /// Locks the file `name` while the returned file is open; `None` if another process holds the lock. Never waits.
    pub fn lock(&self, name: &str, how: FlockOperation) -> Result<Option<File>> {
        let file = self.open_regular(Path::new(name), OFlags::RDWR | OFlags::CREATE)?;
        Ok(is_locked(&file, how).then_some(file))
    }

    /// Writes the file `name` completely or not at all: a temporary file replaces `name` at the end.
    pub fn write_whole(&self, name: impl AsRef<Path>, bytes: &[u8]) -> anyhow::Result<()> {
        self.write(name.as_ref(), bytes, NewFile::finish)
    }

    /// Writes the file `name` completely, unless a file has the name: then the old file stays, without an error.
    pub fn write_new(&self, name: &str, bytes: &[u8]) -> anyhow::Result<()> {
        self.write(Path::new(name), bytes, NewFile::finish_unless_there)
    }

    fn write<'a>(&'a self, name: &Path, bytes: &[u8], finish: fn(NewFile<'a>) -> Result<()>) -> anyhow::Result<()> {
        let written = self.begin(name).and_then(|mut file| {
            file.write_all(bytes)?;
            finish(file)
        });
        written.with_context(|| format!("cannot write {}", self.at(name).display()))
    }

    /// Begins the file `name`; when it is complete, it replaces an old file of that name. An error if anything but a
    /// regular file has the name.
    pub fn begin(&self, name: impl AsRef<Path>) -> Result<NewFile<'_>> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let name = name.as_ref();
        if self.kind(name).is_some_and(|kind| kind != FileType::RegularFile) {
            return Err(self.refusal(name, FileType::RegularFile, Errno::EXIST));
        }
        let flags = NEVER_WAIT | OFlags::WRONLY | OFlags::CREATE | OFlags::EXCL;
        loop {
            let part = format!(".{}-{}.part", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
            match openat(&self.fd, &part, flags, Mode::from_raw_mode(0o666)) {
                Err(Errno::EXIST) => {} // left by a process on another machine or by a killed process
                opened => return Ok(NewFile { folder: self, name: name.into(), part, file: opened?.into() }),
            }
        }
    }

    /// Removes the file or link `name`; the target of a link stays.
    pub fn remove(&self, name: impl AsRef<Path>) -> Result<()> {
        Ok(unlinkat(&self.fd, name.as_ref(), AtFlags::empty())?)
    }

    /// Opens the regular file `name`, and reports its owner if the owner is another user.
    fn open_regular(&self, name: &Path, how: OFlags) -> Result<File> {
        // Only a regular file is opened (unless another entry takes the name at this moment), because some devices act
        // on an open.
        let refusal = |error| self.refusal(name, FileType::RegularFile, error);
        if self.kind(name).is_some_and(|kind| kind != FileType::RegularFile) {
            return Err(refusal(Errno::INVAL));
        }
        let file = openat(&self.fd, name, NEVER_WAIT | how, Mode::from_raw_mode(0o666)).map_err(refusal)?;
        let (file, _) = file::checked(file.into(), u64::MAX)?;
        say_owner(&self.at(name), file.metadata()?.uid());
        Ok(file)
    }

    /// Returns the type of the entry `name`, without following links; `None` if there is no entry.
    fn kind(&self, name: &Path) -> Option<FileType> {
        let found = statat(&self.fd, name, AtFlags::SYMLINK_NOFOLLOW);
        found.ok().map(|found| FileType::from_raw_mode(found.st_mode))
    }

    /// Returns the reason why `name` cannot be used: its type is not `wanted`, or else the system's `error`.
    fn refusal(&self, name: &Path, wanted: FileType, error: Errno) -> Error {
        match self.kind(name).filter(|kind| *kind != wanted) {
            Some(kind) => {
                let text = format!("it is {}, and {} belongs there", in_words(kind), in_words(wanted));
                Error::new(ErrorKind::InvalidInput, text)
            }
            None => error.into(),
        }
    }
}

/// A file that is being written under a temporary name. [`NewFile::finish`] gives the file its own name; if the value
/// is dropped before, the file is removed.
#[derive(Debug)]
pub struct NewFile<'a> {
    folder: &'a Dir,
    name: PathBuf,
    part: String,
    file: File,
}

impl NewFile<'_> {
    /// Returns another handle of the open file, for a writer that needs to own a handle.
    pub fn handle(&self) -> Result<File> {
        self.file.try_clone()
    }

    /// Puts the complete file in its place.
    pub fn finish(self) -> Result<()> {
        self.file.sync_all()?;
        Ok(renameat(&self.folder.fd, &self.part, &self.folder.fd, &self.name)?)
    }

    /// Puts the complete file in its place, unless a file is there already.
    fn finish_unless_there(self) -> Result<()> {
        self.file.sync_all()?;
        let (fd, part) = (&self.folder.fd, &self.part);
        let put = match renameat_with(fd, part, fd, &self.name, RenameFlags::NOREPLACE) {
            // The file system does not support NOREPLACE; a hard link replaces no file either.
            Err(Errno::INVAL | Errno::NOSYS) => linkat(fd, part, fd, &self.name, AtFlags::empty()),
            put => put,
        };
        if put == Err(Errno::EXIST) { Ok(()) } else { Ok(put?) }
    }
}

impl Write for NewFile<'_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> Result<()> {
        Ok(()) // no bytes are buffered
    }
}

impl Drop for NewFile<'_> {
    fn drop(&mut self) {
        let _ = self.folder.remove(&self.part); // fails after `finish`; a file that stays does no harm
    }
}

/// Locks `fd`; returns false if another process holds the lock. On a file system without locks it returns true.
fn is_locked(fd: impl AsFd, how: FlockOperation) -> bool {
    flock(fd, how) != Err(Errno::WOULDBLOCK)
}

fn in_words(kind: FileType) -> &'static str {
    match kind {
        FileType::RegularFile => "a regular file",
        FileType::Directory => "a directory",
        FileType::Symlink => "a link",
        FileType::Fifo => "a FIFO",
        FileType::CharacterDevice | FileType::BlockDevice => "a device",
        FileType::Socket => "a socket",
        FileType::Unknown => "of an unknown kind",
    }
}

/// Prints a note if the file belongs to another user, once for each user.
fn say_owner(path: &Path, owner: u32) {
    static TOLD: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());
    if owner != geteuid().as_raw() && TOLD.lock().is_ok_and(|mut told| told.insert(owner)) {
        eprint_line(&format!("note: {} belongs to another user ({owner})", path.display()));
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::fs::symlink;

    use super::*;

    #[test]
    fn a_file_has_its_name_once_it_is_complete() {
        let top = tempfile::tempdir().unwrap();
        let dir = Dir::open(top.path()).unwrap();
        dir.write_whole("table", b"old").unwrap();
        let mut begun = dir.begin("table").unwrap();
        begun.write_all(b"new").unwrap();
        assert_eq!(dir.read("table", 9).unwrap(), b"old");
        drop(begun);
        assert_eq!(dir.names().unwrap(), ["table"], "what was not finished is gone");
        let mut begun = dir.begin("table").unwrap();
        begun.write_all(b"new").unwrap();
        begun.finish().unwrap();
        assert_eq!((dir.read("table", 9).unwrap(), dir.names().unwrap().len()), (b"new".to_vec(), 1));
        symlink("table", dir.at("link")).unwrap();
        assert!(dir.begin("link").is_err());
    }

    /// Makes a folder with links, a FIFO and a folder in it, and a file `precious` outside it.
    fn full() -> (tempfile::TempDir, Dir) {
        let top = tempfile::tempdir().unwrap();
        fs::write(top.path().join("precious"), "precious").unwrap();
        fs::create_dir(top.path().join("elsewhere")).unwrap();
        let dir = Dir::make(&top.path().join("a/run")).unwrap();
        symlink("../../precious", dir.at("link")).unwrap();
        symlink("../../elsewhere", dir.at("link-to-folder")).unwrap();
        symlink("nowhere", dir.at("loose")).unwrap();
        rustix::fs::mkfifoat(CWD, dir.at("fifo"), Mode::RWXU).unwrap();
        fs::create_dir(dir.at("folder")).unwrap();
        (top, dir)
    }

    #[test]
    fn only_regular_files_are_opened_and_no_open_waits() {
        let (top, dir) = full();
        for (name, expected) in [
            ("link", "it is a link"),
            ("loose", "it is a link"),
            ("fifo", "it is a FIFO"),
            ("folder", "it is a directory"),
        ] {
            let said = [
                dir.read(name, 99).unwrap_err().to_string(),
                dir.create(name).unwrap_err().to_string(),
                dir.lock(name, FlockOperation::NonBlockingLockExclusive).unwrap_err().to_string(),
                format!("{:#}", dir.write_whole(name, b"new").unwrap_err()),
            ];
            assert!(said.iter().all(|said| said.contains(expected)), "{name}: {said:?}");
        }
        assert!(dir.folder("link-to-folder").unwrap_err().to_string().contains("it is a link"));
        assert!(dir.make_folder("link-to-folder").unwrap_err().to_string().contains("it is a link"));
        assert!(
            dir.make_folder("fifo").unwrap_err().to_string().contains("it is a FIFO, and a directory belongs there")
        );
        assert_eq!(fs::read(top.path().join("precious")).unwrap(), b"precious");
        assert_eq!(dir.names().unwrap().len(), 5, "nothing was made");
        assert_eq!(dir.read("none", 9).unwrap_err().kind(), ErrorKind::NotFound);
    }

    #[test]
    fn write_whole_replaces_a_file_and_write_new_does_not() {
        let (_top, dir) = full();
        dir.write_whole("file", b"old").unwrap();
        dir.write_whole("file", b"new").unwrap();
        dir.write_new("file", b"newer").unwrap();
        dir.write_new("other", b"other").unwrap();
        assert_eq!(
            (dir.read_text("file", 3).unwrap(), dir.read_text("other", 9).unwrap()),
            ("new".into(), "other".into())
        );
        assert!(dir.read("file", 2).unwrap_err().to_string().contains("2 are the most"));
        dir.create("file").unwrap().write_all(b"x").unwrap();
        assert_eq!(dir.read("file", 9).unwrap(), b"x");
        assert_eq!(dir.names().unwrap().len(), 7, "no parts are left");
    }

    #[test]
    fn another_folder_that_takes_the_name_is_not_touched() {
        let (top, dir) = full();
        dir.write_whole("file", b"ours").unwrap();
        fs::rename(top.path().join("a/run"), top.path().join("a/moved")).unwrap();
        symlink("../elsewhere", top.path().join("a/run")).unwrap();
        dir.write_whole("more", b"more").unwrap();
        assert_eq!(dir.read("file", 9).unwrap(), b"ours");
        assert!(top.path().join("a/moved/more").exists());
        assert_eq!(fs::read_dir(top.path().join("elsewhere")).unwrap().count(), 0);
    }

    #[test]
    fn a_lock_is_held_by_one_process() {
        let (_top, dir) = full();
        let lock = || dir.lock("lock", FlockOperation::NonBlockingLockExclusive).unwrap();
        let held = lock().expect("it is free");
        assert!(lock().is_none());
        drop(held);
        assert!(lock().is_some());
    }
}
