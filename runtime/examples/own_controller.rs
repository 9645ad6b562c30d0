//! A controller of your own in place of attitude-mpc: one PD law per axis, with everything that a process needs.
//!
//! ```text
//! cargo build --release --workspace --example own_controller
//! trefoil swap attitude-mpc --exec target/release/examples/own_controller        while a flight is under way
//! ```

use std::process::ExitCode;

use airframe::Parameters;
use contract::message::{Controls, Reference, SolveStatus, State};
use contract::snapshot::{NO_MEMORY, Snapshot};
use runtime::input::Input;
use runtime::node::{self, Core};
use runtime::process;
use runtime::session::SessionError;
use settings::Scenario;

/// Double pole of each attitude loop \[rad/s\].
const ATTITUDE_POLE: f64 = 6.0;
/// Pole of the climb \[rad/s\].
const CLIMB_POLE: f64 = 4.0;

fn main() -> ExitCode {
    process::main("attitude-mpc", |session| node::run(session, node::open::<PdController>))
}

/// One PD law per axis.
struct PdController {
    /// Mass, then the moments of inertia about y, x, z, in the order of the demand \[kg, kg m2\].
    inertia: [f64; 4],
}

impl Core for PdController {
    type Inputs = (Input<Reference>, Input<State>);
    type Answer = Controls;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        let Parameters { mass_kg, ixx_kgm2, iyy_kgm2, izz_kgm2, .. } = scenario.airframe;
        Ok(Self { inertia: [mass_kg, iyy_kgm2, ixx_kgm2, izz_kgm2] })
    }

    fn step(&mut self, tick: u64, (references, states): &Self::Inputs) -> Result<Controls, SessionError> {
        let (reference, state) = (references.known(), states.known());
        let fresh = state.stamp.sequence > 0 && state.stamp.tick >= tick;
        let status = if fresh { SolveStatus::Explicit } else { SolveStatus::Stale }; // the mixer ignores stale demands
        Ok(Controls { demand: self.demand(state, reference), status: status as u64, ..Controls::default() })
    }

    /// Keeps no memory: the next process begins cold.
    fn snapshot(&self) -> Snapshot {
        NO_MEMORY
    }

    fn restore(&mut self, _memory: &Snapshot) -> bool {
        false
    }
}

impl PdController {
    /// Demand of col, lon, lat, ped as deviations from trim \[N, N m, N m, N m\].
    fn demand(&self, state: &State, reference: &Reference) -> [f64; 4] {
        let body = &state.measured;
        let turn = |axis: usize| {
            let error_rad = reference.attitude_rad[axis] - body.attitude_rad[axis];
            let error_radps = reference.rates_radps[axis] - body.rates_radps[axis];
            ATTITUDE_POLE * ATTITUDE_POLE * error_rad + 2.0 * ATTITUDE_POLE * error_radps
        };
        let wanted = [CLIMB_POLE * (reference.w_mps - body.velocity_mps[2]), turn(1), turn(0), turn(2)];
        std::array::from_fn(|i| self.inertia[i] * wanted[i])
    }
}
