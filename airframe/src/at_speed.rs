//! Linear model of attitude and vertical velocity at any flight condition; [`linear`](crate::linear) has the hover
//! model.
//!
//! ```text
//! dx/dt = A x + B (u + o)
//! w'     = q u - p v + g cos phi cos theta + F_z / m - (d_z + c |V|) w / m            (11), with drag
//! phi'   = p + tan theta (q sin phi + r cos phi)                                      (8)
//! theta' = q cos phi - r sin phi
//! psi'   = (q sin phi + r cos phi) / cos theta
//! p'     = ((Iyy - Izz) q r + lat) / Ixx, and so on                                   (12)-(14)
//! ```
//!
//! State and inputs are deviations from hover at every point, so that models of different points can follow each other.
//! The offset `o` is the part of the equations of motion at the point that `A x + B u` does not contain. The velocities
//! u and v, and phi and theta in (8), change slowly and are parameters: their terms are exact at the point and add
//! nothing to `o`. Gravity and the products of rates are linearised.
//!
//! At speed, `w` changes when the vehicle pitches, although its velocity over ground does not. `lean` has the
//! coefficients of that change: `dw = -(v dphi - u cos phi dtheta)`, the integral of `q u - p v` in (11).

use nalgebra::Vector4;

use crate::level_flight::{Drag, LevelFlight};
use crate::linear::Continuous;
use crate::{Parameters, Trim};

/// Largest roll and pitch of a point \[rad\]: (8) is singular at a pitch of pi / 2.
const MAX_ANGLE_RAD: f64 = 1.2;
/// Largest velocity of a point along a body axis \[m/s\].
const MAX_VELOCITY_MPS: f64 = 50.0;
/// Largest body rate of a point \[rad/s\], from (51).
const MAX_RATE_RADPS: f64 = std::f64::consts::TAU;

/// Point at which the equations of motion are linearised.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FlightPoint {
    /// Body velocity u, v, w \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Roll phi \[rad\].
    pub roll_rad: f64,
    /// Pitch theta \[rad\].
    pub pitch_rad: f64,
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
}

/// Linear model about a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtSpeed {
    /// Matrices `A` and `B`.
    pub continuous: Continuous,
    /// Offset `o` on the inputs \[N, N m, N m, N m\].
    pub offset: Vector4<f64>,
    /// Negative derivative of w by phi and by theta at constant velocity over ground \[m/s per rad\].
    pub lean: [f64; 2],
}

impl From<&LevelFlight> for FlightPoint {
    fn from(level: &LevelFlight) -> Self {
        let LevelFlight { velocity_mps, roll_rad, pitch_rad, .. } = *level;
        Self { velocity_mps, roll_rad, pitch_rad, rates_radps: [0.0; 3] }
    }
}

impl AtSpeed {
    /// Linearises at `point`, clamped to the `MAX_` constants. `trim` is the hover.
    pub fn new(vehicle: &Parameters, trim: &Trim, drag: &Drag, point: &FlightPoint) -> Self {
        let Parameters { g_mps2: g, mass_kg: m, ixx_kgm2: ixx, iyy_kgm2: iyy, izz_kgm2: izz, .. } = *vehicle;
        let [u, v, w] = point.velocity_mps.map(|x| x.clamp(-MAX_VELOCITY_MPS, MAX_VELOCITY_MPS));
        let [p, q, r] = point.rates_radps.map(|x| x.clamp(-MAX_RATE_RADPS, MAX_RATE_RADPS));
        let [phi, theta] = [point.roll_rad, point.pitch_rad].map(|x| x.clamp(-MAX_ANGLE_RAD, MAX_ANGLE_RAD));
        let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (libm::sincos(phi), libm::sincos(theta));
        let speed = (u * u + v * v + w * w).sqrt();

        let mut continuous = Continuous::hover(vehicle, trim);
        let a = &mut continuous.a;
        a.fill(0.0);
        a[(0, 0)] = -drag.per_velocity(speed)[2] / m;
        a[(0, 1)] = -g * sin_phi * cos_theta;
        a[(0, 2)] = -g * cos_phi * sin_theta;
        a[(0, 4)] = -v; // (11), linearised
        a[(0, 5)] = u;
        a[(1, 4)] = 1.0; // (8), linearised
        a[(1, 5)] = sin_phi * libm::tan(theta);
        a[(1, 6)] = cos_phi * libm::tan(theta);
        a[(2, 5)] = cos_phi;
        a[(2, 6)] = -sin_phi;
        a[(3, 5)] = sin_phi / cos_theta;
        a[(3, 6)] = cos_phi / cos_theta;
        a[(4, 5)] = (iyy - izz) / ixx * r; // (12), linearised
        a[(4, 6)] = (iyy - izz) / ixx * q;
        a[(5, 4)] = (izz - ixx) / iyy * r; // (13), linearised
        a[(5, 6)] = (izz - ixx) / iyy * p;
        a[(6, 4)] = (ixx - iyy) / izz * q; // (14), linearised
        a[(6, 5)] = (ixx - iyy) / izz * p;

        let gravity = g * (cos_phi * cos_theta - libm::cos(trim.roll_rad));
        let col = m * (gravity - a[(0, 1)] * (phi - trim.roll_rad) - a[(0, 2)] * theta);
        let offset = Vector4::new(col, -(izz - ixx) * p * r, -(iyy - izz) * q * r, -(ixx - iyy) * p * q);

        Self { continuous, offset, lean: [v, -u * cos_phi] }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Vector3};

