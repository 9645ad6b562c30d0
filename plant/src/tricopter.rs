//! Vehicle of the paper with all that acts on it: actuators, air, ground, battery, and their faults.

use contract::actuation::Actuation;
use contract::message::{Kinematics, PlantStatus};
use runtime::error::SessionError;
use settings::{Fault, Scenario};

use crate::air::Air;
use crate::battery::Battery;
use crate::dynamics::{self, Dynamics, StateVector};
use crate::faults::actuators::ActuatorFaults;
use crate::integrator;
use crate::landing::Landing;
use crate::memory::Tape;
use crate::vehicle::{self, Vehicle};

/// Tilt-rotor tricopter of the scenario.
#[derive(Debug, Clone)]
pub struct Tricopter {
    dynamics: Dynamics,
    air: Air,
    battery: Option<Battery>,
    /// Take-off and landing; `None` without a ground.
    landing: Option<Landing>,
    actuator_faults: ActuatorFaults,
    sample_ns: u64,
    substep_ns: u64,
    pub(crate) x: StateVector,
    /// Reason for which the integration stopped; `None` while it goes on.
    diverged: Option<PlantStatus>,
}

impl Tricopter {
    /// Builds the vehicle of `scenario` at its [`start`](vehicle::start).
    pub fn new(scenario: &Scenario) -> Self {
        let (motion, actuators) = vehicle::start(scenario);
        let x = dynamics::assemble(&motion, &actuators);
        Self {
            dynamics: Dynamics::new(scenario),
            air: Air::new(scenario),
            battery: Battery::new(scenario),
            landing: Landing::new(scenario),
            actuator_faults: ActuatorFaults::new(scenario),
            sample_ns: scenario.sample_ns(),
            substep_ns: scenario.substep_ns(),
            x,
            diverged: divergence(&x),
        }
    }

    fn integrate(&mut self, from_ns: u64, until_ns: u64, command: &Actuation) {
        let position = dynamics::actuation(&self.x);
        let dt_s = (until_ns - from_ns) as f64 / 1e9;
        let demand = self.demand(command);
        let driven = self.battery.as_mut().map_or(demand, |battery| battery.drive(&demand, &position, dt_s));
        let (command, condition) = self.actuator_faults.inject(from_ns / self.sample_ns, &position, &driven);
        let calm = self.air.without_faults(from_ns, &self.x);
        let mut x = integrator::step(&self.x, dt_s, |t_s, x| {
            let outside = self.air.with_faults(from_ns, t_s, &calm);
            self.dynamics.derivative(x, &command, &condition, &outside)
        });
        dynamics::normalise(&mut x);
        self.diverged = divergence(&x).or_else(|| self.dynamics.breaks(&self.x, &x));
        let slid_m = self.dynamics.settle(&x);
        if let Some(landing) = &mut self.landing {
            let (footing, rotor_speed) = (self.dynamics.footing(&x), dynamics::actuation(&x).rotor_speed);
            landing.observe(&dynamics::kinematics(&x), footing, slid_m, rotor_speed, until_ns - from_ns);
        }
        self.x = x;
    }

    /// Demand on motor controllers and servo: the command in force, clipped to the limits, except that rotor speeds of
    /// 0 (a cut or a stop) stay 0.
    fn demand(&self, command: &Actuation) -> Actuation {
        let clipped = self.dynamics.clip(command);
        // A command of zero stops the motors instead of idling them; the mixer disarms by this command.
        if command.rotor_speed == [0.0; 3] { Actuation { rotor_speed: [0.0; 3], ..clipped } } else { clipped }
    }
}

impl Vehicle for Tricopter {
    /// Integrates; every step ends at the next multiple of the substep, the last step at `until_ns`.
    fn advance(&mut self, from_ns: u64, until_ns: u64, command: &Actuation) -> Result<(), SessionError> {
        let mut now_ns = from_ns;
        while now_ns < until_ns && self.diverged.is_none() {
            let substep_ns = (now_ns / self.substep_ns + 1) * self.substep_ns;
            let end_ns = substep_ns.min(until_ns);
            self.integrate(now_ns, end_ns, command);
            now_ns = end_ns;
        }
        Ok(())
    }

    fn motion(&self) -> Kinematics {
        dynamics::kinematics(&self.x)
    }

    fn actuators(&self) -> Actuation {
        dynamics::actuation(&self.x)
    }

    fn wind_mps(&self, now_ns: u64) -> [f64; 3] {
        self.air.mean_wind_mps(now_ns, self.motion().position_m[2])
    }

    fn diverged(&self) -> Option<PlantStatus> {
        self.diverged
    }

    fn phase(&self, is_over: bool) -> PlantStatus {
        match (is_over, &self.landing) {
            (false, Some(landing)) => landing.in_flight(),
            (false, None) => PlantStatus::Flying,
            (true, Some(landing)) => landing.at_the_end(),
            (true, None) => PlantStatus::Finished,
        }
    }

    fn apply_fault(&mut self, number: usize, fault: &Fault) {
        self.actuator_faults.apply_fault(number, fault);
        self.air.apply_fault(number, fault);
    }

    fn remember(&mut self, tape: &mut Tape, tick: u64) {
        tape.value(&mut self.x);
        self.diverged = divergence(&self.x);
        self.battery.iter_mut().for_each(|battery| battery.remember(tape));
        self.dynamics.remember(tape);
        self.landing.iter_mut().for_each(|landing| landing.remember(tape));
        self.air.remember(tape, tick);
        self.actuator_faults.remember(tape);
    }
}

/// Bound of the simulation that the state `x` violates, if any.
pub(crate) fn divergence(x: &StateVector) -> Option<PlantStatus> {
    vehicle::divergence(x, &x[0..3], &x[10..13])
}
