//! Attitude errors in the level frame, and the force and moment for a wanted motion: common to `geometric` and `indi`.
//!
//! At trim the body is rolled by `phi_trim`, so that the thrust is vertical. The level frame `L` is the body turned
//! back by this roll: its z axis is the direction of the thrust at trim, and its Euler angles are the deviations of the
//! state `x`. Tilt and heading are taken in this frame: a turn about the body's z axis would tilt the thrust.
//!
//! The rotation from `L` to its reference, `q = (w, x, y, z)`, is split into a tilt, about an axis in the plane of
//! x and y, and a turn about z after it:
//!
//! ```text
//! q = tilt turn      tilt = (n, (w x - y z)/n, (w y + x z)/n, 0)      turn = (w, 0, 0, z)/n      n = sqrt(w2 + z2)
//! e = 2 (tilt_x, tilt_y, sgn(w) turn_z)
//! ```
//!
//! (Brescianini and D'Andrea, *Tilt-prioritized quadrocopter attitude control*, IEEE Transactions on Control Systems
//! Technology 28, 2020.) The tilt error does not depend on the heading error, `e` is the angle for small errors, and it
//! grows up to 2 for half a turn. An inverted vehicle (n = 0) tilts about `(x, y)` and does not turn.
//!
//! The vertical acceleration, down positive, is `g + (F_y sin phi cos theta + F_z cos phi cos theta) / m`. The law asks
//! for an acceleration in the world frame and not for a derivative of w, because guidance makes the reference of w from
//! a vertical speed at the measured attitude: the terms that turning axes add to w are in the reference too. The side
//! force `F_y` follows from the demand by the mixing matrix. Beyond 60 degrees of tilt the inverse `1 / c` of the share
//! `c` of col that is vertical becomes `4 c`, which is small for a vehicle on its side, and negative for an inverted
//! one.

use airframe::{MixingMatrix, Parameters, Trim};
use contract::actuation::Actuation;
use nalgebra::{DVectorView, Quaternion, UnitQuaternion, Vector3, Vector4};

/// Smallest vertical share of col at which the vertical acceleration is inverted exactly.
const LEAST_LIFT: f64 = 0.5;
/// Length of `(w, z)` below which the vehicle counts as inverted.
const INVERTED: f64 = 1e-9;

/// Vehicle as a rigid body about its trim.
#[derive(Debug, Clone)]
pub struct RigidBody {
    g_mps2: f64,
    mass_kg: f64,
    /// Moments of inertia Ixx, Iyy, Izz \[kg m2\].
    inertia_kgm2: Vector3<f64>,
    kf: f64,
    trim_roll_rad: f64,
    /// Sine and cosine of the roll of trim.
    trim_roll: (f64, f64),
    mixing: MixingMatrix,
}

impl RigidBody {
    /// Builds the rigid body of `vehicle` about its `trim`, with the map `mixing` of its actuators.
    pub fn new(vehicle: &Parameters, trim: &Trim, mixing: &MixingMatrix) -> Self {
        Self {
            g_mps2: vehicle.g_mps2,
            mass_kg: vehicle.mass_kg,
            inertia_kgm2: vehicle.moments_kgm2(),
            kf: vehicle.kf,
            trim_roll_rad: trim.roll_rad,
            trim_roll: libm::sincos(trim.roll_rad),
            mixing: *mixing,
        }
    }

    /// Errors of a state `x` against its reference `r`, both (w, phi, theta, psi, p, q, r, ...) as deviations from
    /// trim: the error of the vertical speed \[m/s\]; then, about x, y, z of the level frame, the errors of tilt and
    /// heading \[rad\] and of the rates \[rad/s\].
    pub fn errors(&self, x: &DVectorView<f64>, r: &[f64; 7]) -> [f64; 7] {
        let attitude = UnitQuaternion::from_euler_angles(x[1], x[2], x[3]);
        let wanted = UnitQuaternion::from_euler_angles(r[1], r[2], r[3]);
        let turn = attitude.inverse() * wanted;
        let [ex, ey, ez] = attitude_error(&turn);
        let rates = self.level(Vector3::new(x[4], x[5], x[6]));
        let [ep, eq, er] = (turn * self.level(Vector3::new(r[4], r[5], r[6])) - rates).into();
        [self.down(x)[1] * (r[0] - x[0]), ex, ey, ez, ep, eq, er]
    }

