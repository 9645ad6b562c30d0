//! Flight as it would have been with some of its disturbed ticks in order.
//!
//! A tick is in order if the plant took its sample, every active process answered to it in time, having read the
//! messages of the same tick unharmed, and the command came to the plant before the next sample. Every other tick is
//! **disturbed**. To undo a tick is to put it in order: the processes that were active answer, and the command comes as
//! long after the sample as is usual in this flight. All other ticks stay as they were, with the same readings and
//! instants, so a flight with one tick undone shows what that tick cost.

use std::collections::BTreeSet;

use contract::Topic;
use runtime::release::Release;
use settings::{Late, Mode};

use crate::recording::Recording;
use crate::script::{Cycle, Key, Process, Read, Script};

/// Disturbance of a tick: the first one in the order of the ring.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Disturbed {
    pub tick: u64,
    /// Node at which the disturbance showed.
    pub node: &'static str,
    pub what: String,
}

/// Returns every disturbed tick of the script, except its last tick, whose command has no sample after it.
pub fn disturbed(recording: &Recording, script: &Script) -> Vec<Disturbed> {
    let Some(plant) = process_of(script, Topic::State, 1) else { return vec![] };
    let last = plant.cycles.last().map_or(0, |last| last.tick);
    let first = if script.begun_at() > 0 { script.begun_at() + 1 } else { 0 };
    (first..last).filter_map(|tick| look_at(recording, script, plant, tick)).collect()
}

/// Returns the `script` of a flight with `ticks` undone.
#[must_use]
pub fn without(recording: &Recording, script: &Script, ticks: &BTreeSet<u64>) -> Script {
    let mut repaired = script.clone();
    let period_ns = recording.scenario.sample_ns();
    let usual = Usual::of(script, period_ns);
    for tick in ticks {
        undo(&mut repaired, *tick, period_ns, &usual);
    }
    continue_from_what_was_added(&mut repaired, ticks);
    repaired
}

fn process_of(script: &Script, topic: Topic, epoch: u64) -> Option<&Process> {
    script.process(topic, epoch).map(|i| &script.processes[i])
}

fn look_at(recording: &Recording, script: &Script, plant: &Process, tick: u64) -> Option<Disturbed> {
    let disturbed = |topic: Topic, what: String| Some(Disturbed { tick, node: topic.publisher(), what });
    let Some(sample) = plant.cycle(tick) else { return disturbed(Topic::State, "took no sample".into()) };
    if let Some(what) = harm(recording, plant, sample) {
        return disturbed(Topic::State, what);
    }
    let mut read = vec![Key { topic: Topic::State, epoch: 1, tick }];
    for topic in Topic::OF_CONTROLLERS {
        let Some((process, cycle)) = active_cycle(script, topic, tick) else {
            return disturbed(topic, "did not answer".into());
        };
        for source in topic.sources() {
            let used = cycle.inputs[source as usize].map(|read| read.key);
            if !used.is_some_and(|used| read.contains(&used)) {
                let used = used.map_or("none".into(), |used| format!("that of tick {}", used.tick));
                return disturbed(topic, format!("answered without the {} of this tick: it had {used}", source.name()));
            }
        }
        if let Some(what) = harm(recording, process, cycle) {
            return disturbed(topic, what);
        }
        read.push(Key { topic, epoch: process.epoch, tick });
    }
    let command = read.last()?;
    let next = plant.cycles.get(plant.cycles.partition_point(|cycle| cycle.tick <= tick))?;
    // In lockstep and in process a command is handed over at once, with the time of its arrival.
    let arrived = next.arrivals.iter().find(|(read, _)| read.key == *command).map(|(_, after_ns)| *after_ns);
    match arrived.filter(|_| next.tick == tick + 1) {
        Some(after_ns) if after_ns < recording.scenario.sample_ns() => None,
        Some(after_ns) => {
            disturbed(Topic::Actuators, format!("the command came {:.2} ms after the sample", after_ns as f64 / 1e6))
        }
        None => disturbed(Topic::Actuators, "the command came after the next sample, or never".into()),
    }
}

/// Describes what happened to the message of a cycle; `None` if it was delivered in time and unchanged.
fn harm(recording: &Recording, process: &Process, cycle: &Cycle) -> Option<String> {
    let deadline = Release::of(&recording.scenario).deadline(recording.scenario.deadline_of(process.topic as usize));
    let response_ns = cycle.publish_ns.saturating_sub(cycle.sample_ns);
    let late = recording.scenario.run.mode == Mode::Realtime && response_ns > deadline.deadline_ns;
    if late {
        let withheld = matches!(deadline.late, Late::Skip | Late::Hold | Late::Stop);
        let fate = if withheld { ", withheld" } else { "" };
        return Some(format!("answered {:.2} ms after the sample{fate}", response_ns as f64 / 1e6));
    }
    cycle.faulted.then(|| "a fault lost or changed its message".into())
}

/// Returns the active process of a node on a tick, with its cycle.
fn active_cycle(script: &Script, topic: Topic, tick: u64) -> Option<(&Process, &Cycle)> {
    let of_node = script.processes.iter().filter(|process| process.topic == topic);
    { of_node }.find_map(|process| Some((process, process.cycle(tick).filter(|cycle| !cycle.standby)?)))
}

