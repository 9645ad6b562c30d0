//! Position controller: PID from trajectory to attitude and climb references (45)-(47).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`trajectory`] | position reference over time | figure 5 |
//! | [`heading`] | heading reference over time | |
//! | [`pid`] | position error to angles and climb | (45)-(47) |
//! | [`observer`] | outer disturbance observer | |
//! | [`rates`] | references of the body rates | |
//! | [`reentry`] | limits after a silence | |
//! | [`memory`] | state kept from tick to tick | |
//!
//! ```text
//! STATE -> error in the heading frame -> PID + feed-forward - disturbance -> limits -> + trim -> REFERENCE
//! ```
//!
//! Departure: profile `robust` adds to the paper velocity feedback in place of the differenced error, errors in the
//! heading frame, feed-forward, and a w reference that is exact at any attitude. Each is a setting; with all of them
//! off this is the paper's controller. Test `val_closed_loop_cases` flies both.
//!
//! Without a usable state of the tick the last reference is repeated, and integrators and observer do not change. The
//! integrators count the time before the next state as one period, so that the reference does not jump after a silence;
//! after a long one it is limited too ([`reentry`]). The observer counts a short gap in full and a silence as one
//! period, because it does not know the attitude in between. A state without thrust counts as missing: the vehicle does
//! not follow any reference then, and integrators and observer would adapt to that.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod heading;
pub mod memory;
mod node;
pub mod observer;
pub mod pid;
pub mod rates;
pub mod reentry;
pub mod trajectory;

use airframe::{Trim, angle};
use contract::Scenario;
use contract::message::{Reference, State, guidance_flags};
use contract::scenario::{Derivative, Guidance as Settings, RateReference, RollReference};
use contract::snapshot::{self, OptionalTick, Snapshot};
use nalgebra::{Rotation3, Vector2, Vector3};

use heading::HeadingCommand;
use memory::Memory;
use observer::{Observer, to_heading_frame};
use reentry::Limits;
pub use trajectory::{Setpoint, Trajectory};

/// Position controller.
#[derive(Debug, Clone)]
pub struct Guidance {
    settings: Settings,
    /// Sample time \[s\].
    sample_s: f64,
    trajectory: Trajectory,
    heading: HeadingCommand,
    roll_trim_rad: f64,
    g_mps2: f64,
    memory: Memory,
}

/// Time since the last sample used.
#[derive(Debug, Clone, Copy)]
struct Lapse {
    /// Time by the stamps \[s\]; 0 at the first sample.
    elapsed_s: f64,
    /// Time for the integrals \[s\]: one period after a silence and at the first sample.
    counted_s: f64,
    /// Periods that the observer counts: one after a silence or after a gap in which the thrust was cut.
    believed_periods: u64,
}

