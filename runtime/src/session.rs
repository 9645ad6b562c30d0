//! A process of the stack: joins a run, takes its session, runs its node, leaves.
//!
//! Every node's `main.rs` is the same three lines around [`main`]; the launcher starts the same code as
//! `launcher node NAME`.

use std::cell::{Cell, RefCell};
use std::path::Path;
use std::process::ExitCode;
use std::rc::Rc;
use std::sync::Arc;

use rustix::process::Signal;

use crate::console;
use crate::cycle_loop::{Clock, CycleLoop};
use crate::cycle_timing::CycleTiming;
use crate::domain::{Domain, DomainError};
use crate::fault_table::FaultUpdates;
use crate::input::Input;
use crate::output::Output;
use crate::port::{Bus, NODE_DEPTH, PortError, Receive, Wire, observer_depth};
use crate::realtime::{self, ControlPage, now_ns, phase};
use crate::release::Release;
use crate::shared_role::VACANT;
use crate::warm_up::WarmUpPlan;
use contract::file::{self, LARGEST_TEXT};
use contract::message::Stamp;
use contract::scenario::{self, Late, Mode, Scenario, ScenarioError};
use contract::snapshot::Snapshot;
use contract::topic::{NODES, Topic};

/// Exit codes of the stack's programs.
pub mod exit {
    /// Flown.
    pub const FLOWN: u8 = 0;
    /// Flown, but outside the scenario's bounds.
    pub const OUT_OF_BOUNDS: u8 = 1;
    /// Usage or scenario error.
    pub const USAGE: u8 = 2;
    /// A process or the log was lost, messages were missed, or the results cannot be written or printed.
    pub const PROCESS_LOST: u8 = 3;
    /// A node whose deadline has the policy `stop` missed it.
    pub const BUDGET_BROKEN: u8 = 4;
    /// Interrupted.
    pub const INTERRUPTED: u8 = 130;
}

/// Why a process cannot take or keep its session.
#[derive(Debug, thiserror::Error)]
pub enum SessionError {
    /// The run is not there.
    #[error(transparent)]
    Domain(#[from] DomainError),
    /// Its parent is not the launcher of the run.
    #[error("it belongs to the launcher of namespace '{0}', which did not start it, or has died since")]
    Orphan(String),
    /// A port is refused.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The run's settings cannot be read.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// The run's page or settings file cannot be opened.
    #[error("{what}: {why}")]
    Io {
        /// Which file.
        what: String,
        /// Why.
        why: std::io::Error,
    },
    /// A deadline with the policy `stop` was missed.
    #[error(
        "tick {tick}: the message was ready {response_ms:.3} ms after the sample, past its deadline of {deadline_ms} ms"
    )]
    Late {
        /// Which tick.
        tick: u64,
        /// When it was ready \[ms\].
        response_ms: f64,
        /// When it was due \[ms\].
        deadline_ms: f64,
    },
    /// No place was offered to this process, or another one has it.
    #[error(
        "no place for {node} of epoch {epoch}: the launcher starts the processes of its run itself, one for each place"
    )]
    Taken {
        /// Which node.
        node: &'static str,
        /// Which incarnation.
        epoch: u32,
    },
    /// Before the start, a process was silent, or heard by nobody.
    #[error("no message of {node} has arrived within {} s: it has not started, or is stuck", PROBE_LIMIT_NS / 1_000_000_000)]
    Silent {
        /// Which node.
        node: &'static str,
    },
    /// A fault has it end by itself.
    #[error("tick {tick}: a fault has it end by itself")]
    FaultExit {
        /// Which tick.
        tick: u64,
    },
    /// In lockstep the ring did not come round.
    #[error("tick {tick}: the ring stands still: a process of it is stuck, or the scenario takes the plant away")]
    Stuck {
        /// Which tick.
        tick: u64,
    },
}

/// How long a process waits before the start for a message of everybody it listens to: less than the launcher does, so that it can say whose.
const PROBE_LIMIT_NS: u64 = 9_000_000_000;
/// How often it sends a probe meanwhile, and looks for those of others.
const PROBE_PERIOD_NS: u64 = 2_000_000;

