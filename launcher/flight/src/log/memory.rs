//! What the nodes remember, in the log.

use std::path::Path;

use contract::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::Origin;

use super::Log;
use super::join::parts_of;
use super::read::read_memories;

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

/// What the nodes remember last of all at or before sample `tick`, in the log at `first` with all parts of its run; empty where it has
/// nothing of it.
///
/// # Errors
/// When no part can be read.
pub fn memories(first: &Path, tick: u64) -> anyhow::Result<Vec<Memory>> {
    let mut newest: Vec<Memory> = vec![];
    let (mut run, mut failed, mut read) = (None, None, 0);
    for part in parts_of(first) {
        let each = |log: &Log, memory: Memory| {
            let at = newest.first().map_or(0, |known| known.tick);
            let is_of_run = *run.get_or_insert_with(|| log.written_by.run.clone()) == log.written_by.run;
            if !is_of_run || memory.tick > tick || memory.tick < at {
                return;
            }
            if memory.tick > at {
                newest.clear();
            }
            if !newest.iter().any(|known| known.topic == memory.topic) {
                newest.push(memory);
            }
        };
        match read_memories(&part, each) {
            Ok(()) => read += 1,
            Err(why) => failed = failed.or(Some(why)),
        }
    }
    match failed {
        Some(why) if read == 0 => Err(why),
        _ => Ok(newest),
    }
}
