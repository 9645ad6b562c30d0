//! Roles of processes: the drivers that carry inputs into the state machine of [`ring::roles`], and its actions out.
//!
//! | module | holds |
//! |---|---|
//! | [`driver`] | trait of the drivers of processes |
//! | [`realtime`] | driver in real time: inputs from the control page and the clock |
//! | [`lockstep`] | driver of processes in lockstep: [`ring::roles::simulated`], run between two ticks |
//! | [`connections`] | finds processes that work and are cut off: no message arrives from them, or at them |

pub mod connections;
pub mod driver;
pub mod lockstep;
pub mod realtime;
