use super::*;
use crate::random::Stream;

const SAMPLE_NS: u64 = 10_000_000;

/// Measurements along x of a sensor with these settings, at the first samples; the vehicle is at `x(k)`.
fn along_x(settings: &SensorSettings, seed: u64, samples: u64, x: impl Fn(u64) -> f64) -> Vec<f64> {
    let mut sensor = Sensor::new(settings, 0.0, 1.0, SAMPLE_NS);
    let mut random = Stream::Noise.open(seed);
    let measured = |k: u64| Some(sensor.measure(k * SAMPLE_NS, [x(k), 0.0, 0.0], true, &mut random)?[0]);
    (0..samples).filter_map(measured).collect()
}

#[test]
fn noise_of_a_density_grows_with_the_root_of_the_rate() {
    for rate_hz in [100.0, 25.0] {
        let settings = SensorSettings { noise_density: [0.02, 0.0, 0.0], rate_hz, ..SensorSettings::default() };
        let drawn = along_x(&settings, 1, 40_000, |_| 0.0);
        let deviation = (drawn.iter().map(|x| x * x).sum::<f64>() / drawn.len() as f64).sqrt();
        let expected = 0.02 * (rate_hz / 2.0_f64).sqrt();
        assert!((deviation / expected - 1.0).abs() < 0.05, "at {rate_hz} Hz");
    }
}

#[test]
fn a_bias_begins_somewhere_and_walks() {
    let settings = SensorSettings { bias: [0.3, 0.0, 0.0], bias_walk: [0.1, 0.0, 0.0], ..SensorSettings::default() };
    let flights = 2000;
    let variance = |k: u64| {
        let bias = |seed| *along_x(&settings, seed, k + 1, |_| 0.0).last().expect("a sample");
        (0..flights).map(bias).map(|x| x * x).sum::<f64>() / flights as f64
    };
    for (k, expected) in [(0, 0.09), (400, 0.09 + 0.01 * 4.0)] {
        assert!((variance(k) / expected - 1.0).abs() < 5.0 * (2.0 / flights as f64).sqrt(), "at sample {k}");
    }
}

#[test]
fn values_are_multiples_of_the_quantum() {
    let settings = SensorSettings { quantum: [0.25, 0.0, 0.0], ..SensorSettings::default() };
    assert_eq!(along_x(&settings, 1, 4, |k| 0.1 * k as f64), [0.0, 0.0, 0.25, 0.25]);
}

#[test]
fn a_slow_sensor_measures_when_it_is_due() {
    let slow = SensorSettings { rate_hz: 25.0, ..SensorSettings::default() };
    assert_eq!(along_x(&slow, 1, 9, |k| k as f64), [0.0, 4.0, 8.0]);
}
