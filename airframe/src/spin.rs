//! Steady spin on the two rear rotors: the hover that remains possible without rotor 1.
//!
//! Two rotors cannot lift the vehicle without a moment. A tilted vehicle that turns at the rate `w` about the vertical
//! needs such a moment to keep turning; `n` is the direction down in the body frame. Mueller and D'Andrea (*Stability
//! and control of a quadrocopter despite the complete loss of one, two, or three propellers*, ICRA 2014) call such a
//! flight relaxed hover:
//!
//! ```text
//! M = w^2 n x J n,      F . n = -m g
//! ```
//!
//! Equal rear thrusts `T / 2` give `M = (0, -l2 T, 0)` and `F = (0, 0, -T)`, so with `n = (n_x, 0, n_z)`
//!
//! ```text
//! n_x (1 - n_x^2) = -l2 m g / (w^2 (Ixx - Izz)),      T = m g / n_z
//! ```
//!
//! The left side is at most `2 / sqrt(27)`, at 35 degrees of tilt: the slowest spin. In a faster spin the vehicle is
//! more upright.

use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};

use crate::Parameters;
use crate::exponential::exponential;

/// Spin rate as a multiple of the slowest spin rate: the tilt is then 15.4 degrees, for every vehicle.
const RATE_RATIO: f64 = 1.25;
/// Fastest spin that is used \[rad/s\]: a fifth of a turn in the time constant of a rotor, 30 ms.
const MAX_RATE_RADPS: f64 = 40.0;
/// Largest share of the highest rear thrust that the spin may need, so that thrust is left for control.
const MAX_THRUST_SHARE: f64 = 0.8;

/// States of the linear model: two tilts of `n`, p, q, r, the sink rate, and the speeds of rotors 2 and 3.
pub const STATES: usize = 8;
/// Inputs of the linear model: commanded speeds of rotors 2 and 3.
pub const INPUTS: usize = 2;

/// Steady spin of a vehicle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spin {
    /// Direction down in the body frame, `n`.
    pub down: Vector3<f64>,
    /// Body rates, `w n` \[rad/s\].
    pub rates_radps: Vector3<f64>,
    /// Speed of rotors 2 and 3 \[rotor speed unit\].
    pub rotor_speed: f64,
}

impl Spin {
    /// Solves the spin of `vehicle`, clockwise seen from above. `None` if the spin would be faster than 40 rad/s, or
    /// would need more than 80 % of the thrust at `max_rotor_speed`.
    pub fn solve(vehicle: &Parameters, max_rotor_speed: f64) -> Option<Self> {
        let Parameters { g_mps2: g, mass_kg: m, l2_m: l2, kf, ixx_kgm2: ixx, izz_kgm2: izz, .. } = *vehicle;
        let steepest = 2.0 / libm::sqrt(27.0);
        let slowest_radps = (l2 * m * g / ((ixx - izz).abs() * steepest)).sqrt();
        let rate_radps = RATE_RATIO * slowest_radps;
        // n (1 - n^2) = s steepest has the root n = 2 sin(asin(s) / 3) / sqrt(3).
        let share = 1.0 / (RATE_RATIO * RATE_RATIO);
        let lean = 2.0 / libm::sqrt(3.0) * libm::sin(libm::asin(share) / 3.0);
        let down = Vector3::new(-lean * (ixx - izz).signum(), 0.0, (1.0 - lean * lean).sqrt());
        let rotor_speed = (m * g / (2.0 * down.z * kf)).sqrt();
        let has_margin = rotor_speed * rotor_speed <= MAX_THRUST_SHARE * max_rotor_speed * max_rotor_speed;
        let is_slow = rate_radps <= MAX_RATE_RADPS; // false for equal moments of inertia too: the rate is then infinite
        (has_margin && is_slow).then_some(Self { down, rates_radps: down * rate_radps, rotor_speed })
    }

    /// Deviation of a flight from the spin, in the states of the linear model.
    pub fn deviation(
        &self,
        down: &Vector3<f64>,
        rates_radps: &Vector3<f64>,
        sink_mps: f64,
        rear_speed: [f64; 2],
    ) -> SMatrix<f64, STATES, 1> {
        let lean = self.leans().tr_mul(&(down - self.down));
        let rates = rates_radps - self.rates_radps;
        let [right, left] = rear_speed.map(|speed| speed - self.rotor_speed);
        SMatrix::from([[lean[0], lean[1], rates.x, rates.y, rates.z, sink_mps, right, left]])
    }

