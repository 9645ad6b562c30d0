//! All measured times, run by run.
//!
//! Programs that are compared run in turns, round after round, so that a change of the machine's speed affects both.

use std::sync::atomic::AtomicU32;

use runtime::console::eprint_line;
use settings::SchedulingPolicy;

use super::canary::{Canary, CanaryWatch, LONGEST};
use super::cycles::WARM_UP_NS;
use super::machine::{CYCLICTEST, Placement, Stress, cyclictest, installed, measured_cpu, on_cpu};
use super::ring_peer::Releases;
use super::rings::{Noted, RingPeers};
use super::series::MeasuredTimes;
use super::timed_flights::{self, TimedFlights, in_process_speed, lockstep_speed};
use crate::mpc::steps::clock_ns;

/// Rate of the rings that are compared \[Hz\].
const RING_HZ: u32 = 250;
/// Rate of the idle flights and of the paper's survey \[Hz\].
const FLIGHT_HZ: u32 = 100;
/// Rate of the flights under load \[Hz\]. A delay harmless at 100 Hz is a miss here, so that scheduling classes differ.
const LOADED_HZ: u32 = 500;
/// Rates at which the stack is flown, up to rates at which it misses \[Hz\].
const RATES_HZ: [u32; 5] = [100, 250, 500, 1000, 2000];
/// Priority of cyclictest and of the loop compared with it.
const LOOP_PRIORITY: u32 = 80;

/// Number of rounds, and duration of each measurement.
pub struct Rounds {
    pub rounds: usize,
    /// Duration of the bare loop, and of cyclictest \[s\].
    pub loop_s: f64,
    /// Duration of the stack, and of the raw rings compared with it \[s\].
    pub ring_s: f64,
    /// Duration of an idle flight of either scheduling class \[s\].
    pub idle_s: f64,
    pub load_s: f64,
    pub rate_s: f64,
    pub paper_s: f64,
    pub lockstep_s: f64,
    pub in_process_s: f64,
}

impl Rounds {
    /// Plan that is long enough for figures.
    pub const FULL: Self = Self {
        rounds: 5,
        loop_s: 4.0,
        ring_s: 1.5,
        idle_s: 1.5,
        load_s: 3.0,
        rate_s: 3.0,
        paper_s: 60.0,
        lockstep_s: 20.0,
        in_process_s: 60.0,
    };
    /// Plan that is only long enough to see that everything works.
    pub const QUICK: Self = Self {
        rounds: 1,
        loop_s: 0.3,
        ring_s: 0.3,
        idle_s: 0.3,
        load_s: 0.3,
        rate_s: 0.5,
        paper_s: 1.0,
        lockstep_s: 1.0,
        in_process_s: 2.0,
    };
}

pub struct Raw {
    /// Bare loop.
    pub ours: MeasuredTimes,
    /// cyclictest, compared with the bare loop; empty if not installed.
    pub cyclictest: MeasuredTimes,
    pub rings: [Rings; 2],
    /// Flights by scheduling class, idle and under load.
    pub policies: Vec<TimedFlights>,
    pub rates: Vec<TimedFlights>,
    pub paper: TimedFlights,
    /// Ratio of simulated time to wall time, round by round.
    pub lockstep: Vec<f64>,
    pub in_process: Vec<f64>,
    /// Time of one reading of `CLOCK_MONOTONIC` \[ns\].
    pub clock_ns: u64,
    pub watch: CanaryWatch,
    /// `true` if the canaries were given `SCHED_FIFO`.
    pub fifo: bool,
}

/// Times of the stack and of the ring compared with it, round by round.
pub struct Rings {
    pub placement: Placement,
    /// Times of the stack from sense to act, without the executions of its nodes.
    pub stack: MeasuredTimes,
    pub hops: MeasuredTimes,
    /// Sums of the executions of the stack's nodes.
    pub executions: MeasuredTimes,
    /// Times of a ring that only rings futexes, the doorbells of its page: the kernel's own wake-up.
    pub raw: MeasuredTimes,
}

