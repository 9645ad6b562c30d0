//! Topics of PX4 that messages of the ring fit, so that tools made for PX4 show a flight: names, units and frames are
//! PX4's (NED, FRD, quaternions w x y z, single precision). A topic has the fields that Trefoil knows, and no others.
//!
//! | topic | from |
//! |---|---|
//! | `vehicle_attitude` `vehicle_angular_velocity` `vehicle_local_position` | measured motion: what the controllers use |
//! | the same with `_groundtruth` | true motion |
//! | `vehicle_local_position_setpoint` `vehicle_attitude_setpoint` `vehicle_rates_setpoint` | REFERENCE |
//! | `actuator_outputs` | ACTUATORS: `Omega_1..3` in the rotor speed unit, tilt in rad: PX4's "natural output units" |

use contract::message::{Kinematics, Truth, quaternion};
use flight::log::Record;

/// Name and fields of each topic; every one begins with its timestamp.
pub const TOPICS: [(&str, &str); 10] = [
    ("vehicle_attitude", ATTITUDE),
    ("vehicle_attitude_groundtruth", ATTITUDE),
    ("vehicle_angular_velocity", RATES),
    ("vehicle_angular_velocity_groundtruth", RATES),
    ("vehicle_local_position", POSITION),
    ("vehicle_local_position_groundtruth", POSITION),
    (
        "vehicle_local_position_setpoint",
        "uint64_t timestamp;float x;float y;float z;float yaw;float vx;float vy;float vz;",
    ),
    ("vehicle_attitude_setpoint", "uint64_t timestamp;float[4] q_d;"),
    ("vehicle_rates_setpoint", "uint64_t timestamp;float roll;float pitch;float yaw;"),
    ("actuator_outputs", "uint64_t timestamp;uint32_t noutputs;float[16] output;"),
];
const ATTITUDE: &str = "uint64_t timestamp;uint64_t timestamp_sample;float[4] q;";
const RATES: &str = "uint64_t timestamp;uint64_t timestamp_sample;float[3] xyz;";
const POSITION: &str = "uint64_t timestamp;uint64_t timestamp_sample;float x;float y;float z;float vx;float vy;float vz;\
                        float heading;bool xy_valid;bool z_valid;bool v_xy_valid;bool v_z_valid;";

/// Passes the rows that a message makes to `each`, with their places in [`TOPICS`] and without the first timestamp.
/// `timestamp` is that of the message's sample, and `truth` is the TRUTH of its tick, if the log has it.
pub fn rows(
    record: &Record,
    truth: Option<&Truth>,
    timestamp: [u8; 8],
    mut each: impl FnMut(usize, &[u8]) -> anyhow::Result<()>,
) -> anyhow::Result<()> {
    match record {
        Record::State(state) => {
            let actual = truth.map(|truth| &truth.actual);
            for (place, motion) in [&state.measured].into_iter().chain(actual).enumerate() {
                let row = |values: Vec<u8>| [&timestamp[..], &values].concat();
                each(place, &row(floats(&quaternion(motion.attitude_rad))))?;
                each(2 + place, &row(floats(&motion.rates_radps)))?;
                each(4 + place, &row(position(motion)))?;
            }
            Ok(())
        }
        Record::Reference(reference) => {
            let [phi, theta, psi] = reference.attitude_rad;
            let yaw = [psi];
            each(6, &floats(&[&reference.position_m[..], &yaw, &reference.velocity_mps].concat()))?;
            each(7, &floats(&quaternion([phi, theta, psi])))?;
            each(8, &floats(&reference.rates_radps))
        }
        Record::Controls(_) | Record::Truth(_) => Ok(()),
        Record::Actuators(actuators) => {
            let mut output = [0.0; 16];
            output[..3].copy_from_slice(&actuators.command.rotor_speed);
            output[3] = actuators.command.tilt_rad;
            each(9, &[&4_u32.to_le_bytes()[..], &floats(&output)].concat())
        }
    }
}

/// Returns position, velocity and heading, and which of them are known: a sensor that is off gives NaN.
fn position(motion: &Kinematics) -> Vec<u8> {
    let (position_m, velocity_mps) = (motion.position_m, motion.velocity_ned_mps());
    let values = [&position_m[..], &velocity_mps, &motion.attitude_rad[2..]].concat();
    let known = [&position_m[..2], &position_m[2..], &velocity_mps[..2], &velocity_mps[2..]];
    let known = known.map(|values| u8::from(values.iter().all(|value| value.is_finite())));
    [floats(&values), known.to_vec()].concat()
}

fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| (*value as f32).to_le_bytes()).collect()
}
