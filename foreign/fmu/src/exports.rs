//! The functions of FMI 3.0 that a tool calls for co-simulation.

#![expect(unsafe_code, reason = "the functions are exported to C")]

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;

use crate::description::TOKEN;
use crate::instance::{Instance, STATE_BYTES, Saved};
use crate::variables::SETTINGS;

/// Result of a function.
pub type Status = i32;
pub const OK: Status = 0;
pub const ERROR: Status = 3;

type Log = unsafe extern "C" fn(*mut c_void, Status, *const c_char, *const c_char);

/// Instance, and the receiver of its messages.
pub struct Handle {
    instance: Instance,
    environment: *mut c_void,
    log: Option<Log>,
    /// Text that the tool was given last.
    text: CString,
}

/// Makes text for C, cut at the first zero byte.
fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// Passes the reason of an error to the tool.
fn tell(log: Option<Log>, environment: *mut c_void, why: &str) {
    if let Some(log) = log {
        let (category, why) = (c"logStatusError", c_text(why));
        // SAFETY: the tool gave function and environment for this call; both texts end with a zero.
        unsafe { log(environment, ERROR, category.as_ptr(), why.as_ptr()) };
    }
}

/// Runs `work` on an instance; an error or a panic of `work` is reported to the tool.
///
/// # Safety
/// `handle` came from `fmi3InstantiateCoSimulation`, was not freed, and is used by one thread at a time.
unsafe fn with(handle: *mut Handle, work: impl FnOnce(&mut Handle) -> Result<(), String>) -> Status {
    // SAFETY: the caller guarantees it.
    let Some(handle) = (unsafe { handle.as_mut() }) else { return ERROR };
    let done = catch_unwind(AssertUnwindSafe(|| work(handle))).unwrap_or_else(|_| Err("a defect in the FMU".into()));
    match done {
        Ok(()) => OK,
        Err(why) => {
            tell(handle.log, handle.environment, &why);
            ERROR
        }
    }
}

/// Lends `count` values of the tool to be read.
///
/// # Safety
/// `values` points to `count` values that live as long as `'a`; if `count` is 0, `values` may be NULL.
unsafe fn given<'a, T>(values: *const T, count: usize) -> &'a [T] {
    // SAFETY: the caller guarantees it.
    if count == 0 || values.is_null() { &[] } else { unsafe { std::slice::from_raw_parts(values, count) } }
}

/// Lends `count` values of the tool to be written.
///
/// # Safety
/// As for [`given`], and nothing else uses the values meanwhile.
unsafe fn taken<'a, T>(values: *mut T, count: usize) -> &'a mut [T] {
    // SAFETY: the caller guarantees it.
    if count == 0 || values.is_null() { &mut [] } else { unsafe { std::slice::from_raw_parts_mut(values, count) } }
}

/// Reads text of the tool; NULL is empty.
///
/// # Safety
/// `text` is NULL or ends with a zero.
unsafe fn text<'a>(text: *const c_char) -> &'a str {
    // SAFETY: the caller guarantees it.
    if text.is_null() { "" } else { unsafe { CStr::from_ptr(text) }.to_str().unwrap_or_default() }
}

/// Returns the version of the standard.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

/// Does nothing: errors are always reported, and nothing else is.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub extern "C" fn fmi3SetDebugLogging(_: *mut Handle, _: u8, _: usize, _: *const *const c_char) -> Status {
    OK
}

/// Creates an instance; NULL on an error, which is reported.
///
/// # Safety
/// The texts end with a zero, and `log` can be called with `environment`, as the standard says.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    token: *const c_char,
    resources: *const c_char,
    _visible: u8,
    _logging: u8,
    _event_mode: u8,
    _early_return: u8,
    _intermediate: *const u32,
    intermediate_count: usize,
    environment: *mut c_void,
    log: Option<Log>,
    _update: *const c_void,
) -> *mut Handle {
    // SAFETY: the tool gives text.
    let (token, resources) = unsafe { (text(token), text(resources)) };
    let created = if token != TOKEN {
        Err(format!("modelDescription.xml has the token {token}, and this library {TOKEN}"))
    } else if intermediate_count > 0 {
        Err("there are no intermediate variables".into())
    } else {
        catch_unwind(|| Instance::new(PathBuf::from(resources))).unwrap_or_else(|_| Err("a defect in the FMU".into()))
    };
    match created {
        Ok(instance) => Box::into_raw(Box::new(Handle { instance, environment, log, text: CString::default() })),
        Err(why) => {
            tell(log, environment, &why);
            std::ptr::null_mut()
        }
    }
}

