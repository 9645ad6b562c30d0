//! Script of a flight, from its log alone: which process answered to which samples, and what it had read.
//!
//! A message is known by its topic, the epoch of its publisher and the tick it answers to: no process answers twice.
//! Copies that a fault has changed or a deadline has withheld have the same key.
//!
//! A process that slept may have read messages that were sent long after the sample that it answers to. So a message is
//! held back until [`LOOK_AHEAD`] later messages are known, or the log ends.

use std::collections::VecDeque;
use std::sync::Arc;

use contract::Topic;
use contract::message::{Arrival, Stamp, Truth};
use runtime::limits::HELD_MESSAGES;
use runtime::shared_role::Origin;

use flight::log::{Memory, Record, last_tick};

/// Key of a message and of its copies that a fault changed or a deadline withheld.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Key {
    pub topic: Topic,
    pub epoch: u64,
    pub tick: u64,
}

/// Message that a process read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Read {
    pub key: Key,
    /// `true` if the message is read as its sender meant it, without the faults of the link.
    pub unharmed: bool,
}

/// Cycle of a process: its answer to a sample; for the plant the sample.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Cycle {
    pub tick: u64,
    /// Instant of the sample, and (`publish_ns`) when the answer was ready, as the process read the clock \[ns\].
    pub sample_ns: u64,
    pub publish_ns: u64,
    /// `true` if the process was on standby.
    pub standby: bool,
    /// `true` if a fault lost or changed the message on the way.
    pub faulted: bool,
    /// Number of changes of the fault table that the process knew.
    pub faults: u64,
    /// Inputs by topic: the newest message that the process had; none for the plant.
    pub inputs: [Option<Read>; Topic::COUNT],
    /// Commands that came to the plant since the previous sample, each with its delay from that sample \[ns\].
    pub arrivals: Vec<(Read, u64)>,
}

/// Cycles and messages of one process.
#[derive(Debug, Clone)]
pub struct Process {
    pub topic: Topic,
    pub epoch: u64,
    /// Origin of the memory with which the process began; `None` if it began without one.
    pub continues: Option<Origin>,
    pub cycles: Vec<Cycle>,
    /// Intact messages in the order of sending.
    pub recorded: Arc<Vec<Record>>,
    numbers: Numbers,
    /// Last input by topic: epoch and sequence number, and the message.
    last_read: [Option<(u64, u64, Read)>; Topic::COUNT],
    /// `true` if the log lacks messages of the process; all its later messages are left out.
    has_hole: bool,
}

/// Sequence numbers of the messages that a process sent.
#[derive(Debug, Clone, Default)]
struct Numbers {
    /// Number of messages known, and the highest sequence number.
    messages: u64,
    sent: u64,
    /// Sequence numbers, each with the tick of the first message that has it; copies of a message come later.
    ticks: VecDeque<(u64, u64)>,
}

/// Cycles of every process of a flight, as far as they are known.
#[derive(Debug, Clone)]
pub struct Script {
    /// Processes in the order of their first messages.
    pub processes: Vec<Process>,
    /// Gaps of the log, by process, each with the tick after which nothing of that process is known.
    pub holes: Vec<(u64, String)>,
    ahead: VecDeque<Record>,
    /// Intact TRUTHs, in order, as far as they are kept.
    truths: VecDeque<Truth>,
    look_ahead: usize,
    /// Memories of the nodes, if the script begins in the middle of the flight.
    pub(super) begins_with: Vec<Memory>,
    /// First tick of which messages are taken in.
    pub(super) begins: u64,
    /// Newest tick of which a cycle is known. Before it, every cycle is known with all of its messages. `u64::MAX` when
    /// no more messages come.
    pub(super) reach: u64,
}

/// Number of messages that are held back: a minute and more of a flight at 100 Hz, and four seconds at 2 kHz.
pub(super) const LOOK_AHEAD: usize = 32_768;

impl Default for Script {
    fn default() -> Self {
        Self::looking_ahead(LOOK_AHEAD)
    }
}

