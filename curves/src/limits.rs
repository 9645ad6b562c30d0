//! Demands of a curve on a vehicle, and the shortest duration within its limits.
//!
//! A vehicle with acceleration `a` and velocity `v` needs the thrust `f` per mass, with gravity `g` down, linear drag
//! `d` and quadratic drag `c`:
//!
//! ```text
//! f = a - g + (d + c |v|) v / m
//! ```
//!
//! The tilt of `f` from the vertical is the tilt of the vehicle about trim, because its thrust has a fixed direction in
//! the body (differential flatness: Mellinger and Kumar, ICRA 2011). The rate at which `f` turns is the body rate
//! across the thrust. `d` is taken the same along all axes. Wind is not in `f`: the share that is kept for control must
//! suffice.
//!
//! A curve that takes `k` times as long has `1/k` of the velocity and `1/k2` of the acceleration, and the same path.
//! [`VehicleLimits::least_stretch`] finds the least `k` at which no sample of the curve exceeds a limit, by bisection.

use nalgebra::Vector3;

use crate::curve::Leg;

/// Factor by which the first bracket of a bisection grows or shrinks.
const BRACKET: f64 = 2.0;
/// Number of bisections: they find the stretch with a relative error of 1e-12.
const BISECTIONS: u32 = 40;
/// Relative excess over a limit that counts as rounding.
const ROUNDING: f64 = 1e-9;
/// Stretch, or inverse of a stretch, at which the search for a bracket ends.
const MAX_STRETCH: f64 = 1e9;

/// Limits of a vehicle, with the parameters that its demands depend on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VehicleLimits {
    /// Acceleration of gravity \[m/s2\].
    pub g_mps2: f64,
    /// Linear drag per mass \[1/s\].
    pub drag_linear_1ps: f64,
    /// Quadratic drag per mass \[1/m\].
    pub drag_quadratic_1pm: f64,
    /// Largest demands. The range of the thrust contains gravity, and the tilt is below a quarter turn.
    pub most: Demand,
}

/// Quantity that has a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Speed \[m/s\].
    Speed,
    /// Acceleration \[m/s2\].
    Acceleration,
    /// Vertical speed \[m/s\].
    Vertical,
    /// Tilt of the thrust \[rad\].
    Tilt,
    /// Largest thrust per mass \[m/s2\].
    Thrust,
    /// Least thrust per mass \[m/s2\].
    LeastThrust,
    /// Rate at which the thrust turns \[rad/s\].
    Turn,
}

/// Largest value of each quantity, and the least thrust.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Demand {
    /// Speed \[m/s\].
    pub speed_mps: f64,
    /// Acceleration \[m/s2\].
    pub acceleration_mps2: f64,
    /// Vertical speed \[m/s\].
    pub vertical_mps: f64,
    /// Tilt of the thrust \[rad\].
    pub tilt_rad: f64,
    /// Least and largest thrust per mass \[m/s2\].
    pub thrust_mps2: [f64; 2],
    /// Rate at which the thrust turns \[rad/s\].
    pub turn_radps: f64,
}

/// Demand beyond a limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excess {
    /// Quantity that is exceeded.
    pub quantity: Quantity,
    /// Demand, in the unit of the quantity.
    pub asked: f64,
    /// Limit, in the same unit.
    pub has: f64,
}

impl Demand {
    /// Joins the demands of two legs.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            speed_mps: self.speed_mps.max(other.speed_mps),
            acceleration_mps2: self.acceleration_mps2.max(other.acceleration_mps2),
            vertical_mps: self.vertical_mps.max(other.vertical_mps),
            tilt_rad: self.tilt_rad.max(other.tilt_rad),
            thrust_mps2: [self.thrust_mps2[0].min(other.thrust_mps2[0]), self.thrust_mps2[1].max(other.thrust_mps2[1])],
            turn_radps: self.turn_radps.max(other.turn_radps),
        }
    }

    /// Finds the first quantity that exceeds `limits`; `None` if none does. NaN exceeds.
    pub fn excess(&self, limits: &VehicleLimits) -> Option<Excess> {
        use Quantity as Q;
        let (has, [least, most], [idle, full]) = (&limits.most, self.thrust_mps2, limits.most.thrust_mps2);
        let most_of = |quantity, asked, has| (asked <= has * (1.0 + ROUNDING), Excess { quantity, asked, has });
        let all = [
            most_of(Q::Speed, self.speed_mps, has.speed_mps),
            most_of(Q::Acceleration, self.acceleration_mps2, has.acceleration_mps2),
            most_of(Q::Vertical, self.vertical_mps, has.vertical_mps),
            most_of(Q::Thrust, most, full),
            (least >= idle * (1.0 - ROUNDING), Excess { quantity: Q::LeastThrust, asked: least, has: idle }),
            most_of(Q::Tilt, self.tilt_rad, has.tilt_rad),
            most_of(Q::Turn, self.turn_radps, has.turn_radps),
        ];
        all.into_iter().find(|(fits, _)| !fits).map(|(_, excess)| excess)
    }
}

