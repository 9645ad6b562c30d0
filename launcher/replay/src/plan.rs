//! Plan of a replay, and its result.

use contract::Topic;
use settings::{ProgramKind, Scenario};

use crate::fields::Differs;
use crate::recording::Recording;

/// Processes that compute in a replay, and their settings.
#[derive(Debug, Clone, Default)]
pub struct ReplayPlan {
    /// Node that computes alone, with the messages of the other nodes from the log; `None` lets all nodes compute.
    pub only: Option<Topic>,
    /// A node, and the settings that its processes get instead of their own, perhaps with another program.
    pub settings: Option<(Topic, Box<Scenario>)>,
    /// First tick to compare. The replay begins at the newest memories of the nodes that the log has before this tick.
    pub from: u64,
    /// Last tick to replay; `None` for the last tick of the flight.
    pub until: Option<u64>,
    /// Function that is called before the active process of a node answers to a tick.
    pub before: Option<(Topic, u64, fn())>,
}

impl ReplayPlan {
    /// Returns the settings of a process.
    pub(super) fn settings_of<'a>(&'a self, recording: &'a Recording, topic: Topic, epoch: u64) -> &'a Scenario {
        match &self.settings {
            Some((of, settings)) if *of == topic => settings,
            _ => recording.settings_of(topic, epoch),
        }
    }

    /// Returns the node that another program with its own `main` runs, with its settings.
    pub(super) fn elsewhere(&self) -> Option<(Topic, &Scenario)> {
        let (topic, settings) = self.settings.as_ref()?;
        (settings.node.of(*topic).kind() == ProgramKind::Executable).then_some((*topic, settings))
    }

    /// Returns whether the processes of a node compute, unless they run another program.
    pub fn covers(&self, topic: Topic) -> bool {
        self.only.is_none_or(|only| only == topic)
    }

    pub(super) fn computes(&self, recording: &Recording, topic: Topic, epoch: u64) -> bool {
        let replaced = self.settings.as_ref().is_some_and(|(of, _)| *of == topic);
        self.covers(topic) && (replaced || !recording.is_foreign(topic, epoch))
    }
}

/// First difference between a replay and its flight.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FirstDifference {
    pub tick: u64,
    pub topic: Topic,
    pub epoch: u64,
    /// Field, with its value in the flight and in the replay.
    pub differs: Differs,
}

/// Result of a replay.
#[derive(Debug, Clone, Default)]
pub struct Replayed {
    /// Messages by the topic of their node: TRUTH counts with STATE.
    pub messages: [ComparedMessages; Topic::COUNT],
    /// First difference, if there is one.
    pub first: Option<FirstDifference>,
    /// Number of compared messages that differ.
    pub different: u64,
    /// Reason why the replay ended before the end of the flight; `None` if it did not.
    pub stopped: Option<String>,
    /// Sample after which the replay began; 0 for the beginning of the flight.
    pub begun_at: u64,
    /// Last sample that was flown.
    pub last_tick: u64,
    /// `true` if [`ReplayPlan::before`] was called.
    pub came_to_break: bool,
}

/// Messages of one node, and what a replay did with them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ComparedMessages {
    /// Messages in the log.
    pub logged: u64,
    /// Messages that the replay sent.
    pub computed: u64,
    /// Messages of `computed` that were compared with a message of the log.
    pub compared: u64,
    /// Messages of `computed` in which a fault flipped bits, perhaps bits of times; they are not compared.
    pub flipped: u64,
}

impl Replayed {
    /// Returns the number of computed messages of all topics.
    pub fn computed(&self) -> u64 {
        self.messages.iter().map(|of_topic| of_topic.computed).sum()
    }

    /// Returns the number of compared messages of all topics.
    pub fn compared(&self) -> u64 {
        self.messages.iter().map(|of_topic| of_topic.compared).sum()
    }
}
