//! Driver of the roles in lockstep: the plant asks which processes work on a tick, and waits for the answer.
//!
//! ```text
//! plant: asked = tick + 1 -> launcher: all messages of earlier ticks are here -> simulated roles -> processes ended,
//! started, ready -> assigned -> decided = tick + 1 -> plant: STATE of that tick
//! ```
//!
//! The ring stands still meanwhile, so the time that this takes does not matter. The wall clock decides one thing only:
//! a ring that has not moved for `[supervision] wall_limit_s` ends the run, unless a debugger traces one of its
//! processes.

use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::topic::Topic;
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;
use settings::Scenario;

use super::driver::Driver;
use crate::event::{Event, What};
use crate::limits::{LOOK, QUICK_LOOK};
use crate::log::Record;
use ring::roles::Order;
use ring::roles::role::{Action, RoleInput, Signal};
use ring::roles::simulated::Simulated;
use ring::roles::supervised::Supervised;

/// Roles of a lockstep run, and the decision that the plant waits for.
pub struct Lockstep {
    page: Arc<ControlPage>,
    simulated: Simulated,
    asked: Option<Asked>,
    /// Processes that the roles have killed between two ticks; their exits are expected.
    killed: Vec<(Topic, u32)>,
    wall_limit: Option<Duration>,
    /// Ticks done by the active and the standby process of each node when the ring last moved, and that instant.
    moved: ([[u32; 2]; Topic::COUNT], Instant),
}

/// Tick that the plant waits for, after the roles have decided which processes work on it.
struct Asked {
    tick: u64,
    /// Processes that must be ready before the plant is answered.
    starting: Vec<(Topic, u32)>,
}

impl Lockstep {
    pub fn new(scenario: &Scenario, page: Arc<ControlPage>) -> Self {
        let limit_s = scenario.supervision.wall_limit_s;
        Self {
            page,
            simulated: Simulated::new(scenario),
            asked: None,
            killed: vec![],
            wall_limit: (limit_s > 0.0).then(|| Duration::from_secs_f64(limit_s)),
            moved: ([[u32::MAX; 2]; Topic::COUNT], Instant::now()), // no real count, so the first look counts as a move
        }
    }

    /// Removes a process that ended or could not be started, as `input` says. Ignores processes that the roles killed.
    fn exited(&mut self, topic: Topic, epoch: u32, input: RoleInput) {
        if self.killed.contains(&(topic, epoch)) {
            return;
        }
        let tick = self.asked.as_ref().map_or_else(|| self.page.plant_tick(), |asked| asked.tick);
        self.simulated.exited(topic, epoch, tick, input);
        if let Some(Asked { starting, .. }) = &mut self.asked {
            starting.retain(|started| *started != (topic, epoch));
        }
        self.page.next_decision.set(0);
        self.page.role(topic).dismiss(epoch);
        self.page.doorbell(topic).ring();
    }

    /// Returns the ticks done by the active and the standby process of a node; 0 for a process that is absent or
    /// stopped.
    fn done_by(&self, topic: Topic) -> [u32; 2] {
        let Assignment { active, standby } = self.simulated.assignment(topic);
        [active, standby].map(|epoch| self.page.role(topic).done(epoch).get())
    }

    /// Returns the name of the process that the ring waits for.
    fn awaited(&self) -> &'static str {
        if let Some(Asked { starting, .. }) = &self.asked {
            let late = starting.iter().find(|(topic, epoch)| self.page.role(*topic).observed.get() != *epoch);
            return late.map_or("the recorder", |(topic, _)| topic.publisher());
        }
        let sampled = self.done_by(Topic::State)[0];
        let late = |topic: &Topic| {
            let epochs = self.simulated.assignment(*topic).epochs();
            { epochs }.any(|epoch| self.page.role(*topic).done(epoch).get() < sampled)
        };
        Topic::ALL.into_iter().find(late).unwrap_or(Topic::State).publisher()
    }
}

impl Driver for Lockstep {
    fn nodes(&self) -> &[Supervised; Topic::COUNT] {
        &self.simulated.nodes
    }

