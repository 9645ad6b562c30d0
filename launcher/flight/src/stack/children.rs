//! Children of the launcher: starts them, signals them, waits for them, and removes their ports and descendants.
//!
//! Each child has a process group of its own. The processes that it starts in turn are in that group: they get the same
//! signals, and do not outlive it. Processes of users' code that leave the group are killed too ([`crate::strays`]).

use std::fs::File;
use std::io::ErrorKind;
use std::os::fd::{BorrowedFd, OwnedFd};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use anyhow::Context;
use contract::topic::Topic;
use runtime::domain::Domain;
use runtime::port::Bus;
use runtime::realtime::die_with_parent;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, WaitId, WaitIdOptions, kill_process_group, pidfd_open, waitid};
use rustix::time::Timespec;
use settings::file::read_text;
use settings::{NodeSettings, ProgramKind};

use super::end::ChildExit;
use super::one_cpu::OneCpu;
use crate::event::{self, Event};
use crate::limits::{CLEAN_UP_LIMIT, KILL_LIMIT, SAY_AFTER};
use crate::own_program;
use crate::provenance::status_of;
use crate::strays::ChildMark;
use runtime::console::eprint_line;

/// Longest output of a program whose last lines are shown \[bytes\]; of a longer output nothing is shown.
const MOST_OUTPUT_BYTES: u64 = 1 << 20;
/// Number of last lines of the output that are shown.
const LAST_LINES: usize = 5;

/// Name of the recorder's process.
pub const RECORDER: &str = "recorder";

#[derive(Clone, Copy, Default)]
pub struct SpawnRequest<'a> {
    /// Topic that the process publishes on; `None` for the recorder.
    pub topic: Option<Topic>,
    pub epoch: u32,
    /// File that the recorder writes.
    pub log: Option<&'a Path>,
    /// Program of a node other than the launcher's own core.
    pub program: Option<&'a NodeSettings>,
    /// File with the settings of this process, if they are not those of the run.
    pub settings: Option<&'a Path>,
    /// `true` if the process is confined to the CPU of the flight; `false` for the recorder, and for a node whose
    /// settings name CPUs. Such a node takes these CPUs itself, perhaps before this thread continues.
    pub shares_cpu: bool,
}

pub struct ChildProcess {
    /// Topic that the process publishes on; `None` for the recorder.
    pub topic: Option<Topic>,
    pub epoch: u32,
    pub child: Child,
    /// `true` if the process was killed on purpose.
    pub killed: bool,
    /// `true` if [`wait`] was called for this node at the end: dropping the children need not kill it.
    pub awaited: bool,
    /// File with the output of the process, for a program or library of a user.
    output: Option<PathBuf>,
    /// Mark of the process and its descendants, for a program or library of a user.
    mark: Option<ChildMark>,
    /// Descriptor that becomes readable when the process ends.
    pidfd: Option<OwnedFd>,
}

impl ChildProcess {
    /// Prints the last lines that the program of a user has written.
    pub fn tell_output(&self) {
        let text = self.output.as_ref().and_then(|path| read_text(path, MOST_OUTPUT_BYTES).ok()).unwrap_or_default();
        let lines: Vec<&str> = text.lines().collect();
        lines[lines.len().saturating_sub(LAST_LINES)..].iter().for_each(|line| eprint_line(line));
    }

    /// Name of the node, or of the recorder.
    pub fn name(&self) -> &'static str {
        name_of(self.topic)
    }
}

fn name_of(topic: Option<Topic>) -> &'static str {
    topic.map_or(RECORDER, Topic::publisher)
}

/// Children of a run. Dropping the value kills the processes that are left.
pub struct Children {
    domain: Domain,
    /// CPU that the nodes are confined to. The recorder is not confined, because the ring does not wait for it.
    one_cpu: Option<OneCpu>,
    /// Folder for the output of programs of users; `None` if it goes to the output of the launcher.
    pub outputs: Option<PathBuf>,
    /// Children that have not been seen to end.
    pub all: Vec<ChildProcess>,
    /// Number of events that were sent to a recorder.
    pub told: usize,
    cleaners: Vec<JoinHandle<()>>,
}

/// Says which process cannot be started, and from which file.
fn cannot_start(name: &str, executable: Option<&str>) -> String {
    let own = || std::env::current_exe().map_or_else(|_| "the launcher".into(), |path| path.display().to_string());
    executable.map_or_else(|| format!("cannot start {name} from {}", own()), |file| format!("cannot start {file}"))
}

impl Children {
    pub fn new(domain: Domain, one_cpu: Option<OneCpu>) -> Self {
        Self { domain, one_cpu, outputs: None, all: vec![], told: 0, cleaners: vec![] }
    }

