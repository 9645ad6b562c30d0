//! Node in the place of guidance that holds the references of the hover, so that the attitude loop flies alone.

use airframe::Trim;
use contract::message::{Reference, State};
use contract::snapshot::{NO_MEMORY, Snapshot};
use guidance::rates::body_rates;
use nalgebra::Vector3;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::{Core, Open, open};
use settings::{RateReference, Scenario};

use super::small::SMALL;

/// Sample at which the references step.
pub const STEP_TICK: u64 = 1;

/// Functions that open the node with a step of the reference of w, phi, theta or psi.
pub const STEPS: [Open; 4] = [open::<Held<0>>, open::<Held<1>>, open::<Held<2>>, open::<Held<3>>];
/// Function that opens the node without a step.
pub const HELD: Open = open::<Held<4>>;

/// References of the hover. Number `STEPPED` of w, phi, theta and psi steps; none if it is 4.
struct Held<const STEPPED: usize> {
    /// References before, at and after the step. At the step the rate reference matches the change of the angle, if
    /// `guidance.rate_reference` is `difference`.
    course: [Reference; 3],
}

impl<const STEPPED: usize> Core for Held<STEPPED> {
    type Inputs = Input<State>;
    type Answer = Reference;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        let roll_rad = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction).roll_rad;
        let before = Reference { attitude_rad: [roll_rad, 0.0, 0.0], ..Reference::default() };
        let (mut at, mut after) = (before, before);
        if let Some(turned) = STEPPED.checked_sub(1).filter(|angle| *angle < 3) {
            after.attitude_rad[turned] += SMALL;
            if scenario.guidance.rate_reference == RateReference::Difference {
                let euler_rates = Vector3::ith(turned, SMALL / scenario.sample_s());
                at.rates_radps = body_rates(&euler_rates, &before.attitude_rad.into()).into();
            }
        } else if STEPPED == 0 {
            after.w_mps += SMALL;
        }
        at = Reference { rates_radps: at.rates_radps, ..after };
        Ok(Self { course: [before, at, after] })
    }

    fn step(&mut self, tick: u64, _: &Self::Inputs) -> Result<Reference, SessionError> {
        let [before, at, after] = self.course;
        Ok(match tick {
            STEP_TICK => at,
            tick if tick < STEP_TICK => before,
            _ => after,
        })
    }

    fn snapshot(&self) -> Snapshot {
        NO_MEMORY
    }

    fn restore(&mut self, _: &Snapshot) -> bool {
        false
    }
}
