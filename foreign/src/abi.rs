//! Types of `trefoil.h`: the interface between the launcher and a controller in another language.
//!
//! `foreign/include/trefoil.h` is generated from this file; a test compares. A change of a type is a new number
//! [`TREFOIL_ABI`], which is also part of the name of the one exported function.

use std::ffi::{c_char, c_void};

use bytemuck::{Pod, Zeroable};

/// Number of this interface. A library of another number is refused.
pub const TREFOIL_ABI: u32 = 1;

/// Age of a message that has not come yet.
pub const TREFOIL_NEVER: u64 = u64::MAX;

/// Largest memory of a node that is continued by another process \[byte\].
pub const TREFOIL_MEMORY_BYTES: u32 = 1000;

/// Vehicle and settings, given when a node is created. The trim is the hover of this vehicle.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct TrefoilSetup {
    /// `[node.NAME.settings]` of the scenario as a JSON object.
    pub settings_json: *const c_char,
    /// Time between two samples \[s\].
    pub dt_s: f64,
    /// Acceleration of gravity \[m/s2\].
    pub g_mps2: f64,
    /// Mass \[kg\].
    pub mass_kg: f64,
    /// Moments of inertia about the body axes x, y, z \[kg m2\].
    pub inertia_kgm2: [f64; 3],
    /// Arms: rotor 1 forward, rotors 2 and 3 back, rotors 2 and 3 sideways \[m\].
    pub arms_m: [f64; 3],
    /// Thrust constant \[N / rotor speed unit squared\].
    pub kf: f64,
    /// Torque constant \[N m / rotor speed unit squared\].
    pub km: f64,
    /// Rotor speeds at trim \[rotor speed unit\].
    pub trim_rotor_speed: [f64; 3],
    /// Tilt of rotor 1 at trim \[rad\].
    pub trim_tilt_rad: f64,
    /// Roll angle at trim \[rad\]; pitch is 0.
    pub trim_roll_rad: f64,
    /// Position at the start of the flight, north, east, down \[m\].
    pub start_position_m: [f64; 3],
    /// Velocity at the start, u, v, w in the body frame \[m/s\].
    pub start_velocity_mps: [f64; 3],
    /// Euler angles roll, pitch, yaw at the start \[rad\].
    pub start_attitude_rad: [f64; 3],
    /// Body rates p, q, r at the start \[rad/s\].
    pub start_rates_radps: [f64; 3],
}

/// Newest sample of the sensors. Position and velocity are NaN while their sensor is off.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilSample {
    /// Age of the sample in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
    pub age_ticks: u64,
    /// Position north, east, down \[m\].
    pub position_m: [f64; 3],
    /// Velocity u, v, w in the body frame \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Euler angles roll, pitch, yaw \[rad\].
    pub attitude_rad: [f64; 3],
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Rotor speeds of the command in force \[rotor speed unit\].
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 of the command in force \[rad\].
    pub tilt_rad: f64,
}

/// Newest answer of guidance.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilReference {
    /// Age in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
    pub age_ticks: u64,
    /// Position on the trajectory, north, east, down \[m\].
    pub position_m: [f64; 3],
    /// Velocity on the trajectory, north, east, down \[m/s\].
    pub velocity_mps: [f64; 3],
    /// References of roll, pitch, yaw \[rad\].
    pub attitude_rad: [f64; 3],
    /// References of the body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Reference of w, the velocity along the body z axis \[m/s\].
    pub w_mps: f64,
    /// Time from one element of `preview` to the next, and from the sample to the first \[s\]; 0 = no preview
    /// (`guidance.preview_s`).
    pub preview_step_s: f64,
    /// Changes of the references from the sample to each time of the preview: w \[m/s\] and roll, pitch, yaw \[rad\].
    pub preview: [[f64; 4]; 8],
}

/// Newest answer of attitude-mpc.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilDemand {
    /// Age in ticks: 0 = of this tick, `TREFOIL_NEVER` = none has come.
    pub age_ticks: u64,
    /// Deviations of col, lon, lat, ped from trim \[N, N m, N m, N m\]: force along body z, positive down, and moments
    /// about body y, x and z, positive as pitch, roll and yaw.
    pub demand: [f64; 4],
}

/// Input of a step of guidance.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilGuidanceInput {
    /// Number of the sample to answer to, from 0.
    pub tick: u64,
    /// Time of that sample \[s\].
    pub time_s: f64,
    /// Newest sample.
    pub sample: TrefoilSample,
}

/// Answer of a step of guidance.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilGuidanceAnswer {
    /// Position on the trajectory, north, east, down \[m\].
    pub position_m: [f64; 3],
    /// Velocity on the trajectory, north, east, down \[m/s\].
    pub velocity_mps: [f64; 3],
    /// References of roll, pitch, yaw \[rad\].
    pub attitude_rad: [f64; 3],
    /// References of the body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Reference of w, the velocity along the body z axis \[m/s\].
    pub w_mps: f64,
}