/// A publisher that is there and not heard for so long before the start is connected to anew.
const RETRY_NS: u64 = 300_000_000;
/// How often that is tried.
const TRIES: u32 = 10;

/// Shows, before the run begins, that a port works.
struct Probe {
    /// The node that is silent, or is heard by nobody, while it does not.
    node: &'static str,
    works: Box<dyn Fn() -> Result<bool, PortError>>,
}

/// A process's place at the ring.
pub struct NodeSession {
    /// The run's settings.
    pub scenario: Scenario,
    /// Bells and phase.
    pub page: Arc<ControlPage>,
    bus: Bus,
    probes: RefCell<Vec<Probe>>,
    cycle_timing: Rc<CycleTiming>,
    rank: usize,
    epoch: u32,
    /// Whether its own faults are the run's, and the launcher acts them out.
    scripted: bool,
}

impl NodeSession {
    /// Joins the run of `namespace` as the process number `epoch`, from 1, that is started as `name`.
    pub fn join(namespace: &str, name: &str, epoch: u32) -> Result<Self, SessionError> {
        Self::join_with(namespace, name, epoch, None)
    }

    /// The same with settings of its own, the merged ones of a file.
    pub fn join_with(namespace: &str, name: &str, epoch: u32, own: Option<&Path>) -> Result<Self, SessionError> {
        let domain = Domain::find(namespace)?;
        let io = |what: &str| {
            let what = domain.file(what).display().to_string();
            move |why| SessionError::Io { what, why }
        };
        let text = file::read_text(&domain.file("scenario.toml"), LARGEST_TEXT).map_err(io("scenario.toml"))?;
        let run = scenario::from_merged(&text, "the run's merged scenario")?;
        let scenario = own.map_or(Ok(run.clone()), |path| {
            let what = path.display().to_string();
            let text = file::read_text(path, LARGEST_TEXT);
            let text = text.map_err(|why| SessionError::Io { what: what.clone(), why })?;
            Ok::<_, SessionError>(scenario::candidate_from(&text, &what)?)
        })?;
        let scripted = scenario.run.mode != Mode::Realtime && scenario.fault == run.fault;
        let page = Arc::new(ControlPage::open(&domain.file("page")).map_err(io("page"))?);
        let bus = Bus::attach(&domain)?;
        let rank = NODES.iter().position(|node| *node == name).unwrap_or(0);
        let mut deadline = scenario.deadline_of(rank);
        let clocked = scenario.run.mode == Mode::Realtime;
        if !clocked {
            deadline.late = Late::Send; // without a clock nothing is due
        }
        let warm_up = WarmUpPlan::new(clocked.then(|| scenario.sample_ns()));
        let cycle_timing = Rc::new(CycleTiming::new(deadline, warm_up));
        Ok(Self { scenario, page, bus, probes: RefCell::default(), cycle_timing, rank, epoch, scripted })
    }

    /// Where this node gets `M` from.
    pub fn input<M: Wire>(&self) -> Result<Input<M>, SessionError> {
        let period_ns = (self.scenario.run.mode == Mode::Realtime).then(|| self.scenario.sample_ns());
        let port = self.receiver(NODE_DEPTH)?;
        Ok(Input::new(port, self.page.clone(), (self.topic(), self.epoch), period_ns))
    }

    /// Where this node sends `M` to. With it the process takes its place in the role.
    pub fn output<M: Wire>(&self) -> Result<Output<M>, SessionError> {
        let port = self.bus.sender()?;
        if !self.page.role(M::TOPIC).claim(self.epoch, port.number()) {
            return Err(SessionError::Taken { node: M::TOPIC.publisher(), epoch: self.epoch });
        }
        let (prober, mut probe) = (port.clone(), M::default());
        *probe.stamp_mut() = Stamp::probe(self.epoch);
        let probe = probe.with_checksum();
        let works = move || Ok(prober.send(&probe).is_ok());
        self.probes.borrow_mut().push(Probe { node: M::TOPIC.publisher(), works: Box::new(works) });
        Ok(Output::new(port, self.page.clone(), self.cycle_timing.clone(), &self.scenario, self.epoch))
    }

