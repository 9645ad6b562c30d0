//! The script of a flight: which process answered to which samples, and what it had read. Made from the log alone.
//!
//! A message is known by its topic, the epoch of its publisher and the tick it answers to: no process answers twice. What
//! a fault made of it on the way, and what its deadline withheld, is known by the same.

use std::collections::HashMap;
use std::sync::Arc;

use contract::Topic;
use contract::message::{Arrival, Stamp};
use runtime::shared_role::Origin;

use crate::log::{Log, Record, last_tick};

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
#[derive(Debug, Clone, PartialEq)]
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
}

/// What every process of a flight did.
#[derive(Debug, Clone, Default)]
pub struct Script {
    pub processes: Vec<Process>,
    /// What the log lacks, by process: nothing of it is known from that tick on.
    pub holes: Vec<String>,
}

impl Script {
    pub fn of(log: &Log) -> Self {
        let mut processes: Vec<Process> = vec![];
        for record in log.tick_by_tick().filter(Record::is_intact) {
            let (topic, epoch) = (record.topic(), record.stamp().epoch);
            let known = processes.iter().position(|process| (process.topic, process.epoch) == (topic, epoch));
            let at = known.unwrap_or_else(|| {
                processes.push(Process { topic, epoch, continues: None, cycles: vec![], recorded: Arc::default() });
                processes.len() - 1
            });
            Arc::make_mut(&mut processes[at].recorded).push(record);
        }
        processes.sort_by_key(|process| (process.topic as usize, process.epoch));
        let mut holes = vec![];
        for process in &mut processes {
            holes.extend(process.cut_at_hole());
        }
        let ticks: HashMap<_, _> = processes.iter().flat_map(Process::ticks).collect();
        for process in &mut processes {
            process.find_cycles(&ticks);
        }
        Self { processes, holes }
    }

    pub fn process(&self, topic: Topic, epoch: u64) -> Option<usize> {
        self.processes.iter().position(|process| (process.topic, process.epoch) == (topic, epoch))
    }
}

impl Process {
    /// What is after a gap in the numbers is of no use: what the process remembers then is not known.
    fn cut_at_hole(&mut self) -> Option<String> {
        let (mut sent, mut hole) = (0, None);
        for (i, record) in self.recorded.iter().enumerate() {
            let Stamp { sequence, tick, .. } = *record.stamp();
            let next = sent + 1;
            if tick > last_tick(i as u64) {
                let (name, epoch) = (self.topic.publisher(), self.epoch);
                hole = Some((
                    i,
                    format!("messages of {name} {epoch} before tick {tick}, which no flight of this length has"),
                ));
                break;
            }
            if sequence > next {
                let (name, epoch) = (self.topic.publisher(), self.epoch);
                hole = Some((i, format!("messages {next} to {} of {name} {epoch}, before tick {tick}", sequence - 1)));
                break;
            }
            if !record.stamp().is_withheld() {
                sent = sent.max(sequence);
            }
        }
        let (from, what) = hole?;
        Arc::make_mut(&mut self.recorded).truncate(from);
        Some(what)
    }

    /// The tick that each number stands for. The first message of a number is as it was meant.
    fn ticks(&self) -> impl Iterator<Item = ((Topic, u64, u64), u64)> {
        let sent = self.recorded.iter().map(Record::stamp).filter(|stamp| !stamp.is_withheld());
        let mut newest = 0;
        let first = sent.filter(move |stamp| {
            let before = newest;
            newest = newest.max(stamp.sequence);
            stamp.sequence > before
        });
        first.map(|stamp| ((self.topic, self.epoch, stamp.sequence), stamp.tick))
    }

    /// Finds the cycles in the messages: the first of each tick, which never goes back.
    fn find_cycles(&mut self, ticks: &HashMap<(Topic, u64, u64), u64>) {
        // One that the log lacks is looked for in vain.
        let read = |topic: Topic, epoch: u64, sequence: u64| {
            let tick = ticks.get(&(topic, epoch, sequence)).copied().unwrap_or(u64::MAX);
            (sequence > 0).then_some(Read { key: Key { topic, epoch, tick }, unharmed: false })
        };
        for record in self.recorded.iter() {
            let stamp = record.stamp();
            if let Some(last) = self.cycles.last_mut().filter(|last| stamp.tick <= last.tick) {
                last.faulted |= stamp.is_faulted() && stamp.tick == last.tick;
                continue;
            }
            let own = self.topic as usize;
            let input = |topic: Topic| {
                let i = topic as usize;
                read(topic, stamp.input_epochs[i], stamp.inputs[i]).filter(|_| topic != self.topic)
            };
            let arrivals = match record {
                Record::State(state) => &state.arrivals[..(state.arrived as usize).min(state.arrivals.len())],
                _ => &[],
            };
            let arrival =
                |arrival: &Arrival| Some((read(Topic::Actuators, arrival.epoch, arrival.sequence)?, arrival.after_ns));
            self.cycles.push(Cycle {
                tick: stamp.tick,
                sample_ns: stamp.sample_ns,
                publish_ns: stamp.publish_ns[own],
                standby: stamp.is_standby(),
                faulted: stamp.is_faulted(),
                faults: stamp.faults,
                inputs: Topic::ALL.map(input),
                arrivals: arrivals.iter().filter_map(arrival).collect(),
            });
            let continues = Origin { epoch: stamp.input_epochs[own], done: stamp.inputs[own] };
            self.continues = (continues != Origin::default()).then_some(continues);
        }
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
