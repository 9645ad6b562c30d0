//! Origin of a run: date, command, commit, host, and the scheduling that the kernel granted. Read from `/proc`; the
//! commit comes from git when the launcher is built (`build.rs`). A value that cannot be read is null, 0 or empty.

use std::fmt::{self, Display, Formatter};
use std::fs::read_to_string;
use std::sync::OnceLock;
use std::time::SystemTime;

use contract::Scenario;
use contract::scenario::to_toml;
use rustix::system::uname;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// Version of run.json and of the results of `launcher measure`; grows with every change that affects readers. A file
/// without a version has version 1.
const SCHEMA_VERSION: u32 = 2;

/// Scheduling and memory limits of a process.
#[derive(Debug, Clone, Serialize)]
pub struct Scheduling {
    /// `fifo` or `other`.
    pub policy: &'static str,
    /// `SCHED_FIFO` priority, 0 for `other`.
    pub priority: u32,
    /// CPUs that it may run on, as the kernel lists them.
    pub affinity: String,
    /// Locked memory \[kB\].
    pub locked_kb: u64,
    /// Largest CPU time without sleeping (`RLIMIT_RTTIME`) \[us\]; `None` if unlimited.
    pub rttime_us: Option<u64>,
}

/// Commit from which the program was built.
#[derive(Debug)]
pub struct BuiltFrom {
    pub commit: &'static str,
    /// `true` if the sources differed from the commit.
    pub changed: bool,
}

/// Commit of this program, set once by its `main`; empty if the build does not know it.
pub static BUILT_FROM: OnceLock<BuiltFrom> = OnceLock::new();

/// Identity of a program of this repository, as written into its logs and results.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Program {
    pub version: String,
    /// Commit from which it was built, if its build knew.
    pub commit: Option<String>,
    /// `true` if the sources differed from the commit.
    pub changed: bool,
}

impl Program {
    /// Returns the identity of the running program.
    pub fn this() -> Self {
        let built = BUILT_FROM.get();
        Self {
            version: env!("CARGO_PKG_VERSION").into(),
            commit: built.map(|built| built.commit.into()),
            changed: built.is_some_and(|built| built.changed),
        }
    }

    /// Returns whether both are known to be built from the same sources.
    pub fn is_same(&self, other: &Self) -> bool {
        self == other && self.commit.is_some() && !self.changed
    }
}

impl Display for Program {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "version {}", self.version)?;
        match &self.commit {
            Some(commit) => write!(f, " commit {}", commit.get(..12).unwrap_or(commit))?,
            None => write!(f, " of an unknown commit")?,
        }
        f.write_str(if self.changed { " with changed sources" } else { "" })
    }
}

/// Reads from `/proc` how process `pid` is scheduled.
pub fn scheduling_of(pid: u32) -> Scheduling {
    let stat = read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
    // Fields 40 and 41, counted after the name in brackets, which may hold blanks.
    let fields: Vec<&str> = stat.rsplit_once(')').map_or(vec![], |(_, rest)| rest.split_whitespace().collect());
    let field = |i: usize| fields.get(i - 3).and_then(|f| f.parse::<u32>().ok()).unwrap_or(0);
    let limits = read_to_string(format!("/proc/{pid}/limits")).unwrap_or_default();
    let rttime = limits.lines().find_map(|line| line.strip_prefix("Max realtime timeout")?.split_whitespace().next());
    Scheduling {
        policy: if field(41) == 1 { "fifo" } else { "other" },
        priority: field(40),
        affinity: status_of(pid, "Cpus_allowed_list:").unwrap_or_default(),
        locked_kb: status_of(pid, "VmLck:").and_then(|kb| kb.parse().ok()).unwrap_or(0),
        rttime_us: rttime.and_then(|us| us.parse().ok()),
    }
}

/// Reads a field of `/proc/PID/status`, up to the first blank; `name` ends with its colon. `None` if it is not there.
pub fn status_of(pid: u32, name: &str) -> Option<String> {
    let status = read_to_string(format!("/proc/{pid}/status")).ok()?;
    let field = status.lines().find_map(|line| line.strip_prefix(name)?.split_whitespace().next());
    field.map(str::to_owned)
}

/// Returns the `provenance` table of run.json: [`host`], the scenario, and the scheduling of each process.
pub fn provenance(scenario: &Scenario, scheduling: &[(String, Scheduling)]) -> Value {
    let scheduling: Map<String, Value> = scheduling.iter().map(|(name, s)| (name.clone(), json!(s))).collect();
    let mut provenance = host();
    provenance["scheduling"] = json!(scheduling);
    provenance["scenario"] = json!(to_toml(scenario));
    provenance
}

/// Returns date, host and program of a result; run.json and the results of `launcher measure` have it.
pub fn host() -> Value {
    let line = |path: &str| read_to_string(path).ok().map(|text| text.trim().to_owned());
    let cpu = read_to_string("/proc/cpuinfo").unwrap_or_default();
    let cpu = cpu.lines().find_map(|l| l.strip_prefix("model name")?.split_once(": ").map(|(_, name)| name.to_owned()));
    let Program { version, commit, changed } = Program::this();
    let git = commit.map(|commit| json!({ "commit": commit, "changed": changed }));
    let command: Vec<String> = std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect();
    json!({
        "schema_version": SCHEMA_VERSION,
        "date": humantime::format_rfc3339_seconds(SystemTime::now()).to_string(),
        "command": command,
        "git": git,
        "host": uname().nodename().to_string_lossy(),
        "version": version,
        "kernel": line("/proc/sys/kernel/osrelease"),
        "cpu": cpu,
        "cores": std::thread::available_parallelism().map(std::num::NonZero::get).ok(),
        "load": line("/proc/loadavg"),
    })
}
