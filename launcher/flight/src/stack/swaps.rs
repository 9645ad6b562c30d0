//! Times that the swaps of a flight in real time took.
//!
//! A trial begins when the candidate is ready, and ends early if it is rejected or returned, so the times of a swap
//! differ from those in the settings. The `scenario.toml` of the run's folder has the times that each swap took; a new
//! order must not overlap them.

use contract::topic::Topic;
use settings::{Scenario, Swap};

use crate::event::{Event, What};
use crate::swap_story::SwapStory;

/// Sets each swap to the times that it took by the `events`. A swap that would overlap an earlier swap of its node is
/// moved behind the earlier swap.
pub fn settle(scenario: &mut Scenario, events: &[Event]) {
    let (sample_s, rate_hz) = (scenario.sample_s(), f64::from(scenario.run.rate_hz));
    let swaps = &mut scenario.swap;
    for (number, swap) in swaps.iter_mut().enumerate() {
        note(swap, number, events, rate_hz);
    }
    let mut in_order: Vec<&mut Swap> = swaps.iter_mut().collect();
    in_order.sort_by_key(|swap| swap.ticks(sample_s).from);
    let mut free = [0; Topic::COUNT];
    for swap in in_order {
        let free = &mut free[swap.node as usize];
        if swap.ticks(sample_s).from < *free {
            swap.at_s = *free as f64 / rate_hz;
        }
        *free = swap.ticks(sample_s).until + 1;
    }
}

/// Sets swap `number` of a node to the times that it took, as far as the events tell them.
fn note(swap: &mut Swap, number: usize, events: &[Event], rate_hz: f64) {
    let Some(story) = SwapStory::of(events, number) else { return };
    let tick = |what: &[What]| story.first(what).map(|event| event.tick);
    let from = tick(&[What::OnStandby]).unwrap_or(story.begun.tick);
    swap.at_s = from as f64 / rate_hz;
    if let Some(until) = tick(&[What::Kept, What::Rejected, What::Returned]) {
        let hand_over = tick(&[What::TookOver]).unwrap_or(until);
        swap.standby_s = hand_over.saturating_sub(from) as f64 / rate_hz;
        swap.watch_s = until.saturating_sub(hand_over) as f64 / rate_hz;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::{check_swaps, load};

    /// Returns the times of swaps of the mixer `at_s`, settled by the `events` (tick, epoch, what, swap).
    fn settled(at_s: &[f64], events: &[(u64, u32, What, Option<usize>)]) -> Vec<[f64; 3]> {
        let mut scenario = load(None, &[]).unwrap();
        scenario.swap = at_s.iter().map(|at_s| Swap::new(Topic::Actuators, *at_s)).collect();
        let one = |(tick, epoch, what, swap)| Event::new(tick, "mixer", epoch, what).begins(swap);
        settle(&mut scenario, &events.iter().copied().map(one).collect::<Vec<_>>());
        check_swaps(&scenario).unwrap();
        scenario.swap.iter().map(|swap| [swap.at_s, swap.standby_s, swap.watch_s]).collect()
    }

    #[test]
    fn a_swap_that_is_over_has_the_times_it_took() {
        use What::{Died, Kept, OnStandby, Rejected, Returned, Started, TookOver};
        let begun = [(100, 2, Started, Some(0)), (110, 2, OnStandby, None)];
        let kept = [&begun[..], &[(212, 2, TookOver, None), (515, 2, Kept, None)]].concat();
        assert_eq!(settled(&[1.0], &kept), [[1.1, 1.02, 3.03]]);
        let rejected = [&begun[..], &[(114, 2, Rejected, None)]].concat();
        assert_eq!(settled(&[1.0], &rejected), [[1.1, 0.04, 0.0]]);
        let returned = [&begun[..], &[(212, 2, TookOver, None), (220, 2, Returned, None), (221, 1, TookOver, None)]];
        assert_eq!(settled(&[1.0], &returned.concat()), [[1.1, 1.02, 0.08]]);
        let never_ready = [begun[0], (101, 2, Died, None), (101, 2, Rejected, None)];
        assert_eq!(settled(&[1.0], &never_ready), [[1.0, 0.01, 0.0]]);
        assert_eq!(settled(&[1.0], &[(100, 1, Rejected, Some(0))]), [[1.0, 0.0, 0.0]], "nobody to take over from");
        assert_eq!(settled(&[1.0], &begun), [[1.1, 1.0, 3.0]], "still under way");
    }

    #[test]
    fn a_swap_that_has_to_wait_moves_behind_the_others() {
        assert_eq!(settled(&[6.0, 1.0], &[]), [[6.0, 1.0, 3.0], [1.0, 1.0, 3.0]]);
        let late = [(600, 2, What::Started, Some(0)), (630, 2, What::OnStandby, None)];
        assert_eq!(settled(&[6.0, 10.1, 14.2], &late), [[6.3, 1.0, 3.0], [10.31, 1.0, 3.0], [14.32, 1.0, 3.0]]);
    }
}
