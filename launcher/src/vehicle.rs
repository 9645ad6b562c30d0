//! Weights of the inputs against the vehicle that they are for, before its flight.

use contract::Scenario;
use contract::scenario::weights_that_fit;
use runtime::console::eprint_line;

/// Warns on stderr if `mpc.r` is that of another vehicle.
pub fn warn_of_weights(scenario: &Scenario) {
    if let Some(fitting) = weights_that_fit(scenario) {
        eprint_line(&format!(
            "warning: `mpc.r` = {:?} is not for this `airframe`, whose weights are about {:?}: leave `mpc.r` out, and it \
             follows the vehicle",
            scenario.mpc.r,
            fitting.map(three_digits)
        ));
    }
}

/// Rounds a number to three significant digits.
fn three_digits(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}