    use super::*;
    use crate::linear::STATES;

    const DRAG: Drag = Drag { linear_nspm: [0.2, 0.2, 0.1], quadratic_ns2pm2: 0.02 };

    fn at(point: &FlightPoint, drag: &Drag) -> AtSpeed {
        let vehicle = Parameters::default();
        AtSpeed::new(&vehicle, &Trim::solve(&vehicle, false), drag, point)
    }

    #[test]
    fn at_hover_the_model_equals_the_hover_model() {
        let vehicle = Parameters::default();
        let trim = Trim::solve(&vehicle, false);
        let point =
            FlightPoint { velocity_mps: [0.0; 3], roll_rad: trim.roll_rad, pitch_rad: 0.0, rates_radps: [0.0; 3] };
        let ours = at(&point, &Drag::default());
        let hover = Continuous::hover(&vehicle, &trim);
        assert!((ours.continuous.a - hover.a).amax() < 1e-14 && ours.continuous.b == hover.b);
        assert!(ours.offset.amax() < 1e-12 && ours.lean == [0.0; 2]);
    }

    #[test]
    fn nothing_accelerates_in_level_flight() {
        let vehicle = Parameters::default();
        let trim = Trim::solve(&vehicle, false);
        for way in [[15.0, 0.0], [0.0, 10.0], [-7.0, 12.0]] {
            let level = LevelFlight::solve(&vehicle, false, &DRAG, way).unwrap();
            let model = at(&FlightPoint::from(&level), &DRAG);
            let mut x = nalgebra::SVector::<f64, STATES>::zeros();
            x[0] = level.velocity_mps[2];
            x[1] = level.roll_rad - trim.roll_rad;
            x[2] = level.pitch_rad;
            let u = crate::MixingMatrix::new(&vehicle, false).deviation(&level.actuation);
            let rate = model.continuous.a * x + model.continuous.b * (u + model.offset);
            assert!(rate.amax() < 1e-9, "{way:?}: {rate}");
        }
    }

    #[test]
    fn lean_is_the_change_of_w_at_constant_ground_velocity() {
        let velocity_mps = [14.0, -6.0, -3.0];
        let (phi, theta, d) = (0.2, -0.4, 1e-6);
        let ned = Rotation3::from_euler_angles(phi, theta, 0.0) * Vector3::from(velocity_mps);
        let point = FlightPoint { velocity_mps, roll_rad: phi, pitch_rad: theta, rates_radps: [0.0; 3] };
        let [by_phi, by_theta] = at(&point, &DRAG).lean;
        for (lean, [dphi, dtheta]) in [(by_phi, [d, 0.0]), (by_theta, [0.0, d])] {
            let w = |side: f64| {
                Rotation3::from_euler_angles(phi + side * dphi, theta + side * dtheta, 0.0)
                    .inverse_transform_vector(&ned)
                    .z
            };
            let change = (w(1.0) - w(-1.0)) / (2.0 * d);
            assert!((change + lean).abs() < 1e-8, "{change} {lean}");
        }
    }
}
