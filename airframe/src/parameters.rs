//! Table I: the numbers of the tricopter.

use serde::{Deserialize, Serialize};

/// Table I of the paper, and the acceleration of gravity it leaves out.
///
/// Rotor speeds `Omega` are in the paper's own unit, called *rotor speed unit*: `F = kf Omega^2` gives newtons.
/// The paper names it RPM, which would make the thrust of a rotor of this size a hundred times too large for its
/// diameter; rad/s fits. Nothing here converts it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Acceleration of gravity \[m/s2\]. Table II follows for 9.81 (its digits are truncated, not rounded).
    pub g_mps2: f64,
    /// Mass m \[kg\].
    pub mass_kg: f64,
    /// Moment of inertia about the body x axis \[kg m2\].
    pub ixx_kgm2: f64,
    /// Moment of inertia about the body y axis \[kg m2\].
    pub iyy_kgm2: f64,
    /// Moment of inertia about the body z axis \[kg m2\].
    pub izz_kgm2: f64,
    /// Arm from the centre of mass forward to rotor 1, the one that tilts \[m\].
    pub l1_m: f64,
    /// Arm from the centre of mass back to the line of rotors 2 and 3 \[m\].
    pub l2_m: f64,
    /// Arm from the centre line sideways to rotors 2 and 3 \[m\].
    pub l3_m: f64,
    /// Thrust constant `K_F` \[N / rotor speed unit squared\].
    pub kf: f64,
    /// Torque constant `K_M` \[N m / rotor speed unit squared\].
    pub km: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            g_mps2: 9.81,
            mass_kg: 1.1,
            ixx_kgm2: 0.0239,
            iyy_kgm2: 0.012_71,
            izz_kgm2: 0.012_73,
            l1_m: 0.2483,
            l2_m: 0.1241,
            l3_m: 0.2150,
            kf: 1.970e-6,
            km: 2.880e-7,
        }
    }
}
