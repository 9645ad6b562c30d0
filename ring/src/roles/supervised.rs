//! Role of one node with the trial of its candidate. The trial judges messages; the role acts on its rulings.

use contract::topic::Topic;
use settings::{Scenario, SwapTicks};

use super::role::{Action, Now, Policy, Role, RoleInput};
use super::trial::Trial;
use crate::event::What;
use crate::record::Record;

pub struct Supervised {
    pub topic: Topic,
    pub role: Role,
    trial: Option<Trial>,
}

impl Supervised {
    /// Creates the roles of all nodes; the first process of each is active.
    pub fn all(scenario: &Scenario) -> [Self; Topic::COUNT] {
        let (settings, sample_ns) = (&scenario.supervision, scenario.sample_ns());
        let policy = |topic| match topic {
            Topic::State => Policy::plant(settings, sample_ns),
            _ => Policy::node(settings, sample_ns),
        };
        let one = |topic: Topic| Self { topic, role: Role::new(topic.publisher(), policy(topic)), trial: None };
        Topic::ALL.map(one)
    }

    pub fn observe(&mut self, record: &Record) {
        if let Some(trial) = &mut self.trial {
            trial.observe(record);
        }
    }

    /// Handles `input`. A candidate that goes on standby is judged from `first_tick` on, or later if its swap says so.
    pub fn on(&mut self, scenario: &Scenario, now: Now, first_tick: u64, input: RoleInput) -> Vec<Action> {
        let mut actions = self.role.on(now, input);
        self.follow(scenario, first_tick);
        for action in &mut actions {
            if let (Action::Report(event), Some(trial)) = (action, &self.trial)
                && event.what == What::TookOver
                && event.epoch == trial.candidate
            {
                *event = event.clone().because(trial.describe());
            }
        }
        actions
    }

    /// Returns the ruling of the trial before `tick`, if any. All messages of earlier ticks must have been observed.
    pub fn ruling(&mut self, tick: u64) -> Option<RoleInput> {
        self.trial.as_mut()?.rule(tick).map(|(ruling, why)| RoleInput::Ruled(ruling, why))
    }

    /// Starts, updates or drops the trial to match the candidate of the role.
    fn follow(&mut self, scenario: &Scenario, first_tick: u64) {
        let Some(contest) = self.role.contest() else {
            self.trial = None;
            return;
        };
        if self.trial.is_none()
            && let Some(swap) = self.role.swap_on_trial().and_then(|i| scenario.swap.get(i))
        {
            let SwapTicks { from, hand_over, until } = swap.ticks(scenario.sample_s());
            let late = first_tick.saturating_sub(from);
            let ticks = SwapTicks { from: from + late, hand_over: hand_over + late, until: until + late };
            let epochs = (contest.old.unwrap_or(0), contest.candidate);
            self.trial = Some(Trial::new(scenario, swap, self.topic, ticks, epochs));
        }
        if let Some(trial) = &mut self.trial {
            (trial.old, trial.active) = (contest.old, contest.handed_over);
        }
    }
}

/// Returns the name of a node that was given up, if any.
pub fn given_up(nodes: &[Supervised]) -> Option<&'static str> {
    nodes.iter().find(|node| node.role.given_up()).map(|node| node.role.name())
}
