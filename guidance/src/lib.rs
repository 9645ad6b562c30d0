//! Position controller: PID from trajectory to attitude and climb references (45)-(47).
//!
//! | module | holds | paper |
//! |---|---|---|
//! | [`trajectory`] | position and heading reference over time | figure 5 |
//! | [`pid`] | position error to angles and climb | (45)-(47) |
//! | [`observer`] | outer disturbance observer | |
//! | [`rates`] | references of the body rates | |
//! | [`limits`] | limits of the reference, also after a silence | |
//! | [`takeoff`] | start of a flight on the ground | |
//! | [`memory`] | state kept from tick to tick | |
//!
//! ```text
//! STATE -> error in the heading frame -> PID + feed-forward - disturbance -> limits -> + trim -> REFERENCE
//! ```
//!
//! Departure: profile `robust` adds to the paper velocity feedback in place of the differenced error, errors in the
//! heading frame, feed-forward, and a w reference that is exact at any attitude. Each is a setting; with all of them
//! off this is the paper's controller. In the heading frame the tilt is limited as a whole, and the part that the
//! limits cut off is fed back into the integrals. Otherwise roll, pitch and climb are three loops of their own. Test
//! `val_closed_loop_cases` flies both controllers.
//!
//! Feed-forward and heading are taken from a later time, at which the vehicle has the attitude: later by
//! `guidance.lead_s`, and by the delay of the commands if attitude-mpc measures it (`attitude.delay_compensation`).
//!
//! With `guidance.preview_s` the reference includes its changes at later times: trajectory and heading go on, and the
//! correction by PID and observer stays, as if the vehicle kept its place beside the trajectory.
//!
//! Without a usable state of the tick the last reference is repeated, and integrators and observer do not change. The
//! integrators count the time before the next state as one period, so that the reference does not jump after a silence;
//! after a long silence the reference is limited too ([`limits`]). The observer counts a short gap in full and a
//! silence as one period, because it does not know the attitude in between. A state without thrust counts as missing:
//! the vehicle does not follow any reference then, so integrators and observer would wind up.

#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod limits;
pub mod memory;
pub mod observer;
pub mod pid;
pub mod rates;
pub mod takeoff;
pub mod trajectory;

use airframe::{Trim, angle};
use contract::message::{Ahead, PREVIEW, Reference, State, guidance_flags};
use contract::snapshot::{self, OptionalTick, Snapshot};
use nalgebra::{Rotation3, Vector2, Vector3};
use runtime::error::SessionError;
use runtime::input::Input;
use runtime::node::Core;
use settings::{Derivative, GuidanceSettings, RateReference, RollReference, Scenario};

use limits::{ReferenceLimits, bounded, limit, within};
use memory::GuidanceMemory;
use observer::{DisturbanceObserver, HeadingFrame};
use pid::{ExactW, PidOutput};
use takeoff::{SPOOL_UP_S, TakeOff};
pub use trajectory::{Setpoint, Trajectory};

/// Position controller.
#[derive(Debug, Clone)]
pub struct Guidance {
    settings: GuidanceSettings,
    /// Sample time \[s\].
    sample_s: f64,
    sample_ns: u64,
    trajectory: Trajectory,
    roll_trim_rad: f64,
    g_mps2: f64,
    /// `true` if the reference is for the moment at which the command that answers it acts.
    leads_by_delay: bool,
    memory: GuidanceMemory,
}

/// Part of the references, for now and for later times, that follows from one sample.
#[derive(Debug, Clone, Copy)]
struct Correction {
    /// Proportional, integral and derivative errors, NED \[m, m s, m/s\].
    errors: [Vector3<f64>; 3],
    /// Disturbance ahead and to the right \[m/s2\].
    disturbance_mps2: Vector2<f64>,
    /// Turn from NED to the heading frame \[rad\]; `None` if errors and feed-forward stay in NED.
    heading_rad: Option<f64>,
    /// Relation of w to the climb, if `exact_w` is set.
    exact_w: Option<ExactW>,
    limits: ReferenceLimits,
}

/// References for one moment.
struct Aim {
    /// Body z velocity \[m/s\].
    w_mps: f64,
    /// Phi, theta, psi \[rad\].
    attitude_rad: Vector3<f64>,
    /// Parts of angles and climb that the limits cut off.
    clipped: PidOutput,
    /// Limits that were reached.
    flags: u64,
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

impl Core for Guidance {
    type Inputs = Input<State>;
    type Answer = Reference;

