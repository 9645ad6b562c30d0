//! Vehicle and controllers before their flight: hover and control loops, and weights of the inputs that do not fit.

use flight::hover::Hover;
use runtime::console::eprint_line;
use settings::{Scenario, weights_that_fit};

/// Describes the hover and the control loops as comments of TOML.
pub fn describe_hover(scenario: &Scenario) -> String {
    let rows = Hover::of(scenario).rows();
    rows.iter().fold("\n".into(), |text, (name, value)| text + &format!("# {name}: {value}\n"))
}

/// Warns on stderr if `attitude.mpc.r` is that of another vehicle.
pub fn warn_of_weights(scenario: &Scenario) {
    if let Some(fitting) = weights_that_fit(scenario) {
        eprint_line(&format!(
            "warning: `attitude.mpc.r` = {:?} is not for this `airframe`, whose weights are about {:?}: leave \
             `attitude.mpc.r` out, and it follows the vehicle",
            scenario.attitude.mpc.r,
            fitting.map(three_digits)
        ));
    }
}

/// Rounds a number to three significant digits.
fn three_digits(number: f64) -> f64 {
    format!("{number:.2e}").parse().unwrap_or(number)
}
