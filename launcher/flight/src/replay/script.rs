//! The script of a flight: which process answered to which samples, and what it had read. Made from the log alone, message by
//! message.
//!
//! A message is known by its topic, the epoch of its publisher and the tick it answers to: no process answers twice. What
//! a fault made of it on the way, and what its deadline withheld, is known by the same.
//!
//! A process that slept may have read what was sent long after the sample that it answers to. So a message is held back until those
//! after it are known too, no more of them than a limit.

use std::collections::VecDeque;
use std::sync::Arc;

use contract::Topic;
use contract::message::{Arrival, Stamp};
use runtime::limits::HELD_MESSAGES;
use runtime::shared_role::Origin;

use crate::log::{Memory, Record, last_tick};

/// One message, and what became of it on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key {
    pub topic: Topic,
    pub epoch: u64,
    pub tick: u64,
}

/// A message that a process read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Read {
    pub key: Key,
    /// Whether it is read as it was meant, whatever a fault made of it on the way.
    pub unharmed: bool,
}

/// One cycle of a process: the answer to a sample, or the sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cycle {
    pub tick: u64,
    /// The instant of the sample, and when the answer was ready, as the process read it \[ns\].
    pub sample_ns: u64,
    pub publish_ns: u64,
    /// Whether its process was on standby.
    pub standby: bool,
    /// Whether a fault lost or changed its message on the way.
    pub faulted: bool,
    /// Changes of the fault table that the process knew.
    pub faults: u64,
    /// What it read, by topic: the newest message it had; for the plant nothing.
    pub inputs: [Option<Read>; Topic::COUNT],
    /// Commands that came to the plant since the sample before, each with the time from then to its arrival \[ns\].
    pub arrivals: Vec<(Read, u64)>,
}

/// What one process did.
#[derive(Debug, Clone)]
pub struct Process {
    pub topic: Topic,
    pub epoch: u64,
    /// Whose memory it began with.
    pub continues: Option<Origin>,
    pub cycles: Vec<Cycle>,
    /// Its messages in the order of sending, those that are whole.
    pub recorded: Arc<Vec<Record>>,
    numbers: Numbers,
    /// What it read last, by topic: publisher and number, and what that is.
    last_read: [Option<(u64, u64, Read)>; Topic::COUNT],
    /// Whether the log lacks messages of it: what comes after them is left out.
    has_hole: bool,
}

/// The messages that a process sent, by number.
#[derive(Debug, Clone, Default)]
struct Numbers {
    /// Messages known, and the highest number.
    messages: u64,
    sent: u64,
    /// Numbers, each with the tick that it stands for: the first message of a number is as it was meant.
    ticks: VecDeque<(u64, u64)>,
}

/// What every process of a flight did, as far as it is known.
#[derive(Debug, Clone)]
pub struct Script {
    /// In the order in which they are first heard of.
    pub processes: Vec<Process>,
    /// What the log lacks, by process, each with the tick after which nothing of it is known.
    pub holes: Vec<(u64, String)>,
    ahead: VecDeque<Record>,
    look_ahead: usize,
    /// What the nodes remembered where it begins in the middle of the flight.
    pub(super) begins_with: Vec<Memory>,
    /// The first tick of which messages are taken in.
    begins: u64,
    /// The newest tick of which a cycle is known; at its highest when no more messages come.
    reach: u64,
}

/// Messages that are held back: a minute and more of a flight at 100 Hz, and four seconds at 2 kHz.
pub(super) const LOOK_AHEAD: usize = 32_768;

impl Default for Script {
    fn default() -> Self {
        Self::looking_ahead(LOOK_AHEAD)
    }
}

impl Script {
    /// The whole of a flight.
    pub fn of(messages: impl Iterator<Item = Record>) -> Self {
        let mut script = Self::default();
        messages.for_each(|record| script.push(&record));
        script.finish();
        script
    }

    pub(super) fn looking_ahead(look_ahead: usize) -> Self {
        Self {
            processes: vec![],
            holes: vec![],
            ahead: VecDeque::new(),
            look_ahead,
            begins_with: vec![],
            begins: 0,
            reach: 0,
        }
    }

    /// One that begins where the nodes remember that, and knows what was sent in so many ticks `before`; with nothing, at the
    /// beginning.
    pub(super) fn beginning_with(begins_with: Vec<Memory>, before: u64) -> Self {
        let begins = begins_with.first().map_or(0, |memory| memory.tick.saturating_sub(before).max(1));
        Self { begins_with, begins, ..Self::default() }
    }

    /// The sample after which it begins; 0 for the beginning of the flight.
    pub fn begun_at(&self) -> u64 {
        self.begins_with.first().map_or(0, |memory| memory.tick)
    }

