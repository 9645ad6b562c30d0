//! Everything measured, run by run.
//!
//! What is compared is run in turns, round after round, so that a change of the machine's speed changes both.

use std::sync::atomic::AtomicU32;

use contract::scenario::Policy;

use super::canary::{Canary, Watch};
use super::costs::Costs;
use super::cycles::WARM_UP_NS;
use super::machine::{CYCLICTEST, Placement, Stress, cyclictest, installed, measured_cpu, on_cpu};
use super::ring_peer::stamped;
use super::rings::{Kind, Noted, Releases, RingPeers};
use super::series::Series;
use super::timed_flight::{self, TimedFlight, fly};
use runtime::console::eprint_line;

/// Rate of the rings that are compared \[Hz\].
pub const RING_HZ: u32 = 250;
/// Rate of the idle flights, and of the paper's \[Hz\].
pub const FLIGHT_HZ: u32 = 100;
/// Rate of the flights under load \[Hz\]: a delay that 100 Hz would forgive is a miss here, so that classes differ.
pub const LOADED_HZ: u32 = 500;
/// Rates at which the stack is flown until it misses \[Hz\].
pub const RATES_HZ: [u32; 5] = [100, 250, 500, 1000, 2000];
/// cyclictest's priority and that of the loop beside it.
pub const LOOP_PRIORITY: u32 = 80;

pub struct Plan {
    pub rounds: usize,
    /// The bare loop and cyclictest, each.
    pub loop_s: f64,
    /// The stack and the raw rings it is compared with, each.
    pub ring_s: f64,
    pub scale_s: f64,
    /// A flight of either scheduling class, idle.
    pub idle_s: f64,
    pub load_s: f64,
    pub rate_s: f64,
    pub paper_s: f64,
    pub lockstep_s: f64,
    pub in_process_s: f64,
}

impl Plan {
    /// Long enough for figures, with that long a survey.
    pub fn full(rounds: usize, paper_s: f64) -> Self {
        Self {
            rounds,
            loop_s: 4.0,
            ring_s: 1.5,
            scale_s: 0.8,
            idle_s: 1.5,
            load_s: 3.0,
            rate_s: 3.0,
            paper_s,
            lockstep_s: 20.0,
            in_process_s: 60.0,
        }
    }

    /// Long enough to see that everything works.
    pub fn quick() -> Self {
        Self {
            rounds: 1,
            loop_s: 0.3,
            ring_s: 0.3,
            scale_s: 0.2,
            idle_s: 0.3,
            load_s: 0.3,
            rate_s: 0.5,
            paper_s: 1.0,
            lockstep_s: 1.0,
            in_process_s: 2.0,
        }
    }
}

pub struct Raw {
    /// The bare loop.
    pub ours: Series,
    /// cyclictest beside it, where installed.
    pub cyclictest: Series,
    pub rings: Vec<Rings>,
    /// Scheduling classes, idle and under load.
    pub policies: Vec<FlightSeries>,
    pub rates: Vec<FlightSeries>,
    pub paper: FlightSeries,
    pub lockstep: Vec<f64>,
    pub in_process: Vec<f64>,
    pub costs: Costs,
    pub watch: Watch,
    /// Whether the canaries were given `SCHED_FIFO`.
    pub fifo: bool,
}

pub struct Rings {
    pub placement: Placement,
    /// The stack, from sense to act without what its nodes did.
    pub stack: Series,
    pub hops: Series,
    /// The sum of its nodes' executions.
    pub executions: Series,
    /// The others, in the order of [`Kind::ALL`].
    pub others: Vec<Series>,
    /// Of [`Kind::Stamped`], the laps without and with the clock read.
    pub laps: [Series; 2],
}

/// Flights under the same circumstances.
pub struct FlightSeries {
    pub name: String,
    pub rate_hz: u32,
    pub policy: Policy,
    /// Under `stress-ng --cpu 4`.
    pub loaded: bool,
    pub ages: Series,
    /// For each slot whether it was missed, and the time it covers if so \[ns\].
    pub slots: Vec<Option<(u64, u64)>>,
    pub cpu_percent: Option<f64>,
    /// Whether all nodes were given the class they asked for.
    pub as_asked: bool,
    /// Whether the vehicle flew to the end, inside its bounds.
    pub inside: bool,
}

impl Raw {
    pub fn measure(plan: &Plan, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let canary = Canary::start()?;
        let fifo = canary.fifo;
        let ring = |placement: Placement| Rings::new(placement);
        let mut raw = Self {
            ours: Series::new("loop"),
            cyclictest: Series::new("cyclictest"),
            rings: vec![ring(Placement::OneCpu), ring(Placement::AllCpus)],
            policies: vec![],
            rates: vec![],
            paper: FlightSeries::new("paper survey", FLIGHT_HZ, Policy::Fifo, false),
            lockstep: vec![],
            in_process: vec![],
            costs: Costs::measure()?,
            watch: Watch::default(),
            fifo,
        };
        for loaded in [false, true] {
            for policy in [Policy::Fifo, Policy::Other] {
                let name = format!("{} {}", policy_name(policy), if loaded { "under load" } else { "idle" });
                let rate_hz = if loaded { LOADED_HZ } else { FLIGHT_HZ };
                raw.policies.push(FlightSeries::new(&name, rate_hz, policy, loaded));
            }
        }
        for round in 0..plan.rounds {
            eprint_line(&format!("round {} of {}: loops, rings, scheduling classes", round + 1, plan.rounds));
            raw.loops(plan, round, interrupts)?;
            for rings in &mut raw.rings {
                rings.round(plan, interrupts)?;
            }
            raw.policies(plan, interrupts)?;
            raw.lockstep.push(timed_flight::lockstep(plan.lockstep_s, interrupts)?);
            raw.in_process.push(timed_flight::in_process(plan.in_process_s));
        }
        eprint_line(&format!("flying at {RATES_HZ:?} Hz"));
        for rate_hz in RATES_HZ {
            let mut flown = FlightSeries::new(&format!("{rate_hz} Hz"), rate_hz, Policy::Fifo, false);
            flown.add(&fly(
                &timed_flight::realtime(rate_hz, Policy::Fifo, plan.rate_s),
                Placement::AllCpus,
                interrupts,
            )?);
            raw.rates.push(flown);
        }
        eprint_line(&format!("flying the paper's survey, {} s", plan.paper_s));
        raw.paper.add(&fly(&timed_flight::paper(plan.paper_s)?, Placement::AllCpus, interrupts)?);
        raw.watch = canary.stop()?;
        Ok(raw)
    }

