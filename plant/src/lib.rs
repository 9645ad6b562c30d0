//! Simulated vehicle: six degrees of freedom, actuators, wind, sensors (7)-(22).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`vehicle`] | interface of a vehicle to the plant | |
//! | [`tricopter`] | the vehicle of the paper, with air, ground, battery and faults | |
//! | [`dynamics`] | forces, moments, equations of motion | (7)-(22) |
//! | [`rotors`] | thrust, torque and angular momentum of the rotors | (15)-(22) |
//! | [`battery`] | voltage, and its effect on commands | |
//! | [`ground`] | forces on the feet, crash and tip-over | |
//! | [`landing`] | true take-off and landing | |
//! | [`integrator`] | one Runge-Kutta step | |
//! | [`commands`] | delay, jitter and loss between mixer and actuators; the cut without commands | |
//! | [`air`] | surroundings of the vehicle at one instant | |
//! | [`schedule`] | wind and disturbance as steps in time | |
//! | [`turbulence`] | continuous gusts, and the mean wind over the height | |
//! | [`sensors`], [`sensor`] | measurements: errors, rates, latencies | |
//! | [`navigation_unit`], [`instruments`] | the navigation unit with its filter (EKF), and its sensors | |
//! | [`telemetry`] | rotor speeds and tilt as sensed | |
//! | [`sampler`] | the plant behind its ports in every mode; the loop of its process | |
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
//! integration stops: time goes on, and the state no longer changes. A user's vehicle can take the tricopter's place.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod air;
pub mod battery;
pub mod commands;
pub mod dynamics;
pub mod faults;
pub mod ground;
pub mod instruments;
pub mod integrator;
pub mod landing;
pub mod memory;
pub mod navigation_unit;
pub mod random;
pub mod rotors;
pub mod sampler;
pub mod schedule;
pub mod sensor;
pub mod sensors;
pub mod telemetry;
pub mod tricopter;
pub mod turbulence;
pub mod vehicle;

use contract::message::{Actuators, Arrival, MAX_ARRIVALS, Navigation, PlantStatus, Stamp, State, Truth};
use contract::snapshot::PLANT_WORDS;
use runtime::error::SessionError;
use settings::{Fault, Scenario};

use commands::CommandLine;
use faults::sensors::SensorFaults;
use memory::Tape;
use navigation_unit::NavigationUnit;
use sensors::Sensors;
use telemetry::Telemetry;
use tricopter::Tricopter;
use vehicle::Vehicle;

/// Simulated vehicle with the time line of its commands and its sensors, advanced from sample to sample.
#[derive(Debug, Clone)]
pub struct Plant<V: Vehicle + ?Sized = Tricopter> {
    vehicle: Box<V>,
    commands: CommandLine,
    /// Arrivals of commands since the present sample, and their number.
    arrivals: ([Arrival; MAX_ARRIVALS], usize),
    /// Arrivals between the previous and the present sample, and their number.
    arrived: ([Arrival; MAX_ARRIVALS], usize),
    sensors: Sensors,
    /// Navigation unit, which takes the place of `sensors`; `None` if the scenario has no EKF.
    navigation: Option<NavigationUnit>,
    sensor_faults: SensorFaults,
    telemetry: Telemetry,
    sample_ns: u64,
    last_tick: u64,
    pub(crate) tick: u64,
}

impl Plant {
    /// Builds the plant of `scenario` with its tricopter.
    pub fn new(scenario: &Scenario) -> Self {
        Self::with(scenario, Box::new(Tricopter::new(scenario)))
    }
}

impl<V: Vehicle + ?Sized> Plant<V> {
    /// Builds the plant of `scenario` with a `vehicle` at its [`start`](vehicle::start). The first command in force
    /// holds the actuators where they start.
    pub fn with(scenario: &Scenario, vehicle: Box<V>) -> Self {
        let (_, actuation) = vehicle::start(scenario);
        Self {
            navigation: NavigationUnit::new(scenario, &vehicle.motion()),
            telemetry: Telemetry::new(scenario, &vehicle.actuators()),
            vehicle,
            commands: CommandLine::new(scenario, actuation),
            arrivals: Default::default(),
            arrived: Default::default(),
            sensors: Sensors::new(scenario),
            sensor_faults: SensorFaults::new(scenario),
            sample_ns: scenario.sample_ns(),
            last_tick: scenario.ticks(),
            tick: 0,
        }
    }

    /// Returns the navigation unit, if there is one.
    pub fn navigation(&self) -> Option<&NavigationUnit> {
        self.navigation.as_ref()
    }

