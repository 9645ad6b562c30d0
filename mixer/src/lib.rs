//! Control allocation: forces and moments to rotor speeds and tilt (31)-(44).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`allocation`] | demand to rotor speeds and tilt | (31)-(32), (39)-(44) |
//! | [`fallback`] | fallback ladder for missing demands | |
//! | [`landing`] | land detector | |
//! | [`rotors`] | detection of a dead rotor and a stuck tilt servo | |
//! | [`damage`] | record of the broken part | |
//! | [`broken`] | descent of a broken vehicle | |
//! | [`ahead`] | motion of a broken vehicle when a new command takes effect | |
//! | [`memory`] | state kept from tick to tick | |
//!
//! With `mixer.projection` a demand that the actuators cannot produce is replaced by the nearest demand that they can
//! produce ([`airframe::projection`]) before the allocation.
//!
//! For any input the command is finite and inside the actuators' limits, except that a rotor without thrust is below
//! the idle speed.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod ahead;
pub mod allocation;
pub mod broken;
pub mod damage;
pub mod fallback;
pub mod landing;
pub mod memory;
pub mod rotors;

use airframe::envelope::Envelope;
use airframe::projection::Projection;
use airframe::{ActuatorLimits, DemandSet, MixingMatrix, Trim};
use bytemuck::Zeroable;
use contract::actuation::Actuation;
use contract::message::{Actuators, Controls, SolveStatus, State, mixer_flags};
use contract::snapshot::{self, OptionalTick, Snapshot};
use nalgebra::Vector4;
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::{BrokenVehicle, Scenario};

use broken::Broken;
use damage::{BrokenPart, Damage};
use fallback::{LevellingLaw, Rung};
use landing::{LandDetector, LandingStage};
use memory::MixerMemory;
use rotors::RotorModel;

/// Control allocation of one vehicle.
pub struct Mixer {
    mixing: MixingMatrix,
    limits: ActuatorLimits,
    trim: Actuation,
    /// Projection of demands; `None` if the scenario has none.
    projection: Option<Projection>,
    level: LevellingLaw,
    rotors: RotorModel,
    /// Laws of a broken vehicle; `None` if the scenario cuts its thrust.
    broken: Option<Broken>,
    /// Speed of rotors that idle on the ground \[rotor speed unit\]; `None` without a ground.
    idle_speed: Option<f64>,
    mass_kg: f64,
    sample_ns: u64,
    memory: MixerMemory,
}

impl Core for Mixer {
    type Inputs = (Input<Controls>, Input<State>);
    type Answer = Actuators;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::new(scenario))
    }

    fn step(&mut self, tick: u64, (demands, states): &Self::Inputs) -> Result<Actuators, SessionError> {
        Ok(self.step(tick, demands.known(), states.known()))
    }

    fn snapshot(&self) -> Snapshot {
        snapshot::pack(&self.memory)
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if the snapshot is foreign, torn or not finite.
    fn restore(&mut self, snapshot: &Snapshot) -> bool {
        snapshot::unpack(snapshot).map(|memory| self.memory = memory).is_some()
    }
}

impl Mixer {
    /// Builds the allocation of `scenario`; `mixer.tilt_reaction` makes it exact for a plant with the tilt reaction.
    pub fn new(scenario: &Scenario) -> Self {
        let tilt_reaction = scenario.mixer.tilt_reaction;
        let mixing = MixingMatrix::new(&scenario.airframe, tilt_reaction);
        let trim = Trim::solve(&scenario.airframe, tilt_reaction);
        let rotors = RotorModel::new(scenario, mixing, &trim.actuation);
        Self {
            mixing,
            limits: scenario.limits(),
            trim: trim.actuation,
            projection: scenario.mixer.projection.then(|| {
                let envelope = Envelope::new(&scenario.airframe, tilt_reaction, scenario.limits());
                Projection::new(DemandSet::exact(&envelope), &scenario.mixer.projection_weights)
            }),
            level: LevellingLaw::new(&scenario.airframe, trim.roll_rad),
            broken: (scenario.mixer.broken_vehicle == BrokenVehicle::Descend)
                .then(|| Broken::new(scenario, mixing, &scenario.actuator_law())),
            idle_speed: scenario.plant.ground.present.then(|| scenario.idle_speed()),
            mass_kg: scenario.airframe.mass_kg,
            sample_ns: scenario.sample_ns(),
            memory: MixerMemory {
                evidence: rotors.unknown(&trim.actuation),
                landing: LandDetector::new(scenario),
                ..MixerMemory::zeroed()
            },
            rotors,
        }
    }

