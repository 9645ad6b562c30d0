//! What every process of the ring does: joins a run, hears, works in time, speaks, and suffers its faults.
//!
//! | module | holds |
//! |---|---|
//! | [`process`] | a process of the stack: join, run, leave |
//! | [`domain`] | what a run owns in shared memory, by namespace |
//! | [`port`] | how messages travel; the only room that names iceoryx2 |
//! | [`inlet`], [`outlet`] | where a node hears and speaks |
//! | [`pace`] | what releases the plant, the only node with a clock |
//! | [`turn`] | when a node is to answer to which sample |
//! | [`cycle`] | wake, step, send, and the punctuality of it |
//! | [`rehearsal`] | what a node does shortly before its cycle, so that the cycle is quick |
//! | [`office`] | which process speaks for a node |
//! | [`ledger`] | faults given while flying |
//! | [`link`] | what faults do to messages on their way |
//! | [`seizure`] | what a fault makes a process do by itself |
//! | [`skew`] | what a fault does to the clock of one process |
//! | [`realtime`] | time, priority, the shared page of bells; the only `unsafe` |
//! | [`console`] | what a process says on stdout and stderr |

pub mod console;
pub mod cycle;
pub mod domain;
pub mod inlet;
pub mod ledger;
pub mod link;
pub mod office;
pub mod outlet;
pub mod pace;
pub mod port;
pub mod process;
pub mod realtime;
pub mod rehearsal;
pub mod seizure;
pub mod skew;
pub mod turn;

pub use realtime::timed;