    fn build(scenario: &Scenario) -> Result<Self, SessionError> {
        Ok(Self::new(scenario))
    }

    fn step(&mut self, tick: u64, states: &Self::Inputs) -> Result<Reference, SessionError> {
        Ok(self.step(tick, states.known()))
    }

    fn snapshot(&self) -> Snapshot {
        snapshot::pack(&self.memory)
    }

    /// Continues from a snapshot. Returns `false`, and changes nothing, if the snapshot is foreign, torn or not finite.
    fn restore(&mut self, snapshot: &Snapshot) -> bool {
        snapshot::unpack(snapshot).map(|memory| self.memory = memory).is_some()
    }
}

impl Guidance {
    /// Builds the controller of `scenario`, at rest.
    pub fn new(scenario: &Scenario) -> Self {
        let roll_trim_rad = Trim::solve(&scenario.airframe, scenario.mixer.tilt_reaction).roll_rad;
        let mut guidance = Self {
            settings: scenario.guidance.clone(),
            sample_s: scenario.sample_s(),
            sample_ns: scenario.sample_ns(),
            trajectory: Trajectory::new(scenario),
            roll_trim_rad,
            g_mps2: scenario.airframe.g_mps2,
            leads_by_delay: scenario.attitude.delay_compensation.is_measured(),
            memory: GuidanceMemory::default(),
        };
        let start = guidance.trajectory.at(0.0);
        guidance.memory.take_off = TakeOff::new(scenario.initial.standing, start.position_m[2]);
        guidance.memory.reference = Reference {
            position_m: start.position_m,
            attitude_rad: [roll_trim_rad, 0.0, guidance.trajectory.heading_at(0.0)],
            ..Reference::default()
        };
        guidance
    }

