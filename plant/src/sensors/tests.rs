use contract::scenario::{Noise, Sensor as Settings};

use super::*;

const MOTION: Kinematics = Kinematics {
    position_m: [1.0, -2.0, 3.0],
    velocity_mps: [0.5, 0.0, -0.5],
    attitude_rad: [0.1, 0.2, -3.0],
    rates_radps: [0.0, 4.0, 0.0],
};
const SAMPLE_NS: u64 = 10_000_000;

/// Sensors of a scenario after `change`.
fn sensors(seed: u64, change: impl Fn(&mut Scenario)) -> Sensors {
    let mut scenario = Scenario::default();
    scenario.run.seed = seed;
    change(&mut scenario);
    Sensors::new(&scenario)
}

fn noisy(seed: u64, position_m: f64, velocity_mps: f64, attitude_deg: f64, rates_dps: f64) -> Sensors {
    sensors(seed, |scenario| scenario.plant.noise = Noise { position_m, velocity_mps, attitude_deg, rates_dps })
}

/// Readings along x of a position sensor with these settings at the first samples of a vehicle at `x(k)`.
fn along_x(settings: &Settings, samples: u64, x: impl Fn(u64) -> f64) -> Vec<f64> {
    let mut sensors = sensors(1, |scenario| scenario.plant.sensors.position = settings.clone());
    let at = |k| Kinematics { position_m: [x(k), 0.0, 0.0], ..Kinematics::default() };
    (0..samples).map(|k| sensors.measure(k * SAMPLE_NS, &at(k)).position_m[0]).collect()
}

#[test]
fn without_errors_the_truth_is_measured() {
    assert_eq!(noisy(1, 0.0, 0.0, 0.0, 0.0).measure(0, &MOTION), MOTION);
}

#[test]
fn noise_repeats_with_the_seed_and_changes_with_it() {
    let mut same = [noisy(7, 0.1, 0.1, 0.1, 0.1), noisy(7, 0.1, 0.1, 0.1, 0.1)];
    let mut other = noisy(8, 0.1, 0.1, 0.1, 0.1);
    for k in 0..10 {
        let first = same[0].measure(k * SAMPLE_NS, &MOTION);
        assert_eq!(first, same[1].measure(k * SAMPLE_NS, &MOTION));
        assert_ne!(first, other.measure(k * SAMPLE_NS, &MOTION));
    }
}

#[test]
fn one_sensor_does_not_disturb_another() {
    let (mut alone, mut together) = (noisy(3, 0.0, 0.2, 0.0, 0.0), noisy(3, 0.1, 0.2, 0.3, 0.4));
    for k in 0..10 {
        let [a, b] =
            [&mut alone, &mut together].map(|s| s.measure(k * SAMPLE_NS, &MOTION).velocity_mps.map(f64::to_bits));
        assert_eq!(a, b);
    }
}

#[test]
fn noise_has_the_mean_deviation_and_independence_it_was_asked_for() {
    let n = 20_000_u32;
    let mut sensors = noisy(42, 0.03, 0.05, 0.5, 2.0);
    let deviations = [0.03, 0.05, 0.5f64.to_radians(), 2f64.to_radians()];
    let rest = Kinematics::default();
    let draws: Vec<[f64; 12]> = (0..n)
        .map(|k| {
            let m = sensors.measure(u64::from(k) * SAMPLE_NS, &rest);
            let groups = [m.position_m, m.velocity_mps, m.attitude_rad, m.rates_radps];
            std::array::from_fn(|i| groups[i / 3][i % 3] / deviations[i / 3])
        })
        .collect();
    let mean = |f: &dyn Fn(&[f64; 12]) -> f64| draws.iter().map(f).sum::<f64>() / f64::from(n);
    let five_sigma = 5.0 / f64::from(n).sqrt();
    for i in 0..12 {
        assert!(mean(&|d| d[i]).abs() < five_sigma);
        assert!((mean(&|d| d[i] * d[i]) - 1.0).abs() < 2f64.sqrt() * five_sigma);
        for j in 0..i {
            assert!(mean(&|d| d[i] * d[j]).abs() < five_sigma);
        }
    }
}

#[test]
fn noise_of_a_density_grows_with_the_root_of_the_rate() {
    let deviation = |rate_hz: f64| {
        let settings = Settings { noise_density: [0.02, 0.0, 0.0], rate_hz, ..Settings::default() };
        let every = (100.0 / rate_hz) as usize;
        let drawn: Vec<f64> = along_x(&settings, 40_000, |_| 0.0).into_iter().step_by(every).collect();
        (drawn.iter().map(|x| x * x).sum::<f64>() / drawn.len() as f64).sqrt()
    };
    for rate_hz in [100.0, 25.0] {
        let expected = 0.02 * (rate_hz / 2.0_f64).sqrt();
        assert!((deviation(rate_hz) / expected - 1.0).abs() < 0.05, "at {rate_hz} Hz");
    }
}

#[test]
fn a_bias_begins_somewhere_and_walks() {
    let settings = Settings { bias: [0.3, 0.0, 0.0], bias_walk: [0.1, 0.0, 0.0], ..Settings::default() };
    let flights = 2000;
    let variance = |k: u64| {
        let bias = |seed| {
            let mut sensors = sensors(seed, |scenario| scenario.plant.sensors.position = settings.clone());
            let said = (0..=k).map(|k| sensors.measure(k * SAMPLE_NS, &Kinematics::default()).position_m[0]);
            said.last().expect("a sample")
        };
        (0..flights).map(bias).map(|x| x * x).sum::<f64>() / flights as f64
    };
    for (k, expected) in [(0, 0.09), (400, 0.09 + 0.01 * 4.0)] {
        assert!((variance(k) / expected - 1.0).abs() < 5.0 * (2.0 / flights as f64).sqrt(), "at sample {k}");
    }
}

#[test]
fn values_are_multiples_of_the_quantum() {
    let settings = Settings { quantum: [0.25, 0.0, 0.0], ..Settings::default() };
    let said = along_x(&settings, 4, |k| 0.1 * k as f64);
    assert_eq!(said, [0.0, 0.0, 0.25, 0.25]);
}

#[test]
fn a_slow_sensor_repeats_and_a_late_one_returns_older_values() {
    let slow = Settings { rate_hz: 25.0, ..Settings::default() };
    assert_eq!(along_x(&slow, 9, |k| k as f64), [0.0, 0.0, 0.0, 0.0, 4.0, 4.0, 4.0, 4.0, 8.0]);
    let late = Settings { latency_ms: 30.0, ..Settings::default() };
    assert_eq!(along_x(&late, 7, |k| k as f64), [0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 3.0]);
    let both = Settings { rate_hz: 25.0, latency_ms: 25.0, ..Settings::default() };
    assert_eq!(along_x(&both, 9, |k| k as f64), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 4.0]);
}
