//! Whether every rotor follows: what the rates should do under the commands, and what they do.
//!
//! The mixer sees neither rotor speeds nor thrust. It knows the command in force, and so where the rotors should be;
//! what each of them should add to the angular acceleration, and what all of it left unexplained:
//!
//! ```text
//! m_i  = J^-1 (moment of rotor i, by command, lag and limits)
//! e    = d omega / dt + J^-1 (omega x J omega) - sum m_i
//! ```
//!
//! A rotor that does nothing leaves `e = -m_i`. Both are averaged over 30 ms, which noise does not survive. A rotor is
//! dead when for 50 ms in a row most of its moment is missing, in its direction, and it was meant to do something:
//!
//! ```text
//! -e . m_i >= 0.7 |m_i|^2,     (e . m_i)^2 >= 0.8 |e|^2 |m_i|^2,     |m_i| >= 0.4 |m_i at hover|
//! ```
//!
//! With one rotor dead no demand holds pitch, roll and height together: the flight is over, and only its energy is left
//! to decide about. A weak rotor, a push, a wrong inertia or a late command is another size, another direction, or over
//! soon.

use airframe::mixing::intermediate;
use airframe::{Actuation, ActuatorLaw, MixingMatrix};
use contract::Scenario;
use nalgebra::{Matrix3, Vector3, Vector4};

/// Time constant of the averages \[s\].
const AVERAGE_S: f64 = 0.03;
/// How long a rotor must seem dead \[s\].
const CERTAIN_S: f64 = 0.05;
/// Share of a rotor's moment that is missing when it is dead; the estimate of attitude-mpc makes up for 20 %.
const MISSING: f64 = 0.7;
/// Square of the cosine between what is missing and what the rotor should do.
const ALIGNED: f64 = 0.8;
/// Share of its moment at hover below which nothing can be told of a rotor.
const TELLING: f64 = 0.4;
/// A longer gap between two samples says nothing of what was between them \[s\].
const GAP_S: f64 = 0.05;

/// What is known of the vehicle.
#[derive(Debug, Clone)]
pub struct Rotors {
    mixing: MixingMatrix,
    law: ActuatorLaw,
    /// Ixx, Iyy, Izz \[kg m2\].
    inertia_kgm2: Vector3<f64>,
    /// `|m_i|^2` at hover.
    hover: [f64; 3],
}

/// What the samples so far tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Where the actuators should be at the newest sample.
    pub actuation: Actuation,
    /// Average of `e` \[rad/s2\].
    pub unexplained: Vector3<f64>,
    /// Averages of `m_i`, a column per rotor \[rad/s2\].
    pub expected: Matrix3<f64>,
    /// For how long each rotor has seemed dead \[s\].
    pub dead_s: Vector3<f64>,
}

impl Rotors {
    /// The rotors of `scenario` as they should be, around the `trim`.
    pub fn new(scenario: &Scenario, mixing: MixingMatrix, trim: &Actuation) -> Self {
        let vehicle = &scenario.airframe;
        let inertia_kgm2 = Vector3::new(vehicle.ixx_kgm2, vehicle.iyy_kgm2, vehicle.izz_kgm2);
        let mut rotors = Self { mixing, law: scenario.actuator_law(), inertia_kgm2, hover: [0.0; 3] };
        let hover = rotors.expected(trim);
        rotors.hover = std::array::from_fn(|rotor| hover.column(rotor).norm_squared());
        rotors
    }

    /// No evidence, with the actuators where they are told to be.
    pub fn unknown(&self, command: &Actuation) -> Evidence {
        Evidence {
            actuation: self.law.limits.clip(command),
            unexplained: Vector3::zeros(),
            expected: Matrix3::zeros(),
            dead_s: Vector3::zeros(),
        }
    }

    /// Takes in a sample `elapsed_s` after the one before: the rates of both \[rad/s\], and the command in force
    /// between.
    pub fn observe(
        &self,
        before: &Evidence,
        rates: [Vector3<f64>; 2],
        command: &Actuation,
        elapsed_s: f64,
    ) -> Evidence {
        if elapsed_s <= 0.0 {
            return *before;
        }
        let actuation = self.law.advance(&before.actuation, command, elapsed_s);
        let expected = (self.expected(&before.actuation) + self.expected(&actuation)) * 0.5;
        let [rates_before, rates] = rates;
        let mean = (rates_before + rates) * 0.5;
        let gyroscopic = mean.cross(&self.inertia_kgm2.component_mul(&mean)).component_div(&self.inertia_kgm2);
        let unexplained = (rates - rates_before) / elapsed_s + gyroscopic - expected.column_sum();

        let share = 1.0 - (-elapsed_s / AVERAGE_S).exp();
        let mut evidence = Evidence {
            actuation,
            unexplained: before.unexplained + (unexplained - before.unexplained) * share,
            expected: before.expected + (expected - before.expected) * share,
            dead_s: before.dead_s,
        };
        if elapsed_s > GAP_S || !evidence.unexplained.iter().all(|e| e.is_finite()) {
            return self.unknown(command);
        }
        for rotor in 0..3 {
            let seems_dead = self.seems_dead(&evidence, rotor);
            evidence.dead_s[rotor] = if seems_dead { before.dead_s[rotor] + elapsed_s } else { 0.0 };
        }
        evidence
    }

    fn seems_dead(&self, evidence: &Evidence, rotor: usize) -> bool {
        let (missing, expected) = (-evidence.unexplained, evidence.expected.column(rotor));
        let (size, along) = (expected.norm_squared(), missing.dot(&expected));
        size >= TELLING * TELLING * self.hover[rotor]
            && along >= MISSING * size
            && along * along >= ALIGNED * size * missing.norm_squared()
    }

    /// `m_i`, a column per rotor.
    fn expected(&self, actuation: &Actuation) -> Matrix3<f64> {
        let u = intermediate(actuation);
        let rotor = |u: Vector4<f64>| {
            let [_, lon, lat, ped]: [f64; 4] = (self.mixing.forward * u).into();
            Vector3::new(lat, lon, ped).component_div(&self.inertia_kgm2)
        };
        Matrix3::from_columns(&[
            rotor(Vector4::new(u[0], u[1], 0.0, 0.0)),
            rotor(Vector4::new(0.0, 0.0, u[2], 0.0)),
            rotor(Vector4::new(0.0, 0.0, 0.0, u[3])),
        ])
    }
}

impl Evidence {
    /// Whether a rotor is dead beyond doubt.
    pub fn is_certain(&self) -> bool {
        self.dead_s.max() >= CERTAIN_S
    }
}

#[cfg(test)]
mod tests;
