//! Events around the processes of a run: files lost in shared memory, and the scenario's faults of host and intruders.
//!
//! Nothing here ends a flight. The roles handle a process that dies, or fails to start, for lack of a file.

use std::io::{BufRead, BufReader, Read};
use std::ops::Range;
use std::process::{Child, ChildStdout, Stdio};
use std::sync::atomic::AtomicU32;

use anyhow::{Context, ensure};
use contract::Scenario;
use contract::scenario::{Fault, FaultKind, FaultTarget, Mode};
use contract::topic::Topic;
use runtime::domain::Domain;
use runtime::port;
use serde_json::json;

use super::children::{Children, kill, wait};
use super::files::{Files, Loss};
use crate::event::{Event, What};
use crate::intruder::{LET_IN, REFUSED, SENT};
use crate::limits::LEAVE_LIMIT;
use crate::own_program;

/// Name by which events call the surroundings of the processes.
const HOST: &str = "host";

pub struct Host {
    domain: Domain,
    lockstep: bool,
    /// Faults that the launcher itself injects and that are still to begin, with their ticks.
    faults: Vec<(Fault, Range<u64>)>,
    intruders: Vec<Intruder>,
    files: Files,
    /// Events since the last look.
    events: Vec<Event>,
}

struct Intruder {
    who: String,
    child: Child,
    words: BufReader<ChildStdout>,
}

impl Host {
    pub fn new(domain: Domain, scenario: &Scenario) -> anyhow::Result<Self> {
        let ours = |fault: &&Fault| fault.kind.is_intrusion() || fault.kind == FaultKind::ShmRemoved;
        let with_ticks = |fault: &Fault| (*fault, fault.ticks(scenario.sample_s()));
        let faults: Vec<_> = scenario.fault.iter().filter(ours).map(with_ticks).collect();
        let needs_root = faults.iter().any(|(fault, _)| fault.kind == FaultKind::WrongUser);
        ensure!(
            !needs_root || rustix::process::geteuid().is_root(),
            "the fault wrong-user starts a process of another user, which only root can: fly as root or without it"
        );
        let lockstep = scenario.run.mode == Mode::Lockstep;
        Ok(Self { files: Files::new(domain.clone()), domain, lockstep, faults, intruders: vec![], events: vec![] })
    }

    /// Injects the faults due at `tick`, and returns the events since the last look.
    pub fn look(&mut self, tick: u64, children: &Children) -> Vec<Event> {
        let (due, later): (Vec<_>, _) =
            std::mem::take(&mut self.faults).into_iter().partition(|(_, ticks)| tick >= ticks.start);
        self.faults = later;
        for (fault, ticks) in due {
            self.inject(&fault, ticks.end, tick, children);
        }
        while let Some(i) = self.intruders.iter_mut().position(|one| !matches!(one.child.try_wait(), Ok(None))) {
            let intruder = self.intruders.remove(i);
            self.write_down(tick, intruder);
        }
        let living: Vec<u32> =
            children.all.iter().map(|process| process.child.id()).chain([std::process::id()]).collect();
        for (loss, path) in self.files.look(&living) {
            let what = if loss == Loss::Removed { What::ShmRemoved } else { What::ShmCutShort };
            self.note(tick, what, &path.display().to_string());
        }
        std::mem::take(&mut self.events)
    }

    /// Waits for the intruders, which leave with the run, and returns what they report as events.
    pub fn finish(&mut self, tick: u64, interrupts: &AtomicU32) -> Vec<Event> {
        for mut intruder in std::mem::take(&mut self.intruders) {
            let _ = wait(&mut intruder.child, &intruder.who, LEAVE_LIMIT, interrupts); // a killed one reports nothing
            self.write_down(tick, intruder);
        }
        std::mem::take(&mut self.events)
    }

    fn note(&mut self, tick: u64, what: What, why: &str) {
        self.events.push(Event::new(tick, HOST, 0, what).because(why));
    }

    fn inject(&mut self, fault: &Fault, until: u64, tick: u64, children: &Children) {
        if let Some(topic) = fault.process.and_then(FaultTarget::process) {
            self.remove_segments_of(topic, children);
        } else if let Some(topic) = fault.target.topic() {
            let kind = json!(fault.kind).as_str().unwrap_or_default().to_owned();
            let who = format!("{} {kind}", topic.name());
            match self.send_in(&who, topic, &kind, until) {
                Ok(intruder) => self.intruders.push(intruder),
                Err(error) => {
                    let detail = format!("{who}: {error:#}");
                    self.note(tick, What::IntruderFailed, &detail);
                }
            }
        }
    }

    fn remove_segments_of(&self, topic: Topic, children: &Children) {
        let of_it: Vec<u32> = children.all.iter().filter(|p| p.topic == Some(topic)).map(|p| p.child.id()).collect();
        for (path, _) in self.domain.files() {
            let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
            if port::makers(&name).next().is_some_and(|maker| of_it.contains(&maker)) {
                // Fails if the file is gone already, which is what the fault wants.
                let _ = std::fs::remove_file(path);
            }
        }
    }

    /// Starts an intruder. In lockstep, where a flight may be over before a process has begun, waits until it is in
    /// place: time stands still meanwhile.
    fn send_in(&self, who: &str, topic: Topic, kind: &str, until: u64) -> anyhow::Result<Intruder> {
        let mut command = own_program();
        command.args(["intrude", "--namespace", self.domain.namespace(), "--topic", topic.name(), "--kind", kind]);
        command.args(["--until", &until.to_string()]).stdin(Stdio::null()).stdout(Stdio::piped());
        let mut child = command.spawn().context("cannot start it")?;
        let mut words = BufReader::new(child.stdout.take().context("it has no stdout")?);
        if self.lockstep {
            let _ = words.fill_buf(); // returns when it is ready, reports its result or ends
        }
        Ok(Intruder { who: who.into(), child, words })
    }

    /// Adds the last line that an intruder, which has ended, has written to the events.
    fn write_down(&mut self, tick: u64, mut intruder: Intruder) {
        let mut words = String::new();
        let _ = intruder.words.read_to_string(&mut words); // what cannot be read is left out
        let last = words.lines().last().unwrap_or("it ended without a word");
        let what = match last {
            word if word.starts_with(REFUSED) => What::IntruderRefused,
            word if word.starts_with(LET_IN) => What::IntruderLetIn,
            word if word.starts_with(SENT) => What::IntruderSpoke,
            _ => What::IntruderFailed,
        };
        self.note(tick, what, &format!("{}: {last}", intruder.who));
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        self.intruders.iter_mut().for_each(|intruder| kill(&mut intruder.child));
    }
}