    /// The bare loop and cyclictest in turns, a different one first each time.
    fn loops(&mut self, plan: &Plan, round: usize, interrupts: &AtomicU32) -> anyhow::Result<()> {
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

    fn policies(&mut self, plan: &Plan, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let loaded = installed("stress-ng");
        for flown in self.policies.iter_mut().filter(|flown| loaded || !flown.loaded) {
            let duration_s = if flown.loaded { plan.load_s } else { plan.idle_s };
            let _stress = flown.loaded.then(|| Stress::start(duration_s + 30.0));
            let scenario = timed_flight::realtime(flown.rate_hz, flown.policy, duration_s);
            flown.add(&fly(&scenario, Placement::AllCpus, interrupts)?);
        }
        Ok(())
    }

    pub fn series(&self) -> Vec<&Series> {
        let rings = self.rings.iter().flat_map(|r| [&r.stack, &r.hops, &r.executions].into_iter().chain(&r.others));
        let flown = self.policies.iter().chain(&self.rates).chain([&self.paper]).map(|flown| &flown.ages);
        [&self.ours, &self.cyclictest].into_iter().chain(rings).chain(flown).collect()
    }
}

impl Rings {
    fn new(placement: Placement) -> Self {
        let series = |name: &str| Series::new(format!("{name}, {}", placement.name()));
        Self {
            placement,
            stack: series("stack"),
            hops: series("stack's hops"),
            executions: series("stack's executions"),
            others: Kind::ALL.iter().map(|kind| series(kind.name())).collect(),
            laps: [series("clock not read"), series("clock read")],
        }
    }

    pub fn of(&self, kind: Kind) -> &Series {
        let i = Kind::ALL.iter().position(|k| *k == kind).unwrap_or(0);
        &self.others[i]
    }

    fn round(&mut self, plan: &Plan, interrupts: &AtomicU32) -> anyhow::Result<()> {
        let period_ns = 1_000_000_000 / u64::from(RING_HZ);
        let scenario = timed_flight::realtime(RING_HZ, Policy::Fifo, plan.ring_s);
        let flight = fly(&scenario, self.placement, interrupts)?;
        self.stack.rounds.push(flight.cycles.sense_to_act_ns());
        self.hops.rounds.push(flight.cycles.hops_ns());
        self.executions.rounds.push(flight.cycles.executions_ns());
        for (kind, series) in Kind::ALL.into_iter().zip(&mut self.others) {
            let scale = matches!(kind, Kind::Socket | Kind::Pipe);
            let seconds = if scale { plan.scale_s } else { plan.ring_s };
            let releases = Releases { period_ns, count: (seconds * f64::from(RING_HZ)) as usize };
            let noted = self.placement.during(|| RingPeers::ring(kind, releases))?.finish(interrupts)?;
            if kind == Kind::Stamped {
                for (laps, read) in self.laps.iter_mut().zip([false, true]) {
                    let of = noted.iter().enumerate().filter(|(lap, _)| stamped(*lap) == read);
                    laps.rounds.push(warm(of.map(|(_, noted)| *noted).collect()));
                }
            }
            series.rounds.push(warm(noted));
        }
        Ok(())
    }
}

impl FlightSeries {
    fn new(name: &str, rate_hz: u32, policy: Policy, loaded: bool) -> Self {
        let ages = Series::new(format!("age, {name}"));
        let name = name.to_owned();
        Self { name, rate_hz, policy, loaded, ages, slots: vec![], cpu_percent: None, as_asked: true, inside: true }
    }

    fn add(&mut self, flight: &TimedFlight) {
        self.slots.extend(flight.cycles.misses());
        self.ages.rounds.push(flight.cycles.ages_ns());
        self.cpu_percent = flight.cpu_percent.or(self.cpu_percent);
        self.as_asked &= flight.as_asked;
        self.inside &= flight.inside;
    }
}

pub fn policy_name(policy: Policy) -> &'static str {
    match policy {
        Policy::Fifo => "SCHED_FIFO",
        Policy::Other => "SCHED_OTHER",
    }
}

/// Without the start, which is left out of the stack's figures too.
fn warm(noted: Noted) -> Vec<u64> {
    let from_ns = noted.first().map_or(0, |(release_ns, _)| release_ns + WARM_UP_NS);
    noted.into_iter().filter(|(release_ns, _)| *release_ns >= from_ns).map(|(_, ns)| ns).collect()
}
