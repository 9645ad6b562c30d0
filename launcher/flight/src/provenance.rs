//! Origin of a run: date, command, commit, host, and the scheduling that the kernel granted. Read from `/proc`; the
//! commit comes from git when the launcher is built (`build.rs`). A value that cannot be read is null, 0 or empty.

use std::collections::BTreeMap;
use std::fmt::{self, Display, Formatter};
use std::fs::read_to_string;
use std::sync::OnceLock;
use std::time::SystemTime;

use contract::topic::NODES;
use machine::Granted;
use rustix::system::uname;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use settings::{Scenario, to_toml};

/// Version of run.json and of the results of `trefoil measure`; grows with every change that affects readers. A file
/// without a version has version 1.
pub const SCHEMA_VERSION: u32 = 6;

/// Scheduling and locked memory of a process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ProcessScheduling {
    /// Scheduling policy: `fifo` or `other`.
    pub policy: String,
    /// `SCHED_FIFO` priority, 0 for `other`.
    pub priority: u32,
    /// CPUs that the process may run on, as the kernel lists them.
    pub affinity: String,
    /// Locked memory \[kB\].
    pub locked_kb: u64,
    /// Largest CPU time without sleeping (`RLIMIT_RTTIME`) \[us\]; null if unlimited.
    pub rttime_us: Option<u64>,
}

/// The `provenance` table of run.json.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Provenance {
    #[serde(flatten)]
    pub host: Host,
    /// Scheduling that the kernel gave each process; empty for a flight in process.
    pub scheduling: BTreeMap<String, ProcessScheduling>,
    /// Settings of the flight as a scenario file, with the faults and swaps ordered while it flew.
    pub scenario: String,
}

/// Date, program and host of a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Host {
    /// Version of this form of results.
    pub schema_version: u32,
    /// Date in UTC, RFC 3339.
    pub date: String,
    /// Command line of the program.
    pub command: Vec<String>,
    /// Commit of the program; null if the build did not know the commit.
    pub git: Option<Git>,
    /// Name of the host.
    pub host: String,
    /// Version of the program.
    pub version: String,
    /// Release of the kernel.
    pub kernel: Option<String>,
    /// Model of the processor.
    pub cpu: Option<String>,
    /// Number of processors that the program may use.
    pub cores: Option<usize>,
    /// Load of the host, as in `/proc/loadavg`.
    pub load: Option<String>,
}

/// Commit of a program, and whether its sources differed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Git {
    /// Hash of the commit.
    pub commit: String,
    /// `true` if the sources differed from the commit.
    pub changed: bool,
}

/// Commit of this program, set once by its `main`; empty if the build does not know the commit.
pub static BUILT_FROM: OnceLock<Git> = OnceLock::new();

/// Identity of a program of this repository, as written into its logs and results.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ProgramIdentity {
    pub version: String,
    /// Commit from which the program was built; `None` if the build did not know the commit.
    pub git: Option<Git>,
}

impl ProgramIdentity {
    /// Returns the identity of the running program.
    pub fn this() -> Self {
        Self { version: env!("CARGO_PKG_VERSION").into(), git: BUILT_FROM.get().cloned() }
    }

    /// Returns whether both programs are known to be built from the same sources.
    pub fn is_same(&self, other: &Self) -> bool {
        self == other && self.git.as_ref().is_some_and(|git| !git.changed)
    }
}

impl Display for ProgramIdentity {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "version {}", self.version)?;
        let Some(Git { commit, changed }) = &self.git else { return f.write_str(" of an unknown commit") };
        let changed = if *changed { " with changed sources" } else { "" };
        write!(f, " commit {}{changed}", commit.get(..12).unwrap_or(commit))
    }
}

/// Reads from `/proc` how process `pid` is scheduled.
pub fn scheduling_of(pid: u32) -> ProcessScheduling {
    let stat = read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // Fields 40 and 41, counted after the name in brackets, which may hold blanks.
    let fields: Vec<&str> = stat.rsplit_once(')').map_or(vec![], |(_, rest)| rest.split_whitespace().collect());
    let field = |i: usize| fields.get(i - 3).and_then(|f| f.parse::<u32>().ok()).unwrap_or(0);
    let limits = read_to_string(format!("/proc/{pid}/limits")).unwrap_or_default();
    let rttime = limits.lines().find_map(|line| line.strip_prefix("Max realtime timeout")?.split_whitespace().next());
    ProcessScheduling {
        policy: if field(41) == 1 { "fifo" } else { "other" }.into(),
        priority: field(40),
        affinity: status_of(pid, "Cpus_allowed_list:").unwrap_or_default(),
        locked_kb: status_of(pid, "VmLck:").and_then(|kb| kb.parse().ok()).unwrap_or(0),
        rttime_us: rttime.and_then(|us| us.parse().ok()),
    }
}

/// Counts the nodes that got each privilege; `None` if the scheduling of no node was recorded.
pub fn granted<'a>(scheduling: impl IntoIterator<Item = (&'a String, &'a ProcessScheduling)>) -> Option<Granted> {
    let is_node = |(name, _): &(&String, _)| NODES.contains(&name.as_str());
    let nodes: Vec<&ProcessScheduling> = scheduling.into_iter().filter(is_node).map(|(_, got)| got).collect();
    let count = |has: fn(&ProcessScheduling) -> bool| nodes.iter().filter(|got| has(got)).count();
    let counted = || Granted { fifo: count(|got| got.policy == "fifo"), locked: count(|got| got.locked_kb > 0) };
    (!nodes.is_empty()).then(counted)
}

/// Reads a field of `/proc/PID/status`, up to the first blank; `name` ends with its colon. `None` if the field or the
/// process is not there.
pub fn status_of(pid: u32, name: &str) -> Option<String> {
    let status = read_to_string(format!("/proc/{pid}/status")).ok()?;
    let field = status.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next());
    field.map(str::to_owned)
}

/// Returns the provenance of a flight of `scenario`; `scheduling` is what the kernel gave to each of its processes.
pub fn provenance(scenario: &Scenario, scheduling: &[(String, ProcessScheduling)]) -> Provenance {
    Provenance { host: host(), scheduling: scheduling.iter().cloned().collect(), scenario: to_toml(scenario) }
}

/// Returns date, program and host of a result of the running program.
pub fn host() -> Host {
    let line = |path: &str| read_to_string(path).ok().map(|text| text.trim().to_owned());
    let cpu = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu = cpu.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name.to_owned()));
    let ProgramIdentity { version, git } = ProgramIdentity::this();
    Host {
        schema_version: SCHEMA_VERSION,
        date: humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        command: std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect(),
        git,
        host: uname().nodename().to_string_lossy().into_owned(),
        version,
        kernel: line("/proc/sys/kernel/osrelease"),
        cpu,
        cores: std::thread::available_parallelism().map(std::num::NonZero::get).ok(),
        load: line("/proc/loadavg"),
    }
}
