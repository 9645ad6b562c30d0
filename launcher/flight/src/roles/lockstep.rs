//! The roles of a flight in lockstep: the plant asks who works on a tick, and waits for the answer.
//!
//! ```text
//! plant: asked = tick + 1 -> launcher: all messages of the ticks before are here -> simulated roles -> processes ended,
//! started, ready -> assigned -> ruled = tick + 1 -> plant: STATE of that tick
//! ```
//!
//! Everything stands still meanwhile, so it does not matter how long that takes. The wall clock decides on nothing but the end:
//! a ring that has not moved for `[supervision] wall_limit_s` ends the run.

use std::time::{Duration, Instant};

use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;

use super::realtime::plant_tick;
use super::role::{Action, Input, Signal};
use super::simulated::{Simulated, Step};

/// How often the queues and the children are looked at.
const LOOK: Duration = Duration::from_millis(5);
/// The same while the plant waits for an answer, or soon may.
const QUICK_LOOK: Duration = Duration::from_micros(100);

/// The roles of a lockstep run, and what it waits for.
pub struct Lockstep {
    /// Who works when.
    pub simulated: Simulated,
    asked: Option<Asked>,
    /// Processes that were ended between two ticks: their end is no news.
    ended: Vec<(Topic, u32)>,
    wall_limit: Option<Duration>,
    /// What the ring had done when it last moved, and when that was.
    moved: ([[u32; 2]; Topic::COUNT], Instant),
}

/// The tick that is asked for, once it has been decided.
struct Asked {
    tick: u64,
    /// Who is to be ready for it.
    starting: Vec<(Topic, u32)>,
}

impl Lockstep {
    /// For a run of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let limit_s = scenario.supervision.wall_limit_s;
        Self {
            simulated: Simulated::new(scenario),
            asked: None,
            ended: vec![],
            wall_limit: (limit_s > 0.0).then(|| Duration::from_secs_f64(limit_s)),
            moved: ([[u32::MAX; 2]; Topic::COUNT], Instant::now()), // the first look is a change
        }
    }

    /// The tick that the plant asks for, unless that was answered: all messages of the ticks before have been sent.
    pub fn question(page: &ControlPage) -> Option<u64> {
        let asked = page.asked().count();
        (asked > page.ruled().count()).then(|| u64::from(asked) - 1)
    }

    /// Decides the `question`, when all of the messages before it have been observed; what is to be done.
    pub fn look(&mut self, question: Option<u64>) -> Vec<(Topic, Action)> {
        let Some(tick) = question.filter(|_| self.asked.is_none()) else { return vec![] };
        let steps = self.simulated.begin(tick);
        let started = |step: &Step| if let Step::Begin(topic, epoch, _) = step { Some((*topic, *epoch)) } else { None };
        self.asked = Some(Asked { tick, starting: steps.iter().filter_map(started).collect() });
        let mut act = |step| match step {
            Step::End(topic, epoch) => {
                self.ended.push((topic, epoch));
                (topic, Action::Signal(epoch, Signal::Kill))
            }
            Step::Begin(topic, epoch, origin) => (topic, Action::Spawn(epoch, origin)),
        };
        steps.into_iter().map(&mut act).collect()
    }

    /// Answers the plant, when all processes are ready and everything has been done.
    pub fn answer(&mut self, page: &ControlPage) {
        let ready = |(topic, epoch): &(Topic, u32)| page.role(*topic).met.get() == *epoch;
        let Some(Asked { tick, .. }) = self.asked.take_if(|asked| asked.starting.iter().all(ready)) else { return };
        for topic in Topic::ALL {
            let assignment: Assignment = self.simulated.assignment(topic);
            page.role(topic).assign(tick as u32, |_| assignment);
        }
        page.ask_from().set(u32::try_from(self.simulated.next_decision()).unwrap_or(u32::MAX));
        page.ruled().raise(tick as u32 + 1);
    }

    /// A process of a node has ended by itself, or could not be started: `input` says which.
    pub fn exited(&mut self, page: &ControlPage, topic: Topic, epoch: u32, input: Input) {
        if self.ended.contains(&(topic, epoch)) {
            return;
        }
        let tick = self.asked.as_ref().map_or_else(|| plant_tick(page), |asked| asked.tick);
        self.simulated.exited(topic, epoch, tick, input);
        if let Some(Asked { starting, .. }) = &mut self.asked {
            starting.retain(|started| *started != (topic, epoch));
        }
        page.ask_from().set(0);
        page.role(topic).dismiss(epoch);
        page.doorbell(topic).ring();
    }

    /// The process that has kept the ring waiting for longer than the wall clock's limit.
    pub fn stuck(&mut self, page: &ControlPage) -> Option<&'static str> {
        let epochs = |topic| {
            let Assignment { active, standby } = self.simulated.assignment(topic);
            [active, standby]
        };
        let done = |topic| epochs(topic).map(|epoch| page.role(topic).done(epoch).get());
        let all = Topic::ALL.map(done);
        if all != self.moved.0 {
            self.moved = (all, Instant::now());
        }
        self.wall_limit.filter(|limit| self.moved.1.elapsed() > *limit)?;
        if let Some(Asked { starting, .. }) = &self.asked {
            let late = starting.iter().find(|(topic, epoch)| page.role(*topic).met.get() != *epoch);
            return Some(late.map_or("the recorder", |(topic, _)| topic.publisher()));
        }
        let sampled = all[Topic::State as usize][0];
        let late = |topic: &Topic| (0..2).any(|i| epochs(*topic)[i] != 0 && done(*topic)[i] < sampled);
        Some(Topic::ALL.into_iter().find(late).unwrap_or(Topic::State).publisher())
    }

    /// When to look again.
    pub fn due(page: &ControlPage) -> Instant {
        Instant::now() + if page.asked().count() > 0 { QUICK_LOOK } else { LOOK }
    }
}
