//! What the nodes remember, in the log.

use contract::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::Origin;

/// What one node remembers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Memory {
    /// The sample after which it was asked for.
    pub tick: u64,
    /// The topic that the node answers on.
    pub topic: Topic,
    /// Which process of it, and how many ticks it had done.
    pub origin: Origin,
    /// Its words, without the zeros at the end.
    pub words: Vec<u64>,
}

impl Memory {
    /// Of the words of a snapshot.
    pub fn new(tick: u64, topic: Topic, origin: Origin, words: &[u64]) -> Self {
        let length = words.iter().rposition(|word| *word != 0).map_or(0, |last| last + 1);
        Self { tick, topic, origin, words: words[..length].to_vec() }
    }

    /// What all nodes remember after sample `tick`, of a running stack; `None` where the vehicle has not written it.
    pub fn of_all(page: &ControlPage, tick: u64) -> Option<Vec<Self>> {
        let (origin, words) = page.plant_memory.read_whole().filter(|(origin, _)| origin.done == tick + 1)?;
        let mut all = vec![Self::new(tick, Topic::State, origin, &words)];
        for topic in [Topic::Reference, Topic::Controls, Topic::Actuators] {
            let memory = page.role(topic).memory.read_whole();
            all.extend(memory.map(|(origin, words)| Self::new(tick, topic, origin, &words)));
        }
        Some(all)
    }

    /// All of its words; `None` where they are more than that.
    pub fn padded<const WORDS: usize>(&self) -> Option<[u64; WORDS]> {
        let mut words = [0; WORDS];
        words.get_mut(..self.words.len())?.copy_from_slice(&self.words);
        Some(words)
    }
}
