//! State of a process, such as limits and environment variables, that a library may change for all later flights in it.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::PathBuf;
use std::{env, fs};

use rustix::process::{WaitId, WaitIdOptions, waitid};

/// Fields of `/proc/self/status` that change only if a library changes them: users, signals, CPUs.
const STAY: [&str; 10] =
    ["Umask:", "Uid:", "Gid:", "Groups:", "SigBlk:", "SigIgn:", "SigCgt:", "NoNewPrivs:", "Seccomp:", "Cpus_allowed:"];

/// Surroundings of this process.
#[derive(Debug, PartialEq, Eq)]
pub struct ProcessSurroundings {
    status: Vec<String>,
    limits: String,
    /// Working directory; `None` if it was removed.
    folder: Option<PathBuf>,
    variables: BTreeMap<OsString, OsString>,
    has_children: bool,
}

impl ProcessSurroundings {
    /// Reads the present surroundings; a part that cannot be read is empty.
    pub fn now() -> Self {
        let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
        let stays = |line: &&str| STAY.iter().any(|field| line.starts_with(field));
        // The call fails if there are no children; an ended process that was not waited for counts as a child.
        let any = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        Self {
            status: status.lines().filter(stays).map(str::to_owned).collect(),
            limits: fs::read_to_string("/proc/self/limits").unwrap_or_default(),
            folder: env::current_dir().ok(),
            variables: env::vars_os().collect(),
            has_children: waitid(WaitId::All, any).is_ok(),
        }
    }
}