    fn observe(&mut self, record: &Record) {
        self.simulated.observe(record);
    }

    fn question(&self) -> Option<u64> {
        let asked = self.page.asked.count();
        (asked > self.page.decided.count()).then(|| u64::from(asked) - 1)
    }

    fn look(&mut self, _scenario: &Scenario, question: Option<u64>) -> Vec<Order> {
        let Some(tick) = question.filter(|_| self.asked.is_none()) else { return vec![] };
        let orders = self.simulated.begin(tick);
        let mut starting = vec![];
        for (topic, action) in &orders {
            match action {
                Action::Spawn(epoch, _) => starting.push((*topic, *epoch)),
                Action::Signal(epoch, _) => self.killed.push((*topic, *epoch)),
                _ => {}
            }
        }
        self.asked = Some(Asked { tick, starting });
        let reports = self.simulated.events.drain(..).map(|event| (Topic::State, Action::Report(event)));
        reports.chain(orders).collect()
    }

    /// Answers the plant if every process that it waits for is ready.
    fn done(&mut self) {
        let page = &self.page;
        let ready = |(topic, epoch): &(Topic, u32)| page.role(*topic).observed.get() == *epoch;
        let Some(Asked { tick, .. }) = self.asked.take_if(|asked| asked.starting.iter().all(ready)) else { return };
        for topic in Topic::ALL {
            page.role(topic).assign(tick as u32, |_| self.simulated.assignment(topic));
        }
        page.next_decision.set(u32::try_from(self.simulated.next_decision()).unwrap_or(u32::MAX));
        page.decided.raise(tick as u32 + 1);
    }

    fn on(&mut self, _scenario: &Scenario, topic: Topic, input: RoleInput) -> Vec<Order> {
        match input {
            RoleInput::Exited(epoch) | RoleInput::NotStarted(epoch, _) => self.exited(topic, epoch, input),
            RoleInput::Disconnected(epoch, why) => {
                let event = Event::new(self.page.plant_tick(), topic.publisher(), epoch, What::Hung).because(why);
                return vec![(topic, Action::Report(event)), (topic, Action::Signal(epoch, Signal::Kill))];
            }
            _ => {} // the simulated roles make all other inputs themselves
        }
        vec![]
    }

    fn may_swap(&self, _topic: Topic) -> Result<(), String> {
        Err("a flight in lockstep must be repeatable: write the swap into its scenario".into())
    }

    fn stuck(&mut self, is_traced: &dyn Fn() -> bool) -> Option<String> {
        if self.simulated.assignment(Topic::State).active == 0 {
            return Some("plant".into());
        }
        let done = Topic::ALL.map(|topic| self.done_by(topic));
        if done != self.moved.0 {
            self.moved = (done, Instant::now());
        }
        self.wall_limit.filter(|limit| self.moved.1.elapsed() > *limit)?;
        if is_traced() {
            self.moved.1 = Instant::now();
            return None;
        }
        let name = self.awaited();
        Some(format!("{name} (the ring has not moved for the wall clock's limit, `supervision.wall_limit_s`)"))
    }

    fn due(&self) -> Instant {
        Instant::now() + if self.page.asked.count() > 0 { QUICK_LOOK } else { LOOK }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::Supervision;

    #[test]
    fn a_ring_that_does_not_move_ends_the_run_unless_a_debugger_has_a_process() {
        let supervision = Supervision { wall_limit_s: 0.01, ..Supervision::default() };
        let scenario = Scenario { supervision, ..Scenario::default() };
        let mut lockstep = Lockstep::new(&scenario, Arc::new(ControlPage::private().expect("memory")));
        assert_eq!(lockstep.stuck(&|| false), None, "the first look");
        std::thread::sleep(Duration::from_millis(11));
        assert_eq!(lockstep.stuck(&|| true), None);
        std::thread::sleep(Duration::from_millis(11));
        assert!(lockstep.stuck(&|| false).is_some_and(|why| why.contains("wall_limit_s")));
    }
}
