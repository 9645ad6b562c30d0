use nalgebra::Vector3;

use super::*;
use crate::state::{ATTITUDE, POSITION};
use crate::tests::{DELAY, DT_S, Flight, NOISE, START, draw, truth};
use crate::{IMUS, Navigation};

/// Flies 20 s with two IMUs, where `spoil` changes their samples from 5 s to 10 s; `look` sees each sample.
fn fly(spoil: impl Fn(u32, &mut [Imu; IMUS]), mut look: impl FnMut(u32, &Flight)) -> Flight {
    let mut flight = Flight::new(1, truth, START);
    let filter = flight.navigation.filter().clone();
    flight.navigation = Navigation::new([filter.clone(), filter], START.constants, DT_S, DELAY);
    for sample in 0..4000 {
        let (imu, aiding) = flight.measure();
        let other = Imu {
            specific_force_mps2: imu.specific_force_mps2 + draw(&mut flight.random) * NOISE.specific_force_mps2,
            rates_radps: imu.rates_radps + draw(&mut flight.random) * NOISE.rates_radps,
        };
        let mut imus = [imu, other];
        if (1000..2000).contains(&sample) {
            spoil(sample, &mut imus);
        }
        flight.navigation.update(&imus, &aiding);
        look(sample, &flight);
    }
    flight
}

fn check_error(flight: &Flight, most_m: f64) {
    let error = flight.error();
    let (position, attitude) = (error.fixed_rows::<3>(POSITION).norm(), error.fixed_rows::<3>(ATTITUDE).norm());
    assert!(position < most_m && attitude < 0.1 * most_m, "{position} m, {attitude} rad");
}

#[test]
fn a_stale_imu_hands_over_at_once() {
    let stuck = Imu { rates_radps: Vector3::new(0.3, 0.1, 0.0), ..Imu::default() };
    let silent = Imu { rates_radps: Vector3::repeat(f64::NAN), ..stuck };
    for bad in [stuck, silent, Imu { specific_force_mps2: Vector3::repeat(1e9), ..stuck }] {
        let look = |sample: u32, flight: &Flight| {
            let (imu, sound) = (flight.navigation.imu(), flight.navigation.sound());
            match sample {
                0..1004 | 2210.. => assert_eq!((imu, sound), (usize::from(sample > 1004), IMUS), "sample {sample}"),
                1006..2190 => assert_eq!((imu, sound), (1, 1), "sample {sample}"),
                _ => {} // a stuck IMU has first given one new sample
            }
            check_error(flight, 1.0);
        };
        let flight = fly(|_, imus| imus[0] = bad, look);
        assert_eq!(flight.navigation.imu(), 1, "it stays where it is");
    }
}

#[test]
fn wrong_gyros_hand_over_and_are_trusted_again_after_the_fault() {
    let turning = Vector3::new(0.2, -0.1, 0.1);
    let flight = fly(|_, imus| imus[0].rates_radps += turning, |_, flight| check_error(flight, 2.0));
    assert_eq!((flight.navigation.imu(), flight.navigation.sound()), (1, 2));
    let flight = fly(|_, imus| imus[1].rates_radps += turning, |_, flight| check_error(flight, 1.0));
    assert_eq!((flight.navigation.imu(), flight.navigation.sound()), (0, 2));
}

#[test]
fn one_imu_after_the_other_may_fail() {
    let spoil = |sample: u32, imus: &mut [Imu; IMUS]| {
        if sample < 1400 {
            imus[0] = Imu::default();
        } else if sample >= 1700 {
            imus[1] = Imu::default();
        }
    };
    let flight = fly(spoil, |_, flight| check_error(flight, 1.0));
    assert_eq!(flight.navigation.imu(), 0);
}

#[test]
fn no_imu_is_sound_if_all_fail() {
    let mut least = IMUS;
    fly(|_, imus| *imus = [Imu::default(); IMUS], |_, flight| least = least.min(flight.navigation.sound()));
    assert_eq!(least, 0);
}
