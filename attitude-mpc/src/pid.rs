//! One PID per axis, to compare with: every axis as if it were alone.
//!
//! ```text
//! col = m   (b (w_ref - w) + c integral)
//! lon = Iyy (k (theta_ref - theta) + b (q_ref - q) + c integral)        lat, ped likewise with phi, p and psi, r
//! ```
//!
//! A double integrator with all three poles at `-a` has `b = 3a`, `k = 3a^2`, `c = a^3`; the climb, a single one with two
//! poles at `-a`, has `b = 2a`, `c = a^2`.
//!
//! Anti-windup is back-calculation (Astrom and Hagglund, Advanced PID Control, ISA 2006, section 3.5): what the actuators were
//! given less what was demanded, `v - u`, drives the integral back with the tracking time constant `Tt`:
//!
//! ```text
//! d integral / dt = error + (v - u) / (inertia c Tt)          Tt = sqrt(Ti Td); without a derivative Tt = Ti
//! Ti = k / c, Td = b / k, so Tt = sqrt(3) / a for the attitude; Ti = b / c = 2 / a for the climb
//! ```

use airframe::Parameters;
use nalgebra::{DVector, Vector4};

/// Poles of the attitude loops \[rad/s\]: what a loop of 30 ms of lag and 20 ms of delay bears with a margin.
const ATTITUDE_POLE: f64 = 4.0;
/// Poles of the climb loop \[rad/s\].
const CLIMB_POLE: f64 = 2.0;

/// `c Tt` of each axis: \[1/s\] for the climb, \[1/s2\] for the others.
const TRACKING: Vector4<f64> = {
    let turn = 1.732_050_807_568_877_2 * ATTITUDE_POLE * ATTITUDE_POLE;
    Vector4::new(2.0 * CLIMB_POLE, turn, turn, turn)
};

/// The law. Its integrals are kept by the controller.
#[derive(Debug, Clone)]
pub struct Pid {
    /// m, Iyy, Ixx, Izz: what turns an acceleration into an input.
    inertia: Vector4<f64>,
    /// Sample time \[s\].
    sample_s: f64,
}

impl Pid {
    /// The law for a vehicle, at a sample time \[s\].
    pub fn new(vehicle: &Parameters, sample_s: f64) -> Self {
        let inertia = Vector4::new(vehicle.mass_kg, vehicle.iyy_kgm2, vehicle.ixx_kgm2, vehicle.izz_kgm2);
        Self { inertia, sample_s }
    }

    /// col, lon, lat, ped \[N, N m, N m, N m\] for a state and its reference, both (w, phi, theta, psi, p, q, r, ...);
    /// adds this sample's errors to the integrals. `unfollowed` is what the actuators were last given less what was demanded.
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
        *integral += (errors + unfollowed.component_div(&self.inertia.component_mul(&TRACKING))) * self.sample_s;
        let a = ATTITUDE_POLE;
        let turn = |i: usize, rate: usize| 3.0 * a * a * errors[i] + 3.0 * a * error(rate) + a * a * a * integral[i];
        let climb = 2.0 * CLIMB_POLE * errors[0] + CLIMB_POLE * CLIMB_POLE * integral[0];
        self.inertia.component_mul(&Vector4::new(climb, turn(1, 5), turn(2, 4), turn(3, 6)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_pushes_its_own_axis() {
        let pid = Pid::new(&Parameters::default(), 0.01);
        for (state, axis) in [(0, 0), (1, 2), (2, 1), (3, 3), (4, 2), (5, 1), (6, 3)] {
            let mut r = [0.0; 7];
            r[state] = 0.1;
            let u = pid.step(&DVector::zeros(7), &r, &Vector4::zeros(), &mut Vector4::zeros());
            assert!(u[axis] > 0.0 && u.iter().filter(|u| **u != 0.0).count() == 1, "state {state}: {u}");
        }
    }

    #[test]
    fn a_constant_error_raises_the_demand_from_tick_to_tick() {
        let pid = Pid::new(&Parameters::default(), 0.01);
        let mut integral = Vector4::zeros();
        let mut push = || pid.step(&DVector::zeros(7), &[0.1; 7], &Vector4::zeros(), &mut integral);
        let (first, second) = (push(), push());
        assert!((second - first).iter().all(|more| *more > 0.0));
    }

    #[test]
    fn what_the_actuators_do_not_follow_drives_the_integral_back() {
        let pid = Pid::new(&Parameters::default(), 0.01);
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

    /// An actuator that gives no more than a share of what a constant error asks for: without anti-windup the integral grows
    /// for ever, with it the demand settles a little above what the actuator gives.
    #[test]
    fn the_integral_of_a_saturated_axis_settles() {
        let pid = Pid::new(&Parameters::default(), 0.01);
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
