//! Descent of a broken vehicle, `mixer.broken_vehicle = "descend"`: yaw is given up, and the vehicle spins.
//!
//! | broken | forces and moments that are left | descent |
//! |---|---|---|
//! | rotor 1 | lift has a pitching moment; yaw and roll are one input | [spin] on rotors 2 and 3 |
//! | rotor 2 or 3 | lift has a rolling moment, or only rotor 1 lifts | none: thrust is cut |
//! | tilt servo | lift, pitch and roll, from which yaw follows | level spin, which the vehicle's inertia slows |
//!
//! Rotor 1 alone could carry a spin too, of 31 rad/s with four fifths of its thrust. But the regulator below, built for
//! this spin, does not reach it from the motion after a rear rotor died, so thrust is cut.
//!
//! Both laws are given the motion at which their command takes effect ([`crate::ahead`]).
//!
//! # Rotor 1
//!
//! The spin is held by a linear-quadratic regulator, from the linear model of [`airframe::spin`] and the speeds that
//! the rotors should have. Each weighted square is one at these errors: lean 0.45 rad, rates 2.2 rad/s, sink rate 2.2
//! m/s, commanded rotor speeds 1.8 times the speed in the spin. The error of the sink rate is clipped, so that the
//! vehicle recovers its attitude before its height.
//!
//! Here `n` is the direction down, leaned by the wanted braking of the horizontal velocity, at most 17 degrees: the
//! mean thrust is along the axis of the spin. Without this lean the vehicle keeps the speed that it gained before it
//! spun. The level spin below has no such lean: its vehicle has little speed, and the lean would only brake its
//! circling.
//!
//! A vehicle whose rotors cannot bring it up to the spin in half a second, such as the ten-inch vehicle, would tumble
//! to the ground before that, so its thrust is cut.
//!
//! # Tilt servo
//!
//! At the angle `mu` lift has a yawing moment, which is zero only at the trim tilt. Differential thrust cannot balance
//! it: the yawing moment of the rear rotors is a fixed multiple of their rolling moment, so it always comes with a
//! rolling moment. Only the inertia of a spinning vehicle is left. At a rate `r` a vehicle that leans by
//! `n = (n_x, n_y)` has
//!
//! ```text
//! Izz dr/dt = M_z + (Ixx - Iyy) n_x n_y r^2
//! ```
//!
//! so the law leans against the spin, in a direction that is fixed in the body, and leans more in a faster spin:
//!
//! ```text
//! n_y* = a(r) + n_y,trim max(0, 1 - |r| / r_0),      n_x* = -sign(r (Ixx - Iyy)) a(r)
//! a(r) = max(a_0 min(|r| / r_0, 1), min(|r| / r_1, a_max))
//! p* = (n_x r - k (n_y - n_y*)) / n_z,      q* = (n_y r + k (n_x - n_x*)) / n_z         from dn/dt = n x w
//! lat = Ixx c (p* - p) + (w x J w)_x,       lon = Iyy c (q* - q) + (w x J w)_y
//! ```
//!
//! The three rotors give lift, lon and lat exactly. Moments come first: lift is limited to the range in which the
//! moments are produced in full. Only moments that no lift allows in full are scaled down, together and no more than
//! needed.

use airframe::spin::{self, Spin};
use airframe::{ActuatorLaw, ActuatorLimits, MixingMatrix, Parameters, Trim, riccati};
use contract::actuation::Actuation;
use contract::message::Kinematics;
use nalgebra::{DMatrix, DVector, Matrix3, SMatrix, Vector3};
use settings::Scenario;

use crate::ahead::{Body, Motion};
use crate::damage::BrokenPart;
use crate::fallback::{CLIMB_BANDWIDTH_RADPS, DESCENT_MPS};

/// Longest time in which the yawing moment of the rear rotors must be able to reach the spin \[s\].
const MAX_SPIN_UP_S: f64 = 0.5;
/// Diagonal of the state weight of the spin.
const SPIN_WEIGHTS: [f64; spin::STATES] = [5.0, 5.0, 0.2, 0.2, 0.2, 0.2, 1e-9, 1e-9];
/// Weight of a rotor speed, times the square of its speed in the spin.
const SPIN_INPUT_WEIGHT: f64 = 0.3;
/// Bound to which the regulator of the spin clips the error of the sink rate \[m/s\].
const MAX_SINK_ERROR_MPS: f64 = 2.0;
/// Gain of the braking of horizontal speed \[1/s\].
const DRIFT_GAIN_RADPS: f64 = 1.5;
/// Largest acceleration against the horizontal velocity \[m/s2\]: a lean of 17 degrees.
const MAX_BRAKING_MPS2: f64 = 3.0;
/// Shortest lag of a rotor in the model of the spin \[s\].
const MIN_LAG_S: f64 = 1e-3;

