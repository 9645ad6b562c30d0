//! Memory that processes share: a file that they map, or private memory of one process.

use std::fs::OpenOptions;
use std::io;
use std::ops::Deref;
use std::os::fd::AsFd;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::{NonNull, null_mut};
use std::sync::atomic::Ordering;

use rustix::mm::{MapFlags, ProtFlags, mmap, mmap_anonymous, munmap};

use crate::domain::allocate;
use crate::realtime::control_page::Page;

const MAGIC: u32 = 0x7EF0_110C;
const READ_WRITE: ProtFlags = ProtFlags::READ.union(ProtFlags::WRITE);

/// Type that processes may share.
///
/// # Safety
/// The type is made of atomics only: every bit pattern is valid, and writes by another process are defined.
pub unsafe trait Shared {}

// SAFETY: the page is made of atomics only.
unsafe impl Shared for Page {}

/// Mapping of a `T`, unmapped when it is dropped.
pub struct Mapping<T>(NonNull<T>);

/// Mapping of the control page.
pub type ControlPage = Mapping<Page>;

impl<T: Shared> Mapping<T> {
    /// Length of the mapping, and of a file that is mapped: whole pages.
    pub(super) const BYTES: usize = size_of::<T>().next_multiple_of(4096);

    /// Maps a `file` of this length.
    pub(super) fn of(file: impl AsFd) -> io::Result<Self> {
        // SAFETY: the address is the kernel's choice, so no existing mapping is replaced; the length is that of the
        // file, checked or set by the caller. Nothing but atomics is ever read or written through it.
        Self::at(unsafe { mmap(null_mut(), Self::BYTES, READ_WRITE, MapFlags::SHARED, file, 0)? })
    }

    /// Makes a `T` in private memory, for a run in process.
    pub fn private() -> io::Result<Self> {
        // SAFETY: the address is the kernel's choice, so no existing mapping is replaced; the memory is all zero.
        Self::at(unsafe { mmap_anonymous(null_mut(), Self::BYTES, READ_WRITE, MapFlags::PRIVATE)? })
    }

    fn at(address: *mut std::ffi::c_void) -> io::Result<Self> {
        NonNull::new(address.cast()).map(Self).ok_or_else(|| io::Error::other("mapped at address zero"))
    }
}

impl ControlPage {
    /// Creates the page as a new file; called by the launcher, once per run.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(path)?;
        allocate(&file, Self::BYTES as u64)?;
        let page = Self::of(&file)?;
        page.magic.store(MAGIC, Ordering::Release);
        Ok(page)
    }

    /// Opens the page of a run; an error if its length or version does not fit.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        if file.metadata()?.len() != Self::BYTES as u64 {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "not a page: wrong length"));
        }
        let page = Self::of(&file)?;
        if page.magic.load(Ordering::Acquire) != MAGIC {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a page of another version"));
        }
        Ok(page)
    }
}

impl<T: Shared> Deref for Mapping<T> {
    type Target = T;

    fn deref(&self) -> &T {
        // SAFETY: the address comes from `at`: page-aligned, as long as `T`, and mapped until drop. `T` is made of
        // atomics only, for which every bit pattern is valid and shared writes are defined.
        unsafe { self.0.as_ref() }
    }
}

impl<T> Drop for Mapping<T> {
    fn drop(&mut self) {
        // SAFETY: mapped with this length, rounded up to whole pages, and no reference outlives `self`. Failure would
        // leak the mapping.
        let _ = unsafe { munmap(self.0.as_ptr().cast(), size_of::<T>()) };
    }
}

// SAFETY: all access goes through atomics behind shared references; the mapping itself never changes.
unsafe impl<T: Shared> Send for Mapping<T> {}
// SAFETY: all access goes through atomics, also from several threads; the mapping itself never changes.
unsafe impl<T: Shared> Sync for Mapping<T> {}
