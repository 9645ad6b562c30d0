//! Processes that continued without the memory of the process before them: restarted cold.
//!
//! Every message says whose memory its process has restored, so a flight in any mode and its log tell the same.

use contract::topic::Topic;
use flight::event::{Event, TimedEvent, What};
use flight::log::Record;

/// Gathers the cold starts of a flight, message by message.
#[derive(Debug, Clone, Default)]
pub struct ColdStarts {
    /// Newest epoch that has answered, by topic.
    newest: [u64; Topic::COUNT],
    found: Vec<(Topic, u64)>,
}

impl ColdStarts {
    /// Takes in the next message.
    pub fn observe(&mut self, record: &Record) {
        let Some((topic, stamp)) = record.stamped() else { return };
        let newest = &mut self.newest[topic as usize];
        if stamp.epoch <= *newest {
            return;
        }
        if *newest > 0 && stamp.restored_epoch == 0 {
            self.found.push((topic, stamp.epoch));
        }
        *newest = stamp.epoch;
    }

    /// Marks the start events of the processes that began cold.
    pub fn mark(&self, events: &mut [TimedEvent]) {
        for TimedEvent { cold, event, .. } in events.iter_mut().filter(|timed| timed.event.what == What::Started) {
            let is_it =
                |(topic, epoch): &(Topic, u64)| topic.publisher() == event.node && *epoch == u64::from(event.epoch);
            *cold = self.found.iter().any(is_it);
        }
    }

    /// Describes the nodes that were restarted cold, each once; `None` without one. A candidate of a swap was not
    /// restarted.
    pub fn describe(&self, events: &[Event]) -> Option<String> {
        let is_candidate = |topic: Topic, epoch: u64| {
            let began = events.iter().find(|event| event.swap.is_some() && u64::from(event.epoch) == epoch);
            began.is_some_and(|event| event.node == topic.publisher())
        };
        let cold =
            |topic: &Topic| self.found.iter().any(|(found, epoch)| found == topic && !is_candidate(*topic, *epoch));
        let nodes: Vec<&str> = Topic::ALL.into_iter().filter(cold).map(Topic::publisher).collect();
        (!nodes.is_empty()).then(|| format!("{} restarted cold", nodes.join(" and ")))
    }
}

#[cfg(test)]
mod tests {
    use contract::message::{Controls, Message};

    use super::*;

    /// Returns an answer of process `epoch`, which has restored the memory of `restored`.
    fn answer(epoch: u64, restored: u64) -> Record {
        let mut answer = Controls::default();
        (answer.stamp_mut().epoch, answer.stamp_mut().restored_epoch) = (epoch, restored);
        answer.into()
    }

    #[test]
    fn a_process_after_another_without_its_memory_began_cold() {
        let mut starts = ColdStarts::default();
        for (epoch, restored) in [(1, 0), (2, 1), (3, 0), (3, 0)] {
            starts.observe(&answer(epoch, restored));
        }
        let started = |epoch| Event::new(0, "attitude-mpc", epoch, What::Started);
        let events = [2, 3].map(started);
        let mut timed = TimedEvent::all(&events, 100);
        starts.mark(&mut timed);
        assert_eq!([timed[0].cold, timed[1].cold], [false, true]);
        assert_eq!(starts.describe(&events).as_deref(), Some("attitude-mpc restarted cold"));
        assert_eq!(starts.describe(&[started(2), started(3).begins(Some(0))]), None, "it is a candidate");
    }
}
