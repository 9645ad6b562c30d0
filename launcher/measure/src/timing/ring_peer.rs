//! One process of a comparison ring: it wakes, passes a token on, and does nothing else.
//!
//! ```text
//! the first     sleeps until the release, passes the token on, waits for it to come round, notes now - release
//! the others    wait for the token, pass it on
//! alone         sleeps until the release, notes now - release; used as a bare 1 kHz loop and as the canary
//! ```
//!
//! A peer enters the real-time class and sleeps by the same calls as the processes of the stack. The difference between
//! the times of this ring and those of the stack is the part that the stack adds to the kernel.

use std::fs;

use anyhow::Context;
use contract::{Topic, exit};
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, Doorbell, enter, now_ns, phase};
use rustix::process::Signal;
use serde::{Deserialize, Serialize};
use settings::{Scenario, Scheduling, SchedulingPolicy};

/// Longest sleep before the peer looks for the token again \[ns\].
const CHECK_NS: u64 = 100_000_000;
/// Delay from the start of the first peer to its first release, by when the others have started \[ns\].
const LEAD_IN_NS: u64 = 50_000_000;
/// File in the run's domain that the first peer writes its samples to.
pub const SAMPLES: &str = "samples";

#[derive(Debug, Clone, clap::Args)]
pub struct RingPeerArgs {
    /// The peer, as JSON
    #[arg(value_parser = |text: &str| serde_json::from_str::<Peer>(text))]
    pub peer: Peer,
}

/// Task of one process of a ring.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Peer {
    /// Namespace of the run's page.
    pub namespace: String,
    /// Place in the ring; the first has the clock.
    pub rank: usize,
    /// `true` for a peer that has no ring to pass the token to.
    pub alone: bool,
    pub releases: Releases,
    /// Priority in `SCHED_FIFO`.
    pub priority: u32,
}

/// Releases of the first peer.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
pub struct Releases {
    /// Interval between two releases \[ns\].
    pub period_ns: u64,
    /// Number of releases to note.
    pub count: usize,
}

/// Runs the peer and returns the exit code.
pub fn run(RingPeerArgs { peer }: &RingPeerArgs) -> anyhow::Result<u8> {
    // Fails only for a signal number that does not exist.
    let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
    let domain = Domain::find(&peer.namespace)?;
    let page = ControlPage::open(&domain.file("page")).context("cannot open the page")?;
    let mut samples = Vec::with_capacity(peer.releases.count);
    let mut token = Token::of(peer, &page);
    enter(&Scheduling {
        policy: SchedulingPolicy::Fifo,
        priority: peer.priority,
        ..Scenario::default().scheduling_of(0)
    });
    if peer.rank > 0 {
        while token.wait() {
            token.pass();
        }
        return Ok(exit::FLOWN);
    }
    keep_time(peer.releases, &page, &mut token, &mut samples);
    page.set_phase(phase::LEAVE);
    let file = domain.file(SAMPLES);
    fs::write(&file, serde_json::to_vec(&samples)?).with_context(|| format!("cannot write {}", file.display()))?;
    Ok(exit::FLOWN)
}

/// Passes the token round until `count` samples have been taken or the run ends. A sample is a release and the time
/// from it until the token came back \[ns\].
fn keep_time(
    Releases { period_ns, count }: Releases,
    page: &ControlPage,
    token: &mut Token,
    samples: &mut Vec<(u64, u64)>,
) {
    let t0_ns = now_ns() + LEAD_IN_NS;
    let mut slot = 0;
    while samples.len() < count {
        let release_ns = t0_ns + slot * period_ns;
        page.phase.wait(phase::JOIN, release_ns);
        if page.phase.count() >= phase::LEAVE {
            return;
        }
        token.pass();
        if !token.wait() {
            return;
        }
        let back_ns = now_ns();
        samples.push((release_ns, back_ns - release_ns));
        // The next release does not depend on this wake-up; releases that were slept through are left out.
        slot = (back_ns - t0_ns) / period_ns + 1;
    }
}

/// State of the token as seen by this peer.
struct Token<'a> {
    alone: bool,
    page: &'a ControlPage,
    input: &'a Doorbell,
    output: &'a Doorbell,
    /// Count of the input doorbell at the last arrival of the token.
    seen: u32,
}

impl<'a> Token<'a> {
    fn of(peer: &Peer, page: &'a ControlPage) -> Self {
        let doorbell = |rank: usize| page.doorbell(Topic::ALL[rank % Topic::COUNT]);
        Self {
            alone: peer.alone,
            page,
            input: doorbell(peer.rank + Topic::COUNT - 1),
            output: doorbell(peer.rank),
            seen: 0,
        }
    }

    /// Waits for the token; returns `false` if the run is over when the token arrives.
    fn wait(&mut self) -> bool {
        if self.alone {
            return true;
        }
        while self.input.count() == self.seen {
            self.input.wait(self.seen, now_ns() + CHECK_NS);
        }
        self.seen = self.input.count();
        self.page.phase.count() < phase::LEAVE
    }

    fn pass(&self) {
        if !self.alone {
            self.output.ring();
        }
    }
}
