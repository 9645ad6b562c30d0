//! Time, the control page, and on Linux all other services of the kernel.
//!
//! | module | holds |
//! |---|---|
//! | `control_page` | the shared page of a run |
//! | `clock`, `futex` | clocks of the kernel, and sleeping on a word of memory |
//! | `linux` | other services of the kernel: mappings, priority, locked memory, pipes, signals, copies |
//! | `without_os` | stand-in for the kernel on other targets, for flights in process |

#[cfg(target_os = "linux")]
mod clock;
mod control_page;
#[cfg(target_os = "linux")]
mod futex;
#[cfg(target_os = "linux")]
mod linux;
#[cfg(not(target_os = "linux"))]
mod without_os;

#[cfg(target_os = "linux")]
pub use clock::{now_ns, thread_cpu_ns};
pub use control_page::{Doorbell, Page, phase};
#[cfg(target_os = "linux")]
pub use futex::{sleep_while, wake};
#[cfg(target_os = "linux")]
pub use linux::*;
#[cfg(not(target_os = "linux"))]
pub use without_os::*;

/// Returns the result of `work`, and the time it took \[ns\].
pub fn timed<T>(work: impl FnOnce() -> T) -> (T, u64) {
    let start_ns = now_ns();
    let result = work();
    (result, now_ns() - start_ns)
}
