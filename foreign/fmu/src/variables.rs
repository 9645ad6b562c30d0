//! Names, units and values of the inputs and outputs. The number of a variable is its value reference.

use contract::message::{ActuationMsg, Sample};

/// Value reference of the time.
pub const TIME: u32 = 0;
/// Value reference of the parameter `settings`.
pub const SETTINGS: u32 = 1;
/// Value reference of the commanded rotor speeds.
pub const ROTOR_SPEED: u32 = 2;
/// Value reference of the commanded tilt.
pub const TILT: u32 = 3;
/// Value reference of the first output.
pub const FIRST_OUTPUT: u32 = 10;

/// Output of the plant.
pub struct PlantOutput {
    pub name: &'static str,
    pub unit: &'static str,
    pub about: &'static str,
    pub values: fn(&Sample) -> &[f64],
}

/// Unit of rotor speeds, which the airframe leaves open.
pub const ROTOR_UNIT: &str = "rotor speed unit";

macro_rules! output {
    ($name:literal, $unit:expr, $about:literal, $($field:ident).+) => {
        PlantOutput { name: $name, unit: $unit, about: $about, values: |of| bytemuck::cast_slice(bytemuck::bytes_of(&of.$($field).+)) }
    };
}

/// All outputs, from [`FIRST_OUTPUT`] on.
pub const OUTPUTS: [PlantOutput; 10] = [
    output!("position_m", "m", "true position north, east, down", truth.actual.position_m),
    output!("velocity_mps", "m/s", "true velocity u, v, w in the body frame", truth.actual.velocity_mps),
    output!("attitude_rad", "rad", "true Euler angles roll, pitch, yaw", truth.actual.attitude_rad),
    output!("rates_radps", "rad/s", "true body rates p, q, r", truth.actual.rates_radps),
    output!("actuator_rotor_speed", ROTOR_UNIT, "true rotor speeds", truth.actuators.rotor_speed),
    output!("actuator_tilt_rad", "rad", "true tilt of rotor 1", truth.actuators.tilt_rad),
    output!("measured_position_m", "m", "measured position north, east, down", state.measured.position_m),
    output!("measured_velocity_mps", "m/s", "measured velocity u, v, w in the body frame", state.measured.velocity_mps),
    output!("measured_attitude_rad", "rad", "measured Euler angles roll, pitch, yaw", state.measured.attitude_rad),
    output!("measured_rates_radps", "rad/s", "measured body rates p, q, r", state.measured.rates_radps),
];

/// Returns the part of a command that the input `reference` sets; `None` if there is no such input.
pub fn input(command: &mut ActuationMsg, reference: u32) -> Option<&mut [f64]> {
    match reference {
        ROTOR_SPEED => Some(&mut command.rotor_speed),
        TILT => Some(std::slice::from_mut(&mut command.tilt_rad)),
        _ => None,
    }
}

/// Returns the values of the output `reference`; `None` if there is no such output.
pub fn output(sample: &Sample, reference: u32) -> Option<&[f64]> {
    let output = OUTPUTS.get(reference.checked_sub(FIRST_OUTPUT)? as usize)?;
    Some((output.values)(sample))
}
