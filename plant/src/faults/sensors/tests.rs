use proptest::prelude::*;

use super::*;

/// Measurement without noise at `tick`, different on every axis and at every tick.
fn measured(tick: u64) -> Kinematics {
    let axes = |first: f64| std::array::from_fn(|axis| first + axis as f64 + 0.01 * tick as f64);
    Kinematics { position_m: axes(1.0), velocity_mps: axes(2.0), attitude_rad: axes(3.0), rates_radps: axes(4.0) }
}

/// Fault of the position sensor from 0.1 s to 0.2 s (ticks 10 to 19), with `change`.
fn fault(kind: FaultKind, change: impl Fn(&mut Fault)) -> Fault {
    let mut fault = Fault::new(FaultTarget::Position, kind, 0.1, Some(0.1));
    change(&mut fault);
    fault
}

/// Readings of the sensors at `ticks`, at 100 Hz.
fn told(faults: &[Fault], seed: u64, ticks: impl IntoIterator<Item = u64>) -> Vec<Kinematics> {
    let mut scenario = Scenario::default();
    scenario.run.seed = seed;
    scenario.fault = faults.to_vec();
    let mut sensors = SensorFaults::new(&scenario);
    let mut reading = |tick| {
        let mut told = measured(tick);
        sensors.inject(tick, &mut told);
        told
    };
    ticks.into_iter().map(&mut reading).collect()
}

/// Positions measured on ticks 0 to 29 with one fault.
fn positions(kind: FaultKind, change: impl Fn(&mut Fault)) -> Vec<Reading> {
    told(&[fault(kind, change)], 3, 0..30).iter().map(|told| told.position_m).collect()
}

fn bits(readings: &[Reading]) -> Vec<[u64; 3]> {
    readings.iter().map(|reading| reading.map(f64::to_bits)).collect()
}

const KINDS: &[FaultKind] = &[
    FaultKind::Off,
    FaultKind::Stuck,
    FaultKind::Garbage,
    FaultKind::Wrong,
    FaultKind::Slow,
    FaultKind::Delayed,
    FaultKind::Intermittent,
    FaultKind::Noise,
];

#[test]
fn each_kind_acts_on_its_own_quantity_while_it_is_active() {
    assert_eq!(KINDS, FaultTarget::Position.kinds());
    for (sensor, target) in [FaultTarget::Position, FaultTarget::Velocity, FaultTarget::Attitude, FaultTarget::Rates]
        .into_iter()
        .enumerate()
    {
        for kind in KINDS {
            let fault = Fault::new(target, *kind, 0.1, Some(0.1));
            let mut changed = 0;
            for (tick, told) in (0..30).zip(told(&[fault], 3, 0..30)) {
                let quantities = |k: Kinematics| [k.position_m, k.velocity_mps, k.attitude_rad, k.rates_radps];
                let (told, truth) = (quantities(told), quantities(measured(tick)));
                for other in 0..4 {
                    let same = bits(&[told[other]]) == bits(&[truth[other]]);
                    assert!(same || other == sensor && (10..20).contains(&tick), "{target:?} {kind:?} at {tick}");
                    changed += u64::from(!same);
                }
            }
            let all = if *kind == FaultKind::Intermittent { 3..=8 } else { 10..=10 };
            assert!(all.contains(&changed), "{target:?} {kind:?} changes {changed} readings");
        }
    }
}

#[test]
fn an_off_sensor_returns_nan() {
    assert!(positions(FaultKind::Off, |_| ())[10..20].iter().flatten().all(|value| value.is_nan()));
}

#[test]
fn stuck_is_the_last_reading_before_bit_for_bit() {
    let told = bits(&positions(FaultKind::Stuck, |_| ()));
    let before = measured(9).position_m.map(f64::to_bits);
    assert!(told[10..20].iter().all(|reading| *reading == before));
    let from_the_start = positions(FaultKind::Stuck, |fault| fault.at_s = 0.0);
    assert!(from_the_start[..10].iter().all(|reading| *reading == measured(0).position_m), "its first reading");
}

#[test]
fn garbage_comes_in_every_kind() {
    let faults = [Fault::new(FaultTarget::Rates, FaultKind::Garbage, 0.0, None)];
    let values: Vec<f64> = told(&faults, 1, 0..300).iter().flat_map(|told| told.rates_radps).collect();
    let count = |what: &dyn Fn(f64) -> bool| values.iter().filter(|value| what(**value)).count();
    assert!(
        count(&f64::is_nan) > 150 && count(&|v| v == f64::INFINITY) > 50 && count(&|v| v == f64::NEG_INFINITY) > 50
    );
    assert!(count(&|v| v.is_finite() && v.abs() > 1e30) > 100 && count(&|v| v.abs() < 1e-30) > 100);
}

