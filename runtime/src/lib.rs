//! Tasks that every process of the ring has: to join a run, receive, work in time, send, and apply its faults.
//!
//! | module | holds |
//! |---|---|
//! | [`process`] | a node as a program: arguments, exit code, the bond with the launcher |
//! | [`session`] | a node's session with a run: join, ports, ready |
//! | [`member`] | data that the ports and the loop of one process share |
//! | [`release`] | the event that begins a cycle |
//! | [`sample_loop`] | the loop of the plant, which begins every tick |
//! | [`cycle_loop`] | the loop of a node that answers |
//! | [`node`] | a node that answers: its core with its ports, and the program that runs it |
//! | [`cycle_timing`] | the timing record of a cycle, and the warm-up before it |
//! | [`input`], [`output`] | the receiving and the sending side of a node |
//! | [`ports`] | the ports of one process, tested before the run begins |
//! | [`port`] | message transport between processes; the only module that names iceoryx2 |
//! | [`queue`] | message transport in one thread |
//! | [`process_faults`] | the faults of one process, updated once a tick |
//! | [`link`] | faults of messages on their way |
//! | [`fault_table`] | faults given in flight |
//! | [`shared_role`] | the processes that run a node, in shared memory |
//! | [`domain`] | everything that a run owns in shared memory, by namespace |
//! | [`realtime`] | time, priority, the control page; the only `unsafe` |
//! | [`console`] | output on stdout and stderr |
//! | [`limits`], [`error`] | every limit, every error |
//!
//! Path of a message from the plant to a node that answers: [`sample_loop`] releases the tick, [`output`] stamps the
//! message, [`link`] lets it pass, [`port`] carries it, [`input`] judges it, [`cycle_loop`] wakes the node.
//!
//! Processes need Linux. On other targets, such as WebAssembly, the crate has what a flight in process needs.

#[cfg(target_os = "linux")]
pub mod console;
#[cfg(target_os = "linux")]
pub mod cycle_loop;
pub mod cycle_timing;
#[cfg(target_os = "linux")]
pub mod domain;
pub mod error;
pub mod fault_table;
#[cfg(test)]
mod fixture;
pub mod input;
pub mod limits;
pub mod link;
pub mod member;
pub mod node;
pub mod output;
pub mod port;
pub mod ports;
#[cfg(target_os = "linux")]
pub mod process;
pub mod process_faults;
pub mod queue;
pub mod realtime;
pub mod release;
#[cfg(target_os = "linux")]
pub mod sample_loop;
#[cfg(target_os = "linux")]
pub mod session;
pub mod shared_role;

pub use realtime::timed;
