use nalgebra::{Matrix2, UnitQuaternion};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::*;
use crate::source::{Measured, SOURCES};
use crate::state::{ACCELERATION_BIAS, Covariance, DRIFT, ERRORS, POSITION, RATES_BIAS, StateError, VELOCITY, turn};

pub(crate) const G_MPS2: f64 = 9.81;
pub(crate) const DT_S: f64 = 0.005;
/// Number of IMU samples from fix to fix, and from one height, field and flow to the next.
const FIX: u64 = 20;
const SLOW: u64 = 10;
pub(crate) const DELAY: usize = 20;

pub(crate) const NOISE: ExpectedNoise = ExpectedNoise {
    specific_force_mps2: 0.3,
    rates_radps: 0.001,
    acceleration_bias_walk: 0.002,
    rates_bias_walk: 0.0002,
    position_m: Vector3::new(0.15, 0.15, 0.25),
    velocity_mps: Vector3::new(0.05, 0.05, 0.1),
    height_m: 0.1,
    wind_pressure: 0.0,
    field: 0.02,
    inclination_rad: 1.138_3, // inclination of a field (0.42, 0, 0.91)
    flow_mps: 0.1,
    antenna_m: 0.0,
    clock_s: 0.0,
    drift: [
        Wander { start: 0.5, walk: 0.1, time_s: 50.0 },
        Wander { start: 0.5, walk: 0.1, time_s: 50.0 },
        Wander { start: 0.0, walk: 0.05, time_s: f64::INFINITY },
    ],
    barometer: Wander { start: 0.2, walk: 0.05, time_s: 30.0 },
    hard_iron: Wander { start: 0.02, walk: 0.004, time_s: 40.0 },
};
/// Deviations at the start.
pub(crate) const START: InitialErrors = InitialErrors {
    position_m: 0.1,
    velocity_mps: 0.05,
    tilt_rad: 0.01,
    heading_rad: 0.03,
    constants: Constants {
        acceleration_bias_mps2: Vector3::new(0.05, 0.05, 0.05),
        rates_bias_radps: Vector3::new(0.01, 0.01, 0.01),
        declination_rad: 0.01,
    },
};

/// Motion that is given by formulas: turns, climbs and accelerations up to half a g on each axis.
pub(crate) fn truth(t_s: f64) -> State {
    let wave = |size: f64, rate: f64, phase: f64| {
        let angle = rate * t_s + phase;
        (size * angle.sin(), size * rate * angle.cos())
    };
    let [x, y, z] = [wave(12.0, 0.6, 0.0), wave(8.0, 0.7, 1.0), wave(3.0, 0.5, 2.0)];
    let [roll, pitch, yaw] = [wave(0.4, 1.1, 0.3), wave(0.3, 0.9, 1.2), wave(2.0, 0.3, 0.0)];
    State {
        position_m: Vector3::new(x.0, y.0, z.0),
        velocity_mps: Vector3::new(x.1, y.1, z.1),
        attitude: UnitQuaternion::from_euler_angles(roll.0, pitch.0, yaw.0),
        ..State::default()
    }
}

/// Flight with random errors along `path`, and its estimator.
pub(crate) struct Flight {
    path: fn(f64) -> State,
    pub random: ChaCha8Rng,
    /// True motion and errors of the sensors since the horizon, oldest first.
    flown: VecDeque<State>,
    sample: u64,
    pub navigation: Navigation,
}

