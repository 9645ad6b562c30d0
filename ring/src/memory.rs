//! Snapshots of the nodes in the log, from which a replay can begin.

use contract::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::{Origin, SnapshotCell};

/// Snapshot of one node's internal state.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Memory {
    /// Plant sample after which the snapshot was requested.
    pub tick: u64,
    /// Topic that the node publishes.
    pub topic: Topic,
    /// Epoch of the process, and the number of ticks it had done.
    pub origin: Origin,
    /// Words of the snapshot, without the zeros at the end.
    pub words: Vec<u64>,
}

impl Memory {
    /// Creates the memory from the words of a snapshot.
    pub fn new(tick: u64, topic: Topic, origin: Origin, words: &[u64]) -> Self {
        let length = words.iter().rposition(|word| *word != 0).map_or(0, |last| last + 1);
        Self { tick, topic, origin, words: words[..length].to_vec() }
    }

    /// Reads the snapshots of all nodes that left one on the `page`; `None` if the plant left none of sample `tick`.
    pub fn of_all(page: &ControlPage, tick: u64) -> Option<Vec<Self>> {
        let vehicle =
            Self::of(Topic::State, &page.plant_memory, tick).filter(|memory| memory.origin.done == tick + 1)?;
        let others = Topic::OF_CONTROLLERS.into_iter();
        let others = others.filter_map(|topic| Self::of(topic, &page.role(topic).memory, tick));
        Some(std::iter::once(vehicle).chain(others).collect())
    }

    fn of<const WORDS: usize>(topic: Topic, cell: &SnapshotCell<WORDS>, tick: u64) -> Option<Self> {
        let (origin, words) = cell.read_whole()?;
        Some(Self::new(tick, topic, origin, &words))
    }

    /// Returns the words of the snapshot with the zeros at the end; `None` if there are more than `WORDS`.
    pub fn padded<const WORDS: usize>(&self) -> Option<[u64; WORDS]> {
        let mut words = [0; WORDS];
        words.get_mut(..self.words.len())?.copy_from_slice(&self.words);
        Some(words)
    }
}
