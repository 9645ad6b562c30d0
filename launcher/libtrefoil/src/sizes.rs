//! Version and sizes of the interface. A caller that was compiled for another version or other sizes must stop.

#![expect(unsafe_code, reason = "the functions are exported to C")]

use std::ffi::c_char;

use foreign::abi::TREFOIL_ABI;

use crate::boundary::{guarded, text, topic_of};

/// Returns the number of the interface of this library: `TREFOIL_ABI` of its headers.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub extern "C" fn trefoil_abi() -> u32 {
    TREFOIL_ABI
}

/// Returns the size of the input of `node`, for instance `sizeof(TrefoilAttitudeInput)`; 0 if there is no such node.
///
/// # Safety
/// `node` is text with a zero at its end.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_input_bytes(node: *const c_char) -> usize {
    // SAFETY: the caller gives text.
    unsafe { size_of_node(node, 0) }
}

/// Returns the size of the answer of `node`, for instance `sizeof(TrefoilAttitudeAnswer)`; 0 if there is no such node.
///
/// # Safety
/// `node` is text with a zero at its end.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_answer_bytes(node: *const c_char) -> usize {
    // SAFETY: the caller gives text.
    unsafe { size_of_node(node, 1) }
}

unsafe fn size_of_node(node: *const c_char, which: usize) -> usize {
    let size = guarded(|| {
        // SAFETY: the caller gives text.
        let topic = topic_of(unsafe { text(node, "the node's name") }?)?;
        Ok(foreign::sizes(topic).map_or(0, |sizes| sizes[which]))
    });
    size.unwrap_or(0)
}