impl Flight {
    pub fn new(seed: u64, path: fn(f64) -> State, start: InitialErrors) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let InitialErrors { position_m, velocity_mps, tilt_rad, heading_rad, constants } = start;
        let path_0 = path(0.0);
        let drift = Vector3::from(NOISE.drift.map(|wander| wander.start));
        let flown = State {
            acceleration_bias_mps2: draw(&mut random).component_mul(&constants.acceleration_bias_mps2),
            rates_bias_radps: draw(&mut random).component_mul(&constants.rates_bias_radps),
            drift_m: draw(&mut random).component_mul(&drift),
            barometer_bias_m: draw(&mut random).x * NOISE.barometer.start,
            hard_iron: draw(&mut random) * NOISE.hard_iron.start,
            declination_rad: draw(&mut random).x * constants.declination_rad,
            ..path_0
        };
        let off = turn(draw(&mut random).component_mul(&Vector3::new(tilt_rad, tilt_rad, heading_rad)));
        let state = State {
            position_m: flown.position_m + draw(&mut random) * position_m,
            velocity_mps: flown.velocity_mps + draw(&mut random) * velocity_mps,
            attitude: off * flown.attitude,
            ..State::default()
        };
        let filter = Filter::new(state, start.covariance(&state.attitude, &NOISE), NOISE, G_MPS2);
        let navigation = Navigation::new([filter], start.constants, DT_S, DELAY);
        Self { path, random, flown: VecDeque::from([flown]), sample: 0, navigation }
    }

    /// Next sample of the IMU, with all that is measured at its end.
    pub fn measure(&mut self) -> (Imu, Aiding) {
        let at = |sample: f64| (self.path)(sample * DT_S);
        let (before, middle) = (at(self.sample as f64), at(self.sample as f64 + 0.5));
        self.sample += 1;
        let random = &mut self.random;
        let last = *self.flown.back().expect("a start");
        let mut wander = |value: f64, wander: &Wander| {
            value * (-DT_S / wander.time_s).exp() + draw(random).x * wander.walk * DT_S.sqrt()
        };
        let now = State {
            drift_m: Vector3::from_fn(|i, _| wander(last.drift_m[i], &NOISE.drift[i])),
            barometer_bias_m: wander(last.barometer_bias_m, &NOISE.barometer),
            hard_iron: last.hard_iron.map(|iron| wander(iron, &NOISE.hard_iron)),
            acceleration_bias_mps2: last.acceleration_bias_mps2
                + draw(random) * (NOISE.acceleration_bias_walk * DT_S.sqrt()),
            rates_bias_radps: last.rates_bias_radps + draw(random) * (NOISE.rates_bias_walk * DT_S.sqrt()),
            declination_rad: last.declination_rad,
            ..at(self.sample as f64)
        };
        self.flown.push_back(now);
        if self.flown.len() > DELAY + 1 {
            self.flown.pop_front();
        }
        let force = (now.velocity_mps - before.velocity_mps) / DT_S - Vector3::new(0.0, 0.0, G_MPS2);
        let turned = (before.attitude.inverse() * now.attitude).scaled_axis() / DT_S;
        let imu = Imu {
            specific_force_mps2: middle.attitude.inverse() * force
                + now.acceleration_bias_mps2
                + draw(random) * NOISE.specific_force_mps2,
            rates_radps: turned + now.rates_bias_radps + draw(random) * NOISE.rates_radps,
        };
        let noisy = |random: &mut ChaCha8Rng, value: Vector3<f64>, noise: Vector3<f64>| {
            value + draw(random).component_mul(&noise)
        };
        let back = now.attitude.inverse();
        let field = back * (turn(Vector3::z() * now.declination_rad) * Vector3::new(0.42, 0.0, 0.91)) + now.hard_iron;
        let (fix, slow) = (self.sample.is_multiple_of(FIX), self.sample.is_multiple_of(SLOW));
        let height_m = now.barometer_bias_m - now.position_m.z;
        let all = Aiding {
            position_m: fix.then(|| noisy(random, now.position_m + now.drift_m, NOISE.position_m)),
            velocity_mps: fix.then(|| noisy(random, now.velocity_mps, NOISE.velocity_mps)),
            height_m: slow.then(|| height_m + draw(random).x * NOISE.height_m),
            field: slow.then(|| field + draw(random) * NOISE.field),
            flow_mps: slow.then(|| (back * now.velocity_mps + draw(random) * NOISE.flow_mps).xy()),
        };
        (imu, all)
    }

    fn step(&mut self) {
        let (imu, aiding) = self.measure();
        self.navigation.update(&[imu; IMUS], &aiding);
    }

    /// Error of the filter at its horizon.
    pub fn error(&self) -> StateError {
        self.navigation.filter().state.error_to(self.flown.front().expect("the horizon"))
    }
}

pub(crate) fn draw(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| StandardNormal.sample(random))
}

fn hover(_: f64) -> State {
    State::default()
}