    /// Demand col, lon, lat, ped \[N, N m, N m, N m\] at `x` for an acceleration down in the world frame \[m/s2\] and
    /// angular accelerations about y, x, z of the level frame \[rad/s2\], by `J alpha`. The inputs `beside` are added.
    pub fn demand(&self, x: &DVectorView<f64>, accelerations: &Vector4<f64>, beside: &Vector4<f64>) -> Vector4<f64> {
        let [down, ay, ax, az] = (*accelerations).into();
        let moment = self.inertia_kgm2.component_mul(&self.body(Vector3::new(ax, ay, az)));
        let moments = Vector4::new(0.0, moment.y + beside[1], moment.x + beside[2], moment.z + beside[3]);
        let held = self.vertical_n(x, &moments); // vertical force with a col of 0
        let col = (self.mass_kg * (down - self.g_mps2) - held) * inverse(self.lift(x)) + beside[0];
        moments + Vector4::new(col, 0.0, 0.0, 0.0)
    }

    /// Accelerations, as in [`demand`](Self::demand), that `inputs` add to the accelerations by other inputs, to first
    /// order.
    pub fn accelerations(&self, x: &DVectorView<f64>, inputs: &Vector4<f64>) -> Vector4<f64> {
        let moment = Vector3::new(inputs[2], inputs[1], inputs[3]);
        let turning = self.level(moment.component_div(&self.inertia_kgm2));
        Vector4::new(inputs[0] * self.lift(x) / self.mass_kg, turning.y, turning.x, turning.z)
    }

    /// Moment `omega x J omega` about y, x, z that keeps the rates of `x`, as lon, lat, ped with a col of 0.
    pub fn gyroscopic(&self, x: &DVectorView<f64>) -> Vector4<f64> {
        let rates = Vector3::new(x[4], x[5], x[6]);
        let moment = rates.cross(&self.inertia_kgm2.component_mul(&rates));
        Vector4::new(0.0, moment.y, moment.x, moment.z)
    }

    /// Acceleration down \[m/s2\] and moments lon, lat, ped \[N m\] that actuators at `actuation` produce at `x`.
    pub fn produced(&self, x: &DVectorView<f64>, actuation: &Actuation) -> Vector4<f64> {
        let mut inputs = self.mixing.deviation(actuation);
        inputs[0] = self.g_mps2 + self.vertical_n(x, &inputs) / self.mass_kg;
        inputs
    }

    /// Inputs col, lon, lat, ped for an acceleration down \[m/s2\] and angular accelerations q, p, r \[rad/s2\] that
    /// the actuators do not produce.
    pub fn inputs(&self, x: &DVectorView<f64>, beyond: &Vector4<f64>) -> Vector4<f64> {
        let [ixx, iyy, izz] = self.inertia_kgm2.into();
        beyond.component_mul(&Vector4::new(self.mass_kg * inverse(self.lift(x)), iyy, ixx, izz))
    }

    /// Moments of inertia about y, x, z \[kg m2\], behind a 1 for the acceleration down.
    pub fn inertia(&self) -> Vector4<f64> {
        let [ixx, iyy, izz] = self.inertia_kgm2.into();
        Vector4::new(1.0, iyy, ixx, izz)
    }

    /// Force down \[N\] of actuators that produce `inputs`: along body z, and along y by the tilted rotor 1.
    fn vertical_n(&self, x: &DVectorView<f64>, inputs: &Vector4<f64>) -> f64 {
        let [y, z] = self.down(x);
        let side_n = self.kf * (self.mixing.trim[0] + (self.mixing.inverse.row(0) * inputs)[0]);
        y * side_n + z * (inputs[0] - self.mass_kg * self.g_mps2 * self.trim_roll.1)
    }

    /// Force down for each newton of col: rotor 1 tilts so that its side force keeps ped.
    fn lift(&self, x: &DVectorView<f64>) -> f64 {
        let [y, z] = self.down(x);
        z + y * self.kf * self.mixing.inverse[(0, 0)]
    }

    /// Components of the direction down along body y and z.
    fn down(&self, x: &DVectorView<f64>) -> [f64; 2] {
        let (sin_phi, cos_phi) = libm::sincos(x[1] + self.trim_roll_rad);
        let cos_theta = libm::cos(x[2]);
        [sin_phi * cos_theta, cos_phi * cos_theta]
    }

    /// Turns a vector from body to level axes.
    fn level(&self, v: Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = self.trim_roll;
        Vector3::new(v.x, cos * v.y - sin * v.z, sin * v.y + cos * v.z)
    }

