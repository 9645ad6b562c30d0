//! The control page: shared memory with the phase of the run, a doorbell per topic, the roles and the fault table.
//!
//! iceoryx2 carries the messages; the doorbells only wake. A doorbell is a counter with a futex on it: a publisher
//! raises it after it has sent, and a receiver sleeps until it changes or a deadline passes. iceoryx2's own event is a
//! datagram with time-outs in milliseconds; a futex needs one system call on each side and times out at the nanosecond.
//!
//! A doorbell holds no state that matters: if a process dies between sending and ringing, the others wait for one
//! time-out.

use std::fs::OpenOptions;
use std::io;
use std::num::NonZeroU32;
use std::ops::Deref;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rustix::io::Errno;
use rustix::mm::{MapFlags, ProtFlags, mmap, mmap_anonymous, munmap};
use rustix::thread::futex;

use super::clock::to_timespec;
use crate::domain::allocate;
use crate::fault_table::FaultTable;
use crate::shared_role::{SharedRole, SnapshotCell, Word};
use contract::Topic;
use contract::snapshot::PLANT_WORDS;

const PAGE_BYTES: usize = 4096 * 12;
const MAGIC: u32 = 0x7EF0_1109;

/// Content of the control page.
#[repr(C)]
pub struct Page {
    magic: AtomicU32,
    /// Phase of the run: see [`phase`]. Rung at every change.
    pub phase: Doorbell,
    /// Newest tick that the launcher has seen; limits how far lockstep may run ahead.
    pub watched: Doorbell,
    /// Newest tick that the recorder has seen, with the same effect; `u32::MAX` if nothing is recorded.
    pub recorded: Doorbell,
    /// Lockstep: ticks up to which the plant has asked the launcher for the assignment of the roles.
    pub asked: Doorbell,
    /// Lockstep: ticks up to which the launcher has decided it.
    pub decided: Doorbell,
    /// Lockstep: first tick for which the plant must ask.
    pub next_decision: Word,
    doorbells: [Doorbell; Topic::COUNT],
    roles: [SharedRole; Topic::COUNT],
    /// Memory of the plant, written every ten seconds for the log.
    pub plant_memory: SnapshotCell<PLANT_WORDS>,
    /// Role of the recorder.
    pub recorder: SharedRole,
    /// Faults that were given in flight.
    pub fault_table: FaultTable,
    origin_ns: AtomicU64,
    samples: AtomicU64,
}
const _: () = assert!(size_of::<Page>() <= PAGE_BYTES);

/// Phases of a run: the values of [`Page::phase`].
pub mod phase {
    /// Phase in which the processes join.
    pub const JOIN: u32 = 0;
    /// Phase in which the plant may fly: all processes are ready.
    pub const GO: u32 = 1;
    /// Phase in which the nodes end.
    pub const LEAVE: u32 = 2;
    /// Phase in which the recorder closes its file: the nodes have ended.
    pub const CLOSE: u32 = 3;
}

/// Counter that wakes waiting processes, on a cache line of its own.
#[repr(C, align(64))]
pub struct Doorbell(AtomicU32);

impl Doorbell {
    /// Present count. Read it before looking for a message, then pass it to [`wait`](Self::wait).
    pub fn count(&self) -> u32 {
        self.0.load(Ordering::Acquire)
    }

    /// Raises the counter and wakes every process that waits.
    pub fn ring(&self) {
        self.0.fetch_add(1, Ordering::Release);
        self.wake();
    }

    /// Raises the counter and wakes no process.
    pub fn mark(&self) {
        self.0.fetch_add(1, Ordering::Release);
    }

    /// Raises the counter to `count` and wakes every process that waits; no effect if the counter is that high already.
    pub fn raise(&self, count: u32) {
        if self.0.fetch_max(count, Ordering::Release) < count {
            self.wake();
        }
    }

    /// Sleeps until the counter differs from `seen` or `deadline_ns` (`CLOCK_MONOTONIC`) has passed.
    pub fn wait(&self, seen: u32, deadline_ns: u64) {
        let deadline = to_timespec(deadline_ns);
        while self.count() == seen {
            match futex::wait_bitset(&self.0, futex::Flags::empty(), seen, Some(&deadline), NonZeroU32::MAX) {
                Ok(()) | Err(Errno::AGAIN | Errno::INTR) => {}
                Err(_) => return, // the deadline
            }
        }
    }

    fn wake(&self) {
        // Fails only for a bad address, which a mapped page does not have.
        let _ = futex::wake(&self.0, futex::Flags::empty(), i32::MAX as u32);
    }
}

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

impl Page {
    /// Doorbell of a topic.
    pub fn doorbell(&self, topic: Topic) -> &Doorbell {
        &self.doorbells[topic as usize]
    }

    /// Role of the node that publishes `topic`.
    pub fn role(&self, topic: Topic) -> &SharedRole {
        &self.roles[topic as usize]
    }

    /// Number of samples that the plant has taken.
    pub fn samples_taken(&self) -> u64 {
        u64::from(self.role(Topic::State).done(1).get())
    }

    /// Current tick: the newest that the plant has sampled; 0 before the first.
    pub fn plant_tick(&self) -> u64 {
        self.samples_taken().saturating_sub(1)
    }

    /// Instant of sample 0, in lockstep of the present sample \[ns\]; 0 before it is known.
    pub fn origin_ns(&self) -> u64 {
        self.origin_ns.load(Ordering::Acquire)
    }

    /// Sets the instant of sample 0, in lockstep of the present sample; called by the plant.
    pub fn set_origin_ns(&self, origin_ns: u64) {
        self.origin_ns.store(origin_ns, Ordering::Release);
    }

    /// Number of samples of the run; 0 until the plant has taken the last one.
    pub fn total_samples(&self) -> u64 {
        self.samples.load(Ordering::Acquire)
    }

    /// Sets the number of samples of the run; called by the plant before it sends the last one.
    pub fn set_total_samples(&self, samples: u64) {
        self.samples.store(samples, Ordering::Release);
    }

    /// Moves the run on to `phase` and wakes every process that waits on a doorbell of a topic or of the phase.
    pub fn set_phase(&self, phase: u32) {
        self.phase.raise(phase);
        for topic in Topic::ALL {
            self.doorbell(topic).ring();
        }
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