fn some_state() -> (State, Imu) {
    let state = State {
        position_m: Vector3::new(1.0, -2.0, 3.0),
        velocity_mps: Vector3::new(4.0, 1.0, -2.0),
        attitude: UnitQuaternion::from_euler_angles(0.3, -0.4, 2.0),
        acceleration_bias_mps2: Vector3::new(0.1, -0.2, 0.05),
        rates_bias_radps: Vector3::new(0.01, 0.02, -0.03),
        drift_m: Vector3::new(0.5, -1.0, 0.2),
        barometer_bias_m: 0.3,
        hard_iron: Vector3::new(0.02, 0.01, -0.03),
        declination_rad: 0.05,
    };
    (state, Imu { specific_force_mps2: Vector3::new(1.0, -2.0, -9.0), rates_radps: Vector3::new(1.0, -0.5, 2.0) })
}

/// Columns of the derivative of `f` by the error of a state.
fn differences<const N: usize>(f: impl Fn(&StateError) -> SVector<f64, N>) -> nalgebra::SMatrix<f64, N, ERRORS> {
    let size = 1e-6;
    let unit = |i: usize| StateError::from_fn(|j, _| if i == j { size } else { 0.0 });
    nalgebra::SMatrix::from_columns(&std::array::from_fn::<_, ERRORS, _>(|i| {
        (f(&unit(i)) - f(&-unit(i))) / (2.0 * size)
    }))
}

#[test]
fn val_the_transition_is_the_derivative_of_the_motion_to_first_order() {
    let (state, imu) = some_state();
    let error = |dt_s: f64| {
        let expected =
            differences(|error| state.moved(&imu, dt_s, G_MPS2).error_to(&state.plus(error).moved(&imu, dt_s, G_MPS2)));
        (state.transition(&imu, dt_s).times(&Covariance::identity()) - expected).abs().max()
    };
    assert!(error(0.004) < 2e-4, "{}", error(0.004));
    let ratio = error(0.004) / error(0.002);
    assert!(
        (ratio - 4.0).abs() < 0.1,
        "half the step has {ratio} times less error: what is left out is of second order"
    );
}

#[test]
fn val_jacobians_of_measurements_are_derivatives() {
    let (state, _) = some_state();
    let covariance = START.covariance(&state.attitude, &NOISE);
    let at = |error: &StateError| Filter::new(state.plus(error), covariance, NOISE, G_MPS2);
    let map = Vector3::new(NOISE.inclination_rad.cos(), 0.0, NOISE.inclination_rad.sin());
    let north_of_map = turn(Vector3::z() * state.declination_rad) * map;
    let expected = state.attitude.inverse() * north_of_map + state.hard_iron;
    let field = state.attitude.inverse() * Vector3::new(0.42, 0.02, 0.91);
    let velocity = Vector2::new(3.0, 1.0);
    let heading = |error: &StateError| at(error).heading(&expected).expect("a horizontal field");
    let Measured { jacobian, .. } = heading(&StateError::zeros());
    assert!((jacobian + differences(|error| heading(error).innovation)).abs().max() < 1e-6, "{jacobian}");
    let plain = State { hard_iron: Vector3::zeros(), declination_rad: 0.0, ..state };
    let Measured { innovation, .. } =
        Filter::new(plain, covariance, NOISE, G_MPS2).heading(&field).expect("a horizontal field");
    assert!(
        (innovation[0] + (0.02_f64 / 0.42).atan()).abs() < 1e-12,
        "a field turned to the east is a heading too low"
    );
    let flow = -differences(|error| at(error).flow(&velocity).innovation);
    assert!((at(&StateError::zeros()).flow(&velocity).jacobian - flow).abs().max() < 1e-6);
}

#[test]
fn an_error_that_is_added_is_found_again() {
    let (state, _) = some_state();
    let error = StateError::from_fn(|i, _| 0.01 * i as f64 - 0.05);
    assert!((state.error_to(&state.plus(&error)) - error).norm() < 1e-12);
}

#[test]
fn a_perfect_imu_gives_back_the_motion() {
    let mut flight = Flight::new(1, truth, START);
    let (mut state, mut before) = (truth(0.0), truth(0.0));
    for sample in 1..=1000 {
        let (now, middle) = (truth(f64::from(sample) * DT_S), truth((f64::from(sample) - 0.5) * DT_S));
        let force = (now.velocity_mps - before.velocity_mps) / DT_S - Vector3::new(0.0, 0.0, G_MPS2);
        let imu = Imu {
            specific_force_mps2: middle.attitude.inverse() * force,
            rates_radps: (before.attitude.inverse() * now.attitude).scaled_axis() / DT_S,
        };
        state = state.moved(&imu, DT_S, G_MPS2);
        before = now;
    }
    let error = state.error_to(&before);
    assert!(error.fixed_rows::<3>(POSITION).norm() < 2e-3 && error.fixed_rows::<6>(VELOCITY).norm() < 1e-3, "{error}");
    flight.step();
    assert!((flight.navigation.estimate(0.0).0.attitude.norm() - 1.0).abs() < 1e-12);
}