    /// Computes REFERENCE at `tick` for the newest `state`.
    ///
    /// The previous answer (hover before the first) is repeated with a flag if the state is missing, older than `tick`,
    /// without thrust or not finite, or if the answer would not be finite. For a state that was answered already, the
    /// answer is repeated without a flag.
    pub fn step(&mut self, tick: u64, state: &State) -> Reference {
        let before = self.memory;
        if state.stamp.sequence == 0 || state.stamp.tick < tick {
            return self.repeat(&before, guidance_flags::STALE);
        }
        if is_cut(state) {
            return self.repeat(&GuidanceMemory { cut: 1, ..before }, guidance_flags::STALE);
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

    /// Repeats the previous answer with `flag`. The memory is `before`, except that the step counts as silent.
    fn repeat(&mut self, before: &GuidanceMemory, flag: u64) -> Reference {
        self.memory = GuidanceMemory { silent: 1, ..*before };
        Reference { flags: before.reference.flags | flag, ..before.reference }
    }

    /// Answers a new sample, `periods` after the last one; 0 at the first.
    fn follow(&mut self, state: &State, periods: u64) -> Reference {
        let t_s = state.stamp.tick as f64 * self.sample_s;
        let elapsed_s = periods as f64 * self.sample_s;
        let is_silence = limits::is_silence(elapsed_s);
        if is_silence {
            self.memory.back = OptionalTick::some(state.stamp.tick);
        }
        let counts = periods > 0 && self.memory.silent == 0 && !is_silence;
        let lapse = Lapse {
            elapsed_s,
            counted_s: if counts { elapsed_s } else { self.sample_s },
            believed_periods: if is_silence || self.memory.cut == 1 { 1 } else { periods },
        };
        let setpoint = self.trajectory.for_vehicle_at(state.measured.position_m[2], t_s);
        let attitude = Vector3::from(state.measured.attitude_rad);
        let [phi, theta, psi] = state.measured.attitude_rad;
        let velocity_ned = Rotation3::from_euler_angles(phi, theta, psi) * Vector3::from(state.measured.velocity_mps);
        let climbs = self.trajectory.is_above_ground(t_s + SPOOL_UP_S);
        if let Some(w_mps) = self.memory.take_off.observe(state.measured.position_m[2], climbs) {
            return self.stand(&setpoint, w_mps, &velocity_ned, t_s);
        }
        let (errors, integral_clamped) = self.errors(&setpoint, state, &velocity_ned, lapse);
        let correction = Correction {
            errors,
            disturbance_mps2: self.disturbance(&velocity_ned, &attitude, lapse),
            heading_rad: self.settings.heading_frame.then_some(psi),
            exact_w: self.settings.exact_w.then(|| ExactW::new(state)),
            limits: self.limits(state.stamp.tick),
        };
        self.memory.age.observe(state, self.sample_ns);
        let delay_s = if self.leads_by_delay { self.memory.age.mean_s() } else { 0.0 };
        let ahead_s = t_s + self.settings.lead_s + delay_s;
        let heading_rad = self.trajectory.heading_at(ahead_s);
        let aim = self.aim(&correction, &self.trajectory.at(ahead_s), [heading_rad, 0.0]);
        self.unwind(&aim.clipped, correction.heading_rad.unwrap_or(0.0), lapse.counted_s);
        let mut reference = Reference {
            position_m: setpoint.position_m,
            velocity_mps: setpoint.velocity_mps,
            w_mps: aim.w_mps,
            attitude_rad: aim.attitude_rad.into(),
            rates_radps: self.rates(&aim.attitude_rad, &attitude, elapsed_s).into(),
            disturbance_mps2: correction.disturbance_mps2.into(),
            flags: aim.flags | if integral_clamped { guidance_flags::INTEGRAL_CLAMPED } else { 0 },
            ..Reference::default()
        };
        self.look_ahead(ahead_s, &correction, &mut reference);
        reference
    }

    /// Reference of a vehicle on its feet: level, with `w_mps`. Integrals and disturbance estimate are zero until the
    /// feet are off.
    fn stand(&mut self, setpoint: &Setpoint, w_mps: f64, velocity_ned: &Vector3<f64>, t_s: f64) -> Reference {
        self.memory.integral_ms = Vector3::zeros();
        self.memory.observer =
            DisturbanceObserver { velocity_ned_mps: *velocity_ned, ..DisturbanceObserver::default() };
        Reference {
            position_m: setpoint.position_m,
            velocity_mps: setpoint.velocity_mps,
            w_mps,
            attitude_rad: [0.0, 0.0, self.trajectory.heading_at(t_s)],
            ..Reference::default()
        }
    }

    /// Computes the references with the feed-forward of `setpoint` and the heading `heading_rad`, towards which the
    /// vehicle still turns by `turn_rad`.
    fn aim(&self, correction: &Correction, setpoint: &Setpoint, [heading_rad, turn_rad]: [f64; 2]) -> Aim {
        let Correction { errors, disturbance_mps2, limits, .. } = *correction;
        let frame = HeadingFrame::new(correction.heading_rad.map_or(0.0, |psi| psi + turn_rad));
        let wanted = pid::wanted(&self.settings, &errors.map(|e| frame.turn(&e)));
        let acceleration = frame.turn(&Vector3::from(setpoint.acceleration_mps2));
        let disturbance = HeadingFrame::new(turn_rad).turn(&disturbance_mps2.push(0.0));

        let mut angles = Vector2::new(wanted.phi_rad, wanted.theta_rad);
        if self.settings.acceleration_feedforward {
            angles += Vector2::new(acceleration.y, -acceleration.x) / self.g_mps2;
        }
        angles += Vector2::new(-libm::atan(disturbance.y / self.g_mps2), libm::atan(disturbance.x / self.g_mps2));
        let mut climb_mps = wanted.climb_mps;
        if self.settings.velocity_feedforward {
            climb_mps += setpoint.velocity_mps[2];
        }

        let mut flags = 0;
        let [phi_rad, theta_rad]: [f64; 2] = if self.settings.heading_frame {
            within(&angles, limits.angle_rad).into()
        } else {
            angles.map(|angle| angle.clamp(-limits.angle_rad, limits.angle_rad)).into()
        };
        for (wanted, limited, flag) in
            [(angles.x, phi_rad, guidance_flags::ROLL_LIMITED), (angles.y, theta_rad, guidance_flags::PITCH_LIMITED)]
        {
            flags |= if limited == wanted { 0 } else { flag };
        }
        let limited_mps = limit(climb_mps, limits.climb_mps, guidance_flags::W_LIMITED, &mut flags);
        let w_mps = correction.exact_w.map_or(limited_mps, |w| w.at(limited_mps));
        let w_mps = limit(w_mps, self.settings.w_limit_mps, guidance_flags::W_LIMITED, &mut flags);
        let roll_zero = match self.settings.roll_reference {
            RollReference::Trim => self.roll_trim_rad,
            RollReference::Absolute => 0.0,
        };
        Aim {
            w_mps,
            attitude_rad: Vector3::new(phi_rad + roll_zero, theta_rad, heading_rad),
            clipped: PidOutput {
                phi_rad: angles.x - phi_rad,
                theta_rad: angles.y - theta_rad,
                climb_mps: climb_mps - limited_mps,
            },
            flags,
        }
    }

    /// Adds the preview to `reference`, which has the feed-forward of `t_s`: the changes of its values until later
    /// times if `correction` stays.
    fn look_ahead(&self, t_s: f64, correction: &Correction, reference: &mut Reference) {
        let step_s = self.settings.preview_s / PREVIEW as f64;
        reference.preview_step_ns = libm::round(step_s * 1e9) as u64;
        if reference.preview_step_ns == 0 {
            return;
        }
        let Reference { w_mps, attitude_rad, .. } = *reference;
        let now = Vector3::from(attitude_rad);
        let (mut heading_rad, mut turn_rad) = (now.z, 0.0);
        let mut at_s = t_s;
        for ahead in &mut reference.preview {
            at_s += step_s;
            let later_rad = self.trajectory.heading_at(at_s);
            turn_rad += angle::difference(later_rad, heading_rad);
            heading_rad = later_rad;
            let setpoint = self.trajectory.at(at_s);
            let later = self.aim(correction, &setpoint, [heading_rad, turn_rad]);
            let change = later.attitude_rad - now;
            *ahead = Ahead { w_mps: later.w_mps - w_mps, attitude_rad: [change.x, change.y, turn_rad] };
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
        self.memory.integral_ms = bounded(&free, clamp);
        self.memory.error_m = error;
        ([error, self.memory.integral_ms, derivative], free != self.memory.integral_ms)
    }

    /// Feeds the part of the output that the limits cut off back into the integral, by back-calculation (Astrom and
    /// Hagglund, Advanced PID Control, ISA 2006, section 3.5) with the tracking time constant `Kp / Ki`:
    ///
    /// ```text
    /// d integral / dt = error - clipped / Kp
    /// ```
    fn unwind(&mut self, clipped: &PidOutput, frame_rad: f64, counted_s: f64) {
        let GuidanceSettings { kp_phi, kp_theta, kp_w, integral_limit, .. } = self.settings;
        let excess = [(clipped.theta_rad, kp_theta), (clipped.phi_rad, kp_phi), (clipped.climb_mps, kp_w)]
            .map(|(clipped, kp)| if clipped == 0.0 || kp == 0.0 { 0.0 } else { clipped / kp });
        if self.settings.heading_frame && excess != [0.0; 3] {
            let back = HeadingFrame::new(frame_rad).back(&Vector3::from(excess));
            self.memory.integral_ms = bounded(&(self.memory.integral_ms - back * counted_s), integral_limit);
        }
    }

    fn disturbance(&mut self, velocity_ned: &Vector3<f64>, attitude: &Vector3<f64>, lapse: Lapse) -> Vector2<f64> {
        let bandwidth = self.settings.disturbance_observer_radps;
        if bandwidth <= 0.0 {
            // A candidate that has an observer continues from this velocity.
            self.memory.observer =
                DisturbanceObserver { velocity_ned_mps: *velocity_ned, ..DisturbanceObserver::default() };
            return Vector2::zeros();
        }
        let tilt = Vector2::new(attitude.x - self.roll_trim_rad, attitude.y);
        // While the vehicle is tilted beyond the limit of guidance, its thrust does not carry it, and its acceleration
        // does not follow from its tilt.
        let is_upset = tilt.norm() > self.settings.angle_limit_deg.to_radians();
        let step = observer::ObserverStep {
            elapsed_s: if is_upset { 0.0 } else { lapse.elapsed_s },
            gain: (bandwidth * self.sample_s).min(1.0),
            periods: lapse.believed_periods,
        };
        self.memory.observer.update(velocity_ned, &tilt, attitude.z, self.g_mps2, step)
    }

    /// Limits of the reference at `tick`.
    fn limits(&self, tick: u64) -> ReferenceLimits {
        let GuidanceSettings { angle_limit_deg, climb_limit_mps, .. } = self.settings;
        let since_s = self.memory.back.get().map(|back| tick.saturating_sub(back) as f64 * self.sample_s);
        ReferenceLimits { angle_rad: angle_limit_deg.to_radians(), climb_mps: climb_limit_mps }.after_silence(since_s)
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

/// Returns whether the command in force has no thrust.
fn is_cut(state: &State) -> bool {
    state.command_in_force.rotor_speed == [0.0; 3]
}

fn all_finite(vectors: &[[f64; 3]]) -> bool {
    vectors.as_flattened().iter().all(|value| value.is_finite())
}

#[cfg(test)]
mod tests;