    /// The first tick of which messages are taken in.
    pub(super) fn begins(&self) -> u64 {
        self.begins
    }

    /// Takes in the next message of the log, tick by tick.
    pub fn push(&mut self, record: &Record) {
        if !record.is_intact() || record.stamp().tick < self.begins {
            return;
        }
        if self.ahead.len() >= self.look_ahead {
            self.find_next_cycle();
        }
        let at = self.process_of(record);
        match self.processes[at].number(record, self.begins) {
            Ok(()) => self.ahead.push_back(*record),
            Err(hole) => self.holes.extend(hole),
        }
    }

    /// No more messages come.
    pub fn finish(&mut self) {
        while self.finish_some(usize::MAX) {}
    }

    /// The same for no more than so many messages; whether there are others.
    pub(super) fn finish_some(&mut self, most: usize) -> bool {
        (0..most.min(self.ahead.len())).for_each(|_| self.find_next_cycle());
        if self.ahead.is_empty() {
            self.reach = u64::MAX;
        }
        !self.ahead.is_empty()
    }

    /// The tick before which every cycle is known, with all of its messages.
    pub(super) fn reach(&self) -> u64 {
        self.reach
    }

    pub fn process(&self, topic: Topic, epoch: u64) -> Option<usize> {
        self.processes.iter().position(|process| (process.topic, process.epoch) == (topic, epoch))
    }

    /// Leaves out the numbers of messages that were sent before `tick`.
    pub(super) fn forget_before(&mut self, tick: u64) {
        for Process { numbers: Numbers { ticks, .. }, .. } in &mut self.processes {
            while ticks.len() > 1 && ticks.front().is_some_and(|(_, sent)| *sent < tick) {
                ticks.pop_front();
            }
        }
    }

    /// Leaves out the messages of such processes, and keeps their cycles; what they sent where it begins stays.
    pub(super) fn forget_messages(&mut self, of: impl Fn(Topic, u64) -> bool) {
        let begun = if self.begins_with.is_empty() { 0 } else { self.begun_at() + HELD_MESSAGES as u64 };
        for process in self.processes.iter_mut().filter(|process| of(process.topic, process.epoch)) {
            Arc::make_mut(&mut process.recorded).retain(|record| record.stamp().tick < begun);
        }
    }

    /// The process that sent `record`.
    fn process_of(&mut self, record: &Record) -> usize {
        let (topic, epoch) = (record.topic(), record.stamp().epoch);
        self.process(topic, epoch).unwrap_or_else(|| {
            self.processes.push(Process::new(topic, epoch));
            self.processes.len() - 1
        })
    }

    fn find_next_cycle(&mut self) {
        let Some(record) = self.ahead.pop_front() else { return };
        let at = self.process_of(&record);
        self.reach = self.reach.max(record.stamp().tick);
        let stamp = record.stamp();
        if self.processes[at].is_cycle(stamp) {
            let own = stamp.input_epochs.iter().zip(stamp.inputs);
            let arrived = match &record {
                Record::State(state) => &state.arrivals[..(state.arrived as usize).min(state.arrivals.len())],
                _ => &[],
            };
            let mut inputs = [None; Topic::COUNT];
            for (topic, (epoch, sequence)) in Topic::ALL.into_iter().zip(own) {
                if topic != record.topic() && sequence > 0 {
                    let known = self.processes[at].last_read[topic as usize];
                    let known = known.filter(|(of, number, _)| (*of, *number) == (*epoch, sequence));
                    let read = known.map_or_else(|| self.read(topic, *epoch, sequence), |(.., read)| read);
                    self.processes[at].last_read[topic as usize] = Some((*epoch, sequence, read));
                    inputs[topic as usize] = Some(read);
                }
            }
            let arrivals = arrived.iter().filter(|arrival| arrival.sequence > 0);
            let arrivals = arrivals.map(|Arrival { sequence, epoch, after_ns }| {
                (self.read(Topic::Actuators, *epoch, *sequence), *after_ns)
            });
            let arrivals = arrivals.collect();
            self.processes[at].begin_cycle(stamp, inputs, arrivals);
        }
        Arc::make_mut(&mut self.processes[at].recorded).push(record);
    }

    /// A message by its number. One that the log lacks is looked for in vain.
    fn read(&self, topic: Topic, epoch: u64, sequence: u64) -> Read {
        let ticks = self.process(topic, epoch).map(|i| &self.processes[i].numbers.ticks);
        let tick = ticks.and_then(|ticks| {
            let at = ticks.binary_search_by_key(&sequence, |(number, _)| *number).ok()?;
            Some(ticks[at].1)
        });
        Read { key: Key { topic, epoch, tick: tick.unwrap_or(u64::MAX) }, unharmed: false }
    }
}

