//! Detection of a dead rotor and of a stuck tilt servo, by comparing the measured acceleration with the acceleration
//! that the commands should cause.
//!
//! The mixer does not measure rotor speeds or thrust. From the command in force it computes the speeds that the rotors
//! should have, the contribution `a_i` of each to the acceleration along the body's z axis and to the angular
//! accelerations, and the remainder `e` that these contributions do not explain:
//!
//! ```text
//! a_i  = (force / m along z,  J^-1 moment) of rotor i, by command, lag and limits
//! e    = (dw/dt + (omega x v - gravity) along z,  d omega / dt + J^-1 (omega x J omega))  -  sum a_i
//! ```
//!
//! A rotor without thrust leaves `e = -a_i`. `e` and `a_i` are averaged over 30 ms, which removes the noise. A rotor is
//! declared dead if for 50 ms in a row most of its moment is missing, in the direction of that moment, and half of its
//! lift too, while its commanded moment is not small. With `m` for the moments and `f` for the force in `a` and `e`:
//!
//! ```text
//! -e_m . m_i >= 0.7 |m_i|^2,     (e_m . m_i)^2 >= 0.8 |e_m|^2 |m_i|^2,     |m_i| >= 0.4 |m_i at hover|
//! -e_f f_i   >= 0.5 f_i^2
//! ```
//!
//! Two sensors must agree: late or wrong rates show moments that no actuator caused, but no missing lift. A failed tilt
//! servo shows no missing lift either, because it only changes the direction of the thrust.
//!
//! With one rotor dead no demand can hold pitch, roll and height together, so the thrust is cut, or [`crate::broken`]
//! brings the vehicle down. A weak rotor, a push, a wrong inertia or a late command is not taken for a dead rotor: its
//! effect differs in size, direction or duration.
//!
//! The yawing moment of rotor 1 is `R Omega1^2 sin(mu - psi)`, with `R = |(l1 K_F, K_M)|` and `psi` the trim tilt (27).
//! So the angle of the servo follows from the yaw acceleration of rotor 1, its expected part plus the remainder:
//!
//! ```text
//! sin(mu - psi) = Izz (a_1 + e)_r / (R Omega1^2)
//! ```
//!
//! The servo is declared stuck if this angle differs by 10 degrees or more from the expected angle, for 150 ms in a
//! row, and the missing yawing moment is larger than the missing rolling moment. A dead rotor is not taken for a stuck
//! servo: it is declared earlier, and a dead rear rotor leaves more roll than yaw.

use airframe::mixing::intermediate;
use airframe::{ActuatorLaw, MixingMatrix};
use bytemuck::{Pod, Zeroable};
use contract::actuation::Actuation;
use contract::message::Kinematics;
use nalgebra::{Matrix4x3, Vector3, Vector4};
use settings::Scenario;

/// Time constant of the averages \[s\].
const AVERAGE_S: f64 = 0.03;
/// Time for which a rotor must seem dead to be declared dead \[s\].
const MIN_DEAD_S: f64 = 0.05;
/// Smallest missing share of a dead rotor's moment: not all, because attitude-mpc's estimate makes up for 20 %.
const MIN_MISSING: f64 = 0.7;
/// Smallest missing share of a dead rotor's lift: lower, because velocity is measured worse than rates, and wind lifts
/// too.
const MIN_LIFT_MISSING: f64 = 0.5;
/// Smallest squared cosine of the angle between the missing moment and the moment of the rotor.
const MIN_ALIGNMENT: f64 = 0.8;
/// Smallest moment at which a rotor can be judged, as a share of its moment at hover.
const MIN_MOMENT: f64 = 0.4;
/// Smallest error of the tilt that counts \[rad\]: 10 degrees, twice the error of a servo that is slightly misaligned.
const MIN_TILT_ERROR_RAD: f64 = 0.175;
/// Time for which the tilt must be wrong for the servo to be declared stuck \[s\]: longer than for a dead rotor.
const MIN_STUCK_S: f64 = 0.15;
/// Longest gap between two samples that can be judged \[s\].
const MAX_GAP_S: f64 = 0.05;