/// Lean of each axis in a level spin, `a_0`: together 16 degrees, which the feet allow at a landing.
const LEAN: f64 = 0.2;
/// Rate from which on each axis leans by `a_0`: `r_0` \[rad/s\].
const LEAN_RADPS: f64 = 8.0;
/// Rate at which the lean of each axis would be 1, `r_1` \[rad/s\]: above 16 rad/s the lean exceeds `a_0`.
const STEEP_RADPS: f64 = 80.0;
/// Largest lean of each axis, `a_max`: together 30 degrees.
const MAX_LEAN: f64 = 0.35;
/// Gain of the lean, `k` \[1/s\].
const LEAN_GAIN_RADPS: f64 = 5.0;
/// Gain of the rates, `c` \[1/s\].
const RATE_GAIN_RADPS: f64 = 20.0;
/// Largest vertical acceleration demanded of the level spin \[m/s2\].
const MAX_CLIMB_MPS2: f64 = 3.0;
/// Lower bound on the vertical share of the thrust in the computation of a command.
const MIN_UPRIGHT: f64 = 0.3;

/// Laws of the descent of one vehicle.
#[derive(Debug, Clone)]
pub struct Broken {
    on_rear_rotors: Option<OnRearRotors>,
    body: Body,
    limits: ActuatorLimits,
    trim: Trim,
}

/// Steady spin with its regulator.
#[derive(Debug, Clone)]
struct OnRearRotors {
    spin: Spin,
    gain: SMatrix<f64, { spin::INPUTS }, { spin::STATES }>,
}

impl Broken {
    /// Builds the laws for the vehicle of `scenario`, whose actuators obey `law` while they work.
    pub fn new(scenario: &Scenario, mixing: MixingMatrix, law: &ActuatorLaw) -> Self {
        let vehicle = scenario.airframe;
        let trim = Trim::solve(&vehicle, scenario.mixer.tilt_reaction);
        let sample_s = scenario.sample_s();
        let on_rear_rotors = OnRearRotors::new(&vehicle, law, sample_s);
        let body = Body { mixing, vehicle, rotor_lag_s: law.rotor_lag_s.max(MIN_LAG_S) };
        Self { on_rear_rotors, body, limits: law.limits, trim }
    }

    /// Returns whether the vehicle can descend without `part`.
    pub fn descends_without(&self, part: BrokenPart) -> bool {
        match part {
            BrokenPart::Rotor(rotor) => rotor == 0 && self.on_rear_rotors.is_some(),
            BrokenPart::Tilt(_) => true,
        }
    }

    /// Computes the command of a descent without `part`, from the newest measurements, the `position` that sound
    /// actuators should have, and the `course` of commands, each with its time \[s\], until the new command takes
    /// effect; the caller clips the new command. `None` if the vehicle cannot descend, or if a number overflows.
    pub fn command(
        &self,
        part: BrokenPart,
        measured: &Kinematics,
        position: &Actuation,
        course: impl Iterator<Item = (Actuation, f64)>,
    ) -> Option<Actuation> {
        let (dead, tilt_rad) = match part {
            BrokenPart::Rotor(rotor) => (Some(rotor), position.tilt_rad),
            BrokenPart::Tilt(tilt_rad) => (None, tilt_rad),
        };
        let now = Motion {
            down: down_in_body(measured),
            rates_radps: measured.rates_radps.into(),
            velocity_mps: measured.velocity_mps.into(),
            sink_mps: measured.sink_mps(),
            position: Actuation { tilt_rad, ..*position },
        };
        let Motion { down, rates_radps: rates, velocity_mps, sink_mps, position } = self.body.ahead(&now, course, dead);
        let faster_mps = DESCENT_MPS - sink_mps;
        let command = match part {
            BrokenPart::Rotor(0) => {
                let [_, right, left] = position.rotor_speed;
                let axis = self.against_drift(&down, &velocity_mps);
                let rear_speed = self.on_rear_rotors.as_ref()?.rear_speed(&axis, &rates, faster_mps, [right, left]);
                Actuation { rotor_speed: [0.0, rear_speed[0], rear_speed[1]], ..self.trim.actuation }
            }
            BrokenPart::Rotor(_) => return None,
            BrokenPart::Tilt(tilt_rad) => {
                let fall_mps2 = (CLIMB_BANDWIDTH_RADPS * faster_mps).clamp(-MAX_CLIMB_MPS2, MAX_CLIMB_MPS2);
                let [lat, lon] = self.level_spin(&down, &rates);
                let remaining = Remaining::new(&self.body.mixing, &self.limits, tilt_rad)?;
                let upright = (down.z - remaining.side * down.y).max(MIN_UPRIGHT);
                let lift_n = self.body.vehicle.mass_kg * (self.body.vehicle.g_mps2 - fall_mps2) / upright;
                Actuation { rotor_speed: remaining.allocate(lift_n, lon, lat), tilt_rad }
            }
        };
        command.is_finite().then_some(command)
    }

