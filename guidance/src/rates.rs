//! References of the body rates: the Euler rate relation of the kinematics, inverted.

use nalgebra::Vector3;

/// Body rates p, q, r \[rad/s\] that turn the Euler angles at `euler_rates_radps`, at the attitude `attitude_rad`.
pub fn body_rates(euler_rates_radps: &Vector3<f64>, attitude_rad: &Vector3<f64>) -> Vector3<f64> {
    let (sin_phi, cos_phi) = libm::sincos(attitude_rad.x);
    let (sin_theta, cos_theta) = libm::sincos(attitude_rad.y);
    let [dphi, dtheta, dpsi] = (*euler_rates_radps).into();
    Vector3::new(
        dphi - dpsi * sin_theta,
        dtheta * cos_phi + dpsi * sin_phi * cos_theta,
        dpsi * cos_phi * cos_theta - dtheta * sin_phi,
    )
}
