//! Storage of iceoryx2 in files of the run's folder, and the shared memory that a flight needs.
//!
//! iceoryx2's own `ipc` uses POSIX shared memory, whose names all stand in `/dev/shm` itself, where every user can
//! create names. [`FileService`] keeps the same structures in files below the root path instead. That path lies in the
//! same file system, so the memory is the same. iceoryx2's own tools look for POSIX shared memory and do not find these
//! files.

use std::fmt::Debug;
use std::fs::OpenOptions;
use std::io::{self, ErrorKind};
use std::path::Path;

use iceoryx2::prelude::{Config, SemanticString, ZeroCopySend};
use iceoryx2::service::header::publish_subscribe::Header;
use iceoryx2::service::internal::ServiceInternal;
use iceoryx2::unique_id_generator::unique_system_id::UniqueSystemId;
use iceoryx2_bb_elementary_traits::testing::abandonable::Abandonable;
use iceoryx2_cal::arc_sync_policy::single_threaded::SingleThreaded;
use iceoryx2_cal::resizable_shared_memory::dynamic::DynamicMemory;
use iceoryx2_cal::shm_allocator::bump_allocator::BumpAllocator;
use iceoryx2_cal::shm_allocator::pool_allocator::PoolAllocator;
use iceoryx2_cal::{
    bag, dynamic_storage, event, hash, monitoring, reactor, serialize, shared_memory, static_storage,
    zero_copy_connection,
};

use rustix::io::Errno;

use super::observer_depth;
use crate::domain::{Domain, allocate};
use crate::error::PortError;
use crate::limits::MAX_SUBSCRIBERS;
use contract::message::{Actuators, Controls, Reference, State, Truth};

/// Number of samples that iceoryx2 reserves for each subscriber besides its queue, and for each publisher.
const BORROWED: usize = 2;
/// Size of a sample besides header and message \[bytes\].
const PER_SAMPLE: usize = 16;
/// Size of a place in a queue \[bytes\].
const PER_PLACE: usize = 16;
/// Size of services, control page and settings, and of rounding up to pages \[bytes\].
const REST: usize = 1 << 20;

/// Shared memory that a flight at `rate_hz` needs \[bytes\], with a second process for every node.
pub fn bytes_needed(rate_hz: u32) -> u64 {
    let depth = observer_depth(rate_hz);
    let service = |message_bytes: usize, listeners: usize| {
        let samples = MAX_SUBSCRIBERS * (depth + BORROWED) + BORROWED;
        let connections = listeners * depth * PER_PLACE;
        samples * (size_of::<Header>() + message_bytes + PER_SAMPLE) + connections
    };
    // Listeners are nodes, recorder and launcher.
    let all = service(size_of::<State>(), 5)
        + service(size_of::<Reference>(), 3)
        + service(size_of::<Controls>(), 3)
        + service(size_of::<Actuators>(), 3)
        + service(size_of::<Truth>(), 2);
    (2 * all + REST) as u64
}

/// iceoryx2's `ipc` with files in place of POSIX shared memory.
#[derive(Debug, Clone)]
pub struct FileService;

impl iceoryx2::service::Service for FileService {
    type StaticStorage = static_storage::recommended::Ipc;
    type ConfigSerializer = serialize::recommended::Recommended;
    type PersistentDynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = dynamic_storage::file::Storage<T>;
    type Bag = bag::recommended::Recommended;
    type DynamicStorage<T: Debug + Send + Sync + ZeroCopySend + 'static> = dynamic_storage::file::Storage<T>;
    type ServiceNameHasher = hash::recommended::Recommended;
    type SharedMemory = shared_memory::file::Memory<PoolAllocator>;
    type ResizableSharedMemory = DynamicMemory<PoolAllocator, Self::SharedMemory>;
    type Connection = zero_copy_connection::file::Connection;
    type Event = event::recommended::Ipc;
    type Monitoring = monitoring::recommended::Ipc;
    type Reactor = reactor::recommended::Ipc;
    type ArcThreadSafetyPolicy<T: Send + Debug + Abandonable> = SingleThreaded<T>;
    type BlackboardMgmt<T: Send + Sync + Debug + ZeroCopySend + 'static> = dynamic_storage::file::Storage<T>;
    type BlackboardPayload = shared_memory::file::Memory<BumpAllocator>;
    type UniqueId = UniqueSystemId;
}

impl ServiceInternal<Self> for FileService {}

/// iceoryx2's settings for the run of `domain`.
pub fn config(domain: &Domain) -> Result<Config, PortError> {
    let root = domain.file("iox");
    let too_long = |_| PortError::Domain(format!("the path {} is too long for iceoryx2", root.display()));
    let path = iceoryx2::prelude::Path::new(as_bytes(&root)).map_err(too_long)?;
    let mut config = Config::default();
    config.global.set_root_path(&path);
    // The launcher watches its children itself; a node would clean up after a dead process inside its loop.
    config.global.node.cleanup_dead_nodes_on_creation = false;
    config.global.node.cleanup_dead_nodes_on_destruction = false;
    config.global.service.cleanup_dead_nodes_on_open = false;
    Ok(config)
}

/// Reads the process numbers of a segment's makers from its name, whose port numbers contain process, time and count.
pub fn makers(segment: &str) -> impl Iterator<Item = u32> {
    // All other parts between dots and underscores are shorter, or no numbers.
    let numbers = segment.split(['.', '_']).filter(|part| part.len() > 20).filter_map(|part| part.parse::<u128>().ok());
    numbers.map(|id| (id >> 64) as u32)
}

/// Allocates the memory of the segments of `domain` that ports of this process use: iceoryx2 does not allocate it.
pub fn allocate_own(domain: &Domain) -> Result<(), PortError> {
    let own = std::process::id();
    for (path, bytes) in domain.files() {
        let name = path.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        // A file without a length is being made at this moment, by the other end of a connection.
        if bytes == 0 || !makers(&name).any(|pid| pid == own) {
            continue;
        }
        let done = OpenOptions::new().write(true).open(&path).and_then(|file| allocate(&file, bytes));
        match done {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                return Err(PortError::Domain(format!("{}: {error}", path.display())));
            }
            _ => {} // the other end of a connection may have removed it
        }
    }
    Ok(())
}

/// Describes an error of iceoryx2, with the system's error if a resource has run out, which iceoryx2 does not pass on.
pub fn reason(error: impl Debug) -> String {
    const RUN_OUT: [Errno; 5] = [Errno::MFILE, Errno::NFILE, Errno::NOSPC, Errno::NOMEM, Errno::AGAIN];
    let last = io::Error::last_os_error();
    let has_run_out = Errno::from_io_error(&last).is_some_and(|errno| RUN_OUT.contains(&errno));
    if has_run_out { format!("{error:?}: {last}") } else { format!("{error:?}") }
}

fn as_bytes(path: &Path) -> &[u8] {
    path.as_os_str().as_encoded_bytes()
}
