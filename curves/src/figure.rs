//! Circle, helix and figure eight, from rest to rest. Except for a climb, a figure ends where it begins.
//!
//! The angle `a` makes one turn for each lap; `e` is the unit vector along the direction of the figure, and `n` the
//! unit vector to the left of `e`:
//!
//! ```text
//! circle         R (1 - cos a) e + R sin a n         clockwise seen from above, centre R ahead in direction e
//! figure eight   R sin a e + R/2 sin 2a n            lemniscate of Gerono, two loops of the length R
//! helix          the circle, and a climb in proportion to a
//! ```

use std::f64::consts::TAU;

use nalgebra::{Vector2, Vector3};

use crate::progress::Laps;
use crate::setpoint::Setpoint;

/// Shape of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FigureShape {
    /// Circle; a helix if it climbs.
    Circle,
    /// Figure eight.
    Eight,
}

/// Figure in space and time.
#[derive(Debug, Clone, Copy)]
pub struct Figure {
    /// Shape of the figure.
    pub shape: FigureShape,
    /// Place where the figure begins, NED \[m\].
    pub from: Vector3<f64>,
    /// Radius of the circle, or length of a loop of the eight \[m\].
    pub radius_m: f64,
    /// Height gained by all laps together \[m\].
    pub climb_m: f64,
    /// Direction of the figure, from north over east \[rad\].
    pub direction_rad: f64,
    /// Turns over time.
    pub laps: Laps,
}

impl Figure {
    /// Centre of the circle, or crossing of the eight, north and east \[m\].
    pub fn centre(&self) -> Vector2<f64> {
        let from = self.from.xy();
        match self.shape {
            FigureShape::Circle => from + self.along() * self.radius_m,
            FigureShape::Eight => from,
        }
    }

    /// Reference at `t_s`; at rest before 0 and after the last lap.
    pub fn at(&self, t_s: f64) -> Setpoint {
        let turns = self.laps.turns(t_s);
        let [angle, rate, acceleration] = [turns.s, turns.ds, turns.dds].map(|turns| turns * TAU);
        let (sin, cos) = libm::sincos(angle);
        // Place along and across the direction, in radii, and its first two derivatives by the angle.
        let [place, slope, bend] = match self.shape {
            FigureShape::Circle => [[1.0 - cos, sin], [sin, cos], [cos, -sin]],
            FigureShape::Eight => {
                let (sin_twice, cos_twice) = (2.0 * sin * cos, cos * cos - sin * sin);
                [[sin, sin_twice / 2.0], [cos, cos_twice], [-sin, -2.0 * sin_twice]]
            }
        };
        let ahead = self.along();
        let left = Vector2::new(ahead.y, -ahead.x);
        let turned = |[a, l]: [f64; 2]| ((ahead * a + left * l) * self.radius_m).push(0.0);
        let up = Vector3::new(0.0, 0.0, -self.climb_m / self.laps.laps);
        Setpoint {
            position_m: (self.from + turned(place) + up * turns.s).into(),
            velocity_mps: (turned(slope) * rate + up * turns.ds).into(),
            acceleration_mps2: (turned(slope) * acceleration + turned(bend) * (rate * rate) + up * turns.dds).into(),
        }
    }

    /// Direction of the figure, north and east.
    fn along(&self) -> Vector2<f64> {
        let (sin, cos) = libm::sincos(self.direction_rad);
        Vector2::new(cos, sin)
    }
}