impl Guidance {
    /// Builds the controller of `scenario`, at rest.
    pub fn new(scenario: &Scenario) -> Self {
        let trajectory = Trajectory::new(scenario);
        let heading = HeadingCommand::new(scenario);
        let roll_trim_rad = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction).roll_rad;
        let hover = Reference {
            position_m: trajectory.at(0.0).position_m,
            attitude_rad: [roll_trim_rad, 0.0, heading_at(&trajectory, &heading, 0.0)],
            ..Reference::default()
        };
        Self {
            settings: scenario.guidance.clone(),
            sample_s: scenario.sample_s(),
            trajectory,
            heading,
            roll_trim_rad,
            g_mps2: scenario.airframe.g_mps2,
            memory: Memory { reference: hover, ..Memory::default() },
        }
    }

    /// Computes REFERENCE at `tick` for the newest `state`.
    ///
    /// The previous answer (hover before the first) is repeated with a flag if the state is missing, older than `tick`,
    /// without thrust or not finite, or if the answer would not be finite. For a state
    /// that was answered already the answer is repeated without a flag.
    pub fn step(&mut self, tick: u64, state: &State) -> Reference {
        let before = self.memory;
        if state.stamp.sequence == 0 || state.stamp.tick < tick {
            return self.repeat(&before, guidance_flags::STALE);
        }
        if is_cut(state) {
            return self.repeat(&Memory { cut: 1, ..before }, guidance_flags::STALE);
        }
        let m = &state.measured;
        let measured = [m.position_m, m.velocity_mps, m.attitude_rad, m.rates_radps];
        if !all_finite(&measured) {
            return self.repeat(&before, guidance_flags::BAD_INPUT);
        }
        let periods = match before.tick.get() {
            Some(last) if state.stamp.tick <= last => return before.reference,
            Some(last) => state.stamp.tick - last,
            None => 0,
        };
        let reference = self.follow(state, periods);
        let [d_x, d_y] = reference.disturbance_mps2;
        if !all_finite(&[reference.attitude_rad, reference.rates_radps, [reference.w_mps, d_x, d_y]]) {
            return self.repeat(&before, guidance_flags::BAD_INPUT);
        }
        self.memory.tick = OptionalTick::some(state.stamp.tick);
        (self.memory.silent, self.memory.cut) = (0, 0);
        self.memory.reference = reference;
        reference
    }

    /// Packs the whole memory, for the process that continues this flight.
    pub fn snapshot(&self) -> Snapshot {
        snapshot::pack(&self.memory)
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if it is foreign, torn or not finite.
    pub fn restore(&mut self, snapshot: &Snapshot) -> bool {
        snapshot::unpack(snapshot).map(|memory| self.memory = memory).is_some()
    }

    /// Repeats the previous answer with `flag`. The memory is `before`, except that the step counts as silent.
    fn repeat(&mut self, before: &Memory, flag: u64) -> Reference {
        self.memory = Memory { silent: 1, ..*before };
        Reference { flags: before.reference.flags | flag, ..before.reference }
    }

    /// Answers a new sample, `periods` after the last one; 0 at the first.
    fn follow(&mut self, state: &State, periods: u64) -> Reference {
        let t_s = state.stamp.tick as f64 * self.sample_s;
        let elapsed_s = periods as f64 * self.sample_s;
        let is_silence = reentry::is_silence(elapsed_s);
        if is_silence {
            self.memory.back = OptionalTick::some(state.stamp.tick);
        }
        let counts = periods > 0 && self.memory.silent == 0 && !is_silence;
        let lapse = Lapse {
            elapsed_s,
            counted_s: if counts { elapsed_s } else { self.sample_s },
            believed_periods: if is_silence || self.memory.cut == 1 { 1 } else { periods },
        };
        let setpoint = self.trajectory.at(t_s);
        let heading_rad = heading_at(&self.trajectory, &self.heading, t_s);
        let attitude = Vector3::from(state.measured.attitude_rad);
        let [phi, theta, psi] = state.measured.attitude_rad;
        let velocity_ned = Rotation3::from_euler_angles(phi, theta, psi) * Vector3::from(state.measured.velocity_mps);
        let frame_rad = if self.settings.heading_frame { psi } else { 0.0 };

        let (errors, integral_clamped) = self.errors(&setpoint, state, &velocity_ned, lapse);
        let wanted = pid::wanted(&self.settings, &errors.map(|e| to_heading_frame(&e, frame_rad)));
        let acceleration = to_heading_frame(&Vector3::from(setpoint.acceleration_mps2), frame_rad);
        let disturbance = self.disturbance(&velocity_ned, &attitude, lapse);

        let mut angles = Vector2::new(wanted.phi_rad, wanted.theta_rad);
        if self.settings.acceleration_feedforward {
            angles += Vector2::new(acceleration.y, -acceleration.x) / self.g_mps2;
        }
        angles += Vector2::new(-libm::atan(disturbance.y / self.g_mps2), libm::atan(disturbance.x / self.g_mps2));
        let mut climb_mps = wanted.climb_mps;
        if self.settings.velocity_feedforward {
            climb_mps += setpoint.velocity_mps[2];
        }

        let mut flags = if integral_clamped { guidance_flags::INTEGRAL_CLAMPED } else { 0 };
        let limits = self.limits(state.stamp.tick);
        let phi_ref = limit(angles.x, limits.angle_rad, guidance_flags::ROLL_LIMITED, &mut flags);
        let theta_ref = limit(angles.y, limits.angle_rad, guidance_flags::PITCH_LIMITED, &mut flags);
        let climb_mps = limit(climb_mps, limits.climb_mps, guidance_flags::W_LIMITED, &mut flags);
        let w_mps = if self.settings.exact_w { pid::exact_w(climb_mps, state) } else { climb_mps };
        let w_mps = limit(w_mps, self.settings.w_limit_mps, guidance_flags::W_LIMITED, &mut flags);
        let roll_zero = match self.settings.roll_reference {
            RollReference::Trim => self.roll_trim_rad,
            RollReference::Absolute => 0.0,
        };
        let attitude_ref = Vector3::new(phi_ref + roll_zero, theta_ref, heading_rad);
        Reference {
            position_m: setpoint.position_m,
            velocity_mps: setpoint.velocity_mps,
            w_mps,
            attitude_rad: attitude_ref.into(),
            rates_radps: self.rates(&attitude_ref, &attitude, elapsed_s).into(),
            disturbance_mps2: disturbance.into(),
            flags,
            ..Reference::default()
        }
    }

    /// Updates the proportional, integral and derivative errors, NED; also returns whether the integral was clamped.
    fn errors(
        &mut self,
        setpoint: &Setpoint,
        state: &State,
        velocity_ned: &Vector3<f64>,
        Lapse { elapsed_s, counted_s, .. }: Lapse,
    ) -> ([Vector3<f64>; 3], bool) {
        let error = Vector3::from(setpoint.position_m) - Vector3::from(state.measured.position_m);
        let derivative = match self.settings.derivative {
            Derivative::Velocity => Vector3::from(setpoint.velocity_mps) - velocity_ned,
            Derivative::Error if elapsed_s > 0.0 => (error - self.memory.error_m) / elapsed_s,
            Derivative::Error => Vector3::zeros(),
        };
        let clamp = self.settings.integral_limit;
        let free = self.memory.integral_ms + error * counted_s;
        self.memory.integral_ms = free.map(|i| i.clamp(-clamp, clamp));
        self.memory.error_m = error;
        ([error, self.memory.integral_ms, derivative], free != self.memory.integral_ms)
    }

    fn disturbance(&mut self, velocity_ned: &Vector3<f64>, attitude: &Vector3<f64>, lapse: Lapse) -> Vector2<f64> {
        let bandwidth = self.settings.disturbance_observer_radps;
        if bandwidth <= 0.0 {
            // A candidate that has an observer continues from this velocity.
            self.memory.observer = Observer { velocity_ned_mps: *velocity_ned, ..Observer::default() };
            return Vector2::zeros();
        }
        let tilt = Vector2::new(attitude.x - self.roll_trim_rad, attitude.y);
        let step = observer::Step {
            elapsed_s: lapse.elapsed_s,
            gain: (bandwidth * self.sample_s).min(1.0),
            periods: lapse.believed_periods,
        };
        self.memory.observer.update(velocity_ned, &tilt, attitude.z, self.g_mps2, step)
    }

    /// Limits of the reference at `tick`.
    fn limits(&self, tick: u64) -> Limits {
        let Settings { angle_limit_deg, climb_limit_mps, .. } = self.settings;
        let since_s = self.memory.back.get().map(|back| tick.saturating_sub(back) as f64 * self.sample_s);
        Limits { angle_rad: angle_limit_deg.to_radians(), climb_mps: climb_limit_mps }.after_silence(since_s)
    }

    fn rates(&self, wanted: &Vector3<f64>, measured: &Vector3<f64>, elapsed_s: f64) -> Vector3<f64> {
        match self.settings.rate_reference {
            RateReference::Difference if elapsed_s > 0.0 => {
                let mut change = wanted - Vector3::from(self.memory.reference.attitude_rad);
                change.z = angle::wrapped(change.z);
                rates::body_rates(&(change / elapsed_s), measured)
            }
            RateReference::Difference | RateReference::Zero => Vector3::zeros(),
        }
    }
}

/// Heading reference at `t_s` \[rad\]: that of the parts of the mission, if it has any.
fn heading_at(trajectory: &Trajectory, heading: &HeadingCommand, t_s: f64) -> f64 {
    trajectory.plan().map_or_else(|| heading.at(t_s), |plan| plan.heading_at(t_s))
}

/// Returns whether the command in force has no thrust.
fn is_cut(state: &State) -> bool {
    state.command_in_force.rotor_speed == [0.0; 3]
}

fn all_finite(vectors: &[[f64; 3]]) -> bool {
    vectors.as_flattened().iter().all(|value| value.is_finite())
}

/// Clamps `value` to +-`bound`, and sets `flag` if that changes it.
fn limit(value: f64, bound: f64, flag: u64, flags: &mut u64) -> f64 {
    let inside = value.clamp(-bound, bound);
    if inside != value {
        *flags |= flag;
    }
    inside
}

#[cfg(test)]
mod tests;
