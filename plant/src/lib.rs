//! Simulated vehicle: six degrees of freedom, actuators, wind, sensors (7)-(22).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`dynamics`] | forces, moments, equations of motion | (7)-(22) |
//! | [`rotors`] | thrust, torque and angular momentum of the rotors | (15)-(22) |
//! | [`battery`] | voltage, and its effect on commands | |
//! | [`ground`] | forces on the feet, crash and tip-over | |
//! | [`landing`] | true take-off and landing | |
//! | [`integrator`] | one Runge-Kutta step | |
//! | [`commands`] | delay, jitter and loss between mixer and actuators; the cut without commands | |
//! | [`schedule`] | wind and disturbance as steps in time | |
//! | [`turbulence`] | continuous gusts, and the mean wind over the height | |
//! | [`sensors`] | measurements: errors, rates, latencies | |
//! | [`filter`] | the complementary filter behind the sensors | |
//! | [`faults`] | faults of sensors, actuators, air and payload | |
//! | [`random`] | the random streams | |
//! | [`memory`] | state of the vehicle as words | |
//!
//! ```text
//!  sample() -> STATE at t_k          command(..): ACTUATORS arrive, any number of times          advance(1)
//!     |--------------------------------------|-----------------------------------------------------|
//!    t_k                                                                                        t_k+1
//! ```
//!
//! The attitude is a quaternion; only messages have Euler angles. If the state diverges (see [`PlantStatus`]) the
//! integration stops: time goes on, and the state no longer changes.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod battery;
pub mod commands;
pub mod dynamics;
pub mod faults;
pub mod filter;
pub mod ground;
pub mod integrator;
pub mod landing;
pub mod memory;
mod process;
pub mod random;
pub mod rotors;
pub mod schedule;
pub mod sensors;
pub mod turbulence;

use airframe::{Actuation, Trim};
use contract::Scenario;
use contract::message::{Actuators, Arrival, Kinematics, MAX_ARRIVALS, PlantStatus, Stamp, State};
use contract::scenario::Fault;
use contract::snapshot::PLANT_WORDS;

use battery::Battery;
use commands::CommandLine;
use dynamics::{Dynamics, StateVector};
use faults::Faults;
use landing::Landing;
use memory::Tape;
pub use process::run;
use schedule::Schedule;
use sensors::Sensors;
use turbulence::{Moment, Turbulence};

/// Largest position on any axis \[m\], far beyond every mission.
const MAX_POSITION_M: f64 = 500.0;
/// Largest body rate on any axis \[rad/s\], sixteen turns a second.
const MAX_RATE_RADPS: f64 = 100.0;

/// Simulated vehicle, advanced from sample to sample.
#[derive(Debug, Clone)]
pub struct Plant {
    dynamics: Dynamics,
    schedule: Schedule,
    turbulence: Option<Turbulence>,
    wind_roughness_m: f64,
    height_zero_m: f64,
    battery: Option<Battery>,
    /// Take-off and landing; `None` without a ground.
    landing: Option<Landing>,
    commands: CommandLine,
    /// Arrivals of commands since the present sample, and their number.
    arrivals: ([Arrival; MAX_ARRIVALS], usize),
    /// Arrivals between the sample before and the present one, and their number.
    arrived: ([Arrival; MAX_ARRIVALS], usize),
    sensors: Sensors,
    faults: Faults,
    sample_ns: u64,
    substep_ns: u64,
    last_tick: u64,
    tick: u64,
    x: StateVector,
    /// Reason for which the integration stopped, if it did.
    diverged: Option<PlantStatus>,
}

