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
    /// Integrals of the PID's errors: of w \[m\], theta, phi, psi \[rad s\].
    pub integral: Vector4<f64>,
    /// The plan published last, 4Nu: inside the set.
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
            integral: Vector4::zeros(),
            plan: DVector::zeros(4 * moves),
            plan_tick: None,
            fallbacks: 0,
        }
    }

    /// Samples from the newest one used to `tick`: 1 in a flight without gaps, and at the first sample.
    pub fn samples_until(&self, tick: u64) -> u64 {
        self.tick.map_or(1, |last| tick.saturating_sub(last))
    }

    /// Keeps the `plan` of sample `tick`.
    pub fn keep(&mut self, plan: &DVector<f64>, tick: u64) {
        self.plan.copy_from(plan);
        self.plan_tick = Some(tick);
    }

    /// Writes the moves of the kept plan from sample `tick` on, the last one held as the plan assumes; hover when there
    /// is none.
    pub fn rest_of_plan(&self, tick: u64, rest: &mut DVector<f64>) {
        let Some(age) = self.plan_tick.and_then(|made| tick.checked_sub(made)) else {
            rest.fill(0.0);
            return;
        };
        let moves = self.plan.len() / 4;
        for k in 0..moves {
            let from = usize::try_from(age).map_or(moves, |age| k.saturating_add(age)).min(moves - 1);
            rest.fixed_rows_mut::<4>(4 * k).copy_from(&self.plan.fixed_rows::<4>(4 * from));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_used_up_move_by_move() {
        let mut memory = Memory::new(7, Actuation::default(), 2);
        let rest = |memory: &Memory, tick| {
            let mut rest = DVector::from_element(8, f64::NAN);
            memory.rest_of_plan(tick, &mut rest);
            rest.as_slice().to_vec()
        };
        assert_eq!(rest(&memory, 0), [0.0; 8]);
        memory.keep(&DVector::from_fn(8, |i, _| i as f64), 10);
        assert_eq!(rest(&memory, 10), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
        for tick in [11, 12, 13, u64::MAX] {
            assert_eq!(rest(&memory, tick), [4.0, 5.0, 6.0, 7.0, 4.0, 5.0, 6.0, 7.0], "sample {tick}");
        }
        assert_eq!(rest(&memory, 9), [0.0; 8], "a plan of the future is none");
    }

    #[test]
    fn gaps_are_counted_in_samples() {
        let mut memory = Memory::new(7, Actuation::default(), 1);
        assert_eq!(memory.samples_until(500), 1);
        memory.tick = Some(500);
        assert_eq!([500, 501, 504, 3].map(|tick| memory.samples_until(tick)), [0, 1, 4, 0]);
    }
}
