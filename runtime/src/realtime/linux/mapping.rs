//! The control page in memory: a file that all processes of a run map, or private memory of one process.

use std::fs::OpenOptions;
use std::io;
use std::ops::Deref;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::Ordering;

use rustix::mm::{MapFlags, ProtFlags, mmap, mmap_anonymous, munmap};

use crate::domain::allocate;
use crate::realtime::control_page::Page;

const PAGE_BYTES: usize = size_of::<Page>().next_multiple_of(4096);
const MAGIC: u32 = 0x7EF0_110C;

/// Mapping of the control page, unmapped when it is dropped.
pub struct ControlPage {
    page: NonNull<Page>,
}

impl ControlPage {
    /// Creates the page as a new file; called by the launcher, once per run.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).create_new(true).mode(0o600).open(path)?;
        allocate(&file, PAGE_BYTES as u64)?;
        let page = Self::map(&file)?;
        page.magic.store(MAGIC, Ordering::Release);
        Ok(page)
    }

    /// Makes a page in private memory, for a run in process.
    pub fn private() -> io::Result<Self> {
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: the address is the kernel's choice, so no existing mapping is replaced; the memory is all zero.
        let address = unsafe { mmap_anonymous(std::ptr::null_mut(), PAGE_BYTES, protection, MapFlags::PRIVATE)? };
        Self::at(address)
    }

    /// Opens the page of a run; an error if its length or version does not fit.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        if file.metadata()?.len() != PAGE_BYTES as u64 {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "not a page: wrong length"));
        }
        let page = Self::map(&file)?;
        if page.magic.load(Ordering::Acquire) != MAGIC {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "a page of another version"));
        }
        Ok(page)
    }

    fn map(file: &std::fs::File) -> io::Result<Self> {
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: the address is the kernel's choice, so no existing mapping is replaced; the length is that of the
        // file, checked or set by the caller. Nothing but atomics is ever read or written through it.
        let address = unsafe { mmap(std::ptr::null_mut(), PAGE_BYTES, protection, MapFlags::SHARED, file, 0)? };
        Self::at(address)
    }

    fn at(address: *mut std::ffi::c_void) -> io::Result<Self> {
        let page = NonNull::new(address.cast::<Page>()).ok_or_else(|| io::Error::other("mapped at address zero"))?;
        Ok(Self { page })
    }
}

impl Deref for ControlPage {
    type Target = Page;

    fn deref(&self) -> &Page {
        // SAFETY: `page` comes from `at`: page-aligned, PAGE_BYTES long, which covers `Page`, and mapped until drop.
        // `Page` is made of atomics only, for which every bit pattern is valid and shared writes are defined.
        unsafe { self.page.as_ref() }
    }
}

impl Drop for ControlPage {
    fn drop(&mut self) {
        // SAFETY: mapped with this length, and no reference outlives `self`. Failure would leak the mapping.
        let _ = unsafe { munmap(self.page.as_ptr().cast(), PAGE_BYTES) };
    }
}

// SAFETY: all access goes through atomics behind shared references; the mapping itself never changes.
unsafe impl Send for ControlPage {}
// SAFETY: as above.
unsafe impl Sync for ControlPage {}
