//! Times of one cycle of a node, as trace and tables show them.

use contract::Topic;
use contract::message::Stamp;

/// Times of the cycle that made a message \[us\], and the slips and late messages just before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CycleTimes {
    /// Time from the sample to the release of the node.
    pub release_us: f64,
    /// Time from the release to the start.
    pub wake_us: f64,
    /// Time from the start to the publication.
    pub execution_us: f64,
    /// Time from the sample to the publication.
    pub response_us: f64,
    /// CPU time; `None` if the next message of the process, which tells it, is not known.
    pub cpu_us: Option<f64>,
    /// Periods without a cycle just before this one.
    pub slips: u64,
    /// Late messages since the message before, this one and messages that were not sent included.
    pub late: u64,
}

impl CycleTimes {
    /// Computes the times of the message with `stamp` on `topic`; `before` and `after` are the stamps of the messages
    /// of the same process around it.
    pub fn new(topic: Topic, stamp: &Stamp, before: &Stamp, after: Option<&Stamp>) -> Self {
        let publish_ns = stamp.publish_ns[topic as usize];
        let since = |from_ns: u64, to_ns: u64| micros(to_ns.saturating_sub(from_ns));
        // Skipped periods count as misses too.
        let slips = stamp.slips.saturating_sub(before.slips);
        let late = stamp.misses.saturating_sub(before.misses).saturating_sub(slips);
        Self {
            release_us: since(stamp.sample_ns, stamp.release_ns),
            wake_us: since(stamp.release_ns, stamp.start_ns),
            execution_us: since(stamp.start_ns, publish_ns),
            response_us: since(stamp.sample_ns, publish_ns),
            cpu_us: after.map(|after| micros(after.cpu_ns)),
            slips,
            late,
        }
    }
}

/// Converts nanoseconds to microseconds.
pub fn micros(ns: u64) -> f64 {
    ns as f64 / 1e3
}