impl VehicleLimits {
    /// Returns limits with the share `share`, 0 to 1, of the margins beyond hover; the rest is kept for control. The
    /// user's limits on speed and acceleration stay.
    #[must_use]
    pub fn share(self, share: f64) -> Self {
        let (g, has) = (self.g_mps2, self.most);
        let most = Demand {
            vertical_mps: has.vertical_mps * share,
            tilt_rad: has.tilt_rad * share,
            thrust_mps2: has.thrust_mps2.map(|thrust| g + (thrust - g) * share),
            turn_radps: has.turn_radps * share,
            ..has
        };
        Self { most, ..self }
    }

    /// Computes the demand of all `legs` together.
    pub fn demand_of(&self, legs: &[Leg]) -> Demand {
        legs.iter().map(|leg| self.demand(leg, 1.0)).fold(self.at_rest(), Demand::and)
    }

    /// Computes the demand of a leg that takes `stretch` times as long.
    pub fn demand(&self, leg: &Leg, stretch: f64) -> Demand {
        let mut demand = self.at_rest();
        let mut before: Option<Vector3<f64>> = None;
        for [velocity, acceleration] in &leg.samples {
            let (velocity, acceleration) = (velocity / stretch, acceleration / (stretch * stretch));
            let thrust = self.thrust(&velocity, &acceleration);
            let size = thrust.norm();
            let direction = thrust / size;
            let turned_rad = before.map_or(0.0, |before| (direction - before).norm());
            before = Some(direction);
            demand = demand.and(Demand {
                speed_mps: velocity.norm(),
                acceleration_mps2: acceleration.norm(),
                vertical_mps: velocity.z.abs(),
                tilt_rad: libm::atan2(libm::hypot(thrust.x, thrust.y), -thrust.z),
                thrust_mps2: [size; 2],
                turn_radps: turned_rad / (leg.interval_s * stretch),
            });
        }
        demand
    }

    /// Demand of a hover.
    fn at_rest(&self) -> Demand {
        Demand {
            speed_mps: 0.0,
            acceleration_mps2: 0.0,
            vertical_mps: 0.0,
            tilt_rad: 0.0,
            thrust_mps2: [self.g_mps2; 2],
            turn_radps: 0.0,
        }
    }

    /// Thrust per mass that a vehicle needs, NED \[m/s2\].
    pub fn thrust(&self, velocity: &Vector3<f64>, acceleration: &Vector3<f64>) -> Vector3<f64> {
        let drag = self.drag_linear_1ps + self.drag_quadratic_1pm * velocity.norm();
        acceleration + velocity * drag - Vector3::z() * self.g_mps2
    }

    /// Returns whether `legs` that take `stretch` times as long exceed no limit.
    pub fn fits(&self, legs: &[Leg], stretch: f64) -> bool {
        legs.iter().all(|leg| self.demand(leg, stretch).excess(self).is_none())
    }

    /// Least factor by which the durations of `legs` must be multiplied so that no limit is exceeded.
    pub fn least_stretch(&self, legs: &[Leg]) -> f64 {
        let (mut low, mut high) = (1.0 / BRACKET, 1.0);
        while !self.fits(legs, high) && high < MAX_STRETCH {
            (low, high) = (high, high * BRACKET);
        }
        while self.fits(legs, low) && low > 1.0 / MAX_STRETCH {
            (low, high) = (low / BRACKET, low);
        }
        for _ in 0..BISECTIONS {
            let middle = low + (high - low) / 2.0;
            if self.fits(legs, middle) { high = middle } else { low = middle }
        }
        high
    }
}