#[test]
fn garbage_and_missing_readings_occur_on_their_share_of_the_ticks() {
    for (kind, default) in [(FaultKind::Garbage, 1.0), (FaultKind::Intermittent, 0.5)] {
        for asked in [None, Some(0.0), Some(0.2), Some(1.0)] {
            let faults = [Fault { probability: asked, ..Fault::new(FaultTarget::Position, kind, 0.0, None) }];
            let n = 4000;
            let changed = (0..n).zip(told(&faults, 5, 0..n)).filter(|(tick, told)| *told != measured(*tick));
            let (share, expected) = (changed.count() as f64 / n as f64, asked.unwrap_or(default));
            let five_sigma = 5.0 * (expected * (1.0 - expected) / n as f64).sqrt();
            assert!((share - expected).abs() <= five_sigma, "{kind:?} {asked:?}: {share}");
        }
    }
}

#[test]
fn wrong_adds_multiplies_or_turns_the_sign() {
    let truth = measured(15).position_m;
    let wrong = |how, value| positions(FaultKind::Wrong, |fault| (fault.how, fault.value) = (how, value))[15];
    assert_eq!(wrong(None, Some(-0.25)), truth.map(|m| m - 0.25));
    assert_eq!(wrong(Some(Wrong::Bias), None), truth.map(|m| m + 1.0));
    assert_eq!(wrong(Some(Wrong::Scale), Some(0.5)), truth.map(|m| m * 0.5));
    assert_eq!(wrong(Some(Wrong::Scale), None), truth.map(|m| m * SCALE));
    assert_eq!(wrong(Some(Wrong::Sign), Some(7.0)), truth.map(|m| -m));
}

#[test]
fn sizes_of_angles_are_degrees() {
    let faults = [FaultTarget::Attitude, FaultTarget::Rates]
        .map(|target| Fault { value: Some(90.0), ..Fault::new(target, FaultKind::Wrong, 0.0, None) });
    let told = told(&faults, 0, [7])[0];
    assert_eq!(told.attitude_rad, measured(7).attitude_rad.map(|m| m + std::f64::consts::FRAC_PI_2));
    assert_eq!(told.rates_radps, measured(7).rates_radps.map(|m| m + std::f64::consts::FRAC_PI_2));
}

#[test]
fn slow_lags_behind_a_ramp() {
    let told = positions(FaultKind::Slow, |fault| (fault.at_s, fault.ms) = (0.0, Some(20.0)));
    // On a ramp of 0.01 per sample the error of a lag of two samples tends to 0.01 / (e^0.5 - 1).
    let behind = measured(9).position_m[0] - told[9][0];
    assert!((behind - 0.01 * (1.0 - (-4.5f64).exp()) / 0.5f64.exp_m1()).abs() < 1e-14, "{behind}");
    let default = positions(FaultKind::Slow, |_| ());
    let first = measured(9).position_m[1] - 0.01 * (-0.05f64).exp_m1();
    assert!((default[10][1] - first).abs() < 1e-14, "200 ms, from the last reading before the fault");
}

#[test]
fn delayed_is_what_was_measured_then_bit_for_bit() {
    for (ms, ticks) in [(None, 10), (Some(30.0), 3), (Some(31.0), 4), (Some(0.0), 0), (Some(60_000.0), 15)] {
        let told = positions(FaultKind::Delayed, |fault| fault.ms = ms);
        assert_eq!(told[15], measured(15 - ticks).position_m, "{ms:?}");
    }
}

#[test]
fn noise_has_the_mean_and_deviation_it_was_asked_for() {
    let n = 20_000;
    for (asked, deviation) in [(Some(0.7), 0.7), (None, 0.3)] {
        let faults = [Fault { value: asked, ..Fault::new(FaultTarget::Position, FaultKind::Noise, 0.0, None) }];
        let told = told(&faults, 9, 0..n);
        let draw = |tick: u64, axis: usize| {
            (told[tick as usize].position_m[axis] - measured(tick).position_m[axis]) / deviation
        };
        let mean = |f: &dyn Fn(u64) -> f64| (0..n - 1).map(f).sum::<f64>() / n as f64;
        let five_sigma = 5.0 / (n as f64).sqrt();
        for axis in 0..3 {
            assert!(mean(&|k| draw(k, axis)).abs() < five_sigma);
            assert!((mean(&|k| draw(k, axis).powi(2)) - 1.0).abs() < 2f64.sqrt() * five_sigma);
            assert!(mean(&|k| draw(k, axis) * draw(k, (axis + 1) % 3)).abs() < five_sigma, "axes are independent");
            assert!(mean(&|k| draw(k, axis) * draw(k + 1, axis)).abs() < five_sigma, "it is white");
        }
    }
}

