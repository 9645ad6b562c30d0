//! Trim of the hover.
//!
//! Setting the total force (23) and the total moment (24) to zero and solving gives (25)-(30). The tilted front rotor
//! balances the reaction torque of the three rotors; its side force is balanced by a roll angle:
//!
//! ```text
//! tan phi   = -l2 K_M / (l1 (l1 + l2) K_F)                        (25)
//! theta     = 0                                                   (26)
//! tan mu    = K_M / (l1 K_F)                                      (27)
//! Omega1^2  = l2 g m cos phi / ((l1 + l2) K_F cos mu)             (28)
//! Omega2^2  = l1 g m cos phi / (2 (l1 + l2) K_F),  Omega3 = Omega2  (29), (30)
//! ```
//!
//! Departure: with the tilt reaction (the pitching moment `K_M Omega1^2 sin mu` that the paper neglects) the pitch
//! balance of (24) has `K_M tan mu` added to `l1 K_F`, which changes the share of rotor 1 in the lift. With that share
//! written as the ratio `a = u2 / (u3 + u4)` one closed form covers both cases. Test `val_trim`.

use contract::actuation::Actuation;

use crate::Parameters;

/// Least idle speed, as a share of the speed of rotor 1 at hover. A slower limit is raised to this speed, because a
/// motor controller takes a command of zero for a cut.
const IDLE_SHARE: f64 = 0.1;

/// Hover equilibrium: attitude and actuator positions without acceleration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trim {
    /// Roll angle phi \[rad\]; pitch and yaw are zero (26).
    pub roll_rad: f64,
    /// Rotor speeds and tilt that hold the hover.
    pub actuation: Actuation,
}

impl Trim {
    /// Solves the hover of `vehicle`; `tilt_reaction` includes the pitching moment of the tilted rotor's drag torque.
    pub fn solve(vehicle: &Parameters, tilt_reaction: bool) -> Self {
        let Parameters { g_mps2: g, mass_kg: m, l1_m: l1, l2_m: l2, kf, km, .. } = *vehicle;
        let tan_mu = km / (l1 * kf); // (27)
        let front_arm = l1 * kf + if tilt_reaction { km * tan_mu } else { 0.0 };
        let a = l2 * kf / front_arm; // front lift over rear lift, from the pitch balance
        let phi = libm::atan(-tan_mu * a / (1.0 + a)); // (25)
        let lift = m * g * libm::cos(phi) / kf; // u2 + u3 + u4, from the z force in (23)
        let mu = libm::atan(tan_mu);
        let omega1 = (lift * a / (1.0 + a) / libm::cos(mu)).sqrt(); // (28)
        let omega2 = (lift / (1.0 + a) / 2.0).sqrt(); // (29)
        Self { roll_rad: phi, actuation: Actuation { rotor_speed: [omega1, omega2, omega2], tilt_rad: mu } } // (30)
    }
    /// Idle speed of rotors whose lower limit is `least` \[rotor speed unit\].
    pub fn idle_speed(&self, least: f64) -> f64 {
        least.max(IDLE_SHARE * self.actuation.rotor_speed[0])
    }

    /// Speed of the slowest rotor \[rotor speed unit\].
    pub fn slowest(&self) -> f64 {
        self.actuation.rotor_speed.into_iter().fold(f64::INFINITY, f64::min)
    }
}
