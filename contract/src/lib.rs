//! What two processes must agree on, and nothing else.
//!
//! | module | holds |
//! |---|---|
//! | [`message`] | the four messages: fixed layout, stamped, plain numbers |
//! | [`topic`] | the four topics and who speaks on each |
//! | [`scenario`] | the run's settings: profiles, file, overrides, checks |

pub mod message;
pub mod scenario;
pub mod topic;

pub use scenario::Scenario;
pub use topic::Topic;
