//! One PID per axis, for comparison; coupling between the axes is ignored.
//!
//! ```text
//! col = m   (kp (w_ref - w) + ki integral)
//! lon = Iyy (kp (theta_ref - theta) + kd (q_ref - q) + ki integral)        lat, ped likewise with phi, p and psi, r
//! ```
//!
//! An angle is a double integrator: all three poles at `-a` need `kd = 3a`, `kp = 3a^2`, `ki = a^3`. The climb is a
//! single integrator: two poles at `-a` need `kp = 2a`, `ki = a^2`. `[attitude.pid]` has the gains.
//!
//! Anti-windup is back-calculation (Astrom and Hagglund, Advanced PID Control, ISA 2006, section 3.5): the input that
//! the actuators were given less the demand, `v - u`, drives the integral back with the tracking time constant `Tt`:
//!
//! ```text
//! d integral / dt = error + (v - u) / (inertia ki Tt)         Tt = sqrt(Ti Td); without a derivative Tt = Ti
//! Ti = kp / ki, Td = kd / kp, so ki Tt = sqrt(kd ki) for the angles and kp for the climb
//! ```

use airframe::Parameters;
use nalgebra::{DVector, Vector4};
use settings::PidGains;

use super::attitude_law::{Aim, AttitudeLaw, Decision};
use crate::memory::AttitudeMemory;

/// PID law. The controller stores its integrals.
#[derive(Debug, Clone)]
pub struct Pid {
    /// Inertia m, Iyy, Ixx, Izz: ratio of input to acceleration.
    inertia: Vector4<f64>,
    /// Product `ki Tt` of each axis \[1/s for the climb, 1/s2 for the others\]; infinite without integral action.
    tracking: Vector4<f64>,
    gains: PidGains,
    /// Sample time \[s\].
    sample_s: f64,
}

impl Pid {
    /// Builds the law of a vehicle with `gains` and a sample time \[s\].
    pub fn new(vehicle: &Parameters, gains: &PidGains, sample_s: f64) -> Self {
        let inertia = vehicle.inertia();
        let PidGains { kp, ki, kd } = *gains;
        let tracking = Vector4::from_fn(|axis, _| {
            let tracking =
                if axis == 0 || kd[axis - 1] == 0.0 { kp[axis] } else { libm::sqrt(kd[axis - 1] * ki[axis]) };
            if ki[axis] > 0.0 && tracking > 0.0 { tracking } else { f64::INFINITY }
        });
        Self { inertia, tracking, gains: *gains, sample_s }
    }

    /// Computes col, lon, lat, ped \[N, N m, N m, N m\] for a state and its reference, both (w, phi, theta, psi, p, q,
    /// r, ...), and updates the integrals. `unfollowed` is the input that the actuators were given less the demand.
    pub fn step(
        &self,
        x: &DVector<f64>,
        r: &[f64],
        unfollowed: &Vector4<f64>,
        integral: &mut Vector4<f64>,
    ) -> Vector4<f64> {
        let error = |i: usize| r[i] - x[i];
        // col, lon, lat, ped drive w; theta and q; phi and p; psi and r.
        let errors = Vector4::new(error(0), error(2), error(1), error(3));
        *integral += (errors + unfollowed.component_div(&self.inertia.component_mul(&self.tracking))) * self.sample_s;
        let PidGains { kp, ki, kd } = self.gains;
        let angle =
            |axis: usize, rate: usize| kp[axis] * errors[axis] + kd[axis - 1] * error(rate) + ki[axis] * integral[axis];
        let climb = kp[0] * errors[0] + ki[0] * integral[0];
        self.inertia.component_mul(&Vector4::new(climb, angle(1, 5), angle(2, 4), angle(3, 6)))
    }
}

impl AttitudeLaw for Pid {
    fn plan(&mut self, aim: &Aim, memory: &mut AttitudeMemory) -> Option<Decision> {
        Decision::explicit(self.step(aim.start, &aim.reference, &aim.unfollowed, &mut memory.integral))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_pushes_its_own_axis() {
        let pid = Pid::new(&Parameters::default(), &PidGains::default(), 0.01);
        for (state, axis) in [(0, 0), (1, 2), (2, 1), (3, 3), (4, 2), (5, 1), (6, 3)] {
            let mut r = [0.0; 7];
            r[state] = 0.1;
            let u = pid.step(&DVector::zeros(7), &r, &Vector4::zeros(), &mut Vector4::zeros());
            assert!(u[axis] > 0.0 && u.iter().filter(|u| **u != 0.0).count() == 1, "state {state}: {u}");
        }
    }

    #[test]
    fn a_constant_error_raises_the_demand_from_tick_to_tick() {
        let pid = Pid::new(&Parameters::default(), &PidGains::default(), 0.01);
        let mut integral = Vector4::zeros();
        let mut push = || pid.step(&DVector::zeros(7), &[0.1; 7], &Vector4::zeros(), &mut integral);
        let (first, second) = (push(), push());
        assert!((second - first).iter().all(|more| *more > 0.0));
    }

    #[test]
    fn a_demand_that_is_not_followed_drives_the_integral_back() {
        let pid = Pid::new(&Parameters::default(), &PidGains::default(), 0.01);
        let errors = [0.1; 7];
        let grown = |unfollowed: f64| {
            let mut integral = Vector4::repeat(0.5);
            pid.step(&DVector::zeros(7), &errors, &Vector4::repeat(unfollowed), &mut integral);
            integral - Vector4::repeat(0.5)
        };
        assert!(grown(0.0).iter().all(|more| (more - 0.001).abs() < 1e-15), "an actuator that follows changes nothing");
        assert!((0..4).all(|axis| grown(-5.0)[axis] < 0.0), "less than was demanded: {}", grown(-5.0));
        assert!((0..4).all(|axis| grown(5.0)[axis] > grown(0.0)[axis]), "more than was demanded");
    }

    /// The actuator gives half of the demand under a constant error: without anti-windup the integral would grow
    /// without bound; with anti-windup the demand settles.
    #[test]
    fn the_integral_of_a_saturated_axis_settles() {
        let pid = Pid::new(&Parameters::default(), &PidGains::default(), 0.01);
        let (mut integral, mut unfollowed) = (Vector4::zeros(), Vector4::zeros());
        let mut demands = vec![];
        for _ in 0..4000 {
            let demand = pid.step(&DVector::zeros(7), &[0.1; 7], &unfollowed, &mut integral);
            unfollowed = demand * 0.5 - demand;
            demands.push(demand);
        }
        let change = demands[3999] - demands[3998];
        assert!(change.amax() < 1e-6 * demands[3999].amax(), "{change}");
    }
}
