//! Canary: on every processor a process of highest priority that repeatedly sleeps for a millisecond.
//!
//! No process of this machine can delay it, so a late wake-up is due to the host. It wakes every 1.001 ms, so that its
//! phase to a ring with a period of whole milliseconds keeps changing.

use std::time::Duration;

use runtime::realtime::now_ns;
use serde::Serialize;

use super::machine::{cpus, on_cpu};
use super::ring_peer::Releases;
use super::rings::{Noted, RingPeers};
use flight::provenance::scheduling_of;
use outcome::percentiles::Percentiles;

/// Largest p99.9 of the canary's delay at which times are judged \[us\].
pub const LIMIT_US: f64 = 5_000.0;
/// Longest watch of a measurement.
pub const LONGEST: Duration = Duration::from_secs(1800);
/// Delay above which a wake-up counts as a gap, which explains a miss \[ns\].
const GAP_NS: u64 = 1_000_000;
const PERIOD_NS: u64 = 1_001_000;
/// Priority above all measured processes.
const PRIORITY: u32 = 90;

pub struct Canary {
    peers: Vec<RingPeers>,
    /// `true` if the canaries were given `SCHED_FIFO`.
    pub fifo: bool,
}

/// Wake-ups noted by the canaries.
#[derive(Debug, Default)]
pub struct CanaryWatch {
    /// Time due and delay of each wake-up, on all processors \[ns\].
    noted: Noted,
    /// Start and end of the gaps \[ns\].
    gaps: Vec<(u64, u64)>,
}

#[derive(Debug, Clone, Serialize)]
pub struct CanarySummary {
    pub noted: Option<Percentiles>,
    /// Delays of all slots; slots that a late wake-up covered are included.
    pub covered: Option<Percentiles>,
    /// Number of wake-ups more than a millisecond late.
    pub gaps: usize,
    /// Reason why times cannot be judged, if so.
    pub doubt: Option<String>,
}

impl Canary {
    /// Starts a canary on every processor, which ends by itself after `longest`.
    pub fn start(longest: Duration) -> anyhow::Result<Self> {
        let count = longest.as_nanos() as u64 / PERIOD_NS;
        let releases = Releases { period_ns: PERIOD_NS, count: count as usize };
        let alone = |cpu| on_cpu(cpu, || RingPeers::alone(releases, PRIORITY));
        let peers = cpus().into_iter().map(alone).collect::<Result<Vec<_>, _>>()?;
        std::thread::sleep(Duration::from_millis(200)); // every canary runs by then
        let fifo = peers.iter().all(|s| scheduling_of(s.clock_pid()).policy == "fifo");
        Ok(Self { peers, fifo })
    }

    pub fn stop(self) -> anyhow::Result<CanaryWatch> {
        let until_ns = now_ns();
        let noted = self.peers.into_iter().map(RingPeers::stop).collect::<Result<Vec<_>, _>>()?;
        // A canary notes nothing after the order to leave, so wake-ups that were due later do not count.
        Ok(CanaryWatch::of(noted.into_iter().flatten().filter(|(release_ns, _)| *release_ns <= until_ns).collect()))
    }
}

impl CanaryWatch {
    fn of(noted: Noted) -> Self {
        let late = noted.iter().filter(|(_, late_ns)| *late_ns > GAP_NS);
        let gaps = late.map(|(release_ns, late_ns)| (*release_ns, release_ns + late_ns)).collect();
        Self { noted, gaps }
    }

    /// Returns whether a gap overlaps the time from `from_ns` to `to_ns`.
    pub fn explains(&self, from_ns: u64, to_ns: u64) -> bool {
        self.gaps.iter().any(|(start_ns, end_ns)| *start_ns < to_ns && *end_ns > from_ns)
    }

    /// Returns the delay of each wake-up \[ns\].
    pub fn late_ns(&self) -> Vec<u64> {
        self.noted.iter().map(|(_, late_ns)| *late_ns).collect()
    }

    /// Returns the delay of every slot, including those that a late wake-up covered \[ns\].
    pub fn covered_ns(&self) -> impl Iterator<Item = u64> {
        let slots = |late_ns: u64| (0..=late_ns / PERIOD_NS).map(move |slots| late_ns - slots * PERIOD_NS);
        self.late_ns().into_iter().flat_map(slots)
    }

    pub fn summary(&self) -> CanarySummary {
        let covered = Percentiles::of(self.covered_ns());
        let p999_us = covered.map_or(f64::INFINITY, |d| d.p999_us);
        let doubt =
            (p999_us > LIMIT_US).then(|| format!("inconclusive (host): the canary's p99.9 is {:.1} ms", p999_us / 1e3));
        CanarySummary { noted: Percentiles::of(self.late_ns()), covered, gaps: self.gaps.len(), doubt }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gap_explains_what_it_overlaps() {
        let watch = CanaryWatch::of(vec![(10_000_000, 3_000), (20_000_000, 4_000_000), (24_000_000, 999_999)]);
        assert!(watch.explains(23_000_000, 33_000_000), "ends in it");
        assert!(watch.explains(10_000_000, 20_000_001), "begins in it");
        assert!(watch.explains(21_000_000, 22_000_000), "covers it");
        assert!(!watch.explains(10_000_000, 20_000_000), "begins after it");
        assert!(!watch.explains(24_000_000, 34_000_000), "a wake-up within a millisecond is no gap");
    }

    #[test]
    fn a_stall_counts_for_every_slot_it_covered() {
        let watch = CanaryWatch::of(vec![(0, 10), (PERIOD_NS, 2 * PERIOD_NS + 5)]);
        let covered: Vec<u64> = watch.covered_ns().collect();
        assert_eq!(covered, [10, 2 * PERIOD_NS + 5, PERIOD_NS + 5, 5]);
        assert_eq!(watch.late_ns().len(), 2);
    }

    #[test]
    fn a_host_that_stalls_leaves_no_verdict() {
        let quiet = vec![(0, 10); 2000];
        assert_eq!(CanaryWatch::of(quiet.clone()).summary().doubt, None);
        let stalled = [quiet, vec![(1, 9_000_000); 3]].concat();
        assert!(CanaryWatch::of(stalled).summary().doubt.is_some());
        assert!(CanaryWatch::default().summary().doubt.is_some(), "no canary, no verdict");
    }
}
