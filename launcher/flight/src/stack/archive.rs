//! Log of a flight: the files of its recorders, joined to one at the end.
//!
//! ```text
//! recorder 1 -> flight.mcap          \
//! (launcher) -> flight.1.rest.mcap    > joined at the end: flight.mcap
//! recorder 2 -> flight.2.mcap        /
//! ```
//!
//! If a recorder dies, the launcher writes the messages that the recorder had not written, and those sent until the
//! next recorder works ([`LogRemainder`]). The nodes are not affected.

use std::collections::{BTreeSet, VecDeque};
use std::io::Read;
use std::os::fd::AsFd;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicU32;
use std::time::{Duration, Instant};

use contract::topic::Topic;
use runtime::console::eprint_line;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use settings::Scenario;

use super::children::{ChildProcess, RECORDER, SpawnRequest, wait};
use super::rest::LogRemainder;
use super::run::{FlightRun, unix};
use crate::event::{self, Event};
use crate::limits::{CATCH_UP_LIMIT, CLOSE_LIMIT, OUTCOME_BYTES};
use crate::log::LogOutcome;
use crate::log::{self, Count, Record};
use crate::recorder::run_of;
use ring::roles::role::{Action, Now, Policy, Role, RoleInput};

/// Log of a flight, with the role of its recorder, which runs by the wall clock in every mode.
pub struct Archive {
    pub role: Role,
    started: Instant,
    path: PathBuf,
    /// Newest stamps of the messages that the launcher has seen, to find gaps.
    count: Count,
    /// Messages sent, as far as `count` tells.
    sent: u64,
    rest: LogRemainder,
    /// Epoch of the recorder that was active last, and epochs of the recorders whose rest the launcher has written.
    active: u32,
    rests: BTreeSet<u32>,
}

impl Archive {
    pub fn new(path: &Path, scenario: &Scenario) -> Self {
        Self {
            role: Role::new(RECORDER, Policy::recorder(&scenario.supervision)),
            started: Instant::now(),
            path: path.into(),
            count: Count::default(),
            sent: 0,
            rest: LogRemainder::new(scenario),
            active: 1,
            rests: BTreeSet::new(),
        }
    }

    /// Takes in one sent message.
    pub fn observe(&mut self, record: &Record) {
        let more = self.count.gap(record).map_or(0, |gap| gap.saturating_add(1));
        self.sent = self.sent.saturating_add(more);
        self.rest.observe(record);
    }

    /// Starts the first recorder, which is active at once.
    pub fn start(&self, run: &mut FlightRun) -> anyhow::Result<()> {
        run.page.recorder.assign(0, |_| Assignment { active: 1, standby: 0 });
        self.spawn(run, 1)
    }

    /// Handles the end of the recorder that is child number `i`, whether it was asked to end or not.
    pub fn exited(&mut self, run: &mut FlightRun, i: usize, tick: u64) {
        self.on(run, tick, RoleInput::Exited(run.children.all[i].epoch));
    }

    /// Supervises the recorder. A flight goes on without a log if need be; the loss is reported at its end.
    pub fn look(&mut self, run: &mut FlightRun, tick: u64) {
        self.rest.look();
        let mut inputs = vec![RoleInput::Tick];
        inputs
            .extend(self.role.starting().filter(|epoch| run.page.recorder.ready.get() == *epoch).map(RoleInput::Ready));
        let (recorded, watched) = (run.page.recorded.count(), run.page.watched.count());
        inputs.push(RoleInput::Progress { done: recorded.into(), samples: watched.into(), excused_ns: 0 });
        for input in inputs {
            self.on(run, tick, input);
        }
    }