impl Script {
    /// Makes the script of a whole flight.
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
            truths: VecDeque::new(),
            look_ahead,
            begins_with: vec![],
            begins: 0,
            reach: 0,
        }
    }

    /// Creates a script that begins at the memories `begins_with`, and also takes in messages of up to `before` earlier
    /// ticks. Without memories the script begins at tick 0.
    pub(super) fn beginning_with(begins_with: Vec<Memory>, before: u64) -> Self {
        let begins = begins_with.first().map_or(0, |memory| memory.tick.saturating_sub(before).max(1));
        Self { begins_with, begins, ..Self::default() }
    }

    /// Returns the sample after which the script begins; 0 for the beginning of the flight.
    pub fn begun_at(&self) -> u64 {
        self.begins_with.first().map_or(0, |memory| memory.tick)
    }

    /// Takes in the next message of the log, in the order of ticks.
    pub fn push(&mut self, record: &Record) {
        if !record.is_intact() || record.tick() < self.begins {
            return;
        }
        let Some((topic, stamp)) = record.stamped() else {
            if let Record::Truth(truth) = record {
                self.truths.push_back(*truth);
            }
            return;
        };
        if self.ahead.len() >= self.look_ahead {
            self.find_next_cycle();
        }
        let at = self.process_of(topic, stamp.epoch);
        match self.processes[at].number(stamp, self.begins) {
            Ok(()) => self.ahead.push_back(*record),
            Err(hole) => self.holes.extend(hole),
        }
    }

    /// Finds the cycles of all messages held back; call this when no more messages come.
    pub fn finish(&mut self) {
        while self.finish_some(usize::MAX) {}
    }

    /// Finds the cycles of at most `most` messages held back; returns whether more messages are held back.
    pub(super) fn finish_some(&mut self, most: usize) -> bool {
        (0..most.min(self.ahead.len())).for_each(|_| self.find_next_cycle());
        if self.ahead.is_empty() {
            self.reach = u64::MAX;
        }
        !self.ahead.is_empty()
    }

    pub fn process(&self, topic: Topic, epoch: u64) -> Option<usize> {
        self.processes.iter().position(|process| (process.topic, process.epoch) == (topic, epoch))
    }

    /// Returns the TRUTH of `tick`, if it is known.
    pub(super) fn truth(&self, tick: u64) -> Option<&Truth> {
        self.truths.get(self.truths.partition_point(|truth| truth.tick < tick)).filter(|truth| truth.tick == tick)
    }

    /// Drops the TRUTHs, and the sequence numbers of messages, that were sent before `tick`.
    pub(super) fn forget_before(&mut self, tick: u64) {
        self.truths.drain(..self.truths.partition_point(|truth| truth.tick < tick));
        for Process { numbers: Numbers { ticks, .. }, .. } in &mut self.processes {
            while ticks.len() > 1 && ticks.front().is_some_and(|(_, sent)| *sent < tick) {
                ticks.pop_front();
            }
        }
    }

    /// Drops the messages of the processes `of`, and keeps their cycles; messages near the beginning of the script
    /// stay.
    pub(super) fn forget_messages(&mut self, of: impl Fn(Topic, u64) -> bool) {
        let begun = if self.begins_with.is_empty() { 0 } else { self.begun_at() + HELD_MESSAGES as u64 };
        for process in self.processes.iter_mut().filter(|process| of(process.topic, process.epoch)) {
            Arc::make_mut(&mut process.recorded).retain(|record| record.tick() < begun);
            if process.topic == Topic::State {
                self.truths.retain(|truth| truth.tick < begun);
            }
        }
    }

    /// Returns the index of a process, which is added if it is new.
    fn process_of(&mut self, topic: Topic, epoch: u64) -> usize {
        self.process(topic, epoch).unwrap_or_else(|| {
            self.processes.push(Process::new(topic, epoch));
            self.processes.len() - 1
        })
    }

    fn find_next_cycle(&mut self) {
        let Some(record) = self.ahead.pop_front() else { return };
        let Some((topic, stamp)) = record.stamped() else { return };
        let at = self.process_of(topic, stamp.epoch);
        self.reach = self.reach.max(stamp.tick);
        if self.processes[at].is_cycle(stamp) {
            let arrived = match &record {
                Record::State(state) => &state.arrivals[..(state.arrived as usize).min(state.arrivals.len())],
                _ => &[],
            };
            let mut inputs = [None; Topic::COUNT];
            for topic in Topic::ALL {
                let (epoch, sequence) = (stamp.input_epochs[topic as usize], stamp.inputs[topic as usize]);
                if sequence > 0 {
                    let known = self.processes[at].last_read[topic as usize];
                    let known = known.filter(|(of, number, _)| (*of, *number) == (epoch, sequence));
                    let read = known.map_or_else(|| self.read(topic, epoch, sequence), |(.., read)| read);
                    self.processes[at].last_read[topic as usize] = Some((epoch, sequence, read));
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

    /// Finds a message by its sequence number; a message that the log lacks has the tick `u64::MAX`.
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

    /// Notes the sequence number of a message, and the origin of the memory with which its process began. Fails from a
    /// gap in the numbers on, because the memory of the process is not known after a gap; the error describes the gap
    /// once.
    fn number(&mut self, stamp: &Stamp, begins: u64) -> Result<(), Option<(u64, String)>> {
        let Stamp { sequence, tick, restored_epoch, restored_ticks, .. } = *stamp;
        if self.has_hole {
            return Err(None);
        }
        let Numbers { messages, sent, ticks } = &mut self.numbers;
        if *messages == 0 && begins > 0 {
            *sent = sequence.saturating_sub(1); // earlier messages are not needed
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
        let restored = Origin { epoch: restored_epoch, done: restored_ticks };
        self.continues = (restored != Origin::default()).then_some(restored);
        if !stamp.is_withheld() && sequence > *sent {
            *sent = sequence;
            ticks.push_back((sequence, tick));
        }
        Ok(())
    }

    /// Returns whether a message begins a cycle: the first message of each tick does. Ticks never go back.
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

    /// Returns the place of the process in the order of processes.
    pub(super) fn place(&self) -> (usize, u64) {
        (self.topic as usize, self.epoch)
    }

    /// Returns the cycle of `tick`, if there is one.
    pub fn cycle(&self, tick: u64) -> Option<&Cycle> {
        self.cycles.get(self.cycles.partition_point(|cycle| cycle.tick < tick)).filter(|cycle| cycle.tick == tick)
    }

    /// Adds the sample of `tick` to the plant's cycles, if it is missing; the delays of later arrivals then count from
    /// this sample.
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

    /// Lets `command` come to the plant `after_ns` after the sample that it answers to, and at no other time.
    pub fn arrive(&mut self, command: Read, after_ns: u64) {
        self.cycles.iter_mut().for_each(|cycle| cycle.arrivals.retain(|(read, _)| read.key != command.key));
        let at = self.cycles.partition_point(|cycle| cycle.tick <= command.key.tick);
        if let Some(next) = self.cycles.get_mut(at) {
            let place = next.arrivals.partition_point(|(_, earlier_ns)| *earlier_ns <= after_ns);
            next.arrivals.insert(place, (command, after_ns));
        }
    }
}