/// Asserts that a mean of `n` draws, each chi-square with `freedom` degrees of freedom, is within 4 standard deviations
/// of `freedom`, or within 5 % for the errors of the linear model.
pub(crate) fn check_mean(what: &str, mean: f64, freedom: f64, n: f64) {
    let bound = (4.0 * (2.0 * freedom / n).sqrt()).max(0.05 * freedom);
    assert!((mean - freedom).abs() < bound, "{what}: {mean} and not {freedom} +- {bound}");
}

/// Checks NEES and NIS over `seeds` flights of 15 s.
fn check_consistency(seeds: u64) {
    let checks = [4.0, 8.0, 15.0].map(|t_s: f64| (t_s / DT_S) as u64);
    let mut nees = [0.0; 3];
    let mut nis = [(0.0, 0.0); SOURCES];
    let mut refused = 0.0;
    for seed in 0..seeds {
        let mut flight = Flight::new(seed, truth, START);
        let mut seen = [0.0; SOURCES];
        for sample in 1..=checks[2] {
            flight.step();
            let filter = flight.navigation.filter();
            for (source, (sum, n)) in Source::ALL.into_iter().zip(&mut nis) {
                let record = filter.record(source);
                let count = record.accepted + record.refused;
                if count > seen[source as usize] {
                    seen[source as usize] = count;
                    (*sum, *n) = (*sum + record.nis, *n + 1.0);
                }
            }
            if let Some(check) = checks.iter().position(|check| *check == sample) {
                let error = flight.error();
                let weighed = filter.covariance.cholesky().expect("a positive covariance").solve(&error);
                nees[check] += error.dot(&weighed) / seeds as f64;
            }
        }
        refused += Source::ALL.iter().map(|source| flight.navigation.filter().record(*source).refused).sum::<f64>();
        assert!(Source::ALL.iter().all(|source| flight.navigation.filter().record(*source).resets == 0.0));
        assert!((flight.navigation.filter().state.attitude.norm() - 1.0).abs() < 1e-12);
    }
    for (check, nees) in checks.iter().zip(nees) {
        check_mean(&format!("NEES at {check}"), nees, ERRORS as f64, seeds as f64);
    }
    for (source, (sum, n)) in Source::ALL.into_iter().zip(nis) {
        check_mean(&format!("NIS of {source:?}"), sum / n, source.components() as f64, n);
    }
    let share = refused / nis.iter().map(|(_, n)| n).sum::<f64>();
    assert!(share < 0.003, "the gates refuse {share} of sound measurements, and should 0.001");
}

#[test]
fn val_errors_and_innovations_are_as_large_as_the_covariance_says() {
    check_consistency(200);
}

#[test]
fn val_in_hover_the_variance_of_the_height_is_that_of_a_riccati_equation_of_two_states() {
    let none = Wander::stationary(0.0, f64::INFINITY);
    let noise = ExpectedNoise {
        acceleration_bias_walk: 0.0,
        rates_bias_walk: 0.0,
        rates_radps: 0.0,
        drift: [none; 3],
        barometer: none,
        ..NOISE
    };
    let [acceleration_bias_mps2, rates_bias_radps] = [Vector3::repeat(1e-6); 2];
    let constants = Constants { acceleration_bias_mps2, rates_bias_radps, ..START.constants };
    let start = InitialErrors { tilt_rad: 1e-6, heading_rad: 1e-6, constants, ..START };
    let covariance = start.covariance(&UnitQuaternion::identity(), &noise);
    let mut filter = Filter::new(State::default(), covariance, noise, G_MPS2);
    let still = Imu { specific_force_mps2: Vector3::new(0.0, 0.0, -G_MPS2), ..Imu::default() };
    let mut p = Matrix2::new(0.01, 0.0, 0.0, 0.0025);
    let f = Matrix2::new(1.0, DT_S, 0.0, 1.0);
    for sample in 1..=6000 {
        filter.predict(&still, DT_S);
        p = f * p * f.transpose();
        p[(1, 1)] += (NOISE.specific_force_mps2 * DT_S).powi(2);
        if sample % FIX == 0 {
            filter.fuse_position(Vector3::zeros());
            filter.fuse_velocity(Vector3::zeros());
            let r = Matrix2::new(NOISE.position_m.z.powi(2), 0.0, 0.0, NOISE.velocity_mps.z.powi(2));
            p -= p * (p + r).try_inverse().expect("a positive matrix") * p;
        }
    }
    for (state, expected) in [(POSITION + 2, p[(0, 0)]), (VELOCITY + 2, p[(1, 1)])] {
        let variance = filter.covariance[(state, state)];
        assert!((variance / expected - 1.0).abs() < 1e-3, "{state}: {variance} and not {expected}");
    }
    assert!(p[(0, 0)].sqrt() > 0.01 && p[(0, 0)].sqrt() < 0.1, "{}", p[(0, 0)].sqrt());
}

