//! Descriptors by whose number iceoryx2 changes the mode of its files when a node is dropped.
//!
//! A library in this process may have put another file over such a number (`dup2`). iceoryx2 would then change the mode
//! of that file. If the file is `/dev/null`, the change affects the whole machine.

use std::fs::{self, Metadata};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::realtime::end_at_once;

/// Descriptors of this process, as the kernel shows them.
const ALL: &str = "/proc/self/fd";

/// Descriptors of one attachment to a run, each with the file that it was opened for.
///
/// Everything that can drop the attachment holds the descriptors, as its first field. So the last owner checks them
/// before iceoryx2 uses them.
pub struct Descriptors(Vec<(PathBuf, Identity)>);

/// Device and inode of a file.
type Identity = (u64, u64);

impl Descriptors {
    /// Finds the descriptors whose files stand below `folder` and have `id` in their names.
    pub fn of(folder: &Path, id: &str) -> Self {
        let is_own = |descriptor: &PathBuf| {
            let file = fs::read_link(descriptor).unwrap_or_default();
            file.strip_prefix(folder).is_ok_and(|name| name.to_string_lossy().contains(id))
        };
        let all: Vec<PathBuf> = fs::read_dir(ALL).into_iter().flatten().flatten().map(|entry| entry.path()).collect();
        let own = all.into_iter().filter(is_own);
        Self(own.filter_map(|descriptor| Some((descriptor.clone(), identity(&descriptor)?))).collect())
    }

    /// Returns a descriptor that has another file now or cannot be looked at; `None` if each has its own file or was
    /// closed.
    fn replaced(&self) -> Option<&Path> {
        let can_look = Path::new(ALL).exists();
        let is_replaced =
            |(descriptor, opened): &&(PathBuf, Identity)| identity(descriptor).map_or(!can_look, |now| now != *opened);
        self.0.iter().find(is_replaced).map(|(descriptor, _)| descriptor.as_path())
    }
}

impl Drop for Descriptors {
    /// Ends the process if a descriptor has another file; the launcher then removes what the process leaves.
    fn drop(&mut self) {
        if let Some(descriptor) = self.replaced() {
            let number = descriptor.file_name().unwrap_or_default().display();
            end_at_once(&format!(
                "a library has put another file over descriptor {number}, which this process opened before: the process \
                 ends without using it; let the library take a number that `open` or `dup` returns\n"
            ));
        }
    }
}

fn identity(descriptor: &Path) -> Option<Identity> {
    fs::metadata(descriptor).ok().map(|file: Metadata| (file.dev(), file.ino()))
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::os::fd::AsRawFd;

    use super::*;

    #[test]
    fn a_descriptor_with_another_file_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let [ours, other] = ["node.7", "node.8"].map(|name| File::create(folder.path().join(name)).unwrap());
        let mut own = Descriptors::of(folder.path(), "7");
        assert_eq!(own.0.len(), 1, "one of ours is below this folder");
        assert_eq!(own.replaced(), None);
        own.0[0].0 = Path::new(ALL).join(other.as_raw_fd().to_string()); // as if `ours` had the number of `other`
        assert!(own.replaced().is_some());
        own.0[0].0 = Path::new(ALL).join("1000000000");
        assert_eq!(own.replaced(), None, "it was closed, and no other file has its number");
        drop((ours, own));
    }
}