    /// Direction that the spin takes for down, in the body frame, so that its thrust brakes the horizontal velocity.
    fn against_drift(&self, down: &Vector3<f64>, velocity_mps: &Vector3<f64>) -> Vector3<f64> {
        let braking_mps2 = (velocity_mps - down * velocity_mps.dot(down)) * DRIFT_GAIN_RADPS;
        let size_mps2 = braking_mps2.norm();
        let share = if size_mps2 > MAX_BRAKING_MPS2 { MAX_BRAKING_MPS2 / size_mps2 } else { 1.0 };
        (down * self.body.vehicle.g_mps2 + braking_mps2 * share).normalize()
    }

    /// Moments about x and y that lean the vehicle against its spin \[N m\].
    fn level_spin(&self, down: &Vector3<f64>, rates: &Vector3<f64>) -> [f64; 2] {
        let Parameters { ixx_kgm2: ixx, iyy_kgm2: iyy, .. } = self.body.vehicle;
        let (r, upright) = (rates.z, down.z.max(MIN_UPRIGHT));
        let share = (r.abs() / LEAN_RADPS).min(1.0);
        let lean = (LEAN * share).max((r.abs() / STEEP_RADPS).min(MAX_LEAN));
        let lean_x = -lean * (r * (ixx - iyy)).signum();
        let lean_y = lean + libm::sin(self.trim.roll_rad) * (1.0 - share);
        let p = (down.x * r - LEAN_GAIN_RADPS * (down.y - lean_y)) / upright;
        let q = (down.y * r + LEAN_GAIN_RADPS * (down.x - lean_x)) / upright;
        let gyroscopic = rates.cross(&self.body.vehicle.moments_kgm2().component_mul(rates));
        [ixx * RATE_GAIN_RADPS * (p - rates.x) + gyroscopic.x, iyy * RATE_GAIN_RADPS * (q - rates.y) + gyroscopic.y]
    }
}

impl OnRearRotors {
    /// Builds spin and regulator; `None` if the vehicle has no spin or cannot reach it in time, or if no regulator
    /// exists.
    fn new(vehicle: &Parameters, law: &ActuatorLaw, sample_s: f64) -> Option<Self> {
        let [_, right, left] = law.limits.rotor_speed_max;
        let spin = Spin::solve(vehicle, right.min(left))?;
        let most_nm = 2.0 * vehicle.km * spin.rotor_speed * spin.rotor_speed; // with all thrust on one rear rotor
        if vehicle.izz_kgm2 * spin.rates_radps.z > MAX_SPIN_UP_S * most_nm {
            return None;
        }
        let (a, b) = spin.discretise(vehicle, law.rotor_lag_s.max(MIN_LAG_S), sample_s);
        let q = DMatrix::from_diagonal(&DVector::from_row_slice(&SPIN_WEIGHTS));
        let r =
            DMatrix::identity(spin::INPUTS, spin::INPUTS) * (SPIN_INPUT_WEIGHT / (spin.rotor_speed * spin.rotor_speed));
        let s = riccati::solve(&a, &b, &q, &r)?;
        let bs = b.transpose() * s;
        let gain = (&r + &bs * &b).cholesky()?.solve(&(&bs * a));
        Some(Self { spin, gain: SMatrix::from_iterator(gain.iter().copied()) })
    }

