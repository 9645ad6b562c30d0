use crate::noise::InitialErrors;
use crate::state::{ATTITUDE, turn};
use crate::tests::{DELAY, DT_S, Flight, START, truth};
use crate::{Filter, IMUS, Navigation, Source};
use nalgebra::Vector3;

/// Error of the attitude \[rad\] and resets of the velocity after a flight of 20 s without magnetometer and flow. The
/// filter starts with a heading that is off by `off_rad` and has the standard deviation `deviation_rad`.
fn error_rad(off_rad: f64, deviation_rad: f64) -> (f64, f64) {
    let mut flight = Flight::new(2, truth, START);
    let mut state = flight.navigation.filter().state;
    state.attitude = turn(Vector3::z() * off_rad) * state.attitude;
    let start = InitialErrors { heading_rad: deviation_rad, ..START };
    let noise = crate::tests::NOISE;
    let filter =
        Filter::new(state, start.covariance(&state.attitude, &noise), noise, flight.navigation.filter().g_mps2());
    flight.navigation = Navigation::new([filter], START.constants, DT_S, DELAY);
    for _ in 0..4000 {
        let (imu, mut aiding) = flight.measure();
        (aiding.field, aiding.flow_mps) = (None, None);
        flight.navigation.update(&[imu; IMUS], &aiding);
    }
    (flight.error().fixed_rows::<3>(ATTITUDE).norm(), flight.navigation.filter().record(Source::Velocity).resets)
}

#[test]
fn val_a_heading_that_is_not_known_is_found_from_any_angle() {
    for off_rad in [-3.1, -1.6, -0.5, 0.0, 0.7, 1.6, 2.5, 3.1] {
        let (error, resets) = error_rad(off_rad, 2.0);
        assert!(error < 0.05 && resets >= 1.0, "{off_rad}: {error}, {resets}");
    }
}

#[test]
fn val_a_heading_that_is_wrong_is_turned_when_all_velocities_are_refused() {
    for off_rad in [-2.0, 1.0, 3.0] {
        let (error, resets) = error_rad(off_rad, 0.03);
        assert!(error < 0.1 && resets >= 1.0, "{off_rad}: {error}, {resets}");
    }
    assert_eq!(error_rad(0.02, 0.03).1, 0.0, "a heading that is right stays");
}
