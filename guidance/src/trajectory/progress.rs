//! Fraction s(t) of a leg that is covered at time t. The table is in [`trajectory`](super).

/// Covered fraction of a leg at one instant, and its derivatives in time.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Covered fraction, 0 to 1 on a leg.
    pub s: f64,
    /// First derivative \[1/s\].
    pub ds: f64,
    /// Second derivative \[1/s2\].
    pub dds: f64,
}

/// Trapezoid of velocity. At the instant at which a ramp begins the acceleration is already that of the ramp.
pub fn trapezoid(t: f64, duration: f64, ramp: f64) -> Progress {
    let cruise = 1.0 / (duration - ramp);
    if t < ramp {
        Progress { s: cruise * t * t / (2.0 * ramp), ds: cruise * t / ramp, dds: cruise / ramp }
    } else if t < duration - ramp || ramp == 0.0 {
        Progress { s: cruise * (t - ramp / 2.0), ds: cruise, dds: 0.0 }
    } else {
        let left = duration - t;
        Progress { s: 1.0 - cruise * left * left / (2.0 * ramp), ds: cruise * left / ramp, dds: -cruise / ramp }
    }
}

/// Quintic of least jerk from rest to rest; before 0 and after `duration` it is at rest.
pub fn min_jerk(t: f64, duration: f64) -> Progress {
    let x = (t / duration).clamp(0.0, 1.0);
    Progress {
        s: x * x * x * (10.0 + x * (-15.0 + x * 6.0)),
        ds: x * x * (30.0 + x * (-60.0 + x * 30.0)) / duration,
        dds: x * (60.0 + x * (-180.0 + x * 120.0)) / (duration * duration),
    }
}