    /// A queue deep enough to see every message, for those who watch and record.
    pub fn observer<M: Wire>(&self) -> Result<Rc<dyn Receive<M>>, SessionError> {
        self.receiver(observer_depth(self.scenario.run.rate_hz))
    }

    fn receiver<M: Wire>(&self, depth: usize) -> Result<Rc<dyn Receive<M>>, SessionError> {
        let port = self.bus.receiver::<M>(depth)?;
        let (page, queue) = (self.page.clone(), port.clone());
        let delivery = || {
            let gone = || "its files in shared memory are gone or damaged; fly again".into();
            PortError::Unheard { topic: M::TOPIC, reason: realtime::shortage().unwrap_or_else(gone) }
        };
        let speaker = move || {
            let role = page.role(M::TOPIC);
            role.port(role.active())
        };
        if self.page.phase().count() != phase::JOIN && port.cannot_reach(speaker()) {
            return Err(delivery().into()); // who joins a run under way waits for nobody
        }
        let (heard, tries, retry_ns) = (Cell::new(false), Cell::new(0), Cell::new(u64::MAX));
        let works = move || {
            if heard.get() {
                return Ok(true); // what comes from now on may be the first message of the run
            }
            while let Ok(Some((_, from))) = queue.receive() {
                heard.set(heard.get() || from == speaker());
            }
            let now_ns = now_ns();
            if speaker() <= VACANT || heard.get() {
                retry_ns.set(now_ns + RETRY_NS);
            } else if queue.cannot_reach(speaker()) || now_ns > retry_ns.get() {
                // Two that connect to each other at the same instant may both fail.
                if tries.replace(tries.get() + 1) == TRIES {
                    return Err(delivery());
                }
                queue.reconnect()?;
                retry_ns.set(now_ns + RETRY_NS);
            }
            Ok(heard.get())
        };
        self.probes.borrow_mut().push(Probe { node: M::TOPIC.publisher(), works: Box::new(works) });
        Ok(port)
    }

    /// Where a node hears of faults that it is given while it flies.
    pub fn news(&self) -> FaultUpdates {
        FaultUpdates::new(self.page.clone())
    }

    /// What the process before this one remembered; `None` for the first, which begins with nothing.
    pub fn memory(&self) -> Option<Snapshot> {
        let memory = &self.page.role(self.topic()).memory;
        // One that is torn is being written: the next look finds it whole.
        (self.epoch > 1).then(|| (0..100).find_map(|_| memory.read())).flatten()
    }

    /// Enters the real-time class, says that this process is ready, and waits for the run to begin: call it last before
    /// the loop, when everything is allocated.
    ///
    /// In lockstep there is no deadline to keep, and a ring that never sleeps would only starve who watches it.
    ///
    /// # Errors
    /// Somebody whom it is to hear cannot be heard.
    pub fn settle(&self) -> Result<CycleLoop, SessionError> {
        let clocked = self.scenario.run.mode == Mode::Realtime;
        if clocked {
            realtime::enter(&self.scenario.realtime.of(self.rank));
        }
        let role = self.page.role(self.topic());
        self.probe(|| role.ready.set(self.epoch))?;
        self.page.doorbell(self.topic()).ring();
        let clock = clocked.then(|| Clock {
            period_ns: self.scenario.sample_ns(),
            patience_ns: self.scenario.deadline_of(self.rank.saturating_sub(1)).deadline_ns,
        });
        // Those that the launcher acts out, the process has no part in.
        let scenario =
            if self.scripted { &Scenario { fault: vec![], ..self.scenario.clone() } } else { &self.scenario };
        Ok(CycleLoop::new(clock, self.page.clone(), self.cycle_timing.clone(), self.topic(), self.epoch, scenario))
    }