/// Frees an instance.
///
/// # Safety
/// `handle` is NULL or came from `fmi3InstantiateCoSimulation`, and is not used any more.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeInstance(handle: *mut Handle) {
    if !handle.is_null() {
        // SAFETY: the handle is a box that was given away.
        drop(unsafe { Box::from_raw(handle) });
    }
}

/// Loads the settings, and puts the plant at its start.
///
/// # Safety
/// As for all functions of an instance: [`with`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3EnterInitializationMode(
    handle: *mut Handle,
    _tolerance_defined: u8,
    _tolerance: f64,
    start_s: f64,
    _stop_defined: u8,
    _stop_s: f64,
) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, |handle| handle.instance.initialise(start_s)) }
}

/// Ends the initialisation.
///
/// # Safety
/// As for all functions of an instance: [`with`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3ExitInitializationMode(handle: *mut Handle) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, |_| Ok(())) }
}

/// Ends the simulation; outputs can still be read.
///
/// # Safety
/// As for all functions of an instance: [`with`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Terminate(handle: *mut Handle) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, |_| Ok(())) }
}

/// Returns the instance to the state after its creation.
///
/// # Safety
/// As for all functions of an instance: [`with`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3Reset(handle: *mut Handle) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, |handle| handle.instance.reset()) }
}

/// Reads the numbers of variables.
///
/// # Safety
/// As for all functions of an instance ([`with`]); the arrays have the given numbers of values.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFloat64(
    handle: *mut Handle,
    references: *const u32,
    reference_count: usize,
    values: *mut f64,
    count: usize,
) -> Status {
    // SAFETY: the caller guarantees it.
    let (references, values) = unsafe { (given(references, reference_count), taken(values, count)) };
    let get = |handle: &mut Handle| {
        let mut at = 0;
        for reference in references {
            let found = handle.instance.get(*reference).ok_or_else(|| format!("variable {reference} has no value"))?;
            let room = values.get_mut(at..at + found.len()).ok_or("too few values")?;
            room.copy_from_slice(&found);
            at += found.len();
        }
        (at == count).then_some(()).ok_or_else(|| "too many values".into())
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, get) }
}

/// Sets the numbers of inputs.
///
/// # Safety
/// As for [`fmi3GetFloat64`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFloat64(
    handle: *mut Handle,
    references: *const u32,
    reference_count: usize,
    values: *const f64,
    count: usize,
) -> Status {
    // SAFETY: the caller guarantees it.
    let (references, values) = unsafe { (given(references, reference_count), given(values, count)) };
    let set = |handle: &mut Handle| {
        let mut at = 0;
        for reference in references {
            let input = handle.instance.input(*reference);
            let input = input.ok_or_else(|| format!("variable {reference} is no input of numbers"))?;
            input.copy_from_slice(values.get(at..at + input.len()).ok_or("too few values")?);
            at += input.len();
        }
        (at == count).then_some(()).ok_or_else(|| "too many values".into())
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, set) }
}

/// Reads the parameter `settings`; the text is valid until the next call.
///
/// # Safety
/// As for [`fmi3GetFloat64`].
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetString(
    handle: *mut Handle,
    references: *const u32,
    reference_count: usize,
    values: *mut *const c_char,
    count: usize,
) -> Status {
    // SAFETY: the caller guarantees it.
    let (references, values) = unsafe { (given(references, reference_count), taken(values, count)) };
    let get = |handle: &mut Handle| {
        if references.iter().any(|reference| *reference != SETTINGS) || references.len() != values.len() {
            return Err("the only text is `settings`".into());
        }
        handle.text = c_text(&handle.instance.settings);
        values.fill(handle.text.as_ptr());
        Ok(())
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, get) }
}

/// Sets the parameter `settings`.
///
/// # Safety
/// As for [`fmi3GetFloat64`]; the texts end with a zero.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetString(
    handle: *mut Handle,
    references: *const u32,
    reference_count: usize,
    values: *const *const c_char,
    count: usize,
) -> Status {
    // SAFETY: the caller guarantees it.
    let (references, values) = unsafe { (given(references, reference_count), given(values, count)) };
    let set = |handle: &mut Handle| {
        // SAFETY: the caller gives text.
        let mut pairs = references.iter().zip(values).map(|(reference, value)| (*reference, unsafe { text(*value) }));
        pairs.try_for_each(|(reference, value)| handle.instance.set_text(reference, value))
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, set) }
}