/// Model of the accelerations that the rotors should cause.
#[derive(Debug, Clone)]
pub struct RotorModel {
    mixing: MixingMatrix,
    law: ActuatorLaw,
    /// Moments of inertia Ixx, Iyy, Izz \[kg m2\].
    inertia_kgm2: Vector3<f64>,
    mass_kg: f64,
    g_mps2: f64,
    /// Squared moment `|m_i|^2` at hover.
    hover: [f64; 3],
    /// Trim tilt psi \[rad\], and yawing moment R of rotor 1 per squared speed at a tilt a quarter turn from psi.
    yaw: (f64, f64),
}

/// Evidence for dead rotors and a stuck servo, from the samples so far.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct RotorEvidence {
    /// Expected actuator positions at the newest sample.
    pub actuation: Actuation,
    /// Average of `e` \[m/s2, rad/s2\].
    pub unexplained: Vector4<f64>,
    /// Averages of `a_i`, a column per rotor \[m/s2, rad/s2\].
    pub expected: Matrix4x3<f64>,
    /// Time for which each rotor has seemed dead \[s\].
    pub dead_s: Vector3<f64>,
    /// Time for which the servo has seemed stuck \[s\].
    pub stuck_s: f64,
}

impl RotorModel {
    /// Builds the model of `scenario`'s sound rotors, with the hover `trim`.
    pub fn new(scenario: &Scenario, mixing: MixingMatrix, trim: &Actuation) -> Self {
        let vehicle = &scenario.airframe;
        let inertia_kgm2 = vehicle.moments_kgm2();
        let (mass_kg, g_mps2) = (vehicle.mass_kg, vehicle.g_mps2);
        let yaw =
            (libm::atan2(vehicle.km, vehicle.l1_m * vehicle.kf), libm::hypot(vehicle.l1_m * vehicle.kf, vehicle.km));
        let law = scenario.actuator_law();
        let mut rotors = Self { mixing, law, inertia_kgm2, mass_kg, g_mps2, hover: [0.0; 3], yaw };
        let hover = rotors.expected(trim);
        rotors.hover = std::array::from_fn(|rotor| hover.fixed_view::<3, 1>(1, rotor).norm_squared());
        rotors
    }

    /// Evidence without any sample, with the actuators at the clipped `command`.
    pub fn unknown(&self, command: &Actuation) -> RotorEvidence {
        RotorEvidence { actuation: self.law.limits.clip(command), ..RotorEvidence::zeroed() }
    }

    /// Updates the evidence by a sample `elapsed_s` after the last one, from the measurements at both samples and the
    /// command in force between them. A gap longer than `MAX_GAP_S`, or a number that overflows, resets the evidence.
    pub fn observe(
        &self,
        before: &RotorEvidence,
        measured: [&Kinematics; 2],
        command: &Actuation,
        elapsed_s: f64,
    ) -> RotorEvidence {
        if elapsed_s <= 0.0 {
            return *before;
        }
        let actuation = self.law.advance(&before.actuation, command, elapsed_s);
        let expected = (self.expected(&before.actuation) + self.expected(&actuation)) * 0.5;
        let unexplained = self.acceleration(measured, elapsed_s) - expected.column_sum();

        let share = 1.0 - libm::exp(-elapsed_s / AVERAGE_S);
        let mut evidence = RotorEvidence {
            actuation,
            unexplained: before.unexplained + (unexplained - before.unexplained) * share,
            expected: before.expected + (expected - before.expected) * share,
            stuck_s: 0.0,
            dead_s: before.dead_s,
        };
        if elapsed_s > MAX_GAP_S || !evidence.unexplained.iter().all(|e| e.is_finite()) {
            return self.unknown(command);
        }
        for rotor in 0..3 {
            let seems_dead = self.seems_dead(&evidence, rotor);
            evidence.dead_s[rotor] = if seems_dead { before.dead_s[rotor] + elapsed_s } else { 0.0 };
        }
        let seems_stuck = self.seems_stuck(&evidence);
        evidence.stuck_s = if seems_stuck { before.stuck_s + elapsed_s } else { 0.0 };
        evidence
    }

    /// Angle of a servo that is declared stuck \[rad\], else `None`.
    pub fn stuck_tilt(&self, evidence: &RotorEvidence) -> Option<f64> {
        (evidence.stuck_s >= MIN_STUCK_S).then(|| self.apparent_tilt(evidence))
    }