    pub fn spawn(&mut self, request: &SpawnRequest) -> anyhow::Result<()> {
        let SpawnRequest { topic, epoch, log, program, settings, shares_cpu } = *request;
        let name = name_of(topic);
        let executable = program.filter(|program| program.kind() == ProgramKind::Executable);
        let mut command = if let Some(program) = executable {
            let mut foreign = Command::new(&program.exec);
            foreign.args(&program.args);
            die_with_parent(&mut foreign); // our own processes set this themselves
            foreign
        } else {
            let mut own = own_program();
            own.args(["node", name]);
            own
        };
        command.envs(program.iter().flat_map(|program| &program.env));
        command.args(["--namespace", self.domain.namespace(), "--epoch", &epoch.to_string()]);
        let talks = || if topic.is_none() { Stdio::piped() } else { Stdio::null() }; // pipes to and from the recorder
        command.stdin(talks()).stdout(talks());
        let is_ours = program.is_none_or(|program| program.kind() == ProgramKind::Own);
        let mark = (!is_ours).then(|| ChildMark::on(&mut command));
        let folder = self.outputs.as_ref().filter(|_| !is_ours && topic.is_some());
        let output = folder.map(|folder| folder.join(format!("{name}.{epoch}.log")));
        if let Some(path) = &output {
            let file = File::create(path).with_context(|| format!("cannot write {}", path.display()))?;
            command.stdout(file.try_clone()?).stderr(file);
        }
        for (option, path) in [("--log", log), ("--settings", settings)] {
            if let Some(path) = path {
                command.arg(option).arg(path);
            }
        }
        // A process in a group of its own gets no Ctrl-C of the terminal: the launcher stops the nodes in order.
        let child = command.process_group(0).spawn().map_err(|error| {
            let cannot = cannot_start(name, executable.map(|program| program.exec.as_str()));
            let is_crowded = error.kind() == ErrorKind::WouldBlock;
            let raise = if is_crowded { "; allow this user more processes (`ulimit -u`)" } else { "" };
            anyhow::Error::new(error).context(format!("{cannot}{raise}"))
        })?;
        if let Some(one_cpu) = self.one_cpu.as_ref().filter(|_| shares_cpu) {
            one_cpu.confine(&child);
        }
        let pidfd = Pid::from_raw(child.id() as i32).and_then(|pid| pidfd_open(pid, PidfdFlags::empty()).ok());
        let never_waits = child.stdin.as_ref().map_or(Ok(()), event::never_wait);
        self.all.push(ChildProcess { topic, epoch, child, killed: false, awaited: false, output, mark, pidfd });
        never_waits.with_context(|| format!("cannot set up the pipe to {name}"))
    }

    /// Returns the index of a child that has ended, and how it ended. Failures are returned before clean ends.
    pub fn exited(&mut self) -> Option<(usize, ChildExit)> {
        let ended = self.all.iter_mut().enumerate().filter_map(|(i, process)| {
            let status = ended(&mut process.child)?;
            Some((i, ChildExit::of(status)))
        });
        ended.max_by_key(|(_, how)| how.gravity())
    }

    /// Sends the newest recorder the `events` that were sent to no recorder yet, as many as its pipe takes.
    pub fn tell(&mut self, events: &[Event]) {
        let Some(pipe) = self.all.iter().rev().find_map(|process| process.child.stdin.as_ref()) else { return };
        self.told += events.iter().skip(self.told).take_while(|event| event::send(pipe, event)).count();
    }

    /// Forgets child `i`, which has ended, kills the processes that it left, and removes the ports that dead processes
    /// left in the services. A thread does the last two, because they take longer than a role may be vacant.
    pub fn clean_up(&mut self, i: usize) {
        let mark = self.all.remove(i).mark;
        let domain = self.domain.clone();
        let clean_up = move || {
            mark.iter().for_each(ChildMark::kill_all);
            let _ = Bus::remove_dead_ports(&domain); // ports that stay are wiped at the end of the run
        };
        self.cleaners.retain(|cleaner| !cleaner.is_finished());
        self.cleaners.extend(std::thread::Builder::new().name("cleaner".into()).spawn(clean_up).ok());
    }

    /// Signals the process `epoch` of a node, or of the recorder if `topic` is `None`; does nothing if there is no such
    /// process.
    pub fn signal(&mut self, topic: impl Into<Option<Topic>>, epoch: u32, signal: Signal) {
        let topic = topic.into();
        let is = |process: &&mut ChildProcess| process.topic == topic && process.epoch == epoch;
        for process in self.all.iter_mut().filter(is) {
            process.killed |= signal == Signal::KILL;
            // The signal fails for a process that has just ended; the next look finds that process.
            let _ = kill_process_group(Pid::from_child(&process.child), signal);
        }
    }

