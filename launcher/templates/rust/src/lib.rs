//! Attitude controller: a linear-quadratic regulator of `model.rs`. Its gain is computed when the node is created.

mod lqr;
mod model;
#[allow(dead_code)]
mod trefoil;

use std::f64::consts::TAU;
use std::ffi::{CStr, c_char, c_void};

use lqr::Matrix;
use model::{A, B, INPUTS as M, MASS_KG, SAMPLE_S, STATES as N, TRIM_ROLL_RAD};
use trefoil::{TREFOIL_ABI, TrefoilAttitudeAnswer, TrefoilAttitudeInput, TrefoilNode, TrefoilSetup};

/// Weights of w, roll, pitch, yaw, p, q, r and of the four lag states.
const Q: [f64; N] = [1e2, 1e3, 1e3, 1e3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
/// Weights of col, lon, lat, ped.
const R: [f64; M] = [0.4, 300.0, 85.0, 300.0];

/// Part of a controller from which the next process goes on after a kill or a swap.
#[derive(Clone, Copy, Default)]
#[repr(C)]
struct Memory {
    /// Demand that the lagging actuators have reached.
    lag: [f64; M],
    /// Last demand.
    demand: [f64; M],
}

struct Controller {
    gain: Matrix<M, N>,
    memory: Memory,
}

/// Returns the deviation of a sample or reference from trim, with the lag states.
fn deviation(w_mps: f64, [roll, pitch, yaw]: [f64; 3], [p, q, r]: [f64; 3], lag: [f64; M]) -> [f64; N] {
    [w_mps, roll - TRIM_ROLL_RAD, pitch, yaw, p, q, r, lag[0], lag[1], lag[2], lag[3]]
}

fn dot(row: &[f64], x: &[f64]) -> f64 {
    row.iter().zip(x).map(|(a, b)| a * b).sum()
}

/// Returns the state one sample after `x` under the inputs `u`.
fn predicted(x: &[f64; N], u: &[f64; M]) -> [f64; N] {
    std::array::from_fn(|i| dot(&A[i], x) + dot(&B[i], u))
}

impl Controller {
    fn new(settings: &CStr, dt_s: f64, mass_kg: f64) -> Result<Self, &'static str> {
        if (dt_s - SAMPLE_S).abs() > 1e-9 {
            return Err("model.rs is a model of another run.rate_hz");
        }
        if mass_kg != MASS_KG {
            return Err("model.rs is a model of another vehicle");
        }
        if settings != c"{}" {
            return Err("this controller has no settings");
        }
        let gain = lqr::lqr(&Q, &R).ok_or("there is no gain for these weights")?;
        Ok(Self { gain, memory: Memory::default() })
    }

    /// Returns the demand; `None` without a sample or a reference of this tick.
    fn step(&mut self, input: &TrefoilAttitudeInput) -> Option<[f64; M]> {
        let (sample, reference) = (&input.sample, &input.reference);
        let w_mps = sample.velocity_mps[2];
        if sample.age_ticks > 0 || reference.age_ticks > 0 || w_mps.is_nan() {
            return None;
        }
        // The demand of this step acts from the next sample on, so the state is predicted by one sample.
        let Memory { lag, demand } = self.memory;
        let next = predicted(&deviation(w_mps, sample.attitude_rad, sample.rates_radps, lag), &demand);
        let goal = deviation(reference.w_mps, reference.attitude_rad, reference.rates_radps, [0.0; M]);
        let mut error: [f64; N] = std::array::from_fn(|i| next[i] - goal[i]);
        error[3] -= TAU * (error[3] / TAU).round(); // the short way round
        self.memory.lag = std::array::from_fn(|i| next[N - M + i]);
        self.memory.demand = std::array::from_fn(|i| -dot(&self.gain[i], &error));
        Some(self.memory.demand)
    }
}

/// # Safety
/// `setup` is valid, and `error` has room for `error_bytes`.
unsafe extern "C" fn create(setup: *const TrefoilSetup, error: *mut c_char, error_bytes: usize) -> *mut c_void {
    // SAFETY: the launcher vouches for both.
    let (setup, error) = unsafe { (&*setup, std::slice::from_raw_parts_mut(error.cast::<u8>(), error_bytes)) };
    // SAFETY: the settings are a text that ends with a zero.
    let settings = unsafe { CStr::from_ptr(setup.settings_json) };
    match Controller::new(settings, setup.dt_s, setup.mass_kg) {
        Ok(controller) => Box::into_raw(Box::new(controller)).cast(),
        Err(reason) => {
            let zero = reason.len().min(error_bytes.saturating_sub(1));
            error[..zero].copy_from_slice(&reason.as_bytes()[..zero]);
            error[zero..].fill(0);
            std::ptr::null_mut()
        }
    }
}

