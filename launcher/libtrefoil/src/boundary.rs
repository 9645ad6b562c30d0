//! The boundary to C: text and memory of the caller, errors and panics returned to it.

#![expect(unsafe_code, reason = "the caller gives pointers")]

use std::ffi::{CStr, CString, c_char, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};

use contract::exit;
use contract::topic::Topic;
use foreign::rounding::Rounding;
use runtime::error::{SessionError, words_of_panic};

/// Error on its way to C: the reason, and the exit code that a process shall end with.
#[derive(Debug)]
pub struct Failure {
    pub why: String,
    pub exit_code: u8,
}

impl Failure {
    /// Makes the failure of a wrong call.
    pub fn of_usage(why: impl Into<String>) -> Self {
        Self { why: why.into(), exit_code: exit::USAGE }
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        let late = matches!(error, SessionError::Late { .. });
        Self { why: error.to_string(), exit_code: if late { exit::BUDGET_BROKEN } else { exit::PROCESS_LOST } }
    }
}

/// Runs `work`; a panic in it becomes a failure. Meanwhile the floating-point unit has its usual mode, which libraries
/// of the caller may have changed.
pub fn guarded<T>(work: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    let of_caller = Rounding::now();
    let is_changed = of_caller != Rounding::USUAL;
    if is_changed {
        Rounding::USUAL.set();
    }
    let done = catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        Err(Failure {
            why: format!("a defect in libtrefoil: {}", words_of_panic(&*panic)),
            exit_code: exit::PROCESS_LOST,
        })
    });
    if is_changed {
        of_caller.set();
    }
    done
}

/// Makes text for C, cut at the first zero byte.
pub fn c_text(text: &str) -> CString {
    CString::new(text.split('\0').next().unwrap_or_default()).unwrap_or_default()
}

/// Reads text that C gives; `what` names it in the error.
///
/// # Safety
/// `text` is null, or points to text with a zero at its end that lives as long as `'a`.
pub unsafe fn text<'a>(text: *const c_char, what: &str) -> Result<&'a str, Failure> {
    if text.is_null() {
        return Err(Failure::of_usage(format!("{what} is NULL")));
    }
    // SAFETY: the caller guarantees it.
    let text = unsafe { CStr::from_ptr(text) };
    text.to_str().map_err(|_| Failure::of_usage(format!("{what} is not UTF-8")))
}

/// Reads `count` texts that C gives; `what` names them in the error.
///
/// # Safety
/// `texts` points to `count` pointers, each as [`text`] requires.
pub unsafe fn texts<'a>(texts: *const *const c_char, count: usize, what: &str) -> Result<Vec<&'a str>, Failure> {
    if texts.is_null() && count > 0 {
        return Err(Failure::of_usage(format!("{what} is NULL")));
    }
    // SAFETY: the caller guarantees it; if `count` is 0, nothing is read.
    (0..count).map(|i| unsafe { text(*texts.add(i), what) }).collect()
}

/// Lends memory of the caller to be read.
///
/// # Safety
/// `memory` is null, or points to `bytes` that are written and live as long as `'a`.
pub unsafe fn given<'a>(memory: *const c_void, bytes: usize, what: &str) -> Result<&'a [u8], Failure> {
    if memory.is_null() {
        return Err(Failure::of_usage(format!("{what} is NULL")));
    }
    // SAFETY: the caller guarantees it.
    Ok(unsafe { std::slice::from_raw_parts(memory.cast(), bytes) })
}

/// Lends memory of the caller to be written.
///
/// # Safety
/// `memory` is null, or points to `bytes` that live as long as `'a` and that nothing else uses meanwhile.
pub unsafe fn taken<'a>(memory: *mut c_void, bytes: usize, what: &str) -> Result<&'a mut [u8], Failure> {
    if memory.is_null() {
        return Err(Failure::of_usage(format!("{what} is NULL")));
    }
    // SAFETY: the caller guarantees it.
    Ok(unsafe { std::slice::from_raw_parts_mut(memory.cast(), bytes) })
}

/// Writes the reason of a failure to `error`, of `error_bytes`, cut to fit; nothing if `error` is null.
///
/// # Safety
/// `error` is null, or points to `error_bytes` that nothing else uses.
pub unsafe fn write_error(why: &str, error: *mut c_char, error_bytes: usize) {
    if error.is_null() || error_bytes == 0 {
        return;
    }
    let fits = |(at, letter): &(usize, char)| at + letter.len_utf8() < error_bytes;
    let text: String = why.char_indices().take_while(fits).map(|(_, letter)| letter).collect();
    let text = c_text(&text);
    let text = text.as_bytes_with_nul();
    // SAFETY: the text with its zero has at most `error_bytes`, and is memory of ours.
    unsafe { std::ptr::copy_nonoverlapping(text.as_ptr().cast(), error, text.len()) };
}

/// Gives a new handle to C. On a failure returns NULL and writes the reason to `error`, of `error_bytes`.
///
/// # Safety
/// As for [`write_error`].
pub unsafe fn handed<T>(opened: Result<T, Failure>, error: *mut c_char, error_bytes: usize) -> *mut T {
    match opened {
        Ok(handle) => Box::into_raw(Box::new(handle)),
        Err(failure) => {
            // SAFETY: the caller guarantees it.
            unsafe { write_error(&failure.why, error, error_bytes) };
            std::ptr::null_mut()
        }
    }
}

/// Returns the value of `result`, or for a failure the negative exit code, and then keeps the reason in `error`.
pub fn code(result: Result<i32, Failure>, error: &mut CString) -> i32 {
    result.unwrap_or_else(|Failure { why, exit_code }| {
        *error = c_text(&why);
        -i32::from(exit_code)
    })
}

/// Frees what [`Box::into_raw`] gave to C; nothing if it is null.
///
/// # Safety
/// `handle` is null, or came from [`Box::into_raw`] and is not used any more.
pub unsafe fn free<T>(handle: *mut T) {
    if !handle.is_null() {
        let _ = guarded(|| {
            // SAFETY: the caller guarantees it.
            drop(unsafe { Box::from_raw(handle) });
            Ok(())
        }); // a panic of the drop cannot be reported to C
    }
}

/// Returns the topic of `node`; an error unless it is a node that answers to samples.
pub fn topic_of(node: &str) -> Result<Topic, Failure> {
    let topic = Topic::of_node(node);
    topic.filter(|topic| foreign::sizes(*topic).is_some()).ok_or_else(|| {
        Failure::of_usage(format!(
            "there is no node `{node}` to be: guidance, attitude-mpc and mixer answer to samples"
        ))
    })
}