    /// Computes ACTUATORS at `tick` from the newest demand and the newest state. The command is finite, and inside the
    /// limits or without thrust; flags report every deviation from the demand.
    ///
    /// A demand that is not finite, or that the controller only repeated, counts as missing; so does a state that is
    /// not finite. [`fallback`] describes the command without a demand or a state, [`landing`] the command on the
    /// ground. With the projection, no limit clips a demand.
    pub fn step(&mut self, tick: u64, controls: &Controls, state: &State) -> Actuators {
        self.store_demand(controls);
        let elapsed_ns = self.store_state(state);
        let MixerMemory { demand_tick, demand, disturbance, state_tick, measured, damage, .. } = self.memory;
        // A broken vehicle uses no demand, because demands are for a whole vehicle.
        let demand_ns = if damage.part().is_some() { u64::MAX } else { self.age_ns(tick, demand_tick) };
        let rung = Rung::of(demand_ns, self.age_ns(tick, state_tick));
        let mut actuators = match (self.stage(rung, elapsed_ns), rung) {
            _ if damage.part().is_some_and(|part| !self.descends_without(part)) => self.cut(mixer_flags::TERMINATED),
            (LandingStage::Landed, _) => self.stop(mixer_flags::DISARMED),
            (LandingStage::Contact, _) => self.idle(mixer_flags::GROUND_CONTACT),
            (LandingStage::Free, Rung::Used) => self.allocate(&demand, 0),
            (LandingStage::Free, Rung::Held) => self.allocate(&demand, mixer_flags::HELD),
            (LandingStage::Free, Rung::Levelled) => {
                self.allocate(&(self.level.demand(&measured, false) - disturbance), mixer_flags::LEVELLED)
            }
            (LandingStage::Free, Rung::Descending) => match damage.part() {
                None => self.allocate(&(self.level.demand(&measured, true) - disturbance), mixer_flags::DESCENDING),
                Some(part) => self.descend_without(part),
            },
            (LandingStage::Free, Rung::TrimOnly) => self.trim(mixer_flags::TRIM_ONLY),
            (LandingStage::Free, Rung::Cut) => self.cut(0),
        };
        if !is_finite(&controls.demand) {
            actuators.flags |= mixer_flags::BAD_INPUT;
        }
        self.memory.delay.outputs[0] = bytemuck::cast(actuators.command);
        actuators
    }

    /// Stores a demand, unless it is missing, not finite or repeated.
    fn store_demand(&mut self, controls: &Controls) {
        let Controls { stamp, demand, disturbance, status, .. } = controls;
        if stamp.sequence > 0 && is_finite(demand) && !SolveStatus::repeated(*status) {
            self.memory.demand_tick = OptionalTick::some(stamp.tick);
            self.memory.demand = Vector4::from(*demand);
            if is_finite(disturbance) {
                self.memory.disturbance = Vector4::from(*disturbance);
            }
        }
    }

    /// Stores a new, finite state and updates the evidence on the rotors. Returns the time since the previous state
    /// \[ns\]; 0 for the first state, and for a state that is not stored.
    fn store_state(&mut self, state: &State) -> u64 {
        let m = &state.measured;
        let finite = [m.position_m, m.velocity_mps, m.attitude_rad, m.rates_radps].iter().all(|v| is_finite(v));
        let tick = state.stamp.tick;
        if state.stamp.sequence == 0 || !finite || self.memory.state_tick.get().is_some_and(|last| tick <= last) {
            return 0;
        }
        let command = Actuation::from(state.command_in_force);
        let samples = self.memory.state_tick.get().map(|last| tick - last);
        let elapsed_ns = samples.map_or(0, |samples| samples.saturating_mul(self.sample_ns));
        let evidence = match samples {
            Some(_) => {
                let elapsed_s = elapsed_ns as f64 / 1e9;
                self.rotors.observe(&self.memory.evidence, [&self.memory.measured, m], &command, elapsed_s)
            }
            None => self.rotors.unknown(&command),
        };
        self.memory.delay.observe(state, bytemuck::cast(command), samples, self.sample_ns);
        self.memory.state_tick = OptionalTick::some(tick);
        self.memory.measured = *m;
        self.memory.evidence = evidence;
        self.note_damage();
        elapsed_ns
    }

    /// Notes the first damage that the evidence shows; notes a stuck servo only if the vehicle may descend without it.
    fn note_damage(&mut self) {
        let MixerMemory { evidence, damage, .. } = self.memory;
        let stuck = || self.rotors.stuck_tilt(&evidence).filter(|_| self.broken.is_some()).map(BrokenPart::Tilt);
        if damage.part().is_none()
            && let Some(part) = evidence.dead_rotor().map(BrokenPart::Rotor).or_else(stuck)
        {
            self.memory.damage = Damage::from(part);
        }
    }

    fn descends_without(&self, part: BrokenPart) -> bool {
        self.broken.as_ref().is_some_and(|broken| broken.descends_without(part))
    }

