//! Joins the messages of a tick: what the nodes computed from one sample, and when the command took effect.
//!
//! The caller chooses what is kept of a message. Report, compare and trace keep whole [`Messages`], joined tick by tick
//! as the log is read ([`Joined`]); [`crate::timing`] keeps each node's cycle while the flight goes on, and
//! `measure timing` keeps the stamps.

use std::collections::BTreeMap;

use contract::Topic;
use contract::message::{Actuators, Controls, Message, Reference, Stamp, State, Truth};
use flight::log::{Count, Log, Record, last_tick};
use guidance::Trajectory;
pub use ring::states::{length_m, position_error_m};
use settings::{Mode, Scenario};

/// Largest number of ticks from a command's own tick to the tick at which the command takes effect. The limit keeps a
/// damaged STATE from causing a search of the whole flight.
const MOST_AGE_TICKS: usize = 1000;
/// Number of newest ticks that [`Joined`] keeps open, because late messages and the age of the command may still come.
const OPEN_TICKS: u64 = 1024;

/// One tick. `T` holds the kept parts of its messages.
#[derive(Debug, Clone, Copy)]
pub struct Tick<T> {
    pub number: u64,
    /// Period of the ring \[ns\].
    pub period_ns: u64,
    /// Instant of the sample \[ns\]; 0 if the tick has no message.
    pub sample_ns: u64,
    /// Position that the mission asks for, NED \[m\].
    pub wanted_m: [f64; 3],
    /// Position error against the mission, as in run.json, NED \[m\]; `None` without a TRUTH.
    pub error_m: Option<[f64; 3]>,
    /// Time from the sample until the tick's command took effect \[ns\]; `None` if it never did.
    pub age_ns: Option<u64>,
    /// Sequence number of the tick's newest ACTUATORS; 0 if there is none.
    command: u64,
    pub of: T,
}

impl<T: Default> Tick<T> {
    fn without_messages(number: u64, trajectory: &Trajectory, sample_s: f64, period_ns: u64) -> Self {
        let wanted_m = trajectory.at(number as f64 * sample_s).position_m;
        let of = T::default();
        Self { number, period_ns, sample_ns: 0, wanted_m, error_m: None, age_ns: None, command: 0, of }
    }
}

impl<T> Tick<T> {
    /// Simulated time of the sample \[s\].
    pub fn time_s(&self) -> f64 {
        self.number as f64 * self.period_ns as f64 / 1e9
    }

    /// Length of the position error \[m\].
    pub fn distance_m(&self) -> Option<f64> {
        self.error_m.map(length_m)
    }
}

#[derive(Clone)]
pub struct Ticks<T> {
    trajectory: Trajectory,
    sample_s: f64,
    period_ns: u64,
    last: u64,
    pub by_number: BTreeMap<u64, Tick<T>>,
    /// Sequence number of the command in force at the newest STATE.
    in_force: u64,
    /// Number of messages observed, and of ticks that were handed out and forgotten.
    seen: u64,
    told: u64,
}

impl<T: Default> Ticks<T> {
    pub fn new(scenario: &Scenario) -> Self {
        Self {
            trajectory: Trajectory::new(scenario),
            sample_s: scenario.sample_s(),
            period_ns: scenario.sample_ns(),
            last: scenario.ticks(),
            by_number: BTreeMap::new(),
            in_force: 0,
            seen: 0,
            told: 0,
        }
    }

    /// Takes one message in; `keep` stores in the tick the part of the message that the caller wants. Of several
    /// messages with the same topic and tick the last counts. A message is ignored if its tick was already handed out,
    /// or if the flight cannot have that tick.
    pub fn observe(&mut self, record: &Record, keep: impl FnOnce(&mut T)) {
        let number = record.tick();
        self.seen += 1;
        let last = self.last.min(last_tick(self.seen));
        if number > last || number < self.told {
            return;
        }
        let Self { trajectory, sample_s, period_ns, .. } = self;
        let tick = self.by_number.entry(number);
        let tick = tick.or_insert_with(|| Tick::without_messages(number, trajectory, *sample_s, *period_ns));
        tick.sample_ns = record.stamped().map_or(tick.sample_ns, |(_, stamp)| stamp.sample_ns);
        keep(&mut tick.of);
        match record {
            Record::State(state) => self.applied(state),
            Record::Truth(truth) => tick.error_m = Some(position_error_m(tick.wanted_m, truth)),
            Record::Actuators(actuators) => tick.command = actuators.stamp.sequence,
            Record::Reference(_) | Record::Controls(_) => {}
        }
    }

    /// Hands each tick, including ticks without a message, once to `each` and forgets it; the newest `open` ticks stay.
    pub fn tell(&mut self, open: u64, mut each: impl FnMut(&Tick<T>)) {
        let end = self.by_number.last_key_value().map_or(0, |(number, _)| number + 1);
        while self.told + open < end {
            let tick = self.by_number.remove(&self.told);
            let Self { trajectory, sample_s, period_ns, .. } = self;
            each(&tick.unwrap_or_else(|| Tick::without_messages(self.told, trajectory, *sample_s, *period_ns)));
            self.told += 1;
        }
    }