    /// Before the run begins, shows that every port works, and says that this process is `ready` when that is so; from
    /// then on until the run begins its probes let the others see the same. In a run that is under way it is ready at
    /// once: nobody waits for it there, and a process that cannot hear or be heard is replaced.
    pub fn probe(&self, ready: impl Fn()) -> Result<(), SessionError> {
        let limit_ns = now_ns() + PROBE_LIMIT_NS;
        let mut said = false;
        while self.page.phase().count() == phase::JOIN {
            match self.probe_once()? {
                None if said => {}
                None => {
                    ready();
                    said = true;
                }
                Some(node) if now_ns() > limit_ns => return Err(SessionError::Silent { node }),
                Some(_) => {}
            }
            self.page.phase().wait(phase::JOIN, now_ns() + PROBE_PERIOD_NS);
        }
        if !said {
            ready();
        }
        Ok(())
    }

    /// Sends a probe through every sending port, and looks whether every receiving one has received something: a node
    /// that is silent, or heard by nobody.
    pub fn probe_once(&self) -> Result<Option<&'static str>, SessionError> {
        let mut silent = None;
        for probe in self.probes.borrow().iter() {
            let works = (probe.works)()?;
            silent = silent.or((!works).then_some(probe.node));
        }
        Ok(silent)
    }

    /// The topic this node speaks on.
    fn topic(&self) -> Topic {
        Topic::ALL[self.rank]
    }

    /// Whether the node kept its budget, at the end of its loop.
    fn verdict(&self) -> Result<(), SessionError> {
        let deadline_ms = self.scenario.deadline_of(self.rank).deadline_ns as f64 / 1e6;
        let late =
            |(tick, response_ns)| SessionError::Late { tick, response_ms: response_ns as f64 / 1e6, deadline_ms };
        self.cycle_timing.broken().map_or(Ok(()), |broken| Err(late(broken)))
    }

    /// The plant's clock, which starts here; `None` when the run was called off.
    pub fn release(&self) -> Option<Release> {
        let going = self.page.phase().count() == phase::GO;
        going.then(|| Release::new(&self.scenario, self.page.clone(), self.cycle_timing.clone()))
    }
}

/// Runs one node as this process: joins the namespace named in the arguments, runs, reports failure on stderr.
///
/// The process dies with its parent, the launcher.
pub fn main(name: &str, run: fn(&NodeSession) -> Result<(), SessionError>) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let epoch_of = |word: &str| word.parse().ok().filter(|epoch| *epoch > 0);
    let (namespace, epoch, own) = match words.as_slice() {
        ["--namespace", namespace] => (namespace, Some(1), None),
        ["--namespace", namespace, "--epoch", epoch] => (namespace, epoch_of(epoch), None),
        ["--namespace", namespace, "--epoch", epoch, "--settings", own] => (namespace, epoch_of(epoch), Some(own)),
        _ => return usage(name),
    };
    epoch.map_or_else(|| usage(name), |epoch| run_as(name, namespace, epoch, own.map(Path::new), run))
}

/// The same with the arguments given.
pub fn run_as(
    name: &str,
    namespace: &str,
    epoch: u32,
    own: Option<&Path>,
    run: fn(&NodeSession) -> Result<(), SessionError>,
) -> ExitCode {
    realtime::tell_of_crashes();
    let session = die_with_launcher(namespace).and_then(|()| NodeSession::join_with(namespace, name, epoch, own));
    match session.and_then(|session| run(&session).and_then(|()| session.verdict())) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::eprint_line(&format!("{name}: {error}"));
            let late = matches!(error, SessionError::Late { .. });
            console::finish(if late { exit::BUDGET_BROKEN } else { exit::PROCESS_LOST })
        }
    }
}

/// From now on this process does not outlive its parent, which must be the launcher of `namespace`.
///
/// Programs other than ours the launcher binds before they begin ([`realtime::die_with_parent`]).
pub fn die_with_launcher(namespace: &str) -> Result<(), SessionError> {
    // Fails only for a signal number that does not exist.
    let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
    // A launcher that died before that sends no signal any more: then the parent is another.
    let parent = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get());
    let launcher = Domain::find(namespace)?.launcher_pid();
    if parent == launcher { Ok(()) } else { Err(SessionError::Orphan(namespace.into())) }
}

fn usage(name: &str) -> ExitCode {
    console::eprint_line(&format!(
        "usage: {name} --namespace NAME [--epoch NUMBER [--settings FILE]]\nThe launcher starts this program, which ends with it."
    ));
    console::finish(exit::USAGE)
}
