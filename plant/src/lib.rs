//! The vehicle: six degrees of freedom, actuators, wind, sensors (7)-(22).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`dynamics`] | forces, moments, equations of motion | (7)-(22) |
//! | [`integrator`] | one Runge-Kutta step | |
//! | [`commands`] | delay, jitter and loss between mixer and actuators; the cut when none comes | |
//! | [`schedule`] | wind and disturbance as steps in time | |
//! | [`sensors`] | measurement noise | |
//! | [`faults`] | faults of sensors, actuators, air and payload | |
//! | [`random`] | the random streams | |
//!
//! ```text
//!  sample() -> STATE at t_k          command(..): ACTUATORS arrive, any number of times          advance(1)
//!     |--------------------------------------|-----------------------------------------------------|
//!    t_k                                                                                        t_k+1
//! ```
//!
//! The state is the paper's: Euler angles, with their singularity at 90 degrees of pitch. The integration stops before
//! it, and wherever else the state diverges (see [`PlantStatus`]); from then on time passes and nothing moves.

pub mod commands;
pub mod dynamics;
pub mod faults;
pub mod integrator;
mod process;
pub mod random;
pub mod schedule;
pub mod sensors;

use airframe::{Actuation, Trim};
use contract::Scenario;
use contract::message::{Actuators, Kinematics, PlantStatus, Stamp, State};
use contract::scenario::Fault;

use commands::CommandLine;
use dynamics::{Dynamics, StateVector};
use faults::Faults;
pub use process::run;
use schedule::Schedule;
use sensors::Sensors;

/// Largest position on any axis \[m\]: far beyond every mission.
const MAX_POSITION_M: f64 = 500.0;
/// Largest pitch angle either way \[rad\]: the Euler angles of (8) are singular at 1.571.
const MAX_PITCH_RAD: f64 = 1.55;
/// Largest body rate on any axis \[rad/s\]: sixteen turns a second.
const MAX_RATE_RADPS: f64 = 100.0;

/// The flying vehicle, from sample to sample.
#[derive(Debug, Clone)]
pub struct Plant {
    dynamics: Dynamics,
    schedule: Schedule,
    commands: CommandLine,
    sensors: Sensors,
    faults: Faults,
    sample_ns: u64,
    substep_ns: u64,
    last_tick: u64,
    tick: u64,
    x: StateVector,
    /// Why the integration stopped, if it did.
    diverged: Option<PlantStatus>,
}

impl Plant {
    /// The vehicle of `scenario` at its own hover trim, displaced by `[initial]`, with the trim command in force.
    pub fn new(scenario: &Scenario) -> Self {
        let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction);
        let initial = &scenario.initial;
        let [roll, pitch, yaw] = initial.attitude_deg.map(f64::to_radians);
        let motion = Kinematics {
            position_m: initial.position_m,
            velocity_mps: initial.velocity_mps,
            attitude_rad: [trim.roll_rad + roll, pitch, yaw],
            rates_radps: initial.rates_radps,
        };
        let x = dynamics::assemble(&motion, &trim.actuation);
        Self {
            dynamics: Dynamics::new(scenario),
            schedule: Schedule::new(scenario),
            commands: CommandLine::new(scenario, trim.actuation),
            sensors: Sensors::new(scenario),
            faults: Faults::new(scenario),
            sample_ns: scenario.sample_ns(),
            substep_ns: scenario.substep_ns(),
            last_tick: scenario.ticks(),
            tick: 0,
            x,
            diverged: divergence(&x),
        }
    }

    /// Takes fault `number` as it is from now on, if it is one of sensors, actuators, air or payload.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault);
    }

    /// STATE at the present instant; every call is a measurement of its own and draws its own noise.
    ///
    /// The command it names is the one in force up to this instant, not one that takes effect at it.
    pub fn sample(&mut self) -> State {
        let actual = dynamics::kinematics(&self.x);
        let mut measured = self.sensors.measure(&actual);
        self.faults.sensors.inject(self.tick, &mut measured);
        let command = self.commands.in_force();
        State {
            stamp: Stamp { tick: self.tick, ..Stamp::default() },
            applied_sequence: command.sequence,
            applied_age_ns: command.age_ns,
            measured,
            actual,
            actuators: dynamics::actuation(&self.x).into(),
            command_in_force: command.actuation.into(),
            status: self.status() as u64,
        }
    }

    /// A command arrives `arrival_ns` after the present sample, be it within the coming period or beyond it.
    pub fn command(&mut self, actuators: &Actuators, arrival_ns: u64) {
        self.commands.receive(actuators, self.now_ns().saturating_add(arrival_ns));
    }

    /// Flies on to the sample `periods` later.
    ///
    /// Every step ends at the next multiple of the substep, or where the command in force changes, whichever is first.
    pub fn advance(&mut self, periods: u64) -> PlantStatus {
        let mut now_ns = self.now_ns();
        self.tick += periods;
        while now_ns < self.now_ns() && self.diverged.is_none() {
            self.commands.switch(now_ns);
            let substep_ns = (now_ns / self.substep_ns + 1) * self.substep_ns;
            let until_ns = substep_ns.min(self.commands.next_switch_ns()).min(self.now_ns());
            self.integrate(now_ns, until_ns);
            now_ns = until_ns;
        }
        self.status()
    }

    fn integrate(&mut self, from_ns: u64, until_ns: u64) {
        let position = dynamics::actuation(&self.x);
        let (command, condition) = self.faults.actuators.inject(from_ns / self.sample_ns, &position, &self.demand());
        let scheduled = self.schedule.at(from_ns);
        let dt_s = (until_ns - from_ns) as f64 / 1e9;
        self.x = integrator::step(&self.x, dt_s, |t_s, x| {
            let outside = self.faults.environment.inject(from_ns, t_s, &scheduled);
            self.dynamics.derivative(x, &command, &condition, &outside)
        });
        self.diverged = divergence(&self.x);
    }

    /// What the motor controllers and the servo are to follow: the command in force within the limits, which hold for
    /// commands and not for a cut.
    fn demand(&self) -> Actuation {
        let command = self.commands.in_force();
        let clipped = self.dynamics.clip(&command.actuation);
        if command.cut { Actuation { rotor_speed: [0.0; 3], ..clipped } } else { clipped }
    }

    fn now_ns(&self) -> u64 {
        self.tick * self.sample_ns
    }

    fn status(&self) -> PlantStatus {
        let in_time = if self.tick < self.last_tick { PlantStatus::Flying } else { PlantStatus::Finished };
        self.diverged.unwrap_or(in_time)
    }
}

/// Which bound of the simulation the state `x` is beyond, if any.
fn divergence(x: &StateVector) -> Option<PlantStatus> {
    let Kinematics { position_m, attitude_rad: [_, theta, _], rates_radps, .. } = dynamics::kinematics(x);
    if !x.iter().all(|value| value.is_finite()) {
        Some(PlantStatus::NonFinite)
    } else if position_m.iter().any(|value| value.abs() > MAX_POSITION_M) {
        Some(PlantStatus::TooFar)
    } else if theta.abs() > MAX_PITCH_RAD {
        Some(PlantStatus::Singular)
    } else if rates_radps.iter().any(|value| value.abs() > MAX_RATE_RADPS) {
        Some(PlantStatus::TooFast)
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