#[test]
fn the_estimate_of_now_is_as_good_as_that_of_the_horizon() {
    let mut flight = Flight::new(3, truth, START);
    (0..4000).for_each(|_| flight.step());
    let (now, _) = flight.navigation.estimate(0.0);
    let off = now.error_to(&truth(flight.sample as f64 * DT_S));
    assert!(off.fixed_rows::<3>(POSITION).norm() < 0.5 && off.fixed_rows::<3>(VELOCITY).norm() < 0.15, "{off}");
    let (ahead, _) = flight.navigation.estimate(0.002);
    assert!((ahead.position_m - now.position_m - now.velocity_mps * 0.002).norm() < 1e-4);
}

#[test]
fn without_fixes_the_deviation_grows_with_the_error_and_the_next_fix_is_accepted() {
    let mut flight = Flight::new(5, truth, START);
    for sample in 0..5000_u32 {
        let (imu, mut aiding) = flight.measure();
        if (1500..3500).contains(&sample) {
            (aiding.position_m, aiding.velocity_mps, aiding.flow_mps) = (None, None, None);
        }
        flight.navigation.update(&[imu; IMUS], &aiding);
        if sample == 3490 {
            let error = flight.error();
            let deviation = flight.navigation.filter().covariance[(0, 0)].sqrt();
            assert!(deviation > 0.5 && error[0].abs() < 4.0 * deviation, "{} and {deviation}", error[0]);
        }
    }
    assert!(flight.error().fixed_rows::<3>(POSITION).norm() < 0.3);
    assert!(Source::ALL.iter().all(|source| flight.navigation.filter().record(*source).resets == 0.0));
}

/// Flies a hover of 20 s in which `spoil` changes the measurements from 10 s on, by the time since then; `look` sees
/// each of these samples.
fn spoiled(spoil: impl Fn(f64, &mut Aiding), mut look: impl FnMut(&Flight)) -> Flight {
    let mut flight = Flight::new(6, hover, START);
    for sample in 0..4000_u32 {
        let (imu, mut aiding) = flight.measure();
        if sample >= 2000 {
            spoil(f64::from(sample - 2000) * DT_S, &mut aiding);
            look(&flight);
        }
        flight.navigation.update(&[imu; IMUS], &aiding);
    }
    flight
}

#[test]
fn a_source_that_disagrees_alone_has_an_error_of_its_own() {
    let away = |aiding: &mut Aiding| {
        aiding.position_m = aiding.position_m.map(|position| position + Vector3::new(30.0, 0.0, 0.0));
        aiding.height_m = aiding.height_m.map(|height| height + 5.0);
        let turned = turn(Vector3::z() * 0.5);
        aiding.field = aiding.field.map(|field| turned * field);
    };
    let flight = spoiled(|_, aiding| away(aiding), |flight| assert!(flight.error().fixed_rows::<9>(0).norm() < 1.5));
    let records = Source::ALL.map(|source| flight.navigation.filter().record(source).resets);
    assert_eq!(records, [1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0]);
    let error = flight.error();
    assert!((error[DRIFT] + 30.0).abs() < 5.0, "the drift takes it up, and forgets it: {}", error[DRIFT]);
}

#[test]
fn sources_that_disagree_together_move_the_estimate() {
    let moving = Vector3::new(4.0, 0.0, 0.0);
    let flight = spoiled(
        |t_s, aiding| {
            aiding.position_m = aiding.position_m.map(|position| position + moving * (5.0 + t_s));
            aiding.velocity_mps = aiding.velocity_mps.map(|velocity| velocity + moving);
            aiding.flow_mps = None;
        },
        |_| {},
    );
    let error = flight.error();
    assert!(error[POSITION] < -50.0 && error[VELOCITY] < -3.5 && error[DRIFT].abs() < 10.0, "{error}");
}

