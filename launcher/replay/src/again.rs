//! Replay under way: each process goes on as soon as its inputs have been sent. Only a part of the log is in memory.

use std::collections::HashMap;
use std::sync::Arc;

use anyhow::{Context, ensure};
use contract::Topic;
use contract::snapshot::Snapshot;
use contract::stamp::delivery::DELIVERED;
use flight::log::{self, Memory, Record};
use runtime::shared_role::Origin;

use crate::course::{LATEST, ProcessCourse, Runs, Waits};
use crate::fields::difference;
use crate::plan::{ComparedMessages, FirstDifference, ReplayPlan, Replayed};
use crate::program::Program;
use crate::recording::Recording;
use crate::script::{Cycle, Key, Process, Read, Script};
use crate::worker::Worker;

/// Replays a recording from its log as `plan` says; `each` gets every message, computed or from the log.
///
/// # Errors
/// The log cannot be read, or a process cannot be built from its settings.
pub fn replay(recording: &Recording, plan: &ReplayPlan, each: impl FnMut(&Record)) -> anyhow::Result<Replayed> {
    let from = if plan.elsewhere().is_none() { plan.from } else { 0 };
    let script = recording.begin(from)?;
    let span = recording.span(&script, plan.until.unwrap_or(u64::MAX));
    let mut flight = ReplayRun::new(recording, plan, script, each);
    let mut flown = Ok(());
    log::stream(&recording.log, span, |_, record| {
        if flown.is_ok() {
            flown = flight.take(record);
        }
    })?;
    flown?;
    flight.fly_on()
}

/// Replays a recording from a `script` in memory.
///
/// # Errors
/// A process cannot be built from its settings.
pub fn replay_script(
    recording: &Recording,
    script: Script,
    plan: &ReplayPlan,
    each: impl FnMut(&Record),
) -> anyhow::Result<Replayed> {
    ReplayRun::new(recording, plan, script, each).fly_on()
}

/// Replay under way.
pub(super) struct ReplayRun<'a, F> {
    recording: &'a Recording,
    plan: &'a ReplayPlan,
    each: F,
    script: Script,
    /// Course of each process of the script.
    courses: Vec<ProcessCourse>,
    /// Memories with which later processes of a node begin, by topic and origin; `None` until computed.
    memories: HashMap<(Topic, Origin), Option<Snapshot>>,
    replayed: Replayed,
    /// Number of messages taken in since the processes last went on.
    taken: usize,
}

/// Number of messages that are taken in, and of cycles that are run, at a time.
const BATCH: usize = 1024;

impl<'a, F: FnMut(&Record)> ReplayRun<'a, F> {
    pub(super) fn new(recording: &'a Recording, plan: &'a ReplayPlan, script: Script, each: F) -> Self {
        let messages = recording.logged.map(|logged| ComparedMessages { logged, ..ComparedMessages::default() });
        let replayed = Replayed { messages, begun_at: script.begun_at(), ..Replayed::default() };
        let nodes = script.begins_with.iter().filter(|memory| memory.topic != Topic::State);
        let memories =
            nodes.filter_map(|memory| Some(((memory.topic, memory.origin), Some(memory.padded()?)))).collect();
        Self { recording, plan, each, script, courses: vec![], memories, replayed, taken: 0 }
    }

    /// Returns the logged memory of a process at the start of the replay, if the process was already running then.
    fn begins_with(&self, i: usize) -> Option<&Memory> {
        let Process { topic, epoch, .. } = self.script.processes[i];
        self.script.begins_with.iter().find(|memory| (memory.topic, memory.origin.epoch) == (topic, epoch))
    }

    /// Returns whether a process had finished cycle `tick` before the replay begins; the messages of such a cycle are
    /// taken from the log.
    fn is_known(&self, i: usize, tick: u64) -> bool {
        let begun_at = self.replayed.begun_at;
        begun_at > 0 && tick < self.begins_with(i).map_or(begun_at + 1, |memory| memory.origin.done)
    }

    /// Takes in the next message of the log; after every [`BATCH`] messages runs the cycles whose inputs are known.
    ///
    /// # Errors
    /// A process cannot be built from its settings.
    pub(super) fn take(&mut self, record: &Record) -> anyhow::Result<()> {
        self.script.push(record);
        self.taken += 1;
        if self.taken < BATCH {
            return Ok(());
        }
        self.taken = 0;
        self.go_on_meanwhile()
    }

    /// Flies the cycles that are known so far, while more messages are to come.
    fn go_on_meanwhile(&mut self) -> anyhow::Result<()> {
        self.go_on(self.script.reach.saturating_sub(LATEST as u64))?;
        self.forget();
        Ok(())
    }

