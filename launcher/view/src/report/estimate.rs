//! Errors of the estimate of the navigation unit, the errors that the unit expects, and its measurements.

use contract::message::{Navigation, State};
use outcome::ticks::LoggedTick;
use plant::instruments::state_of;
use settings::{FilterName, Scenario};

/// Columns of [`errors`].
pub const ERRORS: [&str; 9] = [
    "off_north",
    "off_east",
    "off_down",
    "off_north_speed",
    "off_east_speed",
    "off_down_speed",
    "off_roll",
    "off_pitch",
    "off_yaw",
];
/// Columns of [`expected`].
pub const EXPECTED: [&str; 9] = [
    "expected_north",
    "expected_east",
    "expected_down",
    "expected_north_speed",
    "expected_east_speed",
    "expected_down_speed",
    "expected_roll",
    "expected_pitch",
    "expected_yaw",
];
/// Columns of [`measurements`].
pub const MEASUREMENTS: [&str; 7] = [
    "innovation_position",
    "innovation_velocity",
    "innovation_height",
    "innovation_heading",
    "innovation_flow",
    "refused",
    "resets",
];

/// Link to the figures of a flight with an EKF.
pub fn link(scenario: &Scenario) -> &'static str {
    match scenario.plant.sensors.filter {
        FilterName::Ekf => "<a href=\"#estimate\">Estimate</a>",
        FilterName::None => "",
    }
}

/// Errors of the estimate, estimate less truth: position and velocity NED \[m, m/s\], attitude as turns about the body
/// axes \[rad\]. `None` without the EKF.
pub fn errors(tick: &LoggedTick) -> Option<Vec<f64>> {
    let (state, truth) = (with_unit(tick)?, tick.of.truth.as_ref()?);
    let truth_less_estimate = state_of(&state.measured).error_to(&state_of(&truth.actual));
    Some(truth_less_estimate.iter().take(ERRORS.len()).map(|off| -off).collect())
}

/// Three standard deviations of the [`errors`], as the estimator expects them.
pub fn expected(tick: &LoggedTick) -> Option<Vec<f64>> {
    let Navigation { position_m, velocity_mps, attitude_rad, .. } = with_unit(tick)?.navigation;
    Some([position_m, velocity_mps, attitude_rad].as_flattened().iter().map(|deviation| 3.0 * deviation).collect())
}

/// Innovations by source as shares of their gates, and the numbers of refused measurements and of resets so far.
pub fn measurements(tick: &LoggedTick) -> Option<Vec<f64>> {
    let Navigation { innovations, refused, resets, .. } = with_unit(tick)?.navigation;
    let counts = [refused.iter().sum(), resets].map(|count: u64| count as f64);
    Some([innovations.as_slice(), &counts].concat())
}

/// Returns the STATE of a tick if an EKF made its estimate; without an EKF the deviations are 0.
fn with_unit(tick: &LoggedTick) -> Option<&State> {
    let state = tick.of.state.as_ref()?;
    (state.navigation.position_m[0] > 0.0).then_some(state)
}
