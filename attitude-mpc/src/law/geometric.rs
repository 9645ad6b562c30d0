//! Geometric law: tilt before heading, without singularity, and the inverse of the rigid body's nonlinear equations.
//!
//! ```text
//! alpha = kp e + kd (q w_ref - w) + ki integral(e)      in the axes of the level frame, e as in `level`
//! M     = J alpha + w x J w                             exact for the model's inertia
//! F_z   = (m (a - g) - F_y sin phi cos theta) / (cos phi cos theta)      a = kp e_v + ki integral(e_v), down
//! ```
//!
//! `[attitude.geometric]` has the gains, with the same meaning as in the law [`pid`](super::pid). The anti-windup is
//! the same too. [`level`](super::level) has the errors. A feedback of this kind on SO(3) with an integral is in
//! Goodarzi, Lee and Leok, *Geometric nonlinear PID control of a quadrotor UAV on SE(3)*, ECC 2013. Tests
//! `the_geometric_demand_gives_the_wanted_acceleration_in_the_plant` (tests/laws.rs),
//! `a_heading_error_leaves_the_tilt_alone`.

use airframe::Parameters;
use nalgebra::{DVector, Vector4};
use settings::PidGains;

use super::attitude_law::{Aim, AttitudeLaw, Decision};
use super::level::RigidBody;
use super::pid::Pid;
use crate::memory::AttitudeMemory;

/// PID law of each axis, from errors in the level frame to accelerations.
#[derive(Debug, Clone)]
pub struct Axes {
    pid: Pid,
    /// Zero state, which the PID law subtracts from the errors.
    origin: DVector<f64>,
}

impl Axes {
    /// Builds the law with `gains` and a sample time \[s\].
    pub fn new(gains: &PidGains, sample_s: f64) -> Self {
        let unit = Parameters { mass_kg: 1.0, ixx_kgm2: 1.0, iyy_kgm2: 1.0, izz_kgm2: 1.0, ..Parameters::default() };
        Self { pid: Pid::new(&unit, gains, sample_s), origin: DVector::zeros(7) }
    }

    /// Wanted accelerations down \[m/s2\] and about y, x, z \[rad/s2\]; updates the integrals.
    pub fn accelerations(
        &self,
        errors: &[f64; 7],
        unfollowed: &Vector4<f64>,
        integral: &mut Vector4<f64>,
    ) -> Vector4<f64> {
        self.pid.step(&self.origin, errors, unfollowed, integral)
    }
}

/// Geometric law. The controller stores its integrals.
#[derive(Debug, Clone)]
pub struct Geometric {
    axes: Axes,
    level: RigidBody,
}

impl Geometric {
    /// Builds the law of a vehicle with `gains` and a sample time \[s\].
    pub fn new(level: RigidBody, gains: &PidGains, sample_s: f64) -> Self {
        Self { axes: Axes::new(gains, sample_s), level }
    }
}

impl AttitudeLaw for Geometric {
    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision> {
        let (x, r) = (&aim.start.as_view(), &aim.reference);
        let unfollowed = self.level.accelerations(x, &aim.unfollowed);
        let wanted = self.axes.accelerations(&self.level.errors(x, r), &unfollowed, &mut memory.integral);
        Decision::explicit(self.level.demand(x, &wanted, &self.level.gyroscopic(x)))
    }
}
