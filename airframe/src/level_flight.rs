//! Trimmed level flight at speed: attitude and actuators without linear or angular acceleration.
//!
//! Without rotation the moments vanish if the intermediate input is a multiple of that of hover, `u = s u_trim`. The
//! balance of forces (9)-(11) in body axes remains, with drag:
//!
//! ```text
//! 0 =          - m g sin theta           + D_x
//! 0 = s Fy_trim + m g sin phi cos theta + D_y
//! 0 = s Fz_trim + m g cos phi cos theta + D_z
//! D = -(d + c |V|) V                         V in body axes, still air
//! ```
//!
//! Newton's method finds phi, theta and s. Test `level_flight_does_not_accelerate` of the plant checks the result
//! against the equations of motion.

use contract::actuation::Actuation;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::mixing::MixingMatrix;
use crate::{Parameters, Trim};

/// Largest number of steps of Newton's method; the shipped vehicles need four.
const STEPS: usize = 30;
/// Residual at which the method has converged, as a share of the weight.
const TOLERANCE: f64 = 1e-14;
/// Step of the difference quotients: phi and theta \[rad\], and s.
const DIFFERENCE: f64 = 1e-6;

/// Coefficients of the drag, which acts against the body velocity relative to the air.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Drag {
    /// Linear coefficients along body x, y, z \[N s/m\].
    pub linear_nspm: [f64; 3],
    /// Coefficient of the square of the speed \[N s2/m2\].
    pub quadratic_ns2pm2: f64,
}

impl Drag {
    /// Ratio of drag to velocity along each body axis \[N s/m\], at a speed \[m/s\].
    pub fn per_velocity(&self, speed_mps: f64) -> Vector3<f64> {
        Vector3::from(self.linear_nspm).add_scalar(self.quadratic_ns2pm2 * speed_mps)
    }
}

/// Level flight without acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelFlight {
    /// Body velocity u, v, w \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Roll phi \[rad\].
    pub roll_rad: f64,
    /// Pitch theta \[rad\].
    pub pitch_rad: f64,
    /// Rotor speeds and tilt that hold the flight.
    pub actuation: Actuation,
}

impl LevelFlight {
    /// Solves level flight at the velocities ahead and to the right \[m/s\], in still air; `None` if Newton's method
    /// finds no attitude that holds the flight.
    pub fn solve(
        vehicle: &Parameters,
        tilt_reaction: bool,
        drag: &Drag,
        [ahead_mps, right_mps]: [f64; 2],
    ) -> Option<Self> {
        let trim = Trim::solve(vehicle, tilt_reaction);
        let mixing = MixingMatrix::new(vehicle, tilt_reaction);
        let thrust_n = Vector3::new(0.0, vehicle.kf * mixing.trim[0], -vehicle.kf * mixing.trim.rows(1, 3).sum());
        let weight_n = vehicle.mass_kg * vehicle.g_mps2;
        let way = Vector3::new(ahead_mps, right_mps, 0.0);
        let drag_factor = drag.per_velocity(way.norm());
        let velocity = |x: &Vector3<f64>| Rotation3::from_euler_angles(x[0], x[1], 0.0).inverse() * way;
        let force = |x: &Vector3<f64>| {
            let ((sin_phi, cos_phi), (sin_theta, cos_theta)) = (libm::sincos(x[0]), libm::sincos(x[1]));
            let gravity = Vector3::new(-sin_theta, sin_phi * cos_theta, cos_phi * cos_theta) * weight_n;
            gravity + thrust_n * x[2] - drag_factor.component_mul(&velocity(x)) // (9)-(11)
        };

        let mut x = Vector3::new(trim.roll_rad, 0.0, 1.0);
        for _ in 0..STEPS {
            let rest = force(&x);
            if rest.amax() <= TOLERANCE * weight_n {
                break;
            }
            let columns: [Vector3<f64>; 3] = std::array::from_fn(|i| {
                let step = Vector3::ith(i, DIFFERENCE);
                (force(&(x + step)) - force(&(x - step))) / (2.0 * DIFFERENCE)
            });
            x -= Matrix3::from_columns(&columns).try_inverse()? * rest;
        }
        let holds = force(&x).amax() <= 1e-10 * weight_n && x[2] > 0.0;
        let u = mixing.trim * x[2];
        let rotor_speed = [libm::hypot(u[0], u[1]).sqrt(), u[2].sqrt(), u[3].sqrt()];
        holds.then(|| Self {
            velocity_mps: velocity(&x).into(),
            roll_rad: x[0],
            pitch_rad: x[1],
            actuation: Actuation { rotor_speed, tilt_rad: libm::atan2(u[0], u[1]) },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAG: Drag = Drag { linear_nspm: [0.2, 0.2, 0.1], quadratic_ns2pm2: 0.02 };

    #[test]
    fn level_flight_at_rest_is_hover() {
        let vehicle = Parameters::default();
        for reaction in [false, true] {
            let hover = Trim::solve(&vehicle, reaction);
            let level = LevelFlight::solve(&vehicle, reaction, &DRAG, [0.0; 2]).unwrap();
            assert!((level.roll_rad - hover.roll_rad).abs() < 1e-12 && level.pitch_rad.abs() < 1e-12);
            for (ours, theirs) in level.actuation.rotor_speed.iter().zip(hover.actuation.rotor_speed) {
                assert!((ours / theirs - 1.0).abs() < 1e-12);
            }
            assert!((level.actuation.tilt_rad - hover.actuation.tilt_rad).abs() < 1e-12);
        }
    }

    #[test]
    fn pitch_is_more_nose_down_at_speed_and_level_without_drag() {
        let vehicle = Parameters::default();
        let pitch = |drag: &Drag, v| LevelFlight::solve(&vehicle, false, drag, [v, 0.0]).unwrap().pitch_rad;
        let [slow, fast] = [5.0, 15.0].map(|v| pitch(&DRAG, v));
        assert!(fast < slow && slow < 0.0, "{slow} {fast}");
        assert!(pitch(&Drag::default(), 15.0).abs() < 1e-12);
    }

    #[test]
    fn an_extreme_drag_gives_no_solution_or_a_finite_one() {
        let heavy = Drag { linear_nspm: [0.0, 1e6, 0.0], quadratic_ns2pm2: 0.0 };
        let level = LevelFlight::solve(&Parameters::default(), false, &heavy, [10.0, 10.0]);
        assert!(level.is_none_or(|level| level.actuation.rotor_speed.iter().all(|speed| speed.is_finite())));
    }
}