    /// Stores the age of a command that is newly in force at `state`. Takes the newest command with that number,
    /// because a restarted mixer numbers its messages from 1 again.
    fn applied(&mut self, state: &State) {
        if state.applied_sequence != self.in_force {
            self.in_force = state.applied_sequence;
            let mut before = self.by_number.range_mut(..state.stamp.tick).rev().take(MOST_AGE_TICKS);
            if let Some((_, tick)) = before.find(|(_, tick)| tick.command == state.applied_sequence) {
                tick.age_ns = Some(state.applied_age_ns);
            }
        }
    }
}

/// Messages of a tick. A log may lack any of them.
#[derive(Debug, Clone, Copy, Default)]
pub struct Messages {
    pub state: Option<State>,
    pub reference: Option<Reference>,
    pub controls: Option<Controls>,
    pub actuators: Option<Actuators>,
    pub truth: Option<Truth>,
}

impl Messages {
    /// Stamps of the messages, by topic.
    pub fn stamps(&self) -> [Option<&Stamp>; Topic::COUNT] {
        [
            self.state.as_ref().map(Message::stamp),
            self.reference.as_ref().map(Message::stamp),
            self.controls.as_ref().map(Message::stamp),
            self.actuators.as_ref().map(Message::stamp),
        ]
    }

    fn put(&mut self, record: &Record) {
        match *record {
            Record::State(message) => self.state = Some(message),
            Record::Reference(message) => self.reference = Some(message),
            Record::Controls(message) => self.controls = Some(message),
            Record::Actuators(message) => self.actuators = Some(message),
            Record::Truth(message) => self.truth = Some(message),
        }
    }
}

/// Tick of a log with its messages.
pub type LoggedTick = Tick<Messages>;

/// Joins the messages of a log as they are read. A tick has the messages of the active processes as they were sent,
/// also where a fault changed or lost them on the way.
pub struct Joined {
    ticks: Ticks<Messages>,
    count: Count,
    /// Number of newest ticks that stay open.
    open: u64,
}

impl Joined {
    /// Joins the ticks of a flight of `scenario`, from tick `first` on.
    pub fn new(scenario: &Scenario, first: u64) -> Self {
        let ticks = Ticks { told: first, ..Ticks::new(scenario) };
        Self { ticks, count: Count::default(), open: OPEN_TICKS }
    }

    /// Joins the ticks of a flight under way, and hands each out as soon as `open` later ticks have begun.
    pub fn live(scenario: &Scenario, first: u64, open: u64) -> Self {
        Self { open, ..Self::new(scenario, first) }
    }

    /// Takes one message in, in the order of [`flight::log::stream`]; `each` gets the ticks that no later message can
    /// change.
    pub fn observe(&mut self, record: &Record, each: impl FnMut(&LoggedTick)) {
        if self.count.gap(record).is_some() {
            self.ticks.observe(record, |of| of.put(record));
            self.ticks.tell(self.open, each);
        }
    }

    /// Hands the remaining ticks to `each`, up to the last one seen.
    pub fn finish(&mut self, each: impl FnMut(&LoggedTick)) {
        self.ticks.tell(0, each);
    }
}

/// Returns every tick of a log in memory, from `first` on.
pub fn logged(log: &Log, scenario: &Scenario, first: u64) -> Vec<LoggedTick> {
    let mut joined = Joined::new(scenario, first);
    let mut ticks = vec![];
    log.tick_by_tick().for_each(|record| joined.observe(&record, |tick| ticks.push(*tick)));
    joined.finish(|tick| ticks.push(*tick));
    ticks
}

/// Interval in which a command was in force.
#[derive(Debug, Clone, Copy)]
pub struct InForce {
    pub tick: u64,
    pub sequence: u64,
    pub from_ns: u64,
    /// Instant at which the next command took effect, or of the log's last sample \[ns\].
    pub until_ns: u64,
    pub age_ns: u64,
}

