//! Dryden turbulence at low altitude, and the shear of the mean wind (MIL-F-8785C, section 3.7).
//!
//! At the height h in feet and with the wind W20 at 20 feet, scales and deviations along, across and down are
//!
//! ```text
//! L_w = h,        L_u = L_v = h / (0.177 + 0.000823 h)^1.2
//! s_w = 0.1 W20,  s_u = s_v = s_w / (0.177 + 0.000823 h)^0.4
//! ```
//!
//! For a vehicle that crosses the frozen field at the airspeed V, the gusts have the spectra of white noise filtered by
//!
//! ```text
//! H_u = s_u sqrt(2 T) / (1 + T s)                                 T = L / V
//! H_v = s_v sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2               H_w likewise
//! ```
//!
//! The filters are discretised exactly: the gusts at the samples have the covariance of the continuous process, at any
//! sample rate, from the first sample on. Within a sample the gust is constant. Rotational gusts are left out, because
//! the vehicle is small compared with the scales.
//!
//! W20, h and V are settings by default: the process is stationary, and its spectrum can be tested. With `from_wind`
//! the present values are used: the mean wind of `plant.wind_ned_mps`, the height above the ground, clamped to 10 to
//! 1000 feet, for which the formulas hold, and the speed relative to the mean wind. The filters then have deviation 1
//! and are tuned at each sample, and their output is multiplied by the present deviation.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;
use settings::Scenario;

use crate::memory::Tape;
use crate::random::{Stream, normal};

const FEET_PER_M: f64 = 1.0 / 0.3048;
/// Height of the wind W20, 20 feet \[m\].
pub const REFERENCE_HEIGHT_M: f64 = 6.096;

/// Heights for which the formulas hold \[m\]: 10 and 1000 feet.
const HEIGHTS_M: [f64; 2] = [3.048, 304.8];
/// Smallest airspeed of the filters \[m/s\]: at 0 the gust would never change.
const MIN_AIRSPEED_MPS: f64 = 0.1;

/// Quantities that determine the gusts at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GustConditions {
    /// Height above the ground \[m\].
    pub height_m: f64,
    /// Mean wind at 20 feet, NED \[m/s\].
    pub wind_mps: Vector3<f64>,
    /// Speed of the vehicle relative to the mean wind \[m/s\].
    pub airspeed_mps: f64,
}

/// Gusts of one flight.
#[derive(Debug, Clone)]
pub struct Turbulence {
    along: Axis,
    across: Axis,
    down: Axis,
    to_ned: Rotation3<f64>,
    /// `true` if wind, height and airspeed are the present values, `false` if they are settings.
    from_wind: bool,
    dt_s: f64,
    random: ChaCha8Rng,
    /// Newest sample and its gust, NED \[m/s\].
    newest: Option<(u64, Vector3<f64>)>,
}

/// Component with the filter `a' = (n - a) / T`, `b' = (a - b) / T`; the gust is `from_a a + from_b b`.
#[derive(Debug, Clone, Copy)]
struct Axis {
    a: f64,
    b: f64,
    /// Factors `exp(-dt / T)` and `dt / T`.
    decay: f64,
    share: f64,
    /// Cholesky factor of the covariance that one sample adds to (a, b).
    noise: [f64; 3],
    from: [f64; 2],
    /// Factor on the gust.
    scale: f64,
}

impl Axis {
    /// Starts a component of deviation `sigma_mps` and time scale `t_s` in its stationary state, for samples of `dt_s`.
    fn new(sigma_mps: f64, t_s: f64, dt_s: f64, from: [f64; 2], random: &mut ChaCha8Rng) -> Self {
        let share = dt_s / t_s;
        let (decay, noise) = (libm::exp(-share), covariance_root(sigma_mps, share));
        let axis = Self { a: 0.0, b: 0.0, decay, share, noise, from, scale: 1.0 };
        let start = covariance_root(sigma_mps, f64::INFINITY);
        let [first, second] = two(random);
        Self { a: start[0] * first, b: start[1] * first + start[2] * second, ..axis }
    }

    /// Tunes an axis of deviation 1 to the deviation `sigma_mps` and the time scale `t_s`.
    fn tune(&mut self, sigma_mps: f64, t_s: f64, dt_s: f64) {
        self.share = dt_s / t_s;
        self.decay = libm::exp(-self.share);
        self.noise = covariance_root(1.0, self.share);
        self.scale = sigma_mps;
    }

    fn advance(&mut self, random: &mut ChaCha8Rng) {
        let [first, second] = two(random);
        let Self { a, b, decay, share, noise: [aa, ab, bb], .. } = *self;
        self.a = decay * a + aa * first;
        self.b = decay * (b + share * a) + ab * first + bb * second;
    }

