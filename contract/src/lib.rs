//! What two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages: fixed layout, stamped, plain numbers |
//! | [`topic`] | the four topics and who speaks on each |
//! | [`scenario`] | the run's settings: profiles, file, overrides, checks |
//! | [`port`] | how messages travel; the only file that names iceoryx2 |
//! | [`stamp`] | which plant sample a message descends from, through whom, and when |
//! | [`cycle`] | wake, step, send, and the punctuality of it |
//! | [`rehearsal`] | what a node does shortly before its cycle, so that the cycle is quick |
//! | [`pace`] | what releases the plant, the only node with a clock |
//! | [`domain`] | what a run owns in shared memory, by namespace |
//! | [`realtime`] | time, priority, the shared page of bells; the only `unsafe` |
//! | [`process`] | a process of the stack: join, run, leave |

pub mod cycle;
pub mod domain;
pub mod message;
pub mod pace;
pub mod port;
pub mod process;
pub mod realtime;
pub mod rehearsal;
pub mod scenario;
pub mod stamp;
pub mod topic;

pub use realtime::timed;
pub use scenario::Scenario;
pub use topic::Topic;