/// Returns every command that was in force at a sample, in the order of ticks.
///
/// In lockstep the age is simulated time, which the clock does not show, so a command acts from its publication on.
pub fn in_force(ticks: &[LoggedTick], mode: Mode) -> Vec<InForce> {
    let last_ns = ticks.iter().rev().find_map(|tick| tick.of.state.as_ref()).map_or(0, |state| state.stamp.sample_ns);
    let mut all: Vec<InForce> = vec![];
    for tick in ticks {
        let (Some(command), Some(age_ns)) = (tick.of.actuators, tick.age_ns) else { continue };
        let stamp = &command.stamp;
        let from_ns = match mode {
            Mode::Realtime => stamp.sample_ns.saturating_add(age_ns),
            Mode::Lockstep | Mode::Inprocess => stamp.publish_ns[Topic::Actuators as usize],
        };
        if let Some(before) = all.last_mut() {
            before.until_ns = from_ns;
        }
        let until_ns = last_ns.max(from_ns);
        all.push(InForce { tick: tick.number, sequence: stamp.sequence, from_ns, until_ns, age_ns });
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::stamp::delivery;
    use settings::TrajectoryKind;

    fn stamp(tick: u64, sequence: u64, epoch: u64) -> Stamp {
        Stamp { tick, sample_ns: tick.wrapping_mul(1_000), sequence, epoch, ..Stamp::default() }
    }

    /// Command sent 100 ns after its sample.
    fn command(tick: u64, sequence: u64, epoch: u64) -> Actuators {
        let mut stamp = stamp(tick, sequence, epoch);
        stamp.publish_ns[Topic::Actuators as usize] = stamp.sample_ns.wrapping_add(100);
        Actuators { stamp, ..Actuators::default() }.with_checksum()
    }

    fn state(tick: u64, applied_sequence: u64, applied_age_ns: u64) -> State {
        State { stamp: stamp(tick, tick + 1, 1), applied_sequence, applied_age_ns, ..State::default() }.with_checksum()
    }

    fn truth(tick: u64, position_m: [f64; 3]) -> Truth {
        let mut truth = Truth { tick, sequence: tick + 1, ..Truth::default() };
        truth.actual.position_m = position_m;
        truth.with_checksum()
    }

    fn hovering() -> Scenario {
        let mut scenario = Scenario::default();
        scenario.mission.trajectory = TrajectoryKind::Hover;
        scenario
    }

    #[test]
    fn a_command_acts_from_its_age_on_until_the_next_one() {
        let log = Log {
            states: vec![state(0, 0, 0), state(1, 1, 300), state(2, 1, 300), state(3, 3, 400)],
            actuators: (0..3).map(|tick| command(tick, tick + 1, 1)).collect(),
            ..Log::default()
        };
        let spans = |mode| -> Vec<(u64, u64, u64)> {
            let commands = in_force(&logged(&log, &hovering(), 0), mode);
            commands.iter().map(|command| (command.tick, command.from_ns, command.until_ns)).collect()
        };
        assert_eq!(spans(Mode::Realtime), [(0, 300, 2_400), (2, 2_400, 3_000)]);
        assert_eq!(spans(Mode::Lockstep), [(0, 100, 2_100), (2, 2_100, 3_000)], "on the wall clock");
    }

    #[test]
    fn a_restarted_mixer_is_not_taken_for_its_predecessor() {
        let states = [state(0, 0, 0), state(1, 1, 200), state(2, 2, 200), state(3, 1, 201), state(4, 9, 200)];
        let commands = [command(0, 1, 1), command(1, 2, 1), command(2, 1, 2)];
        let log = Log { states: states.into(), actuators: commands.into(), ..Log::default() };
        let ages: Vec<_> =
            logged(&log, &hovering(), 0).iter().filter_map(|tick| Some((tick.number, tick.age_ns?))).collect();
        assert_eq!(ages, [(0, 200), (1, 200), (2, 201)], "a number that was not sent is left out");
    }

    #[test]
    fn a_hole_is_a_tick_without_messages_and_a_damaged_tick_is_ignored() {
        let mut log = Log { states: (0..10).map(|tick| state(tick, 0, 0)).collect(), ..Log::default() };
        log.states.remove(4);
        log.actuators.push(command(u64::MAX, 1, 1));
        log.truths = log.states.iter().map(|state| truth(state.stamp.tick, [0.0, -3.0, -4.0])).collect();
        let ticks = logged(&log, &hovering(), 0);
        let distances: Vec<_> = ticks.iter().map(Tick::distance_m).collect();
        let mut expected = vec![Some(5.0); 10];
        expected[4] = None;
        assert_eq!(distances, expected);
        assert_eq!(ticks[4].number, 4);
    }

    #[test]
    fn messages_of_a_standby_and_copies_that_a_fault_made_are_left_out() {
        let marked = |sequence, epoch, delivery, col| {
            let stamp = Stamp { delivery, ..stamp(1, sequence, epoch) };
            Controls { stamp, demand: [col, 0.0, 0.0, 0.0], ..Controls::default() }.with_checksum()
        };
        let controls = vec![
            marked(2, 1, delivery::FAULT, -1.0),
            marked(2, 1, delivery::DELIVERED, f64::NAN),
            marked(1, 2, delivery::STANDBY, 7.0),
            marked(1, 2, delivery::STANDBY | delivery::FAULT, 8.0),
        ];
        let log = Log { controls, ..Log::default() };
        assert_eq!(logged(&log, &hovering(), 0)[1].of.controls, Some(log.controls[0]), "as it was sent");
    }
}