    fn gust_mps(&self) -> f64 {
        self.scale * (self.from[0] * self.a + self.from[1] * self.b)
    }
}

fn two(random: &mut ChaCha8Rng) -> [f64; 2] {
    [normal(random), normal(random)]
}

/// Cholesky factor of the covariance that `share` of a time scale adds to (a, b).
fn covariance_root(sigma: f64, share: f64) -> [f64; 3] {
    let (left, r) = if share.is_finite() { (libm::exp(-2.0 * share), share) } else { (0.0, 0.0) };
    let aa = (1.0 - left) / 2.0;
    let ab = 0.25 - (r / 2.0 + 0.25) * left;
    let bb = 0.25 - (r * r / 2.0 + r / 2.0 + 0.25) * left;
    let root_aa = aa.sqrt();
    let root_ab = ab / root_aa;
    [root_aa, root_ab, (bb - root_ab * root_ab).max(0.0).sqrt()].map(|root| root * sigma)
}

/// Scales \[m\] and deviations \[m/s\], each along and down, at `height_m` with the wind `wind_mps` at 20 feet.
fn scales(height_m: f64, wind_mps: f64) -> ([f64; 2], [f64; 2]) {
    let h_ft = height_m * FEET_PER_M;
    let base = 0.177 + 0.000_823 * h_ft;
    let sigma_w = 0.1 * wind_mps;
    ([height_m / libm::pow(base, 1.2), height_m], [sigma_w / libm::pow(base, 0.4), sigma_w])
}

impl Turbulence {
    /// Builds the turbulence of `scenario`; `None` if the scenario has no turbulence.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let settings = &scenario.plant.turbulence;
        let ([l_u, l_w], [s_u, s_w]) = scales(settings.height_m, settings.wind_at_6m_mps);
        let [s_u, s_w] = if settings.from_wind { [1.0; 2] } else { [s_u, s_w] };
        let dt_s = scenario.sample_s();
        let mut random = Stream::Turbulence.open(scenario.run.seed);
        let v = settings.airspeed_mps;
        let first_order = [std::f64::consts::SQRT_2, 0.0];
        let second_order = [3_f64.sqrt(), 1.0 - 3_f64.sqrt()];
        settings.is_on().then(|| Self {
            along: Axis::new(s_u, l_u / v, dt_s, first_order, &mut random),
            across: Axis::new(s_u, l_u / v, dt_s, second_order, &mut random),
            down: Axis::new(s_w, l_w / v, dt_s, second_order, &mut random),
            to_ned: Rotation3::from_axis_angle(&Vector3::z_axis(), settings.direction_deg.to_radians()),
            from_wind: settings.from_wind,
            dt_s,
            random,
            newest: None,
        })
    }

    /// Writes or reads the filters at sample `tick`; refuses if the newest gust is not the gust of the previous sample.
    pub fn remember(&mut self, tape: &mut Tape, tick: u64) {
        for Axis { a, b, decay, share, noise, scale, .. } in [&mut self.along, &mut self.across, &mut self.down] {
            tape.value(noise);
            for number in [a, b, decay, share, scale] {
                tape.value(number);
            }
        }
        tape.value(&mut self.to_ned);
        tape.random(&mut self.random);
        tape.option(&mut self.newest, |tape, (newest, gust)| {
            tape.value(newest);
            tape.value(gust);
        });
        if self.newest.is_none_or(|(newest, _)| newest.checked_add(1) != Some(tick)) {
            tape.refuse();
        }
    }

    /// Gust of sample `tick`, NED \[m/s\]; must be called in the order of samples. With `from_wind` the `moment` of the
    /// first call for a sample determines the gust.
    pub fn at(&mut self, tick: u64, moment: &GustConditions) -> Vector3<f64> {
        let before = match self.newest {
            Some((newest, gust)) if newest == tick => return gust,
            newest => newest.map_or(0, |(newest, _)| newest),
        };
        if self.from_wind {
            self.tune(moment);
        }
        for _ in before..tick {
            for axis in [&mut self.along, &mut self.across, &mut self.down] {
                axis.advance(&mut self.random);
            }
        }
        let gust = self.to_ned * Vector3::new(self.along.gust_mps(), self.across.gust_mps(), self.down.gust_mps());
        self.newest = Some((tick, gust));
        gust
    }

    /// Sets deviations, time scales and direction by the `moment`.
    fn tune(&mut self, moment: &GustConditions) {
        let (north, east) = (moment.wind_mps.x, moment.wind_mps.y);
        let wind_mps = libm::hypot(north, east);
        let height_m = moment.height_m.clamp(HEIGHTS_M[0], HEIGHTS_M[1]);
        let ([l_u, l_w], [s_u, s_w]) = scales(height_m, wind_mps);
        let v = moment.airspeed_mps.max(MIN_AIRSPEED_MPS);
        self.along.tune(s_u, l_u / v, self.dt_s);
        self.across.tune(s_u, l_u / v, self.dt_s);
        self.down.tune(s_w, l_w / v, self.dt_s);
        if wind_mps > 0.0 {
            let (n, e) = (north / wind_mps, east / wind_mps);
            self.to_ned = Rotation3::from_matrix_unchecked(Matrix3::new(n, -e, 0.0, e, n, 0.0, 0.0, 0.0, 1.0));
        }
    }
}