/// # Safety
/// `node` comes from `create`; `input` and `answer` are those of attitude-mpc.
unsafe extern "C" fn step(node: *mut c_void, input: *const c_void, answer: *mut c_void) -> i32 {
    // SAFETY: the launcher vouches for all three.
    let (controller, input) = unsafe { (&mut *node.cast::<Controller>(), &*input.cast::<TrefoilAttitudeInput>()) };
    let demand = controller.step(input);
    let answered = TrefoilAttitudeAnswer { demand: demand.unwrap_or_default(), status: demand.is_none().into() };
    // SAFETY: the launcher vouches for `answer`.
    unsafe { *answer.cast() = answered };
    0
}

/// # Safety
/// `node` comes from `create`; `memory` has room for a [`Memory`].
unsafe extern "C" fn snapshot(node: *const c_void, memory: *mut c_void) {
    // SAFETY: the launcher vouches for both, but not that the memory is aligned.
    unsafe { memory.cast::<Memory>().write_unaligned((*node.cast::<Controller>()).memory) }
}

/// # Safety
/// `node` comes from `create`; `memory` holds a [`Memory`].
unsafe extern "C" fn restore(node: *mut c_void, memory: *const c_void) -> i32 {
    // SAFETY: the launcher vouches for both, but not that the memory is aligned.
    unsafe { (*node.cast::<Controller>()).memory = memory.cast::<Memory>().read_unaligned() };
    0
}

/// # Safety
/// `node` comes from `create`, and is not used again.
unsafe extern "C" fn destroy(node: *mut c_void) {
    // SAFETY: the launcher vouches for it.
    drop(unsafe { Box::from_raw(node.cast::<Controller>()) });
}

static NODE: TrefoilNode = TrefoilNode {
    abi: TREFOIL_ABI,
    input_bytes: size_of::<TrefoilAttitudeInput>() as u32,
    answer_bytes: size_of::<TrefoilAttitudeAnswer>() as u32,
    memory_bytes: size_of::<Memory>() as u32,
    create: Some(create),
    step: Some(step),
    snapshot: Some(snapshot),
    restore: Some(restore),
    destroy: Some(destroy),
};

/// Returns the functions of attitude-mpc, the only node of this library.
///
/// # Safety
/// `node` is a text that ends with a zero.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_node_v1(node: *const c_char) -> *const TrefoilNode {
    // SAFETY: the launcher vouches for it.
    if unsafe { CStr::from_ptr(node) } == c"attitude-mpc" { &raw const NODE } else { std::ptr::null() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trefoil::{TrefoilReference, TrefoilSample};

    #[test]
    fn the_model_hovers_after_five_seconds() {
        let mut controller = Controller::new(c"{}", SAMPLE_S, MASS_KG).unwrap();
        let reference = TrefoilReference {
            age_ticks: 0,
            position_m: [0.0; 3],
            velocity_mps: [0.0; 3],
            attitude_rad: [TRIM_ROLL_RAD, 0.0, 0.0],
            rates_radps: [0.0; 3],
            w_mps: 0.0,
            preview_step_s: 0.0,
            preview: [[0.0; 4]; 8],
        };
        let (mut x, mut before) = ([0.5, 0.2, -0.1, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0; M]);
        for tick in 0..500 {
            let sample = TrefoilSample {
                age_ticks: 0,
                position_m: [0.0; 3],
                velocity_mps: [0.0, 0.0, x[0]],
                attitude_rad: [x[1] + TRIM_ROLL_RAD, x[2], x[3]],
                rates_radps: [x[4], x[5], x[6]],
                rotor_speed: model::TRIM_ROTOR_SPEED,
                tilt_rad: model::TRIM_TILT_RAD,
            };
            let input = TrefoilAttitudeInput { tick, time_s: tick as f64 * SAMPLE_S, sample, reference };
            let demand = controller.step(&input).expect("an answer");
            x = predicted(&x, &before);
            before = demand;
        }
        assert!(x[..7].iter().all(|value| value.abs() < 0.01), "{x:?}");
    }
}