impl Process {
    fn new(topic: Topic, epoch: u64) -> Self {
        Self {
            topic,
            epoch,
            continues: None,
            cycles: vec![],
            recorded: Arc::default(),
            numbers: Numbers::default(),
            last_read: [None; Topic::COUNT],
            has_hole: false,
        }
    }

    /// Takes note of the number of a message, and of whose memory its process began with; an error where it is of no use, with the
    /// reason if that is new: what the process remembers after a gap in the numbers is not known.
    fn number(&mut self, record: &Record, begins: u64) -> Result<(), Option<(u64, String)>> {
        let Stamp { sequence, tick, .. } = *record.stamp();
        if self.has_hole {
            return Err(None);
        }
        let Numbers { messages, sent, ticks } = &mut self.numbers;
        if *messages == 0 && begins > 0 {
            *sent = sequence.saturating_sub(1); // those before are not asked for
        }
        let (name, epoch, next) = (self.topic.publisher(), self.epoch, *sent + 1);
        let hole = if tick > begins.saturating_add(last_tick(*messages)) {
            Some(format!("messages of {name} {epoch} before tick {tick}, which no flight of this length has"))
        } else if sequence > next {
            Some(format!("messages {next} to {} of {name} {epoch}, before tick {tick}", sequence - 1))
        } else {
            None
        };
        self.has_hole = hole.is_some();
        if self.has_hole {
            let known = ticks.back().map_or(begins, |(_, tick)| *tick);
            return Err(hole.map(|hole| (known, hole)));
        }
        *messages += 1;
        let (inputs, input_epochs) = (record.stamp().inputs, record.stamp().input_epochs);
        let continues = Origin { epoch: input_epochs[self.topic as usize], done: inputs[self.topic as usize] };
        self.continues = (continues != Origin::default()).then_some(continues);
        if !record.stamp().is_withheld() && sequence > *sent {
            *sent = sequence;
            ticks.push_back((sequence, tick));
        }
        Ok(())
    }

    /// Whether a message begins a cycle: the first of each tick does, which never goes back.
    fn is_cycle(&mut self, stamp: &Stamp) -> bool {
        let Some(last) = self.cycles.last_mut().filter(|last| stamp.tick <= last.tick) else { return true };
        last.faulted |= stamp.is_faulted() && stamp.tick == last.tick;
        false
    }

    fn begin_cycle(&mut self, stamp: &Stamp, inputs: [Option<Read>; Topic::COUNT], arrivals: Vec<(Read, u64)>) {
        let own = self.topic as usize;
        self.cycles.push(Cycle {
            tick: stamp.tick,
            sample_ns: stamp.sample_ns,
            publish_ns: stamp.publish_ns[own],
            standby: stamp.is_standby(),
            faulted: stamp.is_faulted(),
            faults: stamp.faults,
            inputs,
            arrivals,
        });
    }

    /// Its cycle of a tick.
    pub fn cycle(&self, tick: u64) -> Option<&Cycle> {
        self.cycles.get(self.cycles.partition_point(|cycle| cycle.tick < tick)).filter(|cycle| cycle.tick == tick)
    }

    /// Has the plant take the sample of `tick`, if it did not: what arrived after it is counted from it.
    pub fn sample_at(&mut self, tick: u64, period_ns: u64) {
        let at = self.cycles.partition_point(|cycle| cycle.tick < tick);
        if self.cycles.get(at).is_none_or(|cycle| cycle.tick == tick) || at == 0 {
            return;
        }
        let before = self.cycles[at - 1].clone();
        let passed_ns = (tick - before.tick) * period_ns;
        let next = &mut self.cycles[at];
        let (earlier, later) =
            std::mem::take(&mut next.arrivals).into_iter().partition(|(_, after_ns)| *after_ns < passed_ns);
        let later: Vec<(Read, u64)> = later;
        next.arrivals = later.into_iter().map(|(read, after_ns)| (read, after_ns - passed_ns)).collect();
        let sample_ns = before.sample_ns + passed_ns;
        let publish_ns = before.publish_ns + passed_ns;
        self.cycles.insert(at, Cycle { tick, sample_ns, publish_ns, arrivals: earlier, ..before });
    }

    /// Has `command` come to the plant so long after the sample that it answers to, and at no other time.
    pub fn arrive(&mut self, command: Read, after_ns: u64) {
        self.cycles.iter_mut().for_each(|cycle| cycle.arrivals.retain(|(read, _)| read.key != command.key));
        let at = self.cycles.partition_point(|cycle| cycle.tick <= command.key.tick);
        if let Some(next) = self.cycles.get_mut(at) {
            let place = next.arrivals.partition_point(|(_, earlier_ns)| *earlier_ns <= after_ns);
            next.arrivals.insert(place, (command, after_ns));
        }
    }
}
