//! Vehicle and controllers before their flight: hover and control loops, and input weights that do not fit the vehicle.

use flight::hover::Hover;
use runtime::console::eprint_line;
use settings::{Scenario, weights_that_fit};

/// Describes the hover and the control loops as comments of TOML.
pub fn describe_hover(hover: &Hover) -> String {
    hover.rows().iter().fold("\n".into(), |text, (name, value)| text + &format!("# {name}: {value}\n"))
}

/// Says whether the settings of a valid scenario give stable loops about the hover.
pub fn verdict(hover: &Hover) -> &'static str {
    match &hover.loops {
        Some(loops) if loops.attitude.is_none() || loops.position.is_none() => {
            "valid, but its control loops are unstable about the hover"
        }
        _ => "fine",
    }
}

/// Warns on stderr if `attitude.mpc.r` seems to be meant for another vehicle.
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