#[test]
fn draws_repeat_with_the_seed_and_depend_on_the_tick_alone() {
    for kind in [FaultKind::Garbage, FaultKind::Intermittent, FaultKind::Noise] {
        let positions = |seed, ticks: &[u64]| {
            let told = told(&[fault(kind, |_| ())], seed, ticks.iter().copied());
            bits(&told.iter().map(|told| told.position_m).collect::<Vec<_>>())
        };
        let all: Vec<u64> = (10..20).collect();
        assert_eq!(positions(4, &all), positions(4, &all));
        assert_ne!(positions(4, &all), positions(5, &all));
        let few = [11, 12, 12, 17];
        assert_eq!(positions(4, &few), few.map(|tick| positions(4, &all)[tick as usize - 10]), "{kind:?}");
    }
}

#[test]
fn one_fault_leaves_the_draws_of_another_alone() {
    let noise = |target| Fault::new(target, FaultKind::Noise, 0.0, None);
    let position = |faults: &[Fault]| -> Vec<Reading> { told(faults, 2, 0..20).iter().map(|t| t.position_m).collect() };
    let alone = position(&[noise(FaultTarget::Position)]);
    assert_eq!(position(&[noise(FaultTarget::Position), noise(FaultTarget::Rates)]), alone);
    let other = told(&[noise(FaultTarget::Position), noise(FaultTarget::Velocity)], 2, [0])[0];
    let draws = [other.position_m[0] - measured(0).position_m[0], other.velocity_mps[0] - measured(0).velocity_mps[0]];
    assert!((draws[0] / 0.3 - draws[1] / 0.2).abs() > 1e-3, "each has its own");
}

#[test]
fn faults_of_one_sensor_act_in_the_order_of_the_file() {
    let bias = fault(FaultKind::Wrong, |fault| fault.value = Some(1.0));
    let sign = fault(FaultKind::Wrong, |fault| fault.how = Some(Wrong::Sign));
    let off_before = Fault::new(FaultTarget::Position, FaultKind::Off, 0.05, Some(0.05));
    let stuck = fault(FaultKind::Stuck, |_| ());
    let at_15 = |faults: &[Fault]| told(faults, 0, 0..16)[15].position_m;
    let truth = measured(15).position_m;
    assert_eq!(at_15(&[bias, sign]), truth.map(|m| -(m + 1.0)));
    assert_eq!(at_15(&[sign, bias]), truth.map(|m| -m + 1.0));
    assert_eq!(at_15(&[bias, stuck]), measured(9).position_m, "the bias comes too late to be kept");
    assert_eq!(at_15(&[stuck, bias]), measured(9).position_m.map(|m| m + 1.0));
    let delayed = fault(FaultKind::Delayed, |fault| fault.ms = Some(30.0));
    assert_eq!(at_15(&[bias, delayed]), measured(12).position_m, "what was measured is known before any fault");
    assert!(at_15(&[off_before, stuck]).iter().all(|value| value.is_nan()), "stuck with nothing");
}

proptest! {
    /// For any sizes, sample times and missing samples nothing panics, and outside the fault the truth is measured.
    #[test]
    fn any_size_and_sample_time_leaves_readings_outside_the_fault_unchanged(
        kind in prop::sample::select(KINDS),
        value in prop::num::f64::ANY,
        ms in 0.0..60_000.0,
        how in prop::sample::select(vec![Wrong::Bias, Wrong::Scale, Wrong::Sign]),
        rate_hz in prop::sample::select(vec![50u32, 100, 250, 1000, 2000]),
        steps in prop::collection::vec(0u64..40, 1..50),
    ) {
        let mut scenario = Scenario::default();
        scenario.run.rate_hz = rate_hz;
        let fault = Fault { value: Some(value), ms: Some(ms), how: Some(how), ..fault(kind, |_| ()) };
        let ticks = fault.ticks(scenario.sample_s());
        scenario.fault = vec![fault];
        let mut sensors = SensorFaults::new(&scenario);
        let mut tick = 0;
        for step in steps {
            tick += step;
            let mut told = measured(tick);
            sensors.inject(tick, &mut told);
            prop_assert!(ticks.contains(&tick) || told == measured(tick));
        }
    }
}
