use settings::Noise;

use super::*;

const MOTION: Kinematics = Kinematics {
    position_m: [1.0, -2.0, 3.0],
    velocity_mps: [0.5, 0.0, -0.5],
    attitude_rad: [0.1, 0.2, -3.0],
    rates_radps: [0.0, 4.0, 0.0],
};
const SAMPLE_NS: u64 = 10_000_000;

fn noisy(seed: u64, position_m: f64, velocity_mps: f64, attitude_deg: f64, rates_dps: f64) -> Sensors {
    let mut scenario = Scenario::default();
    scenario.run.seed = seed;
    scenario.plant.noise = Noise { position_m, velocity_mps, attitude_deg, rates_dps };
    Sensors::new(&scenario)
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