/// Input of a step of attitude-mpc.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilAttitudeInput {
    /// Number of the sample to answer to, from 0.
    pub tick: u64,
    /// Time of that sample \[s\].
    pub time_s: f64,
    /// Newest sample.
    pub sample: TrefoilSample,
    /// Newest reference.
    pub reference: TrefoilReference,
}

/// Answer of a step of attitude-mpc.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilAttitudeAnswer {
    /// Deviations of col, lon, lat, ped from trim \[N, N m, N m, N m\]: force along body z, positive down, and moments
    /// about body y, x and z, positive as pitch, roll and yaw.
    pub demand: [f64; 4],
    /// 0 = the demand is valid; any other number = it is invalid, and the mixer treats it as late.
    pub status: u64,
}

/// Input of a step of the mixer.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilMixerInput {
    /// Number of the sample to answer to, from 0.
    pub tick: u64,
    /// Time of that sample \[s\].
    pub time_s: f64,
    /// Newest sample.
    pub sample: TrefoilSample,
    /// Newest demand.
    pub demand: TrefoilDemand,
}

/// Answer of a step of the mixer.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilMixerAnswer {
    /// Rotor speeds \[rotor speed unit\].
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 \[rad\].
    pub tilt_rad: f64,
}

/// Input of a step of the plant: one command, and the time that it is in force.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilPlantInput {
    /// Number of the newest sample, from 0.
    pub tick: u64,
    /// Time at which the step begins \[s\].
    pub time_s: f64,
    /// Duration of the step \[s\]: a period, or less if the command changes in it. 0 at the start of the flight only:
    /// the answer is then the state at the start.
    pub advance_s: f64,
    /// Rotor speeds of the command \[rotor speed unit\]; all 0 = the motors are stopped.
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 of the command \[rad\].
    pub tilt_rad: f64,
}

/// Answer of a step of the plant: the true state at its end.
#[derive(Debug, Clone, Copy, PartialEq, Default, Pod, Zeroable)]
#[repr(C)]
pub struct TrefoilPlantAnswer {
    /// Position north, east, down \[m\].
    pub position_m: [f64; 3],
    /// Velocity u, v, w in the body frame \[m/s\].
    pub velocity_mps: [f64; 3],
    /// Euler angles roll, pitch, yaw \[rad\].
    pub attitude_rad: [f64; 3],
    /// Body rates p, q, r \[rad/s\].
    pub rates_radps: [f64; 3],
    /// Rotor speeds \[rotor speed unit\]. Before the call, the speeds of the command; a plant without lag leaves them.
    pub rotor_speed: [f64; 3],
    /// Tilt of rotor 1 \[rad\]. Before the call, the tilt of the command; a plant without lag leaves it.
    pub tilt_rad: f64,
}

/// Functions of one node. The launcher calls them from one thread at a time for each node that it created.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct TrefoilNode {
    /// Number of the interface: `TREFOIL_ABI`.
    pub abi: u32,
    /// Size of the node's input, for instance `sizeof(TrefoilAttitudeInput)` \[byte\].
    pub input_bytes: u32,
    /// Size of the node's answer, for instance `sizeof(TrefoilAttitudeAnswer)` \[byte\].
    pub answer_bytes: u32,
    /// Size of the memory that `snapshot` writes, at most `TREFOIL_MEMORY_BYTES`; 0 = none: the process that continues
    /// after this one begins cold, and `snapshot` and `restore` may be NULL.
    pub memory_bytes: u32,
    /// Creates a node. On an error writes its reason to `error`, of `error_bytes`, and returns NULL. `setup` and
    /// its text are valid during the call only.
    pub create:
        Option<unsafe extern "C" fn(setup: *const TrefoilSetup, error: *mut c_char, error_bytes: usize) -> *mut c_void>,
    /// Answers to one sample: reads `input` and writes all of `answer`. Any other result than 0 ends the process.
    pub step: Option<unsafe extern "C" fn(node: *mut c_void, input: *const c_void, answer: *mut c_void) -> i32>,
    /// Writes the memory of the node, `memory_bytes`.
    pub snapshot: Option<unsafe extern "C" fn(node: *const c_void, memory: *mut c_void)>,
    /// Continues from the memory of another process; on any other result than 0 the node begins cold.
    pub restore: Option<unsafe extern "C" fn(node: *mut c_void, memory: *const c_void) -> i32>,
    /// Frees the node.
    pub destroy: Option<unsafe extern "C" fn(node: *mut c_void)>,
}

/// Function that every library exports: `trefoil_node_v1`. It returns the functions of `node` (`plant`,
/// `guidance`, `attitude-mpc` or `mixer`), or NULL if the library has no such node. cbindgen.toml declares it in the
/// header.
pub(crate) type FindNode = unsafe extern "C" fn(node: *const c_char) -> *const TrefoilNode;
