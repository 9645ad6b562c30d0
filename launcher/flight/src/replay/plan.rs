//! What a replay is to do, and what it came to.

use contract::Topic;
use contract::scenario::Scenario;

use super::fields::Differs;
use super::recording::Recording;

/// Which processes compute, and with which settings.
#[derive(Debug, Clone, Default)]
pub struct Plan {
    /// The only node that computes, where there is one; messages of the others are those of the log.
    pub only: Option<Topic>,
    /// Other settings for the processes of a node.
    pub settings: Option<(Topic, Box<Scenario>)>,
    /// Another program for the processes of a node.
    pub program: Option<(Topic, String)>,
    /// Messages of earlier ticks are not compared. The replay begins where the log last has before it what the nodes remembered.
    pub from: u64,
    /// Cycles after this tick are left out.
    pub until: Option<u64>,
    /// What is called before the active process of a node answers to a tick.
    pub before: Option<(Topic, u64, fn())>,
}

impl Plan {
    /// The settings of a process.
    pub(super) fn settings_of<'a>(&'a self, recording: &'a Recording, topic: Topic, epoch: u64) -> &'a Scenario {
        match &self.settings {
            Some((of, settings)) if *of == topic => settings,
            _ => recording.settings.get(&(topic, epoch)).unwrap_or(&recording.scenario),
        }
    }

    pub(super) fn program_of(&self, topic: Topic) -> Option<&str> {
        self.program.as_ref().filter(|(of, _)| *of == topic).map(|(_, program)| program.as_str())
    }

    /// Whether the processes of a node compute, but for those of another program.
    pub fn covers(&self, topic: Topic) -> bool {
        self.only.is_none_or(|only| only == topic)
    }

    pub(super) fn computes(&self, recording: &Recording, topic: Topic, epoch: u64) -> bool {
        let replaced = self.settings.as_ref().is_some_and(|(of, _)| *of == topic) || self.program_of(topic).is_some();
        self.covers(topic) && (replaced || !recording.foreign.contains(&(topic, epoch)))
    }
}

/// Where a replay and its flight differ first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    pub tick: u64,
    pub topic: Topic,
    pub epoch: u64,
    /// The field, with its value in the flight and in the replay.
    pub differs: Differs,
}

/// What a replay came to.
#[derive(Debug, Clone, Default)]
pub struct Replayed {
    /// Messages by topic.
    pub messages: [Messages; Topic::COUNT],
    /// The first difference of all.
    pub first: Option<Difference>,
    /// Messages that differ, of those compared.
    pub different: u64,
    /// Why it ended before the flight did.
    pub stopped: Option<String>,
    /// The sample after which it began; 0 for the beginning of the flight.
    pub begun_at: u64,
    /// The last sample that was flown.
    pub last_tick: u64,
    /// Whether what [`Plan::before`] names came to pass.
    pub came_to_break: bool,
}

/// Messages of one topic, and what a replay did with them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Messages {
    /// Those in the log.
    pub logged: u64,
    /// Those that the replay sent.
    pub computed: u64,
    /// Of these, the ones held against one of the log.
    pub compared: u64,
    /// Of these, the ones whose bits a fault has flipped, times among them; they are counted and not compared.
    pub flipped: u64,
}

impl Replayed {
    /// Messages computed, of all topics.
    pub fn computed(&self) -> u64 {
        self.messages.iter().map(|of_topic| of_topic.computed).sum()
    }

    /// Messages compared, of all topics.
    pub fn compared(&self) -> u64 {
        self.messages.iter().map(|of_topic| of_topic.compared).sum()
    }
}
