//! What every process of the ring does: joins a run, hears, works in time, speaks, and has its faults.
//!
//! | module | holds |
//! |---|---|
//! | [`session`] | a process's session with the run: join, ports, ready, leave |
//! | [`domain`] | what a run owns in shared memory, by namespace |
//! | [`port`] | how messages travel; the only module that names iceoryx2 |
//! | [`input`], [`output`] | where a node hears and speaks |
//! | [`release`] | what releases the plant, the only node with a clock |
//! | [`cycle_loop`] | when a node is to answer to which sample |
//! | [`cycle_timing`] | the timing record of a cycle |
//! | [`warm_up`] | what a node touches shortly before its cycle, so that the cycle is quick |
//! | [`shared_role`] | which process works for a node, in shared memory |
//! | [`fault_table`] | faults given while flying |
//! | [`link`] | what faults do to messages on their way |
//! | [`process_fault`] | what a fault makes a process do by itself |
//! | [`skew`] | what a fault does to the clock of one process |
//! | [`realtime`] | time, priority, the control page; the only `unsafe` |
//! | [`console`] | what a process says on stdout and stderr |

pub mod console;
pub mod cycle_loop;
pub mod cycle_timing;
pub mod domain;
pub mod fault_table;
pub mod input;
pub mod link;
pub mod output;
pub mod port;
pub mod process_fault;
pub mod realtime;
pub mod release;
pub mod session;
pub mod shared_role;
pub mod skew;
pub mod warm_up;

pub use realtime::timed;