    /// Lets the stopped processes of the nodes run again.
    pub fn go_on(&self) {
        for process in self.all.iter().filter(|process| process.topic.is_some()) {
            let _ = kill_process_group(Pid::from_child(&process.child), Signal::CONT); // it may have ended
        }
    }

    /// Returns whether a debugger traces a child, or a process that a child (which may be a debugger itself) has
    /// started.
    pub fn any_traced(&self) -> bool {
        let is_traced = |pid: u32| status_of(pid, "TracerPid:").is_some_and(|tracer| tracer != "0");
        let started_by = |pid: u32| -> Vec<u32> {
            let pids = std::fs::read_to_string(format!("/proc/{pid}/task/{pid}/children")).unwrap_or_default();
            pids.split_whitespace().filter_map(|pid| pid.parse().ok()).collect()
        };
        let pids = self.all.iter().map(|process| process.child.id());
        { pids }.any(|pid| is_traced(pid) || started_by(pid).into_iter().any(is_traced))
    }

    /// Sleeps until `due`, or until a child ends, which is noticed at once, or one of `others` is readable.
    pub fn sleep<'a>(&'a self, others: impl Iterator<Item = BorrowedFd<'a>>, due: Instant) {
        let ends = self.all.iter().filter_map(|p| p.pidfd.as_ref()).map(|fd| PollFd::new(fd, PollFlags::IN));
        let others = others.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN));
        let left = Timespec::try_from(due.saturating_duration_since(Instant::now())).ok();
        let _ = poll(&mut ends.chain(others).collect::<Vec<_>>(), left.as_ref()); // an early return is an early look
    }
}

impl Drop for Children {
    fn drop(&mut self) {
        self.all.iter_mut().filter(|process| !process.awaited).for_each(|process| kill(&mut process.child));
        self.all.iter().filter_map(|process| process.mark.as_ref()).for_each(ChildMark::kill_all);
        // A clean-up thread that still works could leave files after the wipe that follows; a stuck thread is left
        // behind.
        let deadline = Instant::now() + CLEAN_UP_LIMIT;
        while self.cleaners.iter().any(|cleaner| !cleaner.is_finished()) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

/// Waits for `child`, called `name`, to end and returns its status; after `limit` or at a second interrupt kills it and
/// returns `None`.
pub fn wait(child: &mut Child, name: &str, limit: Duration, interrupts: &AtomicU32) -> Option<ExitStatus> {
    let note = || format!("waiting up to {} s for the {name} to end; Ctrl-C twice kills it", limit.as_secs());
    let ended = wait_for_end(child, limit, note, || interrupts.load(Ordering::Relaxed) > 1);
    if ended.is_none() {
        kill(child);
    }
    ended
}

/// Waits for `child` to end, at most `limit` or until `is_over`, and returns its status; prints `note` if the wait
/// takes longer than `SAY_AFTER`.
fn wait_for_end(
    child: &mut Child,
    limit: Duration,
    note: impl Fn() -> String,
    is_over: impl Fn() -> bool,
) -> Option<ExitStatus> {
    let started = Instant::now();
    let mut told = limit <= SAY_AFTER;
    loop {
        let ended = ended(child);
        if ended.is_some() || started.elapsed() > limit || is_over() {
            return ended;
        }
        if !told && started.elapsed() > SAY_AFTER {
            told = true;
            eprint_line(&note());
        }
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// Returns the status of `child` if it has ended, and kills the processes that it left in its group.
fn ended(child: &mut Child) -> Option<ExitStatus> {
    let pid = Pid::from_child(child);
    match waitid(WaitId::Pid(pid), WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT) {
        Ok(None) => return None,
        // No other process can have the child's ID before the child is waited for. Fails for a child without a group.
        Ok(Some(_)) => _ = kill_process_group(pid, Signal::KILL),
        Err(_) => {} // the child was waited for before
    }
    child.try_wait().ok().flatten()
}

/// Kills `child` with its group, if it has one, and waits for its end; a child that does not end is left behind.
pub fn kill(child: &mut Child) {
    if ended(child).is_some() {
        return;
    }
    let _ = kill_process_group(Pid::from_child(child), Signal::KILL);
    let _ = child.kill();
    let (limit_s, pid) = (KILL_LIMIT.as_secs(), child.id());
    let note = || {
        format!(
            "waiting up to {limit_s} s for process {pid}, which was killed and does not end: is it frozen, or in a device?"
        )
    };
    wait_for_end(child, KILL_LIMIT, note, || false);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_cannot_be_started_is_told_with_its_file() {
        let own = std::env::current_exe().unwrap();
        assert_eq!(cannot_start("guidance", None), format!("cannot start guidance from {}", own.display()));
        assert_eq!(cannot_start("mixer", Some("/opt/mine")), "cannot start /opt/mine");
    }
}