    /// Waits until the recorder has all messages, at most `CATCH_UP_LIMIT`; messages that it lacks then count as lost.
    pub fn catch_up(page: &ControlPage) {
        let deadline = Instant::now() + CATCH_UP_LIMIT;
        let is_behind = || page.recorder.active() > 0 && page.recorded.count() < page.watched.count();
        while is_behind() && Instant::now() < deadline {
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Waits until the log is closed, and returns its outcome. All nodes must have left.
    pub fn close(mut self, run: &mut FlightRun, interrupts: &AtomicU32) -> LogOutcome {
        self.look(run, run.page.plant_tick()); // a recorder that is ready takes over now
        let (untold, active) = (run.events.len() - run.children.told, run.page.recorder.active());
        let mut last = None;
        for ChildProcess { epoch, child, .. } in run.children.all.iter_mut().filter(|process| process.topic.is_none()) {
            let starts = self.role.starting() == Some(*epoch);
            wait(child, RECORDER, if starts { Duration::ZERO } else { CLOSE_LIMIT }, interrupts);
            if *epoch == active {
                last = child.stdout.take().and_then(outcome_on);
            }
        }
        let on_topics = Topic::ALL.map(|topic| run.page.role(topic).sent_by_all.get());
        let sent = on_topics.into_iter().chain([run.page.truths_sent.get()]).map(u64::from).sum();
        // After giving up, the rest of the last recorder is written already, and messages sent since are not recorded.
        if last.is_none() && !self.role.given_up() {
            self.write_rest(run);
        }
        self.rest.finish();
        self.outcome(last, &run.scenario, &run.events, untold, sent)
    }

    /// Begins to write the messages that the last active recorder did not write.
    fn write_rest(&mut self, run: &FlightRun) {
        match run_of(run.domain.namespace()) {
            Ok(name) => {
                self.rest.begin(&log::rest(&self.path, self.active), &run.scenario, &name);
                self.rests.insert(self.active);
            }
            Err(error) => eprint_line(&format!("error: {error:#}")),
        }
    }

    /// Gives `input` to the role, and carries out its actions.
    fn on(&mut self, run: &mut FlightRun, tick: u64, input: RoleInput) {
        let now = Now { ns: self.started.elapsed().as_nanos() as u64, tick };
        let mut inputs = VecDeque::from([input]);
        while let Some(input) = inputs.pop_front() {
            for action in self.role.on(now, input) {
                match action {
                    Action::Spawn(epoch, _) => {
                        if let Err(error) = self.spawn(run, epoch) {
                            let why = format!("{error:#}");
                            eprint_line(&format!("error: {why}"));
                            inputs.push_back(RoleInput::NotStarted(epoch, why));
                        }
                    }
                    Action::Signal(epoch, signal) => run.children.signal(None, epoch, unix(signal)),
                    Action::Activate(epoch) => {
                        run.page.recorder.assign(0, |_| Assignment { active: epoch, standby: 0 });
                        run.page.recorded.raise(run.page.watched.count()); // a new recorder gets no earlier message
                        self.active = epoch;
                        self.rest.end();
                        inputs.push_back(RoleInput::Activated(epoch));
                    }
                    Action::Vacate(epoch) => {
                        run.page.recorder.assign(0, |work| work.without(epoch));
                        if run.page.recorder.active() == 0 {
                            self.write_rest(run);
                        }
                    }
                    Action::Report(event) => run.events.push(event),
                    Action::Standby(_) => {} // a recorder has no candidates
                }
            }
        }
        if self.role.given_up() {
            run.page.recorded.raise(u32::MAX); // without a recorder, the plant waits for none
            self.rest.end();
        }
    }

    fn spawn(&self, run: &mut FlightRun, epoch: u32) -> anyhow::Result<()> {
        run.children.spawn(&SpawnRequest { epoch, log: Some(&self.part(epoch)), ..SpawnRequest::default() })
    }

    /// Returns the file that the recorder `epoch` is to write.
    fn part(&self, epoch: u32) -> PathBuf {
        log::part(&self.path, epoch)
    }

    /// Joins the files of all recorders, which have ended, and returns the outcome of the log. `last` is the outcome
    /// that the last recorder printed, `None` if it died. `untold` of the `events` did not reach a recorder; the
    /// processes have sent `sent` messages.
    fn outcome(
        self,
        last: Option<LogOutcome>,
        scenario: &Scenario,
        events: &[Event],
        untold: usize,
        sent: u64,
    ) -> LogOutcome {
        let why = if self.role.given_up() {
            "no recorder was left for the flight"
        } else {
            "the recorder ended before it could close the log"
        };
        let rest = |epoch: u32| self.rests.contains(&epoch).then(|| log::rest(&self.path, epoch));
        let files = (1..=self.role.newest()).flat_map(|epoch| [Some(self.part(epoch)), rest(epoch)]);
        let files: Vec<PathBuf> = files.flatten().collect();
        if files.len() == 1 {
            let lost = || LogOutcome { error: Some(why.into()), ..LogOutcome::default() };
            let last = last.unwrap_or_else(lost);
            // The recorder counts gaps only, so it does not count messages after the last one that reached it.
            let missing = (sent + events.len() as u64).saturating_sub(last.records);
            return LogOutcome { dropped: missing.max(last.dropped + untold as u64), ..last };
        }
        match log::join(&files, scenario, events, self.sent) {
            Ok(outcome) => {
                let lost = || (outcome.dropped > 0).then(|| why.into());
                LogOutcome { error: last.map_or_else(lost, |last| last.error), ..outcome }
            }
            Err(error) => LogOutcome { error: Some(format!("{error:#}")), ..LogOutcome::default() },
        }
    }
}

/// Reads the outcome that a recorder, which has ended, wrote to its pipe. Does not wait for the end of the pipe,
/// because other processes may still hold it.
fn outcome_on(stdout: impl Read + AsFd) -> Option<LogOutcome> {
    event::never_wait(&stdout).ok()?;
    let mut text = vec![];
    let _ = stdout.take(OUTCOME_BYTES).read_to_end(&mut text); // fails if another process still holds the pipe
    serde_json::from_slice(&text).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::event::What;
    use crate::log::LogWriter;
    use contract::message::{Message, Stamp, State};
    use ring::roles::role::{Now, RoleInput};
    use rustix::pipe::{PipeFlags, pipe_with};
    use std::fs::File;

    /// Returns both ends of a pipe into which a recorder has written; the second stands for another process that holds
    /// the pipe.
    fn said(outcome: &LogOutcome) -> (File, File) {
        let (reads, writes) = pipe_with(PipeFlags::CLOEXEC).unwrap();
        rustix::io::write(&writes, &serde_json::to_vec(outcome).unwrap()).unwrap();
        (reads.into(), writes.into())
    }

    fn archive(path: &Path, newest: u32) -> Archive {
        let mut archive = Archive::new(path, &Scenario::default());
        for epoch in 1..=newest {
            LogWriter::create(&archive.part(epoch), "", 10_000_000).unwrap().finish().unwrap();
        }
        for _ in 1..newest {
            let now = Now { ns: 0, tick: 0 };
            let active = archive.role.newest();
            archive.role.on(now, RoleInput::Exited(active));
            archive.role.on(Now { ns: archive.role.due_ns().unwrap(), ..now }, RoleInput::Tick);
        }
        archive
    }

    #[test]
    fn the_end_of_the_pipe_is_not_waited_for() {
        let outcome = LogOutcome { records: 7, dropped: 1, ..LogOutcome::default() };
        let (reads, _writes) = said(&outcome);
        assert_eq!(outcome_on(reads), Some(outcome));
    }

    #[test]
    fn events_that_no_recorder_was_told_of_are_missing_unless_the_log_is_joined() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        let events = [Event::new(1, "mixer", 1, What::Died)];
        for (newest, records, dropped) in [(1, 7, 1), (2, 1, 0)] {
            let last = Some(LogOutcome { records: 7, ..LogOutcome::default() });
            let outcome = archive(&path, newest).outcome(last, &Scenario::default(), &events, 1, 0);
            assert_eq!(outcome, LogOutcome { records, dropped, ..LogOutcome::default() });
        }
    }

    #[test]
    fn a_log_whose_last_recorder_did_not_close_it_is_lost_in_part_unless_the_launcher_has_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("flight.mcap");
        let state = |tick: u64| {
            let stamp = Stamp { tick, sequence: tick + 1, epoch: 1, ..Stamp::default() };
            Record::from(State { stamp, ..State::default() }.with_checksum())
        };
        for (newest, has_rest) in [(1, false), (2, false), (1, true), (2, true)] {
            let mut archive = archive(&path, newest);
            (0..9).for_each(|tick| archive.observe(&state(tick)));
            if has_rest {
                archive.rest.begin(&log::rest(&path, newest), &Scenario::default(), "this");
                archive.rests.insert(newest);
                archive.observe(&state(9));
                archive.rest.finish();
            }
            let outcome = archive.outcome(None, &Scenario::default(), &[], 0, 10);
            let expected = if has_rest { (10, 0, None) } else { (0, if newest == 1 { 10 } else { 9 }, Some(CUT)) };
            assert_eq!((outcome.records, outcome.dropped, outcome.error.as_deref()), expected, "{newest}");
        }
        let mut archive = archive(&path, 2);
        let never = Policy { restart_ns: vec![], ..Policy::recorder(&Scenario::default().supervision) };
        archive.role = Role::new(RECORDER, never);
        archive.role.on(Now { ns: 0, tick: 0 }, RoleInput::Exited(1));
        let error = archive.outcome(None, &Scenario::default(), &[], 0, 0).error;
        assert_eq!(error.as_deref(), Some("no recorder was left for the flight"));
    }

    const CUT: &str = "the recorder ended before it could close the log";
}