    /// Flies to the end of the known messages, and returns the result.
    ///
    /// # Errors
    /// A process cannot be built from its settings.
    pub(super) fn fly_on(mut self) -> anyhow::Result<Replayed> {
        while self.script.finish_some(BATCH) {
            self.go_on_meanwhile()?;
        }
        self.go_on(u64::MAX)?;
        let until = self.plan.until.unwrap_or(u64::MAX);
        let hole = self.script.holes.iter().find(|(known, _)| *known < until);
        let hole = hole.map(|(_, hole)| format!("the log lacks {hole}"));
        let courses = self.courses.iter().zip(&self.script.processes);
        let held_up = courses.filter_map(|(course, process)| Some((course.held_up.as_ref()?, process)));
        self.replayed.stopped = match held_up.min_by_key(|((tick, _), process)| (*tick, process.place())) {
            Some(((tick, waits), Process { topic, epoch, .. })) => {
                let cause = hole.unwrap_or_else(|| waits.words());
                Some(format!("at tick {tick} {} {epoch} cannot go on: {cause}", topic.publisher()))
            }
            None => hole,
        };
        Ok(self.replayed)
    }

    /// Runs every cycle whose inputs are there. A cycle before `until` also runs without an input that was sent here,
    /// but lost by a fault. It never runs without an input that was not sent.
    fn go_on(&mut self, until: u64) -> anyhow::Result<()> {
        self.courses.resize_with(self.script.processes.len(), ProcessCourse::default);
        for Process { topic, continues, .. } in &self.script.processes {
            let flies = |epoch| {
                self.plan.computes(self.recording, *topic, epoch) && self.script.process(*topic, epoch).is_some()
            };
            if let Some(origin) = continues.filter(|origin| flies(origin.epoch)) {
                self.memories.entry((*topic, origin)).or_insert(None);
            }
        }
        loop {
            let mut moved = 0;
            for i in 0..self.courses.len() {
                while moved < BATCH && self.waits(i) == Some(Waits::Nothing) {
                    self.cycle(i)?;
                    moved += 1;
                }
            }
            if moved > 0 {
                self.forget_sent();
                continue;
            }
            let Some((i, tick, waits)) = self.furthest_behind(until) else { return Ok(()) };
            match waits {
                Waits::Delivery => self.cycle(i)?,
                waits => self.courses[i].held_up = Some((tick, waits)),
            }
        }
    }

    /// Returns a process whose wait no later message of the log can end, with its next tick and the cause of the wait:
    /// a process that waits only for a delivery, or else the process that is furthest behind; `None` if later messages
    /// may help.
    fn furthest_behind(&self, until: u64) -> Option<(usize, u64, Waits)> {
        let waiting = (0..self.courses.len()).filter_map(|i| Some((i, self.next(i)?.tick, self.waits(i)?)));
        let for_good = waiting.filter(|(_, tick, waits)| match waits {
            Waits::Message(key) => *tick < until && (key.tick < until || key.tick == u64::MAX),
            _ => *tick < until,
        });
        for_good.min_by_key(|(i, tick, waits)| {
            let behind = (*waits != Waits::Delivery).then_some(*tick);
            (behind, self.script.processes[*i].place())
        })
    }

    /// Drops sent messages that no process will ask for; returns the tick before which they were sent.
    fn forget_sent(&mut self) -> u64 {
        let waiting = (0..self.courses.len()).filter_map(|i| self.next(i)).map(|next| next.tick).min();
        let before = waiting.unwrap_or(self.script.reach).saturating_sub(LATEST as u64);
        for course in &mut self.courses {
            while course.sent.len() > 1 && course.sent.front().is_some_and(|(sent, ..)| *sent < before) {
                course.sent.pop_front();
            }
        }
        before
    }

    /// Drops messages, cycles and workers that are no longer needed.
    fn forget(&mut self) {
        let before = self.forget_sent();
        let newest = Topic::ALL.map(|topic| {
            let of_node = self.script.processes.iter().filter(|process| process.topic == topic);
            of_node.map(|process| process.epoch).max().unwrap_or(0)
        });
        for (course, process) in self.courses.iter_mut().zip(&mut self.script.processes) {
            if course.held_up.is_some() {
                (course.cycle, course.recorded) = (process.cycles.len(), process.recorded.len());
            }
            Arc::make_mut(&mut process.recorded).drain(..course.recorded);
            course.recorded = 0;
            // The last cycle stays: messages that belong to it may follow.
            process.cycles.drain(..course.cycle.saturating_sub(1));
            course.cycle = course.cycle.min(1);
            let is_over = process.cycles.last().is_some_and(|last| last.tick < before);
            if is_over && process.epoch < newest[process.topic as usize] {
                course.worker = None;
            }
        }
        self.script.forget_before(before.saturating_sub(LATEST as u64));
    }

