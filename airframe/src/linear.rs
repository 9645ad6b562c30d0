//! Linear model of attitude and vertical velocity, and its zero-order-hold discretisation.
//!
//! The model is about hover, with `x = (w, phi - phi_trim, theta, psi, p, q, r)` and `u = u_delta - u_delta,trim`:
//!
//! ```text
//! dx/dt = A x + B u                                               (48)
//! ```
//!
//! With the actuator lag in the model, four more states `z` follow the inputs, `dz/dt = L (u - z)`, and act on the
//! vehicle in place of the inputs. `L` is `1 / tau` if all actuators have the same lag ([`lag_rates`]).

use contract::actuation::Actuation;
use nalgebra::{DMatrix, Matrix2, Matrix4, SMatrix};

use crate::exponential::exponential;
use crate::{MixingMatrix, Parameters, Trim};

/// States of (48): w, phi, theta, psi, p, q, r.
pub const STATES: usize = 7;
/// Inputs of (48): col, lon, lat, ped.
pub const INPUTS: usize = 4;
/// Number of states with the actuator lag: the states of (48), and the inputs behind the lag.
pub const LAGGED: usize = STATES + INPUTS;

/// `A` and `B` of (48), continuous time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Continuous {
    /// `A`, 7 x 7 \[1/s, mixed\].
    pub a: SMatrix<f64, STATES, STATES>,
    /// `B`, 7 x 4.
    pub b: SMatrix<f64, STATES, INPUTS>,
}

/// `Ad` and `Bd` of one sample, `x[k+1] = Ad x[k] + Bd u[k]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Discrete {
    /// `Ad`, n x n with n = 7, or 11 with the lag states.
    pub a: DMatrix<f64>,
    /// `Bd`, n x 4.
    pub b: DMatrix<f64>,
}

impl Continuous {
    /// Linearises (8) and (11)-(14) at the hover `trim`.
    pub fn hover(vehicle: &Parameters, trim: &Trim) -> Self {
        let (sin_phi, cos_phi) = libm::sincos(trim.roll_rad);
        let mut a = SMatrix::zeros();
        a[(0, 1)] = -vehicle.g_mps2 * sin_phi;
        a[(1, 4)] = 1.0;
        a[(2, 5)] = cos_phi;
        a[(2, 6)] = -sin_phi;
        a[(3, 5)] = sin_phi;
        a[(3, 6)] = cos_phi;
        let mut b = SMatrix::zeros();
        b[(0, 0)] = 1.0 / vehicle.mass_kg;
        b[(4, 2)] = 1.0 / vehicle.ixx_kgm2;
        b[(5, 1)] = 1.0 / vehicle.iyy_kgm2;
        b[(6, 3)] = 1.0 / vehicle.izz_kgm2;
        Self { a, b } // (48)
    }

    /// Discretises with zero-order hold over `sample_s`: both matrices come from one exponential of `[[A, B], [0, 0]]`.
    pub fn discretise(&self, sample_s: f64) -> Discrete {
        zero_order_hold::<STATES, { STATES + INPUTS }>(&self.a, &self.b, sample_s)
    }

    /// Discretises with a lag of the rates `L` between the inputs and the vehicle: 11 states.
    pub fn discretise_with_lag(&self, rates: &Matrix4<f64>, sample_s: f64) -> Discrete {
        let (a, b) = self.with_lag(rates);
        zero_order_hold::<LAGGED, { LAGGED + INPUTS }>(&a, &b, sample_s)
    }

    /// Matrices of continuous time with a lag of the rates `L` between the inputs and the vehicle.
    pub fn with_lag(&self, rates: &Matrix4<f64>) -> (SMatrix<f64, LAGGED, LAGGED>, SMatrix<f64, LAGGED, INPUTS>) {
        let mut a = SMatrix::<f64, LAGGED, LAGGED>::zeros();
        a.fixed_view_mut::<STATES, STATES>(0, 0).copy_from(&self.a);
        a.fixed_view_mut::<STATES, INPUTS>(0, STATES).copy_from(&self.b);
        let mut b = SMatrix::<f64, LAGGED, INPUTS>::zeros();
        let mut leaving = a.fixed_view_mut::<INPUTS, INPUTS>(STATES, STATES);
        leaving -= rates;
        b.fixed_view_mut::<INPUTS, INPUTS>(STATES, 0).copy_from(rates);
        (a, b)
    }
}

/// Rates `L` \[1/s\] at which the conventional inputs follow their demand, for lags of the rotors and of the servo
/// \[s\], to first order about the trim `actuation`:
///
/// ```text
/// L = M diag(T diag(1/tau_rotor, 1/tau_servo) T, 1/tau_rotor, 1/tau_rotor) M^-1
/// T = (sin mu, cos mu; cos mu, -sin mu)      d(u1, u2) = T (d(Omega1^2), Omega1^2 d mu)
/// ```
///
/// `M` is from (38), `u1` and `u2` are from (37): along its thrust, rotor 1 has the lag of the rotors; across its
/// thrust, rotor 1 has the lag of the servo. With equal lags `L` is diagonal.
pub fn lag_rates([rotor_lag_s, servo_lag_s]: [f64; 2], mixing: &MixingMatrix, actuation: &Actuation) -> Matrix4<f64> {
    let mut rates = Matrix4::from_diagonal_element(1.0 / rotor_lag_s);
    if rotor_lag_s == servo_lag_s {
        return rates;
    }
    let (sin_mu, cos_mu) = libm::sincos(actuation.tilt_rad);
    let turn = Matrix2::new(sin_mu, cos_mu, cos_mu, -sin_mu);
    let own = Matrix2::new(1.0 / rotor_lag_s, 0.0, 0.0, 1.0 / servo_lag_s);
    rates.fixed_view_mut::<2, 2>(0, 0).copy_from(&(turn * own * turn));
    mixing.forward * rates * mixing.inverse
}

/// Discretises a model of `N` states; `J` must be `N + INPUTS`.
fn zero_order_hold<const N: usize, const J: usize>(
    a: &SMatrix<f64, N, N>,
    b: &SMatrix<f64, N, INPUTS>,
    sample_s: f64,
) -> Discrete {
    let mut joint = SMatrix::<f64, J, J>::zeros();
    joint.view_mut((0, 0), (N, N)).copy_from(a);
    joint.view_mut((0, N), (N, INPUTS)).copy_from(b);
    let held = exponential(&(joint * sample_s));
    let part = |first, columns| DMatrix::from_fn(N, columns, |row, column| held[(row, first + column)]);
    Discrete { a: part(0, N), b: part(N, INPUTS) }
}
