//! Turbulence of the Dryden form at low altitude, and the shear of the mean wind (MIL-F-8785C, section 3.7).
//!
//! At the height h in feet and with the wind W20 at 20 feet, scales and deviations of the gusts along, across and down are
//!
//! ```text
//! L_w = h,        L_u = L_v = h / (0.177 + 0.000823 h)^1.2
//! s_w = 0.1 W20,  s_u = s_v = s_w / (0.177 + 0.000823 h)^0.4
//! ```
//!
//! and their spectra, for a vehicle that meets the frozen field at the airspeed V, those of white noise through
//!
//! ```text
//! H_u = s_u sqrt(2 T) / (1 + T s)                                 T = L / V
//! H_v = s_v sqrt(T) (1 + sqrt(3) T s) / (1 + T s)^2               H_w likewise
//! ```
//!
//! The filters are discretised exactly: values at the samples have the covariance that the continuous process has there, at any
//! sample rate, from the first sample on. Within a sample the gust stays. Height and airspeed are settings, not those of the
//! moment: so the process is stationary, and its spectrum can be tested. The gusts that turn a wing are left out: the vehicle
//! is small beside the scales.

use contract::Scenario;
use nalgebra::{Rotation3, Vector3};
use rand_chacha::ChaCha8Rng;

use crate::random::{Stream, normal};

const FEET_PER_M: f64 = 1.0 / 0.3048;
/// Height at which the wind is given: 20 feet \[m\].
pub const REFERENCE_HEIGHT_M: f64 = 6.096;

/// The gusts of one flight.
#[derive(Debug, Clone)]
pub struct Turbulence {
    along: Axis,
    across: Axis,
    down: Axis,
    to_ned: Rotation3<f64>,
    random: ChaCha8Rng,
    tick: u64,
}

/// One component: `a' = (n - a) / T`, `b' = (a - b) / T`, and the gust is `from_a a + from_b b`.
#[derive(Debug, Clone, Copy)]
struct Axis {
    a: f64,
    b: f64,
    /// `exp(-dt / T)` and `dt / T`.
    decay: f64,
    share: f64,
    /// Cholesky factor of the covariance of what one sample adds to (a, b).
    noise: [f64; 3],
    from: [f64; 2],
}

impl Axis {
    /// Of deviation `sigma` and time scale `t_s`, by samples of `dt_s`, from its stationary distribution.
    fn new(sigma_mps: f64, t_s: f64, dt_s: f64, from: [f64; 2], random: &mut ChaCha8Rng) -> Self {
        let share = dt_s / t_s;
        let axis =
            Self { a: 0.0, b: 0.0, decay: libm::exp(-share), share, noise: covariance_root(sigma_mps, share), from };
        let start = covariance_root(sigma_mps, f64::INFINITY);
        let [first, second] = two(random);
        Self { a: start[0] * first, b: start[1] * first + start[2] * second, ..axis }
    }

    fn advance(&mut self, random: &mut ChaCha8Rng) {
        let [first, second] = two(random);
        let Self { a, b, decay, share, noise: [aa, ab, bb], .. } = *self;
        self.a = decay * a + aa * first;
        self.b = decay * (b + share * a) + ab * first + bb * second;
    }

    fn gust_mps(&self) -> f64 {
        self.from[0] * self.a + self.from[1] * self.b
    }
}

fn two(random: &mut ChaCha8Rng) -> [f64; 2] {
    [normal(random), normal(random)]
}

/// Lower triangle of the root of the covariance that `share` of a time scale adds to (a, b).
fn covariance_root(sigma: f64, share: f64) -> [f64; 3] {
    let (left, r) = if share.is_finite() { (libm::exp(-2.0 * share), share) } else { (0.0, 0.0) };
    let aa = (1.0 - left) / 2.0;
    let ab = 0.25 - (r / 2.0 + 0.25) * left;
    let bb = 0.25 - (r * r / 2.0 + r / 2.0 + 0.25) * left;
    let root_aa = aa.sqrt();
    let root_ab = ab / root_aa;
    [root_aa, root_ab, (bb - root_ab * root_ab).max(0.0).sqrt()].map(|root| root * sigma)
}

/// Scales along and down \[m\], and deviations along and down \[m/s\], at `height_m` with the wind `wind_mps` at 20 feet.
fn scales(height_m: f64, wind_mps: f64) -> ([f64; 2], [f64; 2]) {
    let h_ft = height_m * FEET_PER_M;
    let base = 0.177 + 0.000_823 * h_ft;
    let sigma_w = 0.1 * wind_mps;
    ([height_m / libm::pow(base, 1.2), height_m], [sigma_w / libm::pow(base, 0.4), sigma_w])
}

impl Turbulence {
    /// The turbulence of `scenario`, if it has any.
    pub fn new(scenario: &Scenario) -> Option<Self> {
        let settings = &scenario.plant.turbulence;
        let ([l_u, l_w], [s_u, s_w]) = scales(settings.height_m, settings.wind_at_6m_mps);
        let dt_s = scenario.sample_s();
        let mut random = Stream::Turbulence.open(scenario.run.seed);
        let v = settings.airspeed_mps;
        let first_order = [std::f64::consts::SQRT_2, 0.0];
        let second_order = [3_f64.sqrt(), 1.0 - 3_f64.sqrt()];
        (settings.wind_at_6m_mps > 0.0).then(|| Self {
            along: Axis::new(s_u, l_u / v, dt_s, first_order, &mut random),
            across: Axis::new(s_u, l_u / v, dt_s, second_order, &mut random),
            down: Axis::new(s_w, l_w / v, dt_s, second_order, &mut random),
            to_ned: Rotation3::from_axis_angle(&Vector3::z_axis(), settings.direction_deg.to_radians()),
            random,
            tick: 0,
        })
    }

    /// The gust of the sample `tick`, NED \[m/s\]; samples are asked for in order.
    pub fn at(&mut self, tick: u64) -> Vector3<f64> {
        while self.tick < tick {
            for axis in [&mut self.along, &mut self.across, &mut self.down] {
                axis.advance(&mut self.random);
            }
            self.tick += 1;
        }
        self.to_ned * Vector3::new(self.along.gust_mps(), self.across.gust_mps(), self.down.gust_mps())
    }
}

/// The mean wind at `height_m`, as a share of that at 20 feet: a logarithmic profile over ground of the roughness
/// `roughness_m`; 1 at every height for the roughness 0.
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
        (0..samples).map(|tick| turbulence.at(tick)).collect()
    }

    /// Deviations and time scales along, across and down, as the standard has them at the default height and airspeed.
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
    fn it_repeats_with_the_seed_and_turns_with_the_wind() {
        assert_eq!(gusts(3, 20), gusts(3, 20));
        assert_ne!(gusts(3, 20), gusts(4, 20));
        let mut east = scenario(3);
        east.plant.turbulence.direction_deg = 90.0;
        let (east, north) = (Turbulence::new(&east).unwrap().at(0), gusts(3, 1)[0]);
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