    /// Turns a vector from level to body axes.
    fn body(&self, v: Vector3<f64>) -> Vector3<f64> {
        let (sin, cos) = self.trim_roll;
        Vector3::new(v.x, cos * v.y + sin * v.z, cos * v.z - sin * v.y)
    }
}

/// Inverse of a lift, bounded where the force is nearly horizontal.
fn inverse(lift: f64) -> f64 {
    lift / (lift * lift).max(LEAST_LIFT * LEAST_LIFT)
}

/// Tilt error about x and y and heading error about z of the rotation `turn` to the reference \[rad for small errors\].
pub fn attitude_error(turn: &UnitQuaternion<f64>) -> [f64; 3] {
    let Quaternion { coords } = turn.quaternion();
    let [x, y, z, w]: [f64; 4] = (*coords).into();
    let n = (w * w + z * z).sqrt();
    if n < INVERTED {
        return [2.0 * x, 2.0 * y, 0.0];
    }
    let towards = if w < 0.0 { -2.0 } else { 2.0 };
    [2.0 * (w * x - y * z) / n, 2.0 * (w * y + x * z) / n, towards * z / n]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::{DVector, Unit};
    use proptest::prelude::*;

    use super::*;

    fn level() -> RigidBody {
        let vehicle = Parameters::default();
        RigidBody::new(&vehicle, &Trim::solve(&vehicle, false), &MixingMatrix::new(&vehicle, false))
    }

    fn about(axis: [f64; 3], angle_rad: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Unit::new_normalize(axis.into()), angle_rad)
    }

    #[test]
    fn the_error_of_a_small_rotation_is_its_angle() {
        for (axis, i) in [([1.0, 0.0, 0.0], 0), ([0.0, 1.0, 0.0], 1), ([0.0, 0.0, 1.0], 2)] {
            for angle_rad in [-1e-3, 1e-3] {
                let mut error = attitude_error(&about(axis, angle_rad));
                error[i] -= angle_rad;
                assert!(error.iter().all(|e| e.abs() < 1e-9), "{error:?}");
            }
        }
    }

    #[test]
    fn a_vehicle_upside_down_tilts_and_does_not_turn() {
        for axis in [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [3.0, -4.0, 0.0]] {
            let [x, y, z] = attitude_error(&about(axis, PI));
            assert!((x.hypot(y) - 2.0).abs() < 1e-9 && z.abs() < 1e-6, "{:?}", [x, y, z]);
        }
    }

    #[test]
    fn the_inverse_of_the_lift_keeps_its_sign_and_a_bound() {
        assert_eq!([inverse(1.0), inverse(0.5), inverse(-0.5), inverse(0.0)], [1.0, 2.0, -2.0, 0.0]);
        assert!((0..=1000).all(|i| inverse(f64::from(i) / 500.0 - 1.0).abs() <= 2.0));
    }

    proptest! {
        #[test]
        fn a_heading_error_leaves_the_tilt_alone(
            way in -PI..PI, tilt_rad in 0.0..3.1_f64, turn_rad in -PI..PI,
        ) {
            let tilt = about([way.cos(), way.sin(), 0.0], tilt_rad);
            let both = attitude_error(&(tilt * about([0.0, 0.0, 1.0], turn_rad)));
            let alone = attitude_error(&tilt);
            prop_assert!((both[0] - alone[0]).abs() < 1e-9 && (both[1] - alone[1]).abs() < 1e-9, "{both:?} {alone:?}");
            prop_assert!(alone[2].abs() < 1e-9 && (both[2] - 2.0 * (0.5 * turn_rad).sin()).abs() < 1e-9, "{both:?}");
            prop_assert!((alone[0].hypot(alone[1]) - 2.0 * (0.5 * tilt_rad).sin()).abs() < 1e-9);
        }

        #[test]
        fn every_attitude_has_an_error_and_none_at_the_reference(
            x in prop::array::uniform7(-4.0..4.0_f64), r in prop::array::uniform7(-4.0..4.0_f64),
        ) {
            let (level, view) = (level(), DVector::from_row_slice(&x));
            let errors = level.errors(&view.as_view(), &r);
            prop_assert!(errors[1].hypot(errors[2]) <= 2.0 + 1e-9 && errors[3].abs() <= 2.0 + 1e-9, "{errors:?}");
            let none = level.errors(&view.as_view(), &x);
            prop_assert!(none.iter().all(|e| e.abs() < 1e-12), "{none:?}");
        }
    }
}