    /// Angle of the servo that explains the yaw acceleration, at most a quarter turn from trim \[rad\].
    fn apparent_tilt(&self, evidence: &RotorEvidence) -> f64 {
        let (trim_rad, moment) = self.yaw;
        let square = evidence.actuation.rotor_speed[0] * evidence.actuation.rotor_speed[0];
        let yaw_nm = self.inertia_kgm2.z * (evidence.expected[(3, 0)] + evidence.unexplained[3]);
        trim_rad + libm::asin((yaw_nm / (moment * square)).clamp(-1.0, 1.0))
    }

    fn seems_stuck(&self, evidence: &RotorEvidence) -> bool {
        let [_, roll, _, yaw]: [f64; 4] = evidence.unexplained.into();
        let has_moment =
            evidence.expected.fixed_view::<3, 1>(1, 0).norm_squared() >= MIN_MOMENT * MIN_MOMENT * self.hover[0];
        let error_rad = self.apparent_tilt(evidence) - evidence.actuation.tilt_rad;
        has_moment
            && error_rad.abs() >= MIN_TILT_ERROR_RAD
            && self.inertia_kgm2.z * yaw.abs() >= self.inertia_kgm2.x * roll.abs()
    }

    fn seems_dead(&self, evidence: &RotorEvidence, rotor: usize) -> bool {
        let (missing, expected) = (-evidence.unexplained, evidence.expected.column(rotor));
        let (missing_m, expected_m) = (missing.fixed_rows::<3>(1), expected.fixed_rows::<3>(1));
        let (size, along) = (expected_m.norm_squared(), missing_m.dot(&expected_m));
        size >= MIN_MOMENT * MIN_MOMENT * self.hover[rotor]
            && along >= MIN_MISSING * size
            && along * along >= MIN_ALIGNMENT * size * missing_m.norm_squared()
            && missing[0] * expected[0] >= MIN_LIFT_MISSING * expected[0] * expected[0]
    }

    /// Accelerations by actuators and disturbances between two samples, from the measurements.
    fn acceleration(&self, [before, after]: [&Kinematics; 2], elapsed_s: f64) -> Vector4<f64> {
        let vector = |of: fn(&Kinematics) -> [f64; 3]| [before, after].map(|measured| Vector3::from(of(measured)));
        let mean = |[before, after]: [Vector3<f64>; 2]| (before + after) * 0.5;
        let (velocity, rates) = (vector(|m| m.velocity_mps), vector(|m| m.rates_radps));
        let [phi, theta, _]: [f64; 3] = mean(vector(|m| m.attitude_rad)).into();
        let omega = mean(rates);

        let carried = omega.cross(&mean(velocity)).z - self.g_mps2 * libm::cos(theta) * libm::cos(phi);
        let gyroscopic = omega.cross(&self.inertia_kgm2.component_mul(&omega)).component_div(&self.inertia_kgm2);
        let linear = (velocity[1].z - velocity[0].z) / elapsed_s + carried;
        let angular = (rates[1] - rates[0]) / elapsed_s + gyroscopic;
        Vector4::new(linear, angular.x, angular.y, angular.z)
    }

    /// Contributions `a_i`, a column per rotor.
    fn expected(&self, actuation: &Actuation) -> Matrix4x3<f64> {
        let u = intermediate(actuation);
        let rotor = |u: Vector4<f64>| {
            let [col, lon, lat, ped]: [f64; 4] = (self.mixing.forward * u).into();
            let [ixx, iyy, izz]: [f64; 3] = self.inertia_kgm2.into();
            Vector4::new(col / self.mass_kg, lat / ixx, lon / iyy, ped / izz)
        };
        Matrix4x3::from_columns(&[
            rotor(Vector4::new(u[0], u[1], 0.0, 0.0)),
            rotor(Vector4::new(0.0, 0.0, u[2], 0.0)),
            rotor(Vector4::new(0.0, 0.0, 0.0, u[3])),
        ])
    }
}

impl RotorEvidence {
    /// Rotor that is declared dead, 0 to 2; `None` if no rotor is.
    pub fn dead_rotor(&self) -> Option<usize> {
        (self.dead_s.max() >= MIN_DEAD_S).then(|| self.dead_s.imax())
    }
}

#[cfg(test)]
mod tests;
