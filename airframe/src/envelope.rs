//! Exact actuator set: the conventional inputs that the limits of rotors and servo allow.
//!
//! The paper leaves this open, because it finds no one-to-one relation between actuator limits and conventional inputs.
//! A relation exists: `u_delta = M u` is linear and invertible, and in `u = (Omega1^2 sin mu, Omega1^2 cos mu,
//! Omega2^2, Omega3^2)` the limits are convex:
//!
//! ```text
//! |(u1, u2)| <= Omega1max^2                       second-order cone
//! |u1| cos mu_max <= u2 sin mu_max                tilt wedge
//! u1 sin mu_trim + u2 cos mu_trim >= idle^2       tangent cut, for an idle bound on rotor 1 (itself reverse-convex)
//! idle^2 <= u3, u4 <= Omegamax^2                  boxes
//! ```

use nalgebra::{Vector2, Vector4};

use crate::{ActuatorLimits, MixingMatrix, Parameters, Trim};

/// Exact set, and the map from intermediate to conventional inputs.
#[derive(Debug, Clone, Copy)]
pub struct Envelope {
    /// Map between demands and squared rotor speeds.
    pub mixing: MixingMatrix,
    /// Tilt at which the idle cut touches rotor 1's circle \[rad\].
    pub cut_tilt_rad: f64,
    /// Amplitude limits that define the set.
    pub limits: ActuatorLimits,
}

impl Envelope {
    /// Builds the set of `limits` around the hover of `vehicle`.
    pub fn new(vehicle: &Parameters, tilt_reaction: bool, limits: ActuatorLimits) -> Self {
        Self {
            mixing: MixingMatrix::new(vehicle, tilt_reaction),
            cut_tilt_rad: Trim::solve(vehicle, tilt_reaction).actuation.tilt_rad,
            limits,
        }
    }

    /// Largest violation of a limit by the intermediate input `u`, as a share of `Omega1max^2`; at most 0 if inside.
    pub fn violation(&self, u: &Vector4<f64>) -> f64 {
        let [max1, max2, max3] = self.limits.rotor_speed_max.map(|omega| omega * omega);
        let idle = self.limits.rotor_speed_min * self.limits.rotor_speed_min;
        let (sin_wedge, cos_wedge) = libm::sincos(self.limits.tilt_max_rad);
        let (sin_cut, cos_cut) = libm::sincos(self.cut_tilt_rad);
        let mut worst = libm::hypot(u[0], u[1]) - max1;
        worst = worst.max(u[0].abs() * cos_wedge - u[1] * sin_wedge);
        if idle > 0.0 {
            worst = worst.max(idle - u[0] * sin_cut - u[1] * cos_cut);
        }
        worst = worst.max(idle - u[2]).max(u[2] - max2).max(idle - u[3]).max(u[3] - max3);
        worst / max1
    }

    /// [`violation`](Self::violation) of a deviation of the conventional inputs from trim \[N, N m, N m, N m\].
    pub fn demand_violation(&self, demand: &Vector4<f64>) -> f64 {
        self.violation(&(self.mixing.trim + self.mixing.inverse * demand))
    }

    /// Computes the smallest box around the set, as deviations from trim: (lower, upper) \[N, N m, N m, N m\].
    pub fn bounding_box(&self) -> (Vector4<f64>, Vector4<f64>) {
        let trim = self.mixing.forward * self.mixing.trim;
        let extreme = |row: usize, sign: f64| {
            let c = self.mixing.forward.row(row) * sign;
            sign * (self.support_front(Vector2::new(c[0], c[1]))
                + self.support_rear(c[2], 1)
                + self.support_rear(c[3], 2))
        };
        let upper = Vector4::from_fn(|row, _| extreme(row, 1.0)) - trim;
        let lower = Vector4::from_fn(|row, _| extreme(row, -1.0)) - trim;
        (lower, upper)
    }

    /// Largest `c u` over the range of one rear rotor's squared speed.
    fn support_rear(&self, c: f64, rotor: usize) -> f64 {
        let omega = if c > 0.0 { self.limits.rotor_speed_max[rotor] } else { self.limits.rotor_speed_min };
        c * omega * omega
    }

    /// Largest `c . (u1, u2)` over rotor 1's part of the set, a sector of a disc cut by the idle line.
    ///
    /// In polar form (radius, tilt) the maximum lies on the arc towards `c`, at an end of the arc, at the apex, or
    /// where the idle cut crosses an edge of the wedge.
    fn support_front(&self, c: Vector2<f64>) -> f64 {
        let radius = self.limits.rotor_speed_max[0] * self.limits.rotor_speed_max[0];
        let idle = self.limits.rotor_speed_min * self.limits.rotor_speed_min;
        let wedge = self.limits.tilt_max_rad;
        let value = |r: f64, tilt: f64| r * (c[0] * libm::sin(tilt) + c[1] * libm::cos(tilt));

        let (mut low, mut high) = (-wedge, wedge);
        let mut best = f64::NEG_INFINITY;
        if idle > 0.0 {
            let reach = libm::acos(idle / radius); // angle from the cut's direction to its end on the arc
            low = low.max(self.cut_tilt_rad - reach);
            high = high.min(self.cut_tilt_rad + reach);
            for edge in [-wedge, wedge] {
                let r = idle / libm::cos(edge - self.cut_tilt_rad);
                if (0.0..=radius).contains(&r) {
                    best = best.max(value(r, edge));
                }
            }
        } else {
            best = 0.0; // the apex: rotor 1 at rest
        }
        let towards = libm::atan2(c[0], c[1]);
        for tilt in [low, high, towards.clamp(low, high)] {
            best = best.max(value(radius, tilt));
        }
        best
    }
}

#[cfg(test)]
mod tests;
