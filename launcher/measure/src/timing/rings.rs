//! Rings for comparison: four processes that only pass a token, and one process that only keeps time.

use std::fs;
use std::process::{Child, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use contract::Topic;
use runtime::domain::Hold;
use runtime::realtime::{ControlPage, phase};
use settings::Scenario;

use super::ring_peer::{Peer, Releases, SAMPLES};
use crate::flights::namespace;
use flight::own_program;
use flight::stack::StartError;

/// Samples of the first peer, in order: release, and time from the release until the token came back \[ns\].
pub type Noted = Vec<(u64, u64)>;

/// Processes of one run, and their shared memory. Drop kills the processes and removes the memory.
pub struct RingPeers {
    /// Processes; the first peer of the ring, which has the clock, is the last here.
    children: Vec<Child>,
    page: ControlPage,
    hold: Hold,
    releases: Releases,
}

impl RingPeers {
    /// Starts a peer alone, with `priority`.
    pub fn alone(releases: Releases, priority: u32) -> anyhow::Result<Self> {
        Self::start(true, releases, &[priority])
    }

    /// Starts a ring of four, with the priorities of the stack's nodes.
    pub fn ring(releases: Releases) -> anyhow::Result<Self> {
        let wanted = Scenario::default();
        Self::start(false, releases, &Topic::ALL.map(|topic| wanted.scheduling_of(topic as usize).priority))
    }

    fn start(alone: bool, releases: Releases, priorities: &[u32]) -> anyhow::Result<Self> {
        let hold = Hold::take(&namespace())?;
        let page = ControlPage::create(&hold.domain.file("page")).context("cannot make a page in shared memory")?;
        let mut peers = Self { children: vec![], page, hold, releases };
        // The peer with the clock is started last, when the others already wait for the token.
        for (rank, &priority) in priorities.iter().enumerate().rev() {
            let namespace = peers.hold.domain.namespace().to_owned();
            let peer = Peer { namespace, rank, alone, releases, priority };
            let mut command = own_program();
            command.args(["measure", "ring-peer"]).arg(serde_json::to_string(&peer)?);
            command.stdin(Stdio::null()).stdout(Stdio::null());
            peers.children.push(command.spawn().context("cannot start a process of a ring to compare with")?);
        }
        Ok(peers)
    }

    /// Waits until all releases are noted.
    pub fn finish(mut self, interrupts: &AtomicU32) -> anyhow::Result<Noted> {
        let run = Duration::from_nanos(self.releases.period_ns * self.releases.count as u64);
        let deadline = Instant::now() + run + Duration::from_secs(20);
        while self.children.last_mut().is_some_and(|child| matches!(child.try_wait(), Ok(None))) {
            if interrupts.load(Ordering::Relaxed) > 0 {
                bail!(StartError::Interrupted);
            }
            if Instant::now() > deadline {
                bail!("a ring to compare with did not come round");
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.noted()
    }

    /// Ends the run before all releases are noted.
    pub fn stop(mut self) -> anyhow::Result<Noted> {
        self.page.set_phase(phase::LEAVE);
        if let Some(child) = self.children.last_mut() {
            child.wait()?;
        }
        self.noted()
    }

    /// Returns the process ID of the peer with the clock.
    pub fn clock_pid(&self) -> u32 {
        self.children.last().map_or(0, Child::id)
    }

    fn noted(&self) -> anyhow::Result<Noted> {
        let file = self.hold.domain.file(SAMPLES);
        let text = fs::read_to_string(file).context("a comparison ring has written no samples")?;
        serde_json::from_str(&text).context("cannot parse the samples of a comparison ring")
    }
}

impl Drop for RingPeers {
    fn drop(&mut self) {
        for child in &mut self.children {
            // Both succeed for a process that has ended already.
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}