    /// Speeds of rotors 2 and 3 that hold the spin, while the vehicle is to sink faster by `faster_mps`.
    fn rear_speed(&self, down: &Vector3<f64>, rates: &Vector3<f64>, faster_mps: f64, rear_speed: [f64; 2]) -> [f64; 2] {
        let sink_mps = (-faster_mps).clamp(-MAX_SINK_ERROR_MPS, MAX_SINK_ERROR_MPS);
        let wanted = -self.gain * self.spin.deviation(down, rates, sink_mps, rear_speed);
        [self.spin.rotor_speed + wanted[0], self.spin.rotor_speed + wanted[1]]
    }
}

/// Lift, lon and lat that three rotors can give while the servo is stuck: the exact set.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Remaining {
    /// Squared rotor speeds per newton of lift, without moments.
    per_lift: Vector3<f64>,
    /// Squared rotor speeds per newton metre of lon and of lat, without lift.
    per_moment: [Vector3<f64>; 2],
    lower: Vector3<f64>,
    upper: Vector3<f64>,
    /// Force along body y per newton of lift.
    pub side: f64,
}

impl Remaining {
    /// Builds the set for a servo that is stuck at `tilt_rad`; `None` if rotor 1 then gives no lift.
    pub fn new(mixing: &MixingMatrix, limits: &ActuatorLimits, tilt_rad: f64) -> Option<Self> {
        let (sin, cos) = libm::sincos(tilt_rad);
        let front = mixing.forward.column(0) * sin + mixing.forward.column(1) * cos;
        let columns = [front.fixed_rows::<3>(0), mixing.forward.fixed_view(0, 2), mixing.forward.fixed_view(0, 3)];
        let inverse = Matrix3::from_columns(&columns.map(nalgebra::Matrix::into_owned)).try_inverse()?;
        let per_lift = -inverse.column(0).into_owned();
        let square = |speed: f64| speed * speed;
        let side = -mixing.forward[(0, 1)] * sin * per_lift[0];
        (per_lift.min() > 0.0).then(|| Self {
            per_lift,
            per_moment: [inverse.column(1).into_owned(), inverse.column(2).into_owned()],
            lower: Vector3::repeat(square(limits.rotor_speed_min)),
            upper: Vector3::from(limits.rotor_speed_max.map(square)),
            side,
        })
    }

    /// Rotor speeds for `lift_n`, `lon_nm` and `lat_nm`. If these are outside the set, lift is changed first, and the
    /// moments are scaled down only if no lift allows them in full.
    pub fn allocate(&self, lift_n: f64, lon_nm: f64, lat_nm: f64) -> [f64; 3] {
        let moments = self.per_moment[0] * lon_nm + self.per_moment[1] * lat_nm;
        let moments = moments * self.share(&moments);
        let lowest_n = (self.lower - moments).component_div(&self.per_lift).max();
        let highest_n = (self.upper - moments).component_div(&self.per_lift).min();
        let lift_n = lift_n.min(highest_n).max(lowest_n);
        (self.per_lift * lift_n + moments).map(|square| square.max(0.0).sqrt()).into()
    }

    /// Largest share, 0 to 1, of the squares for `moments` that fits into the limits with some lift.
    ///
    /// For each pair of rotors i and j, the lift that keeps rotor i above its lower limit must be no larger than the
    /// lift that keeps rotor j below its upper limit.
    fn share(&self, moments: &Vector3<f64>) -> f64 {
        let mut share = 1.0_f64;
        for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
            let taken = moments[j] / self.per_lift[j] - moments[i] / self.per_lift[i];
            let room = self.upper[j] / self.per_lift[j] - self.lower[i] / self.per_lift[i];
            if taken > room {
                share = share.min((room / taken).max(0.0));
            }
        }
        share
    }
}

/// Direction down in the body frame, `n`.
fn down_in_body(measured: &Kinematics) -> Vector3<f64> {
    let [(sin_phi, cos_phi), (sin_theta, cos_theta)] =
        [measured.attitude_rad[0], measured.attitude_rad[1]].map(libm::sincos);
    Vector3::new(-sin_theta, sin_phi * cos_theta, cos_phi * cos_theta)
}

#[cfg(test)]
mod tests;
