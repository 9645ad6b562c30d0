//! Parameters of the tricopter of Table I, and of a second vehicle.

use nalgebra::{Vector3, Vector4};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Vehicle with a complete set of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Preset {
    /// The vehicle of Table I of the paper.
    #[default]
    Paper,
    /// A tricopter with 10-inch propellers, of parts that can be bought (docs/paper.md).
    TenInch,
}

/// Parameters of Table I of the paper, and the acceleration of gravity, which the table leaves out.
///
/// Table I is physically odd in three places. `K_M / K_F` is 0.146 m, where a ten-inch propeller has 0.0165 m: the
/// rotor's torque is nine times too large for its thrust, so trim tilts rotor 1 by 30 degrees. `Iyy` and `Izz` are
/// equal, though a flat vehicle has `Izz` near `Ixx + Iyy`. In rad/s, the hover takes `sum K_M Omega^3` = 2.2 kW for
/// 1.1 kg. `docs/paper.md` describes the effect on the results, and the second vehicle.
///
/// Rotor speeds `Omega` are in the paper's own unit, called *rotor speed unit*: `F = kf Omega^2` gives newtons.
/// The paper names it RPM, which would make the thrust of a rotor of this size a hundred times too large for its
/// diameter; rad/s fits. No code converts the unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Parameters {
    /// Vehicle whose numbers are used for the keys that are absent.
    pub preset: Preset,
    /// Acceleration of gravity \[m/s2\]. 9.81 gives Table II, whose digits are truncated, not rounded.
    pub g_mps2: f64,
    /// Mass m \[kg\].
    pub mass_kg: f64,
    /// Moment of inertia about the body x axis \[kg m2\].
    pub ixx_kgm2: f64,
    /// Moment of inertia about the body y axis \[kg m2\].
    pub iyy_kgm2: f64,
    /// Moment of inertia about the body z axis \[kg m2\].
    pub izz_kgm2: f64,
    /// Arm from the centre of mass forward to rotor 1, which tilts \[m\].
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

impl Parameters {
    /// Mass and moments of inertia `(m, Iyy, Ixx, Izz)`: inputs col, lon, lat, ped over the accelerations they make
    /// \[kg, kg m2\].
    pub fn inertia(&self) -> Vector4<f64> {
        Vector4::new(self.mass_kg, self.iyy_kgm2, self.ixx_kgm2, self.izz_kgm2)
    }

    /// Moments of inertia about the body axes x, y, z \[kg m2\].
    pub fn moments_kgm2(&self) -> Vector3<f64> {
        Vector3::new(self.ixx_kgm2, self.iyy_kgm2, self.izz_kgm2)
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self::from(Preset::Paper)
    }
}

impl From<Preset> for Parameters {
    /// Returns the parameters of a preset.
    ///
    /// `ten-inch` is a tricopter of equal arms of 0.25 m with APC Slow Flyer 10x4.7 propellers. Rotor speeds are in
    /// rad/s. At hover such a propeller has about `C_T` = 0.11 and `C_P` = 0.045 (Brandt and Selig, *Propeller
    /// Performance Data at Low Reynolds Numbers*, AIAA 2011-1255; static data of the UIUC database). With the
    /// diameter D and sea-level air `K_F = C_T rho D^4 / (2 pi)^2` and `K_M = C_P rho D^5 / (2 pi)^3`. Mass and inertia
    /// are summed over the parts, as rods, boxes and points: battery 0.35 kg and electronics 0.30 kg at the centre,
    /// motors with controllers of 85 g at the ends, a servo of 60 g in front, arms of 45 g, legs of 30 g. Test
    /// `the_second_vehicle_has_the_mass_and_inertia_of_its_parts`.
    fn from(preset: Preset) -> Self {
        match preset {
            Preset::Paper => Self {
                preset,
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
            },
            Preset::TenInch => Self {
                preset,
                g_mps2: 9.81,
                mass_kg: 1.19,
                ixx_kgm2: 0.0135,
                iyy_kgm2: 0.0178,
                izz_kgm2: 0.0295,
                l1_m: 0.25,
                l2_m: 0.125,
                l3_m: 0.2165,
                kf: 1.42e-5,
                km: 2.35e-7,
            },
        }
    }
}
