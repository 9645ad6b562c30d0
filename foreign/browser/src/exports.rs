//! Functions that the page calls. Text passes through the memory of the module, whose pages JavaScript sees:
//!
//! ```text
//! trefoil_settings(length)  ->  address   the page writes as many bytes of settings there
//! trefoil_fly()             ->  length    of the answer, in bytes
//! trefoil_answer()          ->  address   the page reads the answer there, before it calls again
//! ```

#![expect(unsafe_code, reason = "the functions are exported to JavaScript")]

use std::cell::RefCell;

use crate::flight::fly;

thread_local! {
    /// Settings of the next flight, and the answer of the last one.
    static TEXTS: RefCell<[Vec<u8>; 2]> = RefCell::default();
}

/// Makes room for `length` bytes of settings, and returns their address.
#[unsafe(no_mangle)]
pub extern "C" fn trefoil_settings(length: usize) -> *mut u8 {
    TEXTS.with_borrow_mut(|[settings, _]| {
        *settings = vec![0; length];
        settings.as_mut_ptr()
    })
}

/// Flies with the settings that were written, and returns the length of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn trefoil_fly() -> usize {
    TEXTS.with_borrow_mut(|[settings, answer]| {
        *answer = fly(&String::from_utf8_lossy(settings)).into_bytes();
        answer.len()
    })
}

/// Returns the address of the answer.
#[unsafe(no_mangle)]
pub extern "C" fn trefoil_answer() -> *const u8 {
    TEXTS.with_borrow(|[_, answer]| answer.as_ptr())
}
