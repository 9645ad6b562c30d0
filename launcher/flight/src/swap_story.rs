//! The swaps of a flight, read from its events: how each began, how it ended, and whether its candidate stayed.

use settings::{Scenario, Swap};

use crate::event::{Event, What};

/// The course of one swap.
pub struct SwapStory<'a> {
    /// Event with which the swap began.
    pub begun: &'a Event,
    /// Events from `begun` on, including those of other processes.
    since: &'a [Event],
}

impl<'a> SwapStory<'a> {
    /// Finds swap `number` in `events`; `None` if the swap has not begun.
    pub fn of(events: &'a [Event], number: usize) -> Option<Self> {
        let first = events.iter().position(|event| event.swap == Some(number))?;
        Some(Self { begun: &events[first], since: &events[first..] })
    }

    /// Returns the candidate's first event of a kind in `what`.
    pub fn first(&self, what: &[What]) -> Option<&'a Event> {
        self.since.iter().find(|event| self.is_of_candidate(event) && what.contains(&event.what))
    }

    /// Returns the event that ended the swap: the candidate was kept, rejected or returned, or the node was given up;
    /// `None` while the swap goes on.
    pub fn end(&self) -> Option<&'a Event> {
        let is_end = |event: &Event| stayed(event) || matches!(event.what, What::Rejected | What::Returned);
        let given_up = |event: &Event| event.node == self.begun.node && event.what == What::GivenUp;
        self.since.iter().find(|event| self.is_of_candidate(event) && is_end(event) || given_up(event))
    }

    fn is_of_candidate(&self, event: &Event) -> bool {
        event.node == self.begun.node && event.epoch == self.begun.epoch
    }
}

/// Returns whether the event says that its candidate stays.
pub fn stayed(event: &Event) -> bool {
    event.what == What::Kept
}

/// A swap of the settings whose candidate did not stay.
pub struct FailedSwap<'a> {
    pub swap: &'a Swap,
    /// Event that ended the swap, with the reason; `None` if the flight ended first.
    end: Option<&'a Event>,
    has_begun: bool,
}

impl<'a> FailedSwap<'a> {
    /// Finds all failed swaps of a flight of `scenario` with these `events`.
    pub fn all(scenario: &'a Scenario, events: &'a [Event]) -> Vec<Self> {
        let failed = |(number, swap)| {
            let story = SwapStory::of(events, number);
            let end = story.as_ref().and_then(SwapStory::end);
            (!end.is_some_and(stayed)).then_some(Self { swap, end, has_begun: story.is_some() })
        };
        scenario.swap.iter().enumerate().filter_map(failed).collect()
    }

    /// Returns the end of the swap in words.
    pub fn name(&self) -> &'static str {
        match self.end.map(|end| end.what) {
            Some(What::Returned) => "was returned",
            Some(What::GivenUp) => "was given up",
            Some(_) => "was rejected",
            None if self.has_begun => "was not decided before the flight ended",
            None => "did not begin before the flight ended",
        }
    }

    /// Describes the swap, its end, and the reason.
    pub fn describe(&self) -> String {
        let why = self.end.and_then(|end| end.why.as_ref()).map_or(String::new(), |why| format!(": {why}"));
        format!("the swap of {} at {:.2} s {}{why}", self.swap.node.publisher(), self.swap.at_s, self.name())
    }
}

/// Returns for each of the `events` whether it is about a candidate: a process that a swap started and that is not kept
/// yet.
pub fn of_candidates(events: &[Event]) -> Vec<bool> {
    let is_of_candidate = |(i, event): (usize, &Event)| {
        let same = |other: &&Event| other.node == event.node && other.epoch == event.epoch;
        let began = |other: &Event| other.swap.is_some() && other.what == What::Started;
        events[..=i].iter().filter(same).any(began) && !events[..i].iter().filter(same).any(stayed)
    };
    events.iter().enumerate().map(is_of_candidate).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use What::{Died, GivenUp, Kept, OnStandby, Rejected, Returned, Started, TookOver};
    use settings::load;

    fn event(node: &str, (epoch, what, swap): (u32, What, Option<usize>)) -> Event {
        Event::new(100, node, epoch, what).begins(swap)
    }

    #[test]
    fn a_swap_ends_with_its_own_candidate() {
        let told = |node: &str, events: &[(u32, What, Option<usize>)]| {
            let events: Vec<Event> = events.iter().map(|one| event(node, *one)).collect();
            SwapStory::of(&events, 1).and_then(|story| story.end().map(|end| end.what))
        };
        let before = [(2, Kept, None), (3, Started, Some(0)), (3, Rejected, None)];
        assert_eq!(told("mixer", &before), None, "another swap's");
        let begun = [&before[..], &[(4, Started, Some(1)), (1, Died, None), (4, TookOver, None)]].concat();
        assert_eq!(told("mixer", &begun), None);
        let over = [&begun[..], &[(4, Returned, None), (5, Started, Some(2)), (5, Kept, None)]].concat();
        assert_eq!(told("mixer", &over), Some(Returned));
        assert_eq!(told("mixer", &[&begun[..], &[(5, GivenUp, None)]].concat()), Some(GivenUp));
    }

    #[test]
    fn a_swap_fails_unless_its_candidate_stayed() {
        let swap = |node: &str, at_s: f64| format!("{{at_s={at_s}, node='{node}'}}");
        let swaps = [swap("mixer", 1.0), swap("guidance", 1.0), swap("attitude-mpc", 1.0), swap("mixer", 9.0)];
        let scenario = load(None, &[format!("swap=[{}]", swaps.join(", "))]).unwrap();
        let events = [
            event("mixer", (2, Started, Some(0))),
            event("guidance", (2, Started, Some(1))),
            event("attitude-mpc", (2, Started, Some(2))),
            event("guidance", (2, Rejected, None)).because("no answer at 1.02 s"),
            event("mixer", (2, TookOver, None)),
            event("mixer", (2, Kept, None)),
        ];
        let told: Vec<String> = FailedSwap::all(&scenario, &events).iter().map(FailedSwap::describe).collect();
        let expected = [
            "the swap of guidance at 1.00 s was rejected: no answer at 1.02 s",
            "the swap of attitude-mpc at 1.00 s was not decided before the flight ended",
            "the swap of mixer at 9.00 s did not begin before the flight ended",
        ];
        assert_eq!(told, expected);
    }

    #[test]
    fn a_process_is_a_candidate_until_it_is_kept() {
        let story = [(1, Died, None), (2, Started, None), (3, Started, Some(0)), (3, OnStandby, None), (2, Died, None)];
        let rest = [(3, TookOver, None), (3, Kept, None), (3, Died, None), (4, Started, Some(1)), (4, Died, None)];
        let events: Vec<Event> = story.iter().chain(&rest).map(|one| event("mixer", *one)).collect();
        let expected = [false, false, true, true, false, true, true, false, true, true];
        assert_eq!(of_candidates(&events), expected);
    }
}