#[test]
fn no_input_makes_an_estimate_that_is_no_number() {
    let wild = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300, -1e300, 180.0, -4e3, 0.0];
    for seed in 0..wild.len() * 4 {
        let mut flight = Flight::new(seed as u64, truth, START);
        for sample in 0..3000 {
            let (mut imu, mut aiding) = flight.measure();
            let value = wild[(seed + sample / 100) % wild.len()];
            let bad = Vector3::new(value, 0.5, value);
            if sample > 500 {
                match seed % 4 {
                    0 => imu.rates_radps = bad,
                    1 => imu.specific_force_mps2 = bad,
                    2 => (aiding.position_m, aiding.height_m, aiding.field) = (Some(bad), Some(value), Some(bad)),
                    _ => (aiding.velocity_mps, aiding.flow_mps) = (Some(bad), Some(bad.xy())),
                }
            }
            flight.navigation.update(&[imu; IMUS], &aiding);
            let (state, rates) = flight.navigation.estimate(0.001);
            let mut all_finite = rates.iter().all(|rate| rate.is_finite());
            all_finite &= bytemuck::cast::<_, [f64; 24]>(state).iter().all(|number| number.is_finite());
            assert!(all_finite, "seed {seed}, sample {sample}: {state:?}");
        }
        let covariance = flight.navigation.filter().covariance;
        assert!(covariance.cholesky().is_some(), "seed {seed}: {covariance}");
    }
}

#[test]
fn an_estimator_with_the_memory_of_another_continues_bit_by_bit() {
    let [mut first, mut second] = [7, 8].map(|seed| Flight::new(seed, truth, START));
    (0..777).for_each(|_| first.step());
    let mut memory = vec![];
    first.navigation.visit(&mut |words| memory.extend_from_slice(words));
    let mut left = memory.as_slice();
    second.navigation.visit(&mut |words| {
        words.copy_from_slice(left.split_off(..words.len()).expect("as many words"));
    });
    assert!(left.is_empty());
    for _ in 0..500 {
        let (imu, aiding) = first.measure();
        first.navigation.update(&[imu; IMUS], &aiding);
        second.navigation.update(&[imu; IMUS], &aiding);
    }
    assert_eq!(first.navigation, second.navigation);
    assert!(first.navigation.filter().covariance[(ACCELERATION_BIAS, RATES_BIAS)].is_finite());
}

#[test]
fn val_in_a_long_hover_the_errors_are_as_large_as_the_covariance_says() {
    let seeds = 40;
    let mut nees = 0.0;
    for seed in 0..seeds {
        let mut flight = Flight::new(seed, hover, START);
        (0..24_000).for_each(|_| flight.step());
        let weighed = flight.navigation.filter().covariance.cholesky().expect("a positive covariance");
        nees += flight.error().dot(&weighed.solve(&flight.error())) / seeds as f64;
    }
    check_mean("NEES after 120 s", nees, ERRORS as f64, seeds as f64);
}

#[test]
fn a_velocity_that_disagrees_alone_is_refused_as_long_as_it_does() {
    let away = Vector3::new(1.0, 0.0, 0.0);
    let spoil = |_: f64, aiding: &mut Aiding| aiding.velocity_mps = aiding.velocity_mps.map(|velocity| velocity + away);
    let flight = spoiled(spoil, |flight| assert!(flight.error().fixed_rows::<6>(0).norm() < 1.0));
    let record = flight.navigation.filter().record(Source::Velocity);
    assert!(record.resets == 0.0 && record.refused > 90.0, "{record:?}");
}

#[test]
fn a_receiver_that_is_stuck_is_silent() {
    let at_m = Vector3::new(0.1, 0.0, 0.0);
    let spoil = |_: f64, aiding: &mut Aiding| aiding.position_m = aiding.position_m.map(|_| at_m);
    let flight = spoiled(spoil, |flight| assert!(flight.error().fixed_rows::<3>(0).norm() < 1.0));
    let record = flight.navigation.filter().record(Source::Position);
    assert!(record.silent_s > 9.0 && record.refused < 5.0, "{record:?}");
}