/// Mean wind at `height_m` above the ground, as a share of that at 20 feet: a logarithmic profile over ground of the
/// roughness `roughness_m`; 1 at every height for the roughness 0.
pub fn shear(height_m: f64, roughness_m: f64) -> f64 {
    if roughness_m <= 0.0 {
        1.0
    } else {
        libm::log(height_m.max(roughness_m) / roughness_m) / libm::log(REFERENCE_HEIGHT_M / roughness_m)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use super::*;

    const DT_S: f64 = 0.02;

    fn scenario(seed: u64) -> Scenario {
        let mut scenario = Scenario::default();
        scenario.run.seed = seed;
        scenario.run.rate_hz = 50;
        scenario.plant.turbulence.wind_at_6m_mps = 8.0;
        scenario
    }

    fn gusts(seed: u64, samples: u64) -> Vec<Vector3<f64>> {
        let mut turbulence = Turbulence::new(&scenario(seed)).expect("there is some");
        (0..samples).map(|tick| turbulence.at(tick, &OTHER)).collect()
    }

    /// Moment that differs from the settings.
    const OTHER: GustConditions =
        GustConditions { height_m: 50.0, wind_mps: Vector3::new(0.0, -3.0, 0.0), airspeed_mps: 9.0 };

    /// Gusts with `from_wind` of a vehicle at the `moment`.
    fn from_wind(seed: u64, samples: u64, moment: &GustConditions) -> Vec<Vector3<f64>> {
        let mut scenario = scenario(seed);
        scenario.plant.turbulence = settings::TurbulenceSettings { from_wind: true, ..Default::default() };
        let mut turbulence = Turbulence::new(&scenario).expect("there is some");
        (0..samples).map(|tick| turbulence.at(tick, moment)).collect()
    }

    #[test]
    fn a_moment_with_the_values_of_the_settings_gives_the_same_gusts() {
        let settings = scenario(3).plant.turbulence;
        let (height_m, airspeed_mps) = (settings.height_m, settings.airspeed_mps);
        let moment = GustConditions { height_m, wind_mps: Vector3::new(8.0, 0.0, 1.0), airspeed_mps };
        for (theirs, ours) in gusts(3, 500).into_iter().zip(from_wind(3, 500, &moment)) {
            assert!((theirs - ours).norm() < 1e-12, "{theirs} and {ours}");
        }
        let east = GustConditions { wind_mps: Vector3::new(0.0, 8.0, 0.0), ..moment };
        let (east, north) = (from_wind(3, 50, &east)[49], gusts(3, 50)[49]);
        assert!((east - Vector3::new(-north.y, north.x, north.z)).norm() < 1e-12);
    }

    #[test]
    fn gusts_follow_the_wind_and_the_height_of_the_moment() {
        let moment =
            |height_m, wind_mps| GustConditions { height_m, wind_mps: Vector3::x() * wind_mps, airspeed_mps: 5.0 };
        let first = |moment: GustConditions| from_wind(3, 1, &moment)[0];
        assert_eq!(first(moment(8.0, 0.0)), Vector3::zeros(), "no wind, no gusts");
        assert!((first(moment(8.0, 6.0)) - first(moment(8.0, 3.0)) * 2.0).norm() < 1e-12);
        // Higher up the gusts along the wind are weaker, and the vertical gusts as strong but slower.
        let (low, high) = (first(moment(5.0, 6.0)), first(moment(50.0, 6.0)));
        let base = |h_m: f64| 0.177 + 0.000_823 * h_m / 0.3048;
        assert!((high.x / low.x - (base(5.0) / base(50.0)).powf(0.4)).abs() < 1e-12 && (high.z - low.z).abs() < 1e-12);
        let step = |height_m| {
            let drawn = from_wind(3, 2000, &moment(height_m, 6.0));
            drawn.windows(2).map(|pair| (pair[1].z - pair[0].z).powi(2)).sum::<f64>()
        };
        assert!(step(5.0) > 5.0 * step(50.0));
        // Heights beyond the standard are clamped; an airspeed of 0 gives a finite gust, not NaN.
        assert_eq!(first(moment(-1.0, 6.0)), first(moment(3.048, 6.0)));
        assert!(first(GustConditions { airspeed_mps: 0.0, ..moment(8.0, 6.0) }).iter().all(|gust| gust.is_finite()));
    }

    /// Deviations and time scales along, across and down, by the standard at the default height and airspeed.
    fn standard() -> [(f64, f64); 3] {
        let settings = &scenario(0).plant.turbulence;
        let h: f64 = settings.height_m / 0.3048;
        let base = 0.177 + 0.000_823 * h;
        let (sigma_w, sigma_u) = (0.8, 0.8 / base.powf(0.4));
        let (l_w, l_u) = (settings.height_m, h / base.powf(1.2) * 0.3048);
        let v = settings.airspeed_mps;
        [(sigma_u, l_u / v), (sigma_u, l_u / v), (sigma_w, l_w / v)]
    }

    #[test]
    fn the_first_sample_and_later_ones_have_the_deviation_of_the_standard() {
        let flights = 4000;
        for tick in [0, 50] {
            let drawn: Vec<_> = (0..flights).map(|seed| gusts(seed, tick + 1)[tick as usize]).collect();
            for (axis, (sigma, _)) in standard().into_iter().enumerate() {
                let variance = drawn.iter().map(|gust| gust[axis] * gust[axis]).sum::<f64>() / flights as f64;
                let share = variance / (sigma * sigma);
                assert!((share - 1.0).abs() < 5.0 * (2.0 / flights as f64).sqrt(), "axis {axis} at {tick}: {share}");
            }
        }
    }

    #[test]
    fn the_spectrum_is_the_one_of_the_standard() {
        let (segments, length) = (400, 2048);
        let drawn = gusts(1, (segments * length) as u64);
        let window: Vec<f64> = (0..length).map(|i| (PI * (i as f64 + 0.5) / length as f64).sin().powi(2)).collect();
        let power: f64 = window.iter().map(|w| w * w).sum();
        for (axis, (sigma, t_s)) in standard().into_iter().enumerate() {
            for bin in [8, 16, 32, 64, 128] {
                let omega = TAU * f64::from(bin) / (length as f64 * DT_S);
                let density = |segment: &[Vector3<f64>]| {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (i, (gust, w)) in segment.iter().zip(&window).enumerate() {
                        let (sin, cos) = (omega * DT_S * i as f64).sin_cos();
                        re += gust[axis] * w * cos;
                        im += gust[axis] * w * sin;
                    }
                    (re * re + im * im) * DT_S / power
                };
                let measured = drawn.chunks_exact(length).map(density).sum::<f64>() / segments as f64;
                let x = (omega * t_s).powi(2);
                let shape = if axis == 0 { 2.0 / (1.0 + x) } else { (1.0 + 3.0 * x) / (1.0 + x).powi(2) };
                let ratio = measured / (sigma * sigma * t_s * shape);
                assert!((ratio - 1.0).abs() < 5.0 / (segments as f64).sqrt(), "axis {axis}, {omega} rad/s: {ratio}");
            }
        }
    }

    #[test]
    fn gusts_repeat_with_the_seed_and_turn_with_the_wind() {
        assert_eq!(gusts(3, 20), gusts(3, 20));
        assert_ne!(gusts(3, 20), gusts(4, 20));
        let mut east = scenario(3);
        east.plant.turbulence.direction_deg = 90.0;
        let (east, north) = (Turbulence::new(&east).unwrap().at(0, &OTHER), gusts(3, 1)[0]);
        assert!((east - Vector3::new(-north.y, north.x, north.z)).norm() < 1e-12);
        assert!(Turbulence::new(&Scenario::default()).is_none());
    }

    #[test]
    fn the_mean_wind_grows_with_height() {
        assert!((shear(REFERENCE_HEIGHT_M, 0.05) - 1.0).abs() < 1e-15 && (shear(3.0, 0.0) - 1.0).abs() < 1e-15);
        assert!(shear(0.0, 0.05).abs() < 1e-15, "calm at the ground");
        assert!((shear(20.0, 0.05) - (400.0_f64).ln() / (121.92_f64).ln()).abs() < 1e-12);
    }
}