impl Raw {
    pub fn measure(plan: &Rounds, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let canary = Canary::start(LONGEST)?;
        let idle = |name: String, rate_hz, policy| TimedFlights::new(name, rate_hz, policy, false);
        let policies = |loaded, state, rate_hz| {
            let new =
                move |policy| TimedFlights::new(format!("{} {state}", policy_name(policy)), rate_hz, policy, loaded);
            [SchedulingPolicy::Fifo, SchedulingPolicy::Other].map(new)
        };
        let mut raw = Self {
            ours: MeasuredTimes::new("loop"),
            cyclictest: MeasuredTimes::new("cyclictest"),
            rings: [Placement::OneCpu, Placement::AllCpus].map(Rings::new),
            policies: [policies(false, "idle", FLIGHT_HZ), policies(true, "under load", LOADED_HZ)].concat(),
            rates: RATES_HZ.map(|rate_hz| idle(format!("{rate_hz} Hz"), rate_hz, SchedulingPolicy::Fifo)).into(),
            paper: idle("paper survey".into(), FLIGHT_HZ, SchedulingPolicy::Fifo),
            lockstep: vec![],
            in_process: vec![],
            clock_ns: clock_ns(),
            watch: CanaryWatch::default(),
            fifo: canary.fifo,
        };
        for round in 0..plan.rounds {
            eprint_line(&format!("round {} of {}: loops, rings, scheduling classes", round + 1, plan.rounds));
            raw.loops(plan, round, interrupts)?;
            for rings in &mut raw.rings {
                rings.round(plan, interrupts)?;
            }
            raw.policies(plan, interrupts)?;
            raw.lockstep.push(lockstep_speed(plan.lockstep_s, interrupts)?);
            raw.in_process.push(in_process_speed(plan.in_process_s));
        }
        eprint_line(&format!("flying at {RATES_HZ:?} Hz"));
        for flights in &mut raw.rates {
            flights.fly_for(plan.rate_s, interrupts)?;
        }
        eprint_line(&format!("flying the paper's survey, {} s", plan.paper_s));
        raw.paper.fly(&timed_flights::paper(plan.paper_s)?, interrupts)?;
        raw.watch = canary.stop()?;
        for flights in raw.policies.iter_mut().chain(&mut raw.rates).chain([&mut raw.paper]) {
            flights.conclude(&raw.watch);
        }
        Ok(raw)
    }

    /// Runs the bare loop and cyclictest in turns; the order changes every round.
    fn loops(&mut self, plan: &Rounds, round: usize, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let count = (plan.loop_s * 1e3) as usize;
        let releases = Releases { period_ns: 1_000_000, count };
        let cpu = measured_cpu();
        for turn in [round, round + 1] {
            if turn % 2 == 0 {
                let peers = on_cpu(cpu, || RingPeers::alone(releases, LOOP_PRIORITY))?;
                self.ours.rounds.push(warm(peers.finish(interrupts)?));
            } else if installed(CYCLICTEST) {
                let late_ns = cyclictest(cpu, LOOP_PRIORITY, count)?;
                let warm_up = (WARM_UP_NS / releases.period_ns) as usize;
                self.cyclictest.rounds.push(late_ns.into_iter().skip(warm_up).collect());
            }
        }
        Ok(())
    }

    fn policies(&mut self, plan: &Rounds, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let can_load = installed("stress-ng");
        for flights in self.policies.iter_mut().filter(|flights| can_load || !flights.loaded) {
            let duration_s = if flights.loaded { plan.load_s } else { plan.idle_s };
            let _stress = flights.loaded.then(|| Stress::start(duration_s + 30.0));
            flights.fly_for(duration_s, interrupts)?;
        }
        Ok(())
    }

    /// Lists all flights, in the order of the tables.
    pub fn flights(&self) -> impl Iterator<Item = &TimedFlights> {
        self.policies.iter().chain(&self.rates).chain([&self.paper])
    }

    pub fn series(&self) -> Vec<&MeasuredTimes> {
        let rings = self.rings.iter().flat_map(|r| [&r.stack, &r.hops, &r.executions, &r.raw]);
        let ages = self.flights().map(|flights| &flights.ages);
        [&self.ours, &self.cyclictest].into_iter().chain(rings).chain(ages).collect()
    }
}

impl Rings {
    fn new(placement: Placement) -> Self {
        let series = |name: &str| MeasuredTimes::new(format!("{name}, {}", placement.name()));
        Self {
            placement,
            stack: series("stack"),
            hops: series("stack's hops"),
            executions: series("stack's executions"),
            raw: series("raw futex"),
        }
    }

    fn round(&mut self, plan: &Rounds, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let scenario = timed_flights::realtime(RING_HZ, SchedulingPolicy::Fifo, plan.ring_s);
        let cycles = timed_flights::cycles(&scenario, self.placement, interrupts)?;
        self.stack.rounds.push(cycles.sense_to_act_ns());
        self.hops.rounds.push(cycles.hops_ns());
        self.executions.rounds.push(cycles.executions_ns());
        let count = (plan.ring_s * f64::from(RING_HZ)) as usize;
        let releases = Releases { period_ns: scenario.sample_ns(), count };
        self.raw.rounds.push(warm(self.placement.during(|| RingPeers::ring(releases))?.finish(interrupts)?));
        Ok(())
    }
}

pub fn policy_name(policy: SchedulingPolicy) -> &'static str {
    match policy {
        SchedulingPolicy::Fifo => "SCHED_FIFO",
        SchedulingPolicy::Other => "SCHED_OTHER",
    }
}

/// Returns the times after the warm-up \[ns\], which the stack's figures leave out too.
fn warm(noted: Noted) -> Vec<u64> {
    let from_ns = noted.first().map_or(0, |(release_ns, _)| release_ns + WARM_UP_NS);
    noted.into_iter().filter(|(release_ns, _)| *release_ns >= from_ns).map(|(_, ns)| ns).collect()
}
