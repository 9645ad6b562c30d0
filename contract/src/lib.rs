//! What two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages: fixed layout, stamped, plain numbers |
//! | [`topic`] | the four topics and who speaks on each |
//! | [`scenario`] | the run's settings: profiles, file, overrides, checks |
//! | [`port`] | how messages travel; the only room that names iceoryx2 |
//! | [`snapshot`] | what a node remembers, as plain numbers, for the one that continues its work |
//! | [`stamp`] | which plant sample a message descends from, through whom, and when |
//! | [`inlet`], [`outlet`] | where a node hears and speaks |
//! | [`cycle`] | wake, step, send, and the punctuality of it |
//! | [`rehearsal`] | what a node does shortly before its cycle, so that the cycle is quick |
//! | [`pace`] | what releases the plant, the only node with a clock |
//! | [`turn`] | when a node is to answer to which sample |
//! | [`guard`], [`integrity`] | which messages are taken for true |
//! | [`link`] | what faults do to messages on their way |
//! | [`seizure`] | what a fault makes a process do by itself |
//! | [`skew`] | what a fault does to the clock of one process |
//! | [`office`], [`plan`] | which process speaks for a node |
//! | [`ledger`], [`roll`] | faults given while flying, and who suffers which |
//! | [`domain`] | what a run owns in shared memory, by namespace |
//! | [`mod@file`] | reading files that come from outside |
//! | [`realtime`] | time, priority, the shared page of bells; the only `unsafe` |
//! | [`console`] | what a process says on stdout and stderr |
//! | [`process`] | a process of the stack: join, run, leave |

pub mod console;
pub mod cycle;
pub mod domain;
pub mod file;
pub mod guard;
pub mod inlet;
pub mod integrity;
pub mod ledger;
pub mod link;
pub mod message;
pub mod office;
pub mod outlet;
pub mod pace;
pub mod plan;
pub mod port;
pub mod process;
pub mod realtime;
pub mod rehearsal;
pub mod roll;
pub mod scenario;
pub mod seizure;
pub mod skew;
pub mod snapshot;
pub mod stamp;
pub mod topic;
pub mod turn;

pub use realtime::timed;
pub use scenario::Scenario;
pub use topic::Topic;
