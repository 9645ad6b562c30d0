//! What the controller remembers from tick to tick. Everything else is fixed when it is built.

use airframe::Actuation;
use nalgebra::{DVector, Vector4};

/// The controller's whole memory: a controller that gets a copy of it continues the same flight.
#[derive(Debug, Clone, PartialEq)]
pub struct Memory {
    /// The newest sample used; `None` before the first.
    pub tick: Option<u64>,
    /// The state `x` of that sample, n.
    pub x: DVector<f64>,
    /// Where the controller believes the actuators were at that sample.
    pub actuation: Actuation,
    /// The estimate `d` \[N, N m, N m, N m\].
    pub disturbance: Vector4<f64>,
    /// The demand published last \[N, N m, N m, N m\].
    pub demand: Vector4<f64>,
    /// The last plan that was an optimum inside the set, 4Nu.
    pub plan: DVector<f64>,
    /// The sample it was made for; `None` before the first.
    pub plan_tick: Option<u64>,
    /// Ticks so far on which a solve failed.
    pub fallbacks: u64,
}

impl Memory {
    /// Nothing seen yet: `states` states at hover, actuators at their `trim`, room for a plan of `moves` moves.
    pub fn new(states: usize, trim: Actuation, moves: usize) -> Self {
        Self {
            tick: None,
            x: DVector::zeros(states),
            actuation: trim,
            disturbance: Vector4::zeros(),
            demand: Vector4::zeros(),
            plan: DVector::zeros(4 * moves),
            plan_tick: None,
            fallbacks: 0,
        }
    }

    /// Samples from the newest one used to `tick`: 1 in a flight without gaps, and at the first sample.
    pub fn samples_until(&self, tick: u64) -> u64 {
        self.tick.map_or(1, |last| tick.saturating_sub(last))
    }

    /// Keeps the optimal `plan` of sample `tick`.
    pub fn keep(&mut self, plan: &DVector<f64>, tick: u64) {
        self.plan.copy_from(plan);
        self.plan_tick = Some(tick);
    }

    /// The moves of the kept plan from sample `tick` on; empty when it is used up.
    pub fn rest_of_plan(&self, tick: u64) -> &[f64] {
        let age = self.plan_tick.and_then(|made| tick.checked_sub(made));
        let used = age.map_or(usize::MAX, |age| usize::try_from(age).unwrap_or(usize::MAX));
        self.plan.as_slice().get(used.saturating_mul(4)..).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_used_up_move_by_move() {
        let mut memory = Memory::new(7, Actuation::default(), 2);
        assert!(memory.rest_of_plan(0).is_empty());
        memory.keep(&DVector::from_fn(8, |i, _| i as f64), 10);
        assert_eq!(memory.rest_of_plan(10).len(), 8);
        assert_eq!(memory.rest_of_plan(11), [4.0, 5.0, 6.0, 7.0]);
        for tick in [12, 13, u64::MAX, 9] {
            assert!(memory.rest_of_plan(tick).is_empty(), "sample {tick}");
        }
    }

    #[test]
    fn gaps_are_counted_in_samples() {
        let mut memory = Memory::new(7, Actuation::default(), 1);
        assert_eq!(memory.samples_until(500), 1);
        memory.tick = Some(500);
        assert_eq!([500, 501, 504, 3].map(|tick| memory.samples_until(tick)), [0, 1, 4, 0]);
    }
}