/// Advances by a step, a whole number of periods. A vehicle that diverges ends the simulation.
///
/// # Safety
/// As for all functions of an instance ([`with`]); the results are NULL or can be written.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DoStep(
    handle: *mut Handle,
    time_s: f64,
    step_s: f64,
    _no_earlier_state: u8,
    event_needed: *mut u8,
    terminate: *mut u8,
    early_return: *mut u8,
    last_time_s: *mut f64,
) -> Status {
    let step = |handle: &mut Handle| {
        let goes_on = handle.instance.step(time_s, step_s)?;
        for (result, value) in [(event_needed, false), (terminate, !goes_on), (early_return, false)] {
            // SAFETY: the caller guarantees it.
            if let Some(result) = unsafe { result.as_mut() } {
                *result = u8::from(value);
            }
        }
        // SAFETY: the caller guarantees it.
        if let Some(last_s) = unsafe { last_time_s.as_mut() } {
            *last_s = time_s + step_s;
        }
        Ok(())
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, step) }
}

/// Writes `saved` to the state that `state` points to, or to a new one if that is NULL.
///
/// # Safety
/// `state` is NULL, or points to NULL or to a state of this FMU.
unsafe fn give(state: *mut *mut Saved, saved: Saved) -> Result<(), String> {
    // SAFETY: the caller guarantees it.
    let state = unsafe { state.as_mut() }.ok_or("no place for the state")?;
    // SAFETY: a state of this FMU is a box that was given away.
    match unsafe { state.as_mut() } {
        Some(old) => *old = saved,
        None => *state = Box::into_raw(Box::new(saved)),
    }
    Ok(())
}

/// Stores the state of the instance in the state that `state` points to, or in a new one if that is NULL.
///
/// # Safety
/// As for all functions of an instance ([`with`]); `state` points to NULL or to a state of this FMU.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3GetFMUState(handle: *mut Handle, state: *mut *mut Saved) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, |handle| give(state, handle.instance.state())) }
}

/// Sets a stored state.
///
/// # Safety
/// As for all functions of an instance ([`with`]); `state` is a state of this FMU.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SetFMUState(handle: *mut Handle, state: *const Saved) -> Status {
    let set = |handle: &mut Handle| {
        // SAFETY: the caller guarantees it.
        handle.instance.set_state(unsafe { state.as_ref() }.ok_or("no state")?);
        Ok(())
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, set) }
}

/// Frees a stored state.
///
/// # Safety
/// As for [`fmi3GetFMUState`]; the state is not used any more.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3FreeFMUState(_: *mut Handle, state: *mut *mut Saved) -> Status {
    // SAFETY: the caller guarantees it.
    if let Some(state) = unsafe { state.as_mut() }
        && !state.is_null()
    {
        // SAFETY: a state of this FMU is a box that was given away.
        drop(unsafe { Box::from_raw(*state) });
        *state = std::ptr::null_mut();
    }
    OK
}

/// Writes the size of a state as bytes to `size`.
///
/// # Safety
/// `size` can be written.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializedFMUStateSize(_: *mut Handle, _: *const Saved, size: *mut usize) -> Status {
    // SAFETY: the caller guarantees it.
    unsafe { size.as_mut() }.map_or(ERROR, |size| {
        *size = STATE_BYTES;
        OK
    })
}

/// Writes a state as bytes.
///
/// # Safety
/// As for [`fmi3SetFMUState`]; `bytes` points to `count` bytes.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3SerializeFMUState(
    handle: *mut Handle,
    state: *const Saved,
    bytes: *mut u8,
    count: usize,
) -> Status {
    let write = |_: &mut Handle| {
        // SAFETY: the caller guarantees it.
        let (state, bytes) = unsafe { (state.as_ref().ok_or("no state")?, taken(bytes, count)) };
        state.serialise(bytes)
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, write) }
}

/// Reads a state from bytes.
///
/// # Safety
/// As for [`fmi3GetFMUState`]; `bytes` points to `count` bytes.
// SAFETY: the standard has one function of this name in an FMU.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fmi3DeserializeFMUState(
    handle: *mut Handle,
    bytes: *const u8,
    count: usize,
    state: *mut *mut Saved,
) -> Status {
    let read = |handle: &mut Handle| {
        // SAFETY: the caller guarantees it.
        unsafe { give(state, handle.instance.deserialise(given(bytes, count))?) }
    };
    // SAFETY: the caller guarantees it.
    unsafe { with(handle, read) }
}
