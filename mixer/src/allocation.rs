//! Allocation of conventional inputs to rotor speeds and tilt, without limits.
//!
//! ```text
//! u_m     = (Omega1^2, Omega2^2, Omega3^2, mu)                     (31)   output
//! u_delta = (col, lon, lat, ped)                                   (32)   input, as deviation from trim
//! du = M^-1 du_delta,  u = u_trim + du                             (39), (40)
//! Omega1^2 = sqrt(u1^2 + u2^2)                                     (41)
//! Omega2^2 = u3,  Omega3^2 = u4                                    (42), (43)
//! mu       = atan2(u1, u2)                                         (44)
//! ```
//!
//! Departure: (44) is printed as atan2 of a quotient; here it takes two arguments. (42) and (43) have no root if u3 or
//! u4 is negative: the rotor then stops, and the caller is told. Test `val_mixer_cases`.

use airframe::MixingMatrix;
use contract::actuation::Actuation;
use nalgebra::Vector4;

/// Computes rotor speeds and tilt for `demand` \[N, N m, N m, N m\]; `true` if (42) or (43) met a negative square.
pub fn allocate(mixing: &MixingMatrix, demand: &Vector4<f64>) -> (Actuation, bool) {
    let du = mixing.inverse * demand; // (39)
    let u = mixing.trim + du; // (40)
    let omega1 = libm::hypot(u[0], u[1]).sqrt(); // (41)
    let omega2 = u[2].max(0.0).sqrt(); // (42)
    let omega3 = u[3].max(0.0).sqrt(); // (43)
    let mu = libm::atan2(u[0], u[1]); // (44)
    (Actuation { rotor_speed: [omega1, omega2, omega3], tilt_rad: mu }, u[2] < 0.0 || u[3] < 0.0)
}
