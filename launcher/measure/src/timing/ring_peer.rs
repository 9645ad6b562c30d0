//! One process of a ring that the stack is compared with: it wakes, passes a token on, and does nothing else.
//!
//! ```text
//! the first     sleeps until the release, passes the token on, waits for it to come round, notes now - release
//! the others    wait for the token, pass it on
//! alone         sleeps until the release, notes now - release: a bare 1 kHz loop, and the canary
//! ```
//!
//! It enters the real-time class and sleeps by the same calls as the stack's own processes. What is between the wake-ups
//! of this ring and those of the stack's is what the stack adds to the kernel.

use std::ffi::OsString;
use std::fmt::Write;
use std::fs;
use std::io::{stdin, stdout};
use std::path::PathBuf;

use anyhow::Context;
use clap::ValueEnum;
use contract::Topic;
use contract::exit;
use contract::scenario::{Policy, Scenario, Scheduling};
use runtime::cycle_timing::warm_up_ns;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, Doorbell, enter, now_ns, phase};
use rustix::process::Signal;

/// Longest wait for the token without a look whether the run is over.
const LOOK_AROUND_NS: u64 = 100_000_000;
/// From the start of the first peer to its first release: the others are there by then.
const LEAD_IN_NS: u64 = 50_000_000;

#[derive(Debug, Clone, clap::Args)]
pub struct RingPeerArgs {
    /// Namespace of the run's page
    #[arg(long)]
    pub namespace: String,
    /// Place in the ring; the first has the clock
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..Topic::COUNT as i64))]
    pub rank: u8,
    /// What carries the token
    #[arg(long)]
    pub link: Link,
    /// Read the clock as a node of the stack does in a cycle, every second time the token comes
    #[arg(long)]
    pub stamps: bool,
    /// Wake once before the token is due, as a node of the stack does
    #[arg(long)]
    pub warm_up: bool,
    /// Between two releases
    #[arg(long)]
    pub period_ns: u64,
    /// Releases to note
    #[arg(long)]
    pub count: usize,
    /// Priority in `SCHED_FIFO`
    #[arg(long)]
    pub priority: u32,
    /// Where the first peer writes its samples
    #[arg(long)]
    pub samples: PathBuf,
}

/// What carries the token.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Link {
    /// Nothing: a peer alone.
    None,
    /// A doorbell of the page: the bare futex.
    Doorbell,
    /// Standard input and output: a pipe or a socket.
    Stream,
}

impl RingPeerArgs {
    pub fn to_words(&self) -> Vec<OsString> {
        let value = self.link.to_possible_value().map(|value| value.get_name().to_owned()).unwrap_or_default();
        let mut words: Vec<OsString> = [
            ("--namespace", self.namespace.clone()),
            ("--rank", self.rank.to_string()),
            ("--link", value),
            ("--period-ns", self.period_ns.to_string()),
            ("--count", self.count.to_string()),
            ("--priority", self.priority.to_string()),
        ]
        .into_iter()
        .flat_map(|(flag, value)| [flag.into(), value.into()])
        .collect();
        words.extend(["--samples".into(), self.samples.clone().into()]);
        words.extend(self.stamps.then(|| "--stamps".into()));
        words.extend(self.warm_up.then(|| "--warm-up".into()));
        words
    }
}

/// Runs the peer; the exit code.
pub fn run(args: &RingPeerArgs) -> anyhow::Result<u8> {
    // Fails only for a signal number that does not exist.
    let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
    let page = ControlPage::open(&Domain::find(&args.namespace)?.file("page")).context("cannot open the page")?;
    let mut samples = Vec::with_capacity(args.count);
    let mut token = Token::of(args, &page);
    enter(&Scheduling { policy: Policy::Fifo, priority: args.priority, ..Scenario::default().realtime.of(0) });
    if args.rank > 0 {
        while token.wait() {
            token.read_clock();
            token.pass();
        }
        return Ok(exit::FLOWN);
    }
    turn(args, &page, &mut token, &mut samples);
    page.set_phase(phase::LEAVE);
    let lines = samples.iter().fold(String::new(), |mut lines, (release_ns, late_ns)| {
        let _ = writeln!(lines, "{release_ns},{late_ns}"); // a String takes everything
        lines
    });
    fs::write(&args.samples, lines).with_context(|| format!("cannot write {}", args.samples.display()))?;
    Ok(exit::FLOWN)
}

