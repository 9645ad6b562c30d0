//! What every process of the ring does: joins a run, receives, works in time, sends, and has its faults.
//!
//! | module | holds |
//! |---|---|
//! | [`process`] | a node as a program: arguments, exit code, the bond with the launcher |
//! | [`session`] | a node's session with a run: join, ports, ready |
//! | [`member`] | what the ports and the loop of one process have in common |
//! | [`release`] | real time or lockstep: decided once |
//! | [`sample_loop`] | the loop of the plant, which begins every tick |
//! | [`cycle_loop`] | the loop of a node that answers |
//! | [`cycle_timing`] | the timing record of a cycle, and the warm-up before it |
//! | [`input`], [`output`] | where a node receives and sends |
//! | [`ports`] | the ports of one process, shown to work before the run begins |
//! | [`port`] | how messages travel between processes; the only module that names iceoryx2 |
//! | [`queue`] | how they travel in one thread |
//! | [`process_faults`] | the faults of one process, taken once a tick |
//! | [`link`] | what faults do to messages on their way |
//! | [`fault_table`] | faults given while flying |
//! | [`shared_role`] | which process runs a node, in shared memory |
//! | [`domain`] | what a run owns in shared memory, by namespace |
//! | [`realtime`] | time, priority, the control page; the only `unsafe` |
//! | [`console`] | what a process says on stdout and stderr |
//! | [`limits`], [`error`] | every limit, every error |
//!
//! One message, from the plant to a node that answers: [`sample_loop`] releases the tick, [`output`] stamps it, [`link`]
//! lets it pass, [`port`] carries it, [`input`] judges it, [`cycle_loop`] wakes the node.

pub mod console;
pub mod cycle_loop;
pub mod cycle_timing;
pub mod domain;
pub mod error;
pub mod fault_table;
#[cfg(test)]
mod fixture;
pub mod input;
pub mod limits;
pub mod link;
pub mod member;
pub mod output;
pub mod port;
pub mod ports;
pub mod process;
pub mod process_faults;
pub mod queue;
pub mod realtime;
pub mod release;
pub mod sample_loop;
pub mod session;
pub mod shared_role;

pub use realtime::timed;