    /// Returns the next cycle of a process; `None` if the process is held up, or if the cycle is not complete yet or
    /// after the end of the plan.
    fn next(&self, i: usize) -> Option<&Cycle> {
        let next = self.script.processes[i].cycles.get(self.courses[i].cycle)?;
        let is_whole = next.tick < self.script.reach;
        (is_whole && self.courses[i].held_up.is_none() && next.tick <= self.plan.until.unwrap_or(u64::MAX))
            .then_some(next)
    }

    fn course_of(&self, key: &Key) -> Option<&ProcessCourse> {
        self.courses.get(self.script.process(key.topic, key.epoch)?)
    }

    /// Returns whether a process is computed here; if not, its messages are taken from the log.
    fn computes(&self, i: usize) -> bool {
        let Process { topic, epoch, .. } = self.script.processes[i];
        self.plan.computes(self.recording, topic, epoch)
    }

    /// Returns the cause for which the next cycle of a process waits; `None` if there is no such cycle.
    fn waits(&self, i: usize) -> Option<Waits> {
        let (next, course, process) = (self.next(i)?, &self.courses[i], &self.script.processes[i]);
        let is_known = self.is_known(i, next.tick);
        // The inputs of a known cycle may be older than the messages that were read.
        let inputs = next.inputs.iter().flatten().filter(|read| !is_known || read.key.tick < u64::MAX);
        let arrivals = next.arrivals.iter().map(|(read, _)| read).filter(|_| !is_known);
        let mut waits = Waits::Nothing;
        for read in inputs.chain(arrivals).filter(|read| course.read[read.key.topic as usize] != Some(**read)) {
            match self.course_of(&read.key).and_then(|sender| sender.sent(read.key.tick)) {
                Some((.., None)) if !read.unharmed => waits = Waits::Delivery,
                Some(_) => {}
                None => return Some(Waits::Message(read.key)),
            }
        }
        let begins = !is_known && course.worker.is_none() && self.computes(i);
        let memory = process.continues.and_then(|origin| self.memories.get(&(process.topic, origin)));
        Some(if begins && memory == Some(&None) { Waits::Memory } else { waits })
    }

    fn begin(&mut self, i: usize) -> anyhow::Result<()> {
        let Process { topic, epoch, continues, .. } = self.script.processes[i];
        let memory = continues.and_then(|origin| Some((origin, (*self.memories.get(&(topic, origin))?)?)));
        let settings = self.plan.settings_of(self.recording, topic, epoch);
        let elsewhere = self.plan.elsewhere().filter(|(of, _)| *of == topic);
        self.courses[i].worker = Some(if let Some((_, settings)) = elsewhere {
            Runs::Elsewhere(Box::new(Program::start(topic, settings)?))
        } else {
            let worker = Worker::new(topic, epoch as u32, settings, memory.as_ref())?;
            if self.begins_with(i).is_some() {
                worker.continue_from(continues.unwrap_or_default());
            }
            Runs::Here(Box::new(worker))
        });
        self.remember(i, 0);
        Ok(())
    }

    /// Keeps the memory of a process that has done `done` ticks, if another process begins with it.
    fn remember(&mut self, i: usize, done: u64) {
        let Process { topic, epoch, .. } = self.script.processes[i];
        if let Some(memory) = self.memories.get_mut(&(topic, Origin { epoch, done })) {
            *memory = match &self.courses[i].worker {
                Some(Runs::Here(worker)) => worker.memory(),
                _ => None,
            };
        }
    }

    fn cycle(&mut self, i: usize) -> anyhow::Result<()> {
        let Some(next) = self.next(i).cloned() else { return Ok(()) };
        let topic = self.script.processes[i].topic;
        let (computes, is_known) = (self.computes(i), self.is_known(i, next.tick));
        let mut sent = vec![];
        if computes {
            if self.courses[i].worker.is_none() {
                self.begin(i)?;
            }
            self.compute(i, &next, is_known, &mut sent)?;
        }
        if !computes || is_known {
            let of_log = &self.script.processes[i].recorded[self.courses[i].recorded..];
            let answers = |record: &Record| record.tick() == next.tick;
            let count = if computes {
                // Messages that a link had held back are in the log only; messages after the answer are sent here too.
                sent.retain(|record| record.stamped().is_some() && record.is_intact());
                let after = sent.iter().position(answers).map_or(0, |answer| sent.len() - answer - 1);
                of_log.iter().position(answers).map_or(0, |answer| answer + 1 + after).min(of_log.len())
            } else {
                let ends = self.script.processes[i].cycles.get(self.courses[i].cycle + 1).map(|next| next.tick);
                of_log.iter().take_while(|record| ends.is_none_or(|ends| record.tick() < ends)).count()
            };
            let truth = self.script.truth(next.tick).filter(|_| topic == Topic::State);
            sent = truth.into_iter().map(|truth| (*truth).into()).chain(of_log[..count].iter().copied()).collect();
            self.courses[i].recorded += count;
        } else {
            self.compare(i, next.tick, &sent);
        }
        for record in &sent {
            self.courses[i].take(next.tick, record);
            (self.each)(record);
        }
        self.courses[i].cycle += 1;
        if topic == Topic::State {
            self.replayed.last_tick = next.tick;
        }
        if !is_known {
            self.remember(i, next.tick + 1);
        }
        Ok(())
    }