impl Plant {
    /// Builds the vehicle of `scenario` at the hover trim of `[airframe]`, or standing with idle rotors, displaced by
    /// `[initial]`. The command in force holds its actuators.
    pub fn new(scenario: &Scenario) -> Self {
        let trim = Trim::solve(&scenario.airframe, scenario.plant.tilt_reaction);
        let initial = &scenario.initial;
        let [roll, pitch, yaw] = initial.attitude_deg.map(f64::to_radians);
        let (rest_rad, actuation) = if initial.standing {
            (0.0, Actuation { rotor_speed: [scenario.idle_speed(); 3], ..trim.actuation })
        } else {
            (trim.roll_rad, trim.actuation)
        };
        let motion = Kinematics {
            position_m: initial.position_m,
            velocity_mps: initial.velocity_mps,
            attitude_rad: [rest_rad + roll, pitch, yaw],
            rates_radps: initial.rates_radps,
        };
        let x = dynamics::assemble(&motion, &actuation);
        Self {
            dynamics: Dynamics::new(scenario),
            schedule: Schedule::new(scenario),
            turbulence: Turbulence::new(scenario),
            wind_roughness_m: scenario.plant.wind_roughness_m,
            height_zero_m: scenario.plant.height_zero_m(),
            battery: Battery::new(scenario),
            landing: Landing::new(scenario),
            commands: CommandLine::new(scenario, actuation),
            arrivals: Default::default(),
            arrived: Default::default(),
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

    /// Updates fault `number` if it is a fault of sensors, actuators, wind or payload.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.faults.apply_fault(number, fault);
    }

    /// Writes the memory after the newest sample into `words`. Returns `false` if it does not fit, if the vehicle has
    /// diverged, or if a sensor fault has changed measurements of the recent past that a delayed sensor may need.
    pub fn memory(&mut self, words: &mut [u64; PLANT_WORDS]) -> bool {
        *words = [0; PLANT_WORDS];
        let mut tape = Tape::to_write(words);
        self.remember(&mut tape);
        tape.fits() && self.diverged.is_none()
    }

    /// Continues from a memory of a vehicle of the same scenario after sample `tick`. Returns `false`, and changes
    /// nothing, if `words` is not such a memory. [Recalled](Self::recall) samples are kept.
    pub fn restore(&mut self, tick: u64, words: &[u64; PLANT_WORDS]) -> bool {
        let (mut words, mut restored) = (*words, Self { tick, ..self.clone() });
        let mut tape = Tape::to_read(&mut words);
        restored.remember(&mut tape);
        let fits = tape.fits() && restored.tick == tick && divergence(&restored.x).is_none();
        if fits {
            *self = restored;
        }
        fits
    }

    /// Stores a sample that was published before the memory to continue from; delayed sensors need it.
    pub fn recall(&mut self, returned: &State) {
        self.faults.sensors.recall(returned.stamp.tick, &returned.measured);
    }

    fn remember(&mut self, tape: &mut Tape) {
        tape.word(&mut self.tick);
        tape.numbers(&mut self.x);
        for (arrivals, arrived) in [&mut self.arrivals, &mut self.arrived] {
            tape.count(arrived, MAX_ARRIVALS);
            for Arrival { sequence, epoch, after_ns } in arrivals {
                for word in [sequence, epoch, after_ns] {
                    tape.word(word);
                }
            }
        }
        self.battery.iter_mut().for_each(|battery| battery.remember(tape));
        self.landing.iter_mut().for_each(|landing| landing.remember(tape));
        self.turbulence.iter_mut().for_each(|turbulence| turbulence.remember(tape, self.tick));
        self.commands.remember(tape);
        self.sensors.remember(tape);
        self.faults.sensors.remember(tape, self.tick);
        self.faults.actuators.remember(tape);
    }

    /// Measures STATE at the present instant; every call draws new noise.
    ///
    /// STATE names the command in force up to this instant, not one that takes effect at it.
    pub fn sample(&mut self) -> State {
        let actual = dynamics::kinematics(&self.x);
        let mut measured = self.sensors.measure(self.now_ns(), &actual);
        self.faults.sensors.inject(self.tick, &mut measured);
        let command = self.commands.in_force();
        let (arrivals, arrived) = self.arrived;
        State {
            stamp: Stamp { tick: self.tick, ..Stamp::default() },
            applied_sequence: command.sequence,
            applied_age_ns: command.age_ns,
            measured,
            actual,
            actuators: dynamics::actuation(&self.x).into(),
            command_in_force: command.actuation.into(),
            status: self.status() as u64,
            arrivals,
            arrived: arrived as u64,
        }
    }

    /// Receives a command `arrival_ns` after the present sample, within the coming period or later. The next sample
    /// reports it. Commands beyond [`MAX_ARRIVALS`] between two samples are ignored.
    pub fn command(&mut self, actuators: &Actuators, arrival_ns: u64) {
        let (arrivals, arrived) = &mut self.arrivals;
        let Some(arrival) = arrivals.get_mut(*arrived) else { return };
        let Stamp { sequence, epoch, .. } = actuators.stamp;
        *arrival = Arrival { sequence, epoch, after_ns: arrival_ns };
        *arrived += 1;
        self.commands.receive(actuators, self.now_ns().saturating_add(arrival_ns));
    }

    /// Integrates to the sample `periods` later.
    ///
    /// Every step ends at the next multiple of the substep, or when the command in force changes, whichever is first.
    pub fn advance(&mut self, periods: u64) -> PlantStatus {
        let mut now_ns = self.now_ns();
        self.tick += periods;
        self.arrived = std::mem::take(&mut self.arrivals);
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
        let dt_s = (until_ns - from_ns) as f64 / 1e9;
        let demand = self.demand();
        let driven = self.battery.as_mut().map_or(demand, |battery| battery.drive(&demand, &position, dt_s));
        let (command, condition) = self.faults.actuators.inject(from_ns / self.sample_ns, &position, &driven);
        let mut scheduled = self.schedule.at(from_ns);
        let (height_m, reference_mps) = (self.height_zero_m - self.x[2], scheduled.wind_mps);
        let shear = turbulence::shear(height_m, self.wind_roughness_m);
        scheduled.wind_mps.x *= shear;
        scheduled.wind_mps.y *= shear;
        if let Some(turbulence) = &mut self.turbulence {
            let airspeed_mps = (dynamics::velocity_ned_mps(&self.x) - scheduled.wind_mps).norm();
            let moment = Moment { height_m, wind_mps: reference_mps, airspeed_mps };
            scheduled.wind_mps += turbulence.at(from_ns / self.sample_ns, &moment);
        }
        let mut x = integrator::step(&self.x, dt_s, |t_s, x| {
            let outside = self.faults.environment.inject(from_ns, t_s, &scheduled);
            self.dynamics.derivative(x, &command, &condition, &outside)
        });
        dynamics::normalise(&mut x);
        self.diverged = divergence(&x).or_else(|| self.dynamics.breaks(&self.x, &x));
        if let Some(landing) = &mut self.landing {
            let rotor_speed = dynamics::actuation(&x).rotor_speed;
            landing.observe(&dynamics::kinematics(&x), self.dynamics.footing(&x), rotor_speed, until_ns - from_ns);
        }
        self.x = x;
    }

    /// Demand on motor controllers and servo: the command in force within the limits, or no rotor speed for a cut or a
    /// stop, which may be below the limits.
    fn demand(&self) -> Actuation {
        let command = self.commands.in_force();
        let clipped = self.dynamics.clip(&command.actuation);
        // A command of zero stops the motors instead of idling them: the mixer disarms by it.
        let stops = command.cut || command.actuation.rotor_speed == [0.0; 3];
        if stops { Actuation { rotor_speed: [0.0; 3], ..clipped } } else { clipped }
    }

    fn now_ns(&self) -> u64 {
        self.tick * self.sample_ns
    }

    fn status(&self) -> PlantStatus {
        let in_time = match (self.tick < self.last_tick, &self.landing) {
            (true, Some(landing)) => landing.in_flight(),
            (true, None) => PlantStatus::Flying,
            (false, Some(landing)) => landing.at_the_end(),
            (false, None) => PlantStatus::Finished,
        };
        self.diverged.unwrap_or(in_time)
    }
}

/// Bound of the simulation that the state `x` violates, if any.
fn divergence(x: &StateVector) -> Option<PlantStatus> {
    let (position_m, rates_radps) = (&x[0..3], &x[10..13]);
    if !x.iter().all(|value| value.is_finite()) {
        Some(PlantStatus::NonFinite)
    } else if position_m.iter().any(|value| value.abs() > MAX_POSITION_M) {
        Some(PlantStatus::TooFar)
    } else if rates_radps.iter().any(|value| value.abs() > MAX_RATE_RADPS) {
        Some(PlantStatus::TooFast)
    } else {
        None
    }
}

#[cfg(test)]
mod tests;