    /// Linear model over one sample, `x[k+1] = Ad x[k] + Bd u[k]`, with the first-order lag `lag_s` of the rotors.
    pub fn discretise(&self, vehicle: &Parameters, lag_s: f64, sample_s: f64) -> (DMatrix<f64>, DMatrix<f64>) {
        let inertia = vehicle.moments_kgm2();
        let slope = 2.0 * vehicle.kf * self.rotor_speed; // derivative of a thrust by its rotor's speed
        let thrust_n = 2.0 * vehicle.kf * self.rotor_speed * self.rotor_speed;
        let (leans, own) = (self.leans(), inertia.component_mul(&self.rates_radps));

        let mut joint = SMatrix::<f64, { STATES + INPUTS }, { STATES + INPUTS }>::zeros();
        // dn/dt = n x w
        let turned = -leans.transpose() * self.rates_radps.cross_matrix() * leans;
        joint.fixed_view_mut::<2, 2>(0, 0).copy_from(&turned);
        joint.fixed_view_mut::<2, 3>(0, 2).copy_from(&(leans.transpose() * self.down.cross_matrix()));
        // J dw/dt = M - w x J w
        let gyroscopic = own.cross_matrix() - self.rates_radps.cross_matrix() * Matrix3::from_diagonal(&inertia);
        let by_inertia = Matrix3::from_diagonal(&inertia.map(f64::recip));
        joint.fixed_view_mut::<3, 3>(2, 2).copy_from(&(by_inertia * gyroscopic));
        let yaw_arm_m = vehicle.km / vehicle.kf;
        for (rotor, side) in [1.0, -1.0].into_iter().enumerate() {
            let moment = Vector3::new(-vehicle.l3_m * side, -vehicle.l2_m, yaw_arm_m * side) * slope;
            joint.fixed_view_mut::<3, 1>(2, 6 + rotor).copy_from(&(by_inertia * moment));
            // d sink/dt = g - T n_z / m
            joint[(5, 6 + rotor)] = -slope * self.down.z / vehicle.mass_kg;
            joint[(6 + rotor, 6 + rotor)] = -1.0 / lag_s;
            joint[(6 + rotor, STATES + rotor)] = 1.0 / lag_s;
        }
        joint.fixed_view_mut::<1, 2>(5, 0).copy_from(&(leans.row(2) * (-thrust_n / vehicle.mass_kg)));

        let held = exponential(&(joint * sample_s));
        let part = |first, columns| DMatrix::from_fn(STATES, columns, |row, column| held[(row, first + column)]);
        (part(0, STATES), part(STATES, INPUTS))
    }

    /// Two unit vectors across `n`: the directions in which `n` can lean.
    fn leans(&self) -> SMatrix<f64, 3, 2> {
        SMatrix::from_columns(&[Vector3::new(-self.down.z, 0.0, self.down.x), Vector3::y()])
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector4;

    use super::*;
    use crate::{MixingMatrix, Preset, Trim};

    fn spins() -> [(Parameters, Spin); 2] {
        [Preset::Paper, Preset::TenInch].map(|preset| {
            let vehicle = Parameters::from(preset);
            (vehicle, Spin::solve(&vehicle, 1.5 * Trim::solve(&vehicle, false).actuation.rotor_speed[1]).unwrap())
        })
    }

    #[test]
    fn val_the_spin_balances_forces_and_moments() {
        for (vehicle, spin) in spins() {
            let square = spin.rotor_speed * spin.rotor_speed;
            let [col, lon, lat, ped]: [f64; 4] =
                (MixingMatrix::new(&vehicle, false).forward * Vector4::new(0.0, 0.0, square, square)).into();
            let inertia = vehicle.moments_kgm2();
            let needed = spin.rates_radps.cross(&inertia.component_mul(&spin.rates_radps));
            assert!((Vector3::new(lat, lon, ped) - needed).amax() < 1e-12, "{needed}");
            assert!((col * spin.down.z + vehicle.mass_kg * vehicle.g_mps2).abs() < 1e-12);
            assert!((spin.down.norm() - 1.0).abs() < 1e-15);
        }
    }

    #[test]
    fn val_the_linear_model_is_the_derivative_of_the_equations_of_motion() {
        for (vehicle, spin) in spins() {
            let (sample_s, lag_s) = (1e-5, 0.03);
            let (a, b) = spin.discretise(&vehicle, lag_s, sample_s);
            let inertia = vehicle.moments_kgm2();
            // One short step of the equations of motion from a deviation `x`, with the rear commands `u` off the spin.
            let step = |x: &SMatrix<f64, STATES, 1>, u: [f64; 2]| {
                let down = spin.down + spin.leans() * x.fixed_rows::<2>(0);
                let rates = spin.rates_radps + x.fixed_rows::<3>(2);
                let speed = [x[6], x[7]].map(|deviation| spin.rotor_speed + deviation);
                let [f2, f3] = speed.map(|speed| vehicle.kf * speed * speed);
                let arm = vehicle.km / vehicle.kf;
                let moment = Vector3::new(-vehicle.l3_m * (f2 - f3), -vehicle.l2_m * (f2 + f3), arm * (f2 - f3));
                let quicker = (moment - rates.cross(&inertia.component_mul(&rates))).component_div(&inertia);
                let sink = x[5] + sample_s * (vehicle.g_mps2 - (f2 + f3) * down.z / vehicle.mass_kg);
                let rear = [0, 1].map(|i| speed[i] + sample_s * (spin.rotor_speed + u[i] - speed[i]) / lag_s);
                spin.deviation(&(down + down.cross(&rates) * sample_s), &(rates + quicker * sample_s), sink, rear)
            };
            for state in 0..STATES {
                let h = if state < 6 { 1e-5 } else { 1e-2 };
                let x = SMatrix::<f64, STATES, 1>::from_fn(|i, _| if i == state { h } else { 0.0 });
                let column = (step(&x, [0.0; 2]) - step(&-x, [0.0; 2])) / (2.0 * h);
                let identity = x / h;
                let (found, expected) = (a.column(state) - identity, column - identity);
                let size = expected.amax().max(1e-5);
                assert!((found - expected).amax() < 2e-3 * size, "{state}: {found} {expected}");
            }
            let column = (step(&SMatrix::zeros(), [1.0, 0.0]) - step(&SMatrix::zeros(), [-1.0, 0.0])) / 2.0;
            assert!((b[(6, 0)] - column[6]).abs() < 1e-3 * column[6] && b[(7, 0)] == 0.0);
        }
    }

    #[test]
    fn a_vehicle_without_thrust_to_spare_or_with_equal_inertias_has_no_spin() {
        let vehicle = Parameters::default();
        let trim = Trim::solve(&vehicle, false).actuation.rotor_speed[1];
        assert!(Spin::solve(&vehicle, 1.4 * trim).is_none());
        assert!(Spin::solve(&Parameters { izz_kgm2: vehicle.ixx_kgm2, ..vehicle }, 2.0 * trim).is_none());
    }
}