    /// Computes the next cycle of a process; adds the messages that it sends to `sent`, TRUTH first.
    fn compute(&mut self, i: usize, next: &Cycle, is_known: bool, sent: &mut Vec<Record>) -> anyhow::Result<()> {
        let process = &self.script.processes[i];
        let mut worker = self.courses[i].worker.take().context("a process that has not begun")?;
        if let (false, true, Runs::Here(worker)) = (is_known, self.courses[i].follows, &mut worker) {
            let restored = self.begins_with(i).is_some_and(|memory| worker.restore(memory));
            ensure!(
                restored,
                "the snapshot of {} {} at tick {} is not in the log: begin earlier, or without --from",
                process.topic.publisher(),
                process.epoch,
                self.replayed.begun_at
            );
        }
        self.courses[i].follows = is_known;
        let message = |Read { key, unharmed }: &Read| {
            let (_, meant, delivered) = self.course_of(key)?.sent(key.tick)?;
            if *unharmed { Some(meant.with_stamp(|stamp| stamp.delivery = DELIVERED)) } else { *delivered }
        };
        for read in next.inputs.iter().flatten() {
            if self.courses[i].read[read.key.topic as usize] != Some(*read)
                && let Some(message) = message(read)
            {
                match &mut worker {
                    Runs::Here(worker) => worker.read(&message)?,
                    Runs::Elsewhere(program) => program.read(&message),
                }
            }
        }
        for (read, after_ns) in next.arrivals.iter().filter(|_| !is_known) {
            if let (Some(Record::Actuators(command)), Runs::Here(worker)) = (message(read), &mut worker) {
                worker.command(&command, *after_ns);
            }
        }
        for read in next.inputs.iter().flatten() {
            self.courses[i].read[read.key.topic as usize] = Some(*read);
        }
        if let Some((_, _, call)) =
            self.plan.before.filter(|(of, tick, _)| (*of, *tick, false) == (process.topic, next.tick, next.standby))
        {
            self.replayed.came_to_break = true;
            call();
        }
        let known = || process.recorded[self.courses[i].recorded..].iter().find(|sent| sent.tick() == next.tick);
        match &mut worker {
            Runs::Here(worker) => {
                let known = is_known.then(known).flatten();
                worker.run(next, &self.recording.given, known, |record| sent.push(*record))?;
            }
            Runs::Elsewhere(program) => program.run(next, |record| sent.push(*record))?,
        }
        self.courses[i].worker = Some(worker);
        Ok(())
    }

    /// Compares the messages that a process sent in the cycle of `tick` with those that it sent in the flight, TRUTH
    /// last.
    fn compare(&mut self, i: usize, tick: u64, sent: &[Record]) {
        let Process { topic, epoch, ref recorded, .. } = self.script.processes[i];
        let messages = &mut self.replayed.messages[topic as usize];
        let is_truth = |record: &&Record| record.stamped().is_none();
        for record in sent.iter().filter(|record| !is_truth(record)).chain(sent.iter().filter(is_truth)) {
            messages.computed += 1;
            let flown = if is_truth(&record) {
                self.script.truth(tick).map(|truth| (*truth).into())
            } else if record.is_intact() {
                let flown = recorded.get(self.courses[i].recorded).copied();
                self.courses[i].recorded += usize::from(flown.is_some());
                flown
            } else {
                messages.flipped += 1;
                None
            };
            let Some(flown) = flown.filter(|_| tick >= self.plan.from) else { continue };
            messages.compared += 1;
            let Some(differs) = difference(&flown, record) else { continue };
            self.replayed.different += 1;
            let place = (tick, topic as usize);
            if self.replayed.first.as_ref().is_none_or(|first| place < (first.tick, first.topic as usize)) {
                self.replayed.first = Some(FirstDifference { tick, topic, epoch, differs });
            }
        }
    }
}
