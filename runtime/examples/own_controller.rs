//! A controller of your own in place of attitude-mpc: one PD law per axis, with everything that a process needs.
//!
//! ```text
//! cargo build --release --workspace --example own_controller
//! launcher swap attitude-mpc --exec target/release/examples/own_controller        while a flight is under way
//! ```

use std::process::ExitCode;

use contract::message::{Controls, Reference, SolveStatus, State};
use contract::snapshot::SNAPSHOT_WORDS;
use runtime::process;
use runtime::session::{NodeSession, SessionError};

/// Double pole of each attitude loop \[rad/s\].
const ATTITUDE_POLE: f64 = 6.0;
/// Pole of the climb \[rad/s\].
const CLIMB_POLE: f64 = 4.0;

fn main() -> ExitCode {
    process::main("attitude-mpc", fly)
}

/// Answers every sample with CONTROLS until the run is over, or another process is active.
fn fly(mut session: NodeSession) -> Result<(), SessionError> {
    let mut states = session.input::<State>()?;
    let mut references = session.input::<Reference>()?;
    let mut controls = session.output::<Controls>()?;
    let vehicle = session.scenario.airframe;
    let inertia = [vehicle.mass_kg, vehicle.iyy_kgm2, vehicle.ixx_kgm2, vehicle.izz_kgm2];
    let nothing_to_remember = [0; SNAPSHOT_WORDS]; // no node accepts this as a snapshot
    let mut cycles = session.ready()?;
    while let Some(tick) = cycles.next(&mut references)? {
        let (reference, state) = (references.newest(), states.newest());
        let fresh = state.stamp.sequence > 0 && state.stamp.tick >= tick;
        let status = if fresh { SolveStatus::Explicit } else { SolveStatus::Stale }; // the mixer ignores stale ones
        let answer =
            Controls { demand: demand(inertia, state, reference), status: status as u64, ..Controls::default() };
        controls.send(answer, cycles.provenance(tick).with(reference).with(state));
        cycles.done(tick, &nothing_to_remember);
    }
    Ok(())
}

/// Demand of col, lon, lat, ped as deviations from trim \[N, N m, N m, N m\].
fn demand(inertia: [f64; 4], state: &State, reference: &Reference) -> [f64; 4] {
    let body = &state.measured;
    let turn = |axis: usize| {
        let error_rad = reference.attitude_rad[axis] - body.attitude_rad[axis];
        let error_radps = reference.rates_radps[axis] - body.rates_radps[axis];
        ATTITUDE_POLE * ATTITUDE_POLE * error_rad + 2.0 * ATTITUDE_POLE * error_radps
    };
    let wanted = [CLIMB_POLE * (reference.w_mps - body.velocity_mps[2]), turn(1), turn(0), turn(2)];
    std::array::from_fn(|i| inertia[i] * wanted[i])
}