    /// Updates fault `number` if it is a fault of sensors, actuators, wind or payload.
    pub fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.sensor_faults.apply_fault(number, fault);
        self.vehicle.apply_fault(number, fault);
    }

    /// Writes the memory after the newest sample to the beginning of `words`, and returns its length, at most
    /// [`PLANT_WORDS`]. `None` if it does not fit, or if the vehicle has diverged or keeps no memory.
    pub fn memory(&mut self, words: &mut [u64]) -> Option<usize> {
        if self.vehicle.diverged().is_some() {
            return None;
        }
        let mut tape = Tape::to_write(words);
        self.remember(&mut tape);
        tape.length()
    }

    /// Continues from a memory of a plant of the same scenario after sample `tick`. Returns `false` if `words` is not
    /// such a memory; the plant must then be restored from another memory before use.
    pub fn restore(&mut self, tick: u64, words: &[u64]) -> bool {
        let mut words = words.to_vec();
        words.resize(PLANT_WORDS.max(words.len()), 0); // a log leaves out the zeros at the end
        let mut tape = Tape::to_read(&mut words);
        self.tick = tick;
        self.remember(&mut tape);
        tape.length().is_some() && self.tick == tick && self.vehicle.diverged().is_none()
    }

    fn remember(&mut self, tape: &mut Tape) {
        tape.value(&mut self.tick);
        for (arrivals, arrived) in [&mut self.arrivals, &mut self.arrived] {
            tape.count(arrived, MAX_ARRIVALS);
            tape.value(arrivals);
        }
        self.vehicle.remember(tape, self.tick);
        self.telemetry.remember(tape, &self.vehicle.actuators());
        self.commands.remember(tape);
        self.sensors.remember(tape);
        if let Some(navigation) = &mut self.navigation {
            navigation.remember(tape);
        }
        self.sensor_faults.remember(tape);
    }

    /// Measures STATE at the present instant; every call draws new noise.
    ///
    /// STATE names the command in force up to this instant, not a command that takes effect at this instant.
    pub fn sample(&mut self) -> State {
        let (measured, navigation) = if let Some(unit) = &self.navigation {
            unit.estimate(self.now_ns())
        } else {
            let mut measured = self.sensors.measure(self.now_ns(), &self.vehicle.motion());
            self.sensor_faults.inject(self.tick, &mut measured);
            (measured, Navigation::default())
        };
        let command = self.commands.in_force();
        let (arrivals, arrived) = self.arrived;
        State {
            stamp: Stamp { tick: self.tick, ..Stamp::default() },
            applied_sequence: command.sequence,
            applied_age_ns: command.age_ns,
            measured,
            command_in_force: command.actuation.into(),
            status: self.status() as u64,
            arrivals,
            arrived: arrived as u64,
            navigation,
            sensed: self.telemetry.read(self.tick).into(),
        }
    }

    /// Returns the TRUTH at the present instant.
    pub fn truth(&self) -> Truth {
        let (actual, actuators) = (self.vehicle.motion(), self.vehicle.actuators().into());
        Truth { tick: self.tick, actual, actuators, ..Truth::default() }
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

    /// Moves to the sample `periods` later, piece by piece: each piece ends when the command in force changes, at a
    /// sample of the IMU if there is a navigation unit, or at that later sample.
    ///
    /// # Errors
    /// Fails if the code of the vehicle fails.
    pub fn advance(&mut self, periods: u64) -> Result<PlantStatus, SessionError> {
        let mut now_ns = self.now_ns();
        self.tick += periods;
        self.arrived = std::mem::take(&mut self.arrivals);
        while now_ns < self.now_ns() && self.vehicle.diverged().is_none() {
            self.commands.switch(now_ns);
            let due_ns = self.navigation.as_ref().map_or(u64::MAX, NavigationUnit::due_ns);
            let until_ns = self.commands.next_switch_ns().min(self.now_ns()).min(due_ns);
            self.vehicle.advance(now_ns, until_ns, &self.commands.in_force().actuation)?;
            if let Some(navigation) = self.navigation.as_mut().filter(|_| until_ns == due_ns) {
                let (motion, wind_mps) = (self.vehicle.motion(), self.vehicle.wind_mps(due_ns));
                navigation.measure(&motion, &self.vehicle.actuators(), &wind_mps, &mut self.sensor_faults);
            }
            now_ns = until_ns;
        }
        (0..periods).for_each(|_| self.telemetry.observe(&self.vehicle.actuators()));
        Ok(self.status())
    }

    fn now_ns(&self) -> u64 {
        self.tick * self.sample_ns
    }

    fn status(&self) -> PlantStatus {
        self.vehicle.diverged().unwrap_or_else(|| self.vehicle.phase(self.tick >= self.last_tick))
    }
}

#[cfg(test)]
mod tests;