/// Puts one tick in order.
fn undo(script: &mut Script, tick: u64, period_ns: u64, usual: &Usual) {
    let Some(plant) = script.process(Topic::State, 1) else { return };
    script.processes[plant].sample_at(tick, period_ns);
    let mut read = [None; Topic::COUNT];
    read[Topic::State as usize] = Some(Read { key: Key { topic: Topic::State, epoch: 1, tick }, unharmed: true });
    let sample_ns = script.processes[plant].cycle(tick).map_or(0, |sample| sample.sample_ns);
    for topic in Topic::OF_CONTROLLERS {
        let Some(i) = worker_at(script, topic, tick) else { return };
        forget_late_answers(script, i, tick);
        let process = &mut script.processes[i];
        let at = process.cycles.partition_point(|cycle| cycle.tick < tick);
        let inputs = Topic::ALL.map(|input| read[input as usize].filter(|_| input.listeners().contains(&topic)));
        let publish_ns = sample_ns + usual.response_ns[topic as usize];
        let faults = process.cycles[..at].last().map_or(0, |before| before.faults);
        let ordered =
            Cycle { tick, sample_ns, publish_ns, standby: false, faulted: false, faults, inputs, arrivals: vec![] };
        match process.cycles.get_mut(at).filter(|cycle| cycle.tick == tick) {
            Some(cycle) => *cycle = Cycle { faults: cycle.faults, ..ordered },
            None => process.cycles.insert(at, ordered),
        }
        let key = Key { topic, epoch: process.epoch, tick };
        read[topic as usize] = Some(Read { key, unharmed: true });
    }
    if let Some(command) = read[Topic::Actuators as usize] {
        script.processes[plant].arrive(command, usual.arrival_ns);
    }
}

/// Drops late answers of a process: those to ticks before `tick` for which it had read later messages, because it was
/// started or woke up late. With an answer to `tick` in time these answers would not exist; their readers get the
/// answer to `tick` instead.
fn forget_late_answers(script: &mut Script, i: usize, tick: u64) {
    let Process { topic, epoch, cycles, .. } = &mut script.processes[i];
    let (topic, epoch) = (*topic, *epoch);
    let is_later = |read: &Read| read.key.tick > tick && read.key.tick < u64::MAX;
    let is_late = |cycle: &Cycle| cycle.tick < tick && cycle.inputs.iter().flatten().any(is_later);
    let late: Vec<u64> = cycles.iter().filter(|cycle| is_late(cycle)).map(|cycle| cycle.tick).collect();
    if late.is_empty() {
        return;
    }
    cycles.retain(|cycle| !is_late(cycle));
    let is_dropped = |key: &Key| (key.topic, key.epoch) == (topic, epoch) && late.contains(&key.tick);
    for cycle in script.processes.iter_mut().flat_map(|process| &mut process.cycles) {
        cycle.arrivals.retain(|(read, _)| !is_dropped(&read.key));
        for read in cycle.inputs.iter_mut().flatten().filter(|read| is_dropped(&read.key)) {
            *read = Read { key: Key { topic, epoch, tick }, unharmed: true };
        }
    }
}

/// Returns the process that answers to `tick`, or else the process that answered last before `tick`.
fn worker_at(script: &Script, topic: Topic, tick: u64) -> Option<usize> {
    let active =
        |process: &Process| process.cycles.iter().rfind(|cycle| cycle.tick <= tick && !cycle.standby).map(|c| c.tick);
    let of_node = script.processes.iter().enumerate().filter(|(_, process)| process.topic == topic);
    { of_node }.filter_map(|(i, process)| Some((active(process)?, i))).max().map(|(_, i)| i)
}

/// Lets each process that took over continue after the undone ticks of the process before it.
fn continue_from_what_was_added(script: &mut Script, ticks: &BTreeSet<u64>) {
    for i in 0..script.processes.len() {
        let Process { topic, continues: Some(origin), ref cycles, .. } = script.processes[i] else { continue };
        let Some(first) = cycles.first().map(|first| first.tick) else { continue };
        let added = ticks.range(origin.done..first.max(origin.done)).next_back().copied();
        let before = process_of(script, topic, origin.epoch);
        let done = added.filter(|tick| before.is_some_and(|before| before.cycle(*tick).is_some()));
        if let (Some(tick), Some(continues)) = (done, &mut script.processes[i].continues) {
            continues.done = tick + 1;
        }
    }
}

/// Usual delays of a flight: medians over the ticks.
struct Usual {
    /// Delay from the sample to the answer, by topic \[ns\].
    response_ns: [u64; Topic::COUNT],
    /// Delay from the sample to the arrival of its command at the plant, if that is before the next sample \[ns\].
    arrival_ns: u64,
}

impl Usual {
    fn of(script: &Script, period_ns: u64) -> Self {
        let of_node = |topic| script.processes.iter().filter(move |process| process.topic == topic);
        let response = |cycle: &Cycle| cycle.publish_ns.saturating_sub(cycle.sample_ns);
        let plant = || of_node(Topic::State).flat_map(|process| process.cycles.windows(2));
        let in_order = |pair: &[Cycle]| -> Vec<u64> {
            let of_sample = pair[1].arrivals.iter().filter(|(read, _)| read.key.tick == pair[0].tick);
            of_sample.map(|(_, after_ns)| *after_ns).filter(|after_ns| *after_ns < period_ns).collect()
        };
        Self {
            response_ns: Topic::ALL
                .map(|topic| median(of_node(topic).flat_map(|process| &process.cycles).map(response).collect())),
            arrival_ns: median(plant().flat_map(in_order).collect()),
        }
    }
}

fn median(mut all: Vec<u64>) -> u64 {
    all.sort_unstable();
    all.get(all.len() / 2).copied().unwrap_or(0)
}