/// Passes the token round until it has come back often enough or the run is over; notes release and time from it \[ns\].
fn turn(args: &RingPeerArgs, page: &ControlPage, token: &mut Token, samples: &mut Vec<(u64, u64)>) {
    let t0_ns = now_ns() + LEAD_IN_NS;
    let mut slot = 0;
    while samples.len() < args.count {
        let release_ns = t0_ns + slot * args.period_ns;
        token.warm_up(release_ns - args.period_ns, |due_ns| page.phase.wait(phase::JOIN, due_ns));
        page.phase.wait(phase::JOIN, release_ns);
        if page.phase.count() >= phase::LEAVE {
            return;
        }
        token.read_clock();
        token.pass();
        if !token.wait() {
            return;
        }
        let back_ns = now_ns();
        samples.push((release_ns, back_ns - release_ns));
        // The next release is never derived from this wake-up, and what was slept through is not made up for.
        slot = (back_ns - t0_ns) / args.period_ns + 1;
    }
}

/// Whether the clock is read in lap `lap` of a ring that compares reading it with not reading it.
pub fn stamped(lap: usize) -> bool {
    lap % 2 == 1
}

/// The token, as this peer sees it.
struct Token<'a> {
    link: Link,
    stamps: bool,
    /// Between two laps \[ns\], if it warms up.
    warm_up: Option<u64>,
    page: &'a ControlPage,
    input: &'a Doorbell,
    output: &'a Doorbell,
    seen: u32,
    /// When it came the last time.
    came_ns: u64,
    passed: usize,
}

impl<'a> Token<'a> {
    fn of(args: &RingPeerArgs, page: &'a ControlPage) -> Self {
        let rank = usize::from(args.rank);
        let doorbell = |rank: usize| page.doorbell(Topic::ALL[rank % Topic::COUNT]);
        Self {
            link: args.link,
            stamps: args.stamps,
            warm_up: args.warm_up.then_some(args.period_ns),
            page,
            input: doorbell(rank + Topic::COUNT - 1),
            output: doorbell(rank),
            seen: 0,
            came_ns: 0,
            passed: 0,
        }
    }

    /// Sleeps until it is time to warm up for what follows `before_ns`, if this peer does.
    fn warm_up(&self, before_ns: u64, sleep_until: impl FnOnce(u64)) {
        if let Some(due_ns) = self.warm_up.and_then(|period_ns| warm_up_ns(period_ns, before_ns, now_ns())) {
            sleep_until(due_ns);
        }
    }

    /// Waits until it comes; false when the run is over.
    fn wait(&mut self) -> bool {
        match self.link {
            Link::None => true,
            Link::Doorbell => self.wait_for_bell(),
            Link::Stream => rustix::io::read(stdin(), &mut [0_u8; 8]).is_ok_and(|bytes| bytes > 0),
        }
    }

    fn wait_for_bell(&mut self) -> bool {
        self.warm_up(self.came_ns, |due_ns| self.input.wait(self.seen, due_ns));
        while self.input.count() == self.seen {
            self.input.wait(self.seen, now_ns() + LOOK_AROUND_NS);
        }
        self.seen = self.input.count();
        self.came_ns = now_ns();
        self.page.phase.count() < phase::LEAVE
    }

    fn pass(&mut self) {
        self.read_clock();
        self.passed += 1;
        match self.link {
            Link::None => {}
            Link::Doorbell => self.output.ring(),
            // A peer that has left is noticed when reading.
            Link::Stream => _ = rustix::io::write(stdout(), &[0_u8; 8]),
        }
    }

    /// What a cycle of the stack notes when it begins, and again when it sends.
    fn read_clock(&self) {
        if self.stamps && stamped(self.passed) {
            std::hint::black_box(now_ns());
        }
    }
}
