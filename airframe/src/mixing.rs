//! Mixing matrix: forces and moments as a linear map of squared rotor speeds.
//!
//! Conventional inputs `u_delta = (col, lon, lat, ped)`: collective force along body z \[N\] and the moments about body
//! y, x and z \[N m\]. They are linear in the intermediate input (37), `u_delta = M u` (38):
//!
//! ```text
//! u   = (Omega1^2 sin mu, Omega1^2 cos mu, Omega2^2, Omega3^2)                     (37)
//! col = -K_F (u2 + u3 + u4)                                                        (33)
//! lon =  l1 K_F u2 - l2 K_F (u3 + u4)                                              (34)
//! lat = -l3 K_F (u3 - u4)                                                          (35)
//! ped =  l1 K_F u1 - K_M u2 + K_M u3 - K_M u4                                      (36)
//! ```
//!
//! Departure: with the tilt reaction, `lon` has the additional term `K_M u1`, the pitching moment of the tilted rotor's
//! drag torque. The term is linear in `u`, so the map stays exact and invertible. Test `val_mixing_matrix`.

use contract::actuation::Actuation;
use nalgebra::{Matrix4, Vector4};

use crate::{Parameters, Trim};

/// Matrix `M` of (38), its inverse, and the trim that deviations are taken from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MixingMatrix {
    /// Matrix `M`, from intermediate input to conventional inputs.
    pub forward: Matrix4<f64>,
    /// Matrix `M^-1`, from conventional inputs to intermediate input.
    pub inverse: Matrix4<f64>,
    /// Intermediate input at trim, `u_trim` \[rotor speed unit squared\].
    pub trim: Vector4<f64>,
}

impl MixingMatrix {
    /// Builds the map for `vehicle`; `tilt_reaction` adds the pitching moment of the tilt reaction.
    ///
    /// # Panics
    /// If the parameters make the map singular (a zero arm or constant); scenario validation rejects such parameters.
    pub fn new(vehicle: &Parameters, tilt_reaction: bool) -> Self {
        let Parameters { l1_m: l1, l2_m: l2, l3_m: l3, kf, km, .. } = *vehicle;
        let reaction = if tilt_reaction { km } else { 0.0 };
        #[rustfmt::skip]
        let forward = Matrix4::new(
            0.0,      -kf,      -kf,      -kf,       // (33)
            reaction, l1 * kf,  -l2 * kf, -l2 * kf,  // (34)
            0.0,      0.0,      -l3 * kf, l3 * kf,   // (35)
            l1 * kf,  -km,      km,       -km,       // (36)
        );
        let inverse = forward.try_inverse().expect("arms and rotor constants are positive, so M is invertible");
        Self { forward, inverse, trim: intermediate(&Trim::solve(vehicle, tilt_reaction).actuation) }
    }

    /// Deviation of the conventional inputs from trim that an actuator position produces \[N, N m, N m, N m\].
    pub fn deviation(&self, actuation: &Actuation) -> Vector4<f64> {
        self.forward * (intermediate(actuation) - self.trim) // (38)
    }
}

/// Intermediate input of an actuator position.
pub fn intermediate(actuation: &Actuation) -> Vector4<f64> {
    let [o1, o2, o3] = actuation.rotor_speed;
    let (sin_mu, cos_mu) = libm::sincos(actuation.tilt_rad);
    Vector4::new(o1 * o1 * sin_mu, o1 * o1 * cos_mu, o2 * o2, o3 * o3) // (37)
}
