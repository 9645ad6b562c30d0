//! Processes that code of users has started and left behind, outside the process group of the child that they came from
//! (`setsid`, `daemon`). They are found by an environment variable that each child begins with and its descendants
//! inherit.

use std::fs;
use std::process::Command;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use runtime::realtime::now_ns;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};

use crate::limits::KILL_LIMIT;

/// Environment variable that holds the mark.
const NAME: &str = "TREFOIL_STARTED_BY";

/// Largest number of times that the environment variables of a process are read.
const LOOKS: usize = 6;

/// Beginning of all marks that this launcher gives; set with the first mark.
static OWN: OnceLock<String> = OnceLock::new();

/// Mark of one child and of all processes that come from it.
#[derive(Debug, Clone)]
pub struct ChildMark(String);

impl ChildMark {
    /// Marks the child that `command` will start.
    pub fn on(command: &mut Command) -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        // The mark contains the time, because a process of an earlier launcher with the same process ID may still run.
        let own = OWN.get_or_init(|| format!("{}-{}-", std::process::id(), now_ns()));
        let mark = Self(format!("{own}{}\0", NEXT.fetch_add(1, Ordering::Relaxed)));
        command.env(NAME, mark.0.trim_end_matches('\0'));
        mark
    }

    /// Kills the processes that have this mark, the child included.
    pub fn kill_all(&self) {
        kill_all(&self.0);
    }
}

/// Kills the processes that children of this launcher have left behind.
pub fn kill_all_of_this_launcher() {
    OWN.get().inspect(|own| kill_all(own));
}

/// Kills the processes whose mark begins with `beginning`, until none is left, for at most [`KILL_LIMIT`]: a process
/// may start another one meanwhile.
fn kill_all(beginning: &str) {
    let started = Instant::now();
    while kill_each(format!("{NAME}={beginning}").as_bytes()) && started.elapsed() < KILL_LIMIT {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Kills, once, each process that has an environment variable with this `beginning`; returns whether it killed any.
fn kill_each(beginning: &[u8]) -> bool {
    let mut found = false;
    let processes = fs::read_dir("/proc").into_iter().flatten().flatten();
    for pid in processes.filter_map(|entry| Pid::from_raw(entry.file_name().to_str()?.parse().ok()?)) {
        // The process is opened before its variables are read, so that the signal reaches no other process with the
        // same ID.
        let Ok(process) = pidfd_open(pid, PidfdFlags::empty()) else { continue };
        let variables = variables_of(pid);
        let is_marked = variables.starts_with(beginning)
            || variables.windows(beginning.len() + 1).any(|part| part[0] == 0 && &part[1..] == beginning);
        found |= is_marked && pidfd_send_signal(process, Signal::KILL).is_ok();
    }
    found
}

/// Returns the environment variables of a process. During an `exec` a process has none for a moment, and a read may end
/// early. So the variables are read until two reads agree, at most [`LOOKS`] times.
fn variables_of(pid: Pid) -> Vec<u8> {
    let mut before = vec![];
    for _ in 0..LOOKS {
        let Ok(variables) = fs::read(format!("/proc/{}/environ", pid.as_raw_nonzero())) else { break };
        match variables.is_empty() {
            true => std::thread::sleep(Duration::from_millis(1)),
            false if variables == before => break,
            false => before = variables,
        }
    }
    before
}

#[cfg(test)]
mod tests {
    use std::io::{BufRead, BufReader};
    use std::os::unix::process::CommandExt;
    use std::process::Stdio;

    use super::*;

    #[test]
    fn a_process_that_has_left_its_group_is_found_by_the_mark_of_its_parent_and_no_other_is() {
        let shell = |words: &str| {
            let mut command = Command::new("sh");
            command.args(["-c", words]).process_group(0).stdout(Stdio::piped());
            command
        };
        let mut one = shell("setsid sleep 600 & echo $!");
        let mut other = shell("exec sleep 600");
        let (of_one, of_other) = (ChildMark::on(&mut one), ChildMark::on(&mut other));
        let (mut one, mut other) = (one.spawn().unwrap(), other.spawn().unwrap());
        let mut stray = String::new();
        BufReader::new(one.stdout.take().unwrap()).read_line(&mut stray).unwrap();
        of_one.kill_all();
        one.wait().unwrap();
        let ends = || {
            let state = fs::read_to_string(format!("/proc/{}/stat", stray.trim())).unwrap_or_default();
            state.is_empty() || state.contains(") Z")
        };
        let started = Instant::now();
        while !ends() {
            assert!(started.elapsed() < Duration::from_secs(10), "it was not killed");
        }
        assert!(other.try_wait().unwrap().is_none(), "another mark");
        of_other.kill_all();
        assert!(!other.wait().unwrap().success());
    }
}
