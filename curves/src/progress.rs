//! Covered fraction s(t) of a leg at time t, and laps of a figure. Times are in seconds.

/// Covered fraction of a leg at one instant, and its derivatives in time.
#[derive(Debug, Clone, Copy)]
pub struct LegProgress {
    /// Covered fraction, 0 to 1 on a leg.
    pub s: f64,
    /// First derivative \[1/s\].
    pub ds: f64,
    /// Second derivative \[1/s2\].
    pub dds: f64,
}

/// Progress with a trapezoid of velocity. When a ramp begins, the acceleration is already that of the ramp.
pub fn trapezoid(t: f64, duration: f64, ramp: f64) -> LegProgress {
    let cruise = 1.0 / (duration - ramp);
    if t < ramp {
        LegProgress { s: cruise * t * t / (2.0 * ramp), ds: cruise * t / ramp, dds: cruise / ramp }
    } else if t < duration - ramp || ramp == 0.0 {
        LegProgress { s: cruise * (t - ramp / 2.0), ds: cruise, dds: 0.0 }
    } else {
        let left = duration - t;
        LegProgress { s: 1.0 - cruise * left * left / (2.0 * ramp), ds: cruise * left / ramp, dds: -cruise / ramp }
    }
}

/// Progress of least jerk from rest to rest, a quintic; at rest before 0 and after `duration`.
pub fn min_jerk(t: f64, duration: f64) -> LegProgress {
    let x = (t / duration).clamp(0.0, 1.0);
    LegProgress {
        s: x * x * x * (10.0 + x * (-15.0 + x * 6.0)),
        ds: x * x * (30.0 + x * (-60.0 + x * 30.0)) / duration,
        dds: x * (60.0 + x * (-180.0 + x * 120.0)) / (duration * duration),
    }
}

/// Laps from rest to rest, whose mean duration is the period.
///
/// n laps take n T. The first half lap is the first half of a min-jerk lap of duration T1, and the last half lap its
/// second half. Between these half laps the rate is constant: it is the rate in the middle of a min-jerk lap, where the
/// angular acceleration is zero, 15/8 of the lap's mean rate:
///
/// ```text
/// n T = T1 + (n - 1) 8/15 T1,   T1 = 15 n T / (8 n + 7)
/// ```
///
/// So velocity and acceleration are continuous. A single lap is the min-jerk lap, T1 = T. With many laps T1 tends to
/// 15/8 T.
#[derive(Debug, Clone, Copy)]
pub struct Laps {
    /// Number of laps.
    pub laps: f64,
    /// Duration of all laps together \[s\].
    pub turning_s: f64,
    /// Duration `T1` \[s\].
    pub ends_s: f64,
}

/// Ratio of the rate of a min-jerk motion in its middle to its mean rate.
const PEAK: f64 = 15.0 / 8.0;

impl Laps {
    /// Makes `laps` laps of the mean duration `period_s`.
    pub fn new(laps: u32, period_s: f64) -> Self {
        let laps = f64::from(laps);
        Self { laps, turning_s: laps * period_s, ends_s: period_s * (15.0 * laps) / (8.0 * laps + 7.0) }
    }

    /// Number of turns after `t`, with its derivatives.
    pub fn turns(&self, t: f64) -> LegProgress {
        let half_s = self.ends_s / 2.0;
        if t < half_s {
            min_jerk(t, self.ends_s)
        } else if t < self.turning_s - half_s {
            let rate = PEAK / self.ends_s;
            LegProgress { s: 0.5 + rate * (t - half_s), ds: rate, dds: 0.0 }
        } else {
            let last = min_jerk(t - (self.turning_s - self.ends_s), self.ends_s);
            LegProgress { s: self.laps - 1.0 + last.s, ..last }
        }
    }
}