    /// Updates the land detector, if there is a ground, by a sample `elapsed_ns` after the last one, and returns its
    /// stage.
    fn stage(&mut self, rung: Rung, elapsed_ns: u64) -> LandingStage {
        let MixerMemory { demand, disturbance, measured, .. } = self.memory;
        let wanted = match rung {
            Rung::Used | Rung::Held => demand + disturbance,
            Rung::Levelled => self.level.demand(&measured, false),
            Rung::Descending => self.level.demand(&measured, true),
            Rung::TrimOnly | Rung::Cut => Vector4::zeros(),
        };
        if self.idle_speed.is_some() && elapsed_ns > 0 {
            self.memory.landing.observe(&measured, wanted[0] / self.mass_kg, elapsed_ns);
        }
        self.memory.landing.stage()
    }

    /// Age at `tick` of a message of tick `of` \[ns\]; `u64::MAX` if there was none.
    fn age_ns(&self, tick: u64, of: OptionalTick) -> u64 {
        of.get().map_or(u64::MAX, |of| tick.saturating_sub(of).saturating_mul(self.sample_ns))
    }

    /// Computes the command for a demand \[N, N m, N m, N m\], with `flags` and the flags of projection and saturation.
    fn allocate(&mut self, demand: &Vector4<f64>, mut flags: u64) -> Actuators {
        if !is_finite(demand.as_slice()) {
            return self.trim(flags | mixer_flags::TRIM_ONLY); // the levelling demand overflowed
        }
        let nearest = self.projection.as_mut().and_then(|projection| projection.nearest(demand));
        let (wanted, negative_square) = allocation::allocate(&self.mixing, &nearest.unwrap_or(*demand));
        let command = self.limits.clip(&wanted);
        if nearest.is_some() {
            flags |= mixer_flags::PROJECTED;
        }
        if negative_square {
            flags |= mixer_flags::NEGATIVE_SQUARE;
        }
        for (rotor, (got, asked)) in command.rotor_speed.iter().zip(wanted.rotor_speed).enumerate() {
            if *got != asked {
                flags |= mixer_flags::ROTOR_SATURATED << rotor;
            }
        }
        if command.tilt_rad != wanted.tilt_rad {
            flags |= mixer_flags::TILT_SATURATED;
        }
        Actuators { command: command.into(), flags, ..Actuators::default() }
    }

    /// Command of a descent without `part`, which is broken.
    fn descend_without(&self, part: BrokenPart) -> Actuators {
        let MixerMemory { measured, evidence, state_tick, delay, .. } = &self.memory;
        let in_force = bytemuck::cast(delay.command);
        let course = delay.course(in_force, state_tick.get().unwrap_or_default(), self.sample_ns);
        let course = course.map(|(command, time_ns)| (bytemuck::cast(command), time_ns * 1e-9));
        let broken = self.broken.as_ref();
        let wanted = broken.and_then(|broken| broken.command(part, measured, &evidence.actuation, course));
        let Some(wanted) = wanted else { return self.cut(mixer_flags::YAW_GIVEN_UP) }; // a number overflowed
        let mut command = self.limits.clip(&wanted);
        let mut flags = mixer_flags::DESCENDING | mixer_flags::YAW_GIVEN_UP;
        for (rotor, (got, asked)) in command.rotor_speed.iter_mut().zip(wanted.rotor_speed).enumerate() {
            if part == BrokenPart::Rotor(rotor) {
                *got = 0.0;
            } else if *got != asked {
                flags |= mixer_flags::ROTOR_SATURATED << rotor;
            }
        }
        Actuators { command: command.into(), flags, ..Actuators::default() }
    }

    /// Command at trim.
    fn trim(&self, flags: u64) -> Actuators {
        Actuators { command: self.limits.clip(&self.trim).into(), flags, ..Actuators::default() }
    }

    /// Command with idling rotors and the tilt at trim.
    fn idle(&self, flags: u64) -> Actuators {
        let idle = Actuation { rotor_speed: [self.idle_speed.unwrap_or_default(); 3], ..self.trim };
        Actuators { command: self.limits.clip(&idle).into(), flags, ..Actuators::default() }
    }

    /// Command without thrust, with the tilt at trim.
    fn stop(&self, flags: u64) -> Actuators {
        let still = Actuation { rotor_speed: [0.0; 3], ..self.trim };
        Actuators { command: still.into(), flags, ..Actuators::default() }
    }

    /// Command without thrust, with `flags` and the flag `CUT`.
    fn cut(&self, flags: u64) -> Actuators {
        self.stop(flags | mixer_flags::CUT)
    }
}

/// Returns whether every number is finite.
fn is_finite(numbers: &[f64]) -> bool {
    numbers.iter().all(|number| number.is_finite())
}

#[cfg(test)]
mod tests;
