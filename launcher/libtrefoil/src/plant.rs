//! The plant of the ring as a program with a `main` of its own: the caller gives the functions of a vehicle, and the
//! plant's loop runs around them. The functions are those that a library exports, so that one file can be both.

#![expect(unsafe_code, reason = "the function is exported to C")]

use std::ffi::c_char;

use contract::topic::Topic;
use foreign::abi::TrefoilNode;

use crate::boundary::{Failure, guarded, texts, write_error};
use crate::process::joined;

fn run(functions: &TrefoilNode, arguments: &[&str]) -> Result<(), Failure> {
    let session = joined(Topic::State.publisher(), arguments)?;
    let vehicle = foreign::vehicle_of_program(functions, &session.scenario)?;
    Ok(plant::sampler::run(session, vehicle)?)
}

/// Runs this process as the plant of the run that the launcher has started it for, with the vehicle that `functions`
/// create: as in a library, `step` reads a `TrefoilPlantInput` and writes a `TrefoilPlantAnswer`. Give the arguments of
/// `main`: those of the launcher are found among them.
///
/// Returns 0 after the run. Below 0: an error, with its reason in `error`, of `error_bytes`; end the process with this
/// number as its exit code, without the sign.
///
/// # Safety
/// `functions` is NULL or a table of functions as `trefoil_node_v1` returns it; the `argc` texts in `argv` end with a
/// zero; `error` is NULL or has `error_bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_plant_run(
    functions: *const TrefoilNode,
    argc: i32,
    argv: *const *const c_char,
    error: *mut c_char,
    error_bytes: usize,
) -> i32 {
    let flown = guarded(|| {
        // SAFETY: the caller gives text.
        let arguments = unsafe { texts(argv, argc.max(0) as usize, "argv")? };
        // SAFETY: the caller gives a table, or NULL.
        let functions = unsafe { functions.as_ref() }.ok_or_else(|| Failure::of_usage("functions is NULL"))?;
        run(functions, &arguments)
    });
    let Err(failure) = flown else { return 0 };
    // SAFETY: the caller gives room for the reason.
    unsafe { write_error(&failure.why, error, error_bytes) };
    -i32::from(failure.exit_code)
}
