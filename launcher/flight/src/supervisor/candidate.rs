//! Candidates of a node against the clock: invited, let into the standby, judged.

use std::time::Instant;

use contract::scenario::{Scenario, SwapTicks};
use runtime::realtime::ControlPage;
use runtime::shared_role::Assignment;

use super::Order;
use super::node::{Node, Started};
use crate::event::{Event, What};
use crate::succession::successor;
use crate::succession::trial::{Ruling, Trial};

impl Node {
    /// Whether somebody is on trial, or was started and does not work yet.
    pub fn has_candidate(&self) -> bool {
        self.trial.is_some() || self.started.is_some()
    }

    /// Whether a candidate may come; why not.
    pub fn may_swap(&self, page: &ControlPage) -> Result<(), String> {
        let name = self.topic.publisher();
        if self.has_candidate() {
            return Err(format!("{name} has a candidate already; wait until its trial is over"));
        }
        if page.role(self.topic).active() == 0 {
            return Err(format!("{name} has nobody active to take over from"));
        }
        Ok(())
    }

    /// Starts the candidate of swap number `i`.
    pub fn invite(
        &mut self,
        page: &ControlPage,
        i: usize,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        if let Err(why) = self.may_swap(page) {
            let rejected = Event::new(tick, self.topic.publisher(), self.newest, What::Rejected);
            events.push(rejected.because(why).begins(Some(i)));
            return;
        }
        self.newest = successor(self.newest, page.role(self.topic).active());
        self.start(Some(i), tick, now, events, orders);
    }

    /// Gives work to who was started and is ready.
    pub fn welcome(&mut self, page: &ControlPage, scenario: &Scenario, tick: u64, events: &mut Vec<Event>) {
        let role = page.role(self.topic);
        if tick == 0 {
            return;
        }
        let active = role.active();
        // Who comes by a swap is tried beside somebody, or not at all: see `Node::died`.
        let has_work = |swap: Option<usize>| swap.is_none() || active != 0;
        let is_ready = |started: &mut Started| role.met.get() == started.epoch && has_work(started.swap);
        let Some(Started { epoch, swap, .. }) = self.started.take_if(is_ready) else { return };
        match swap {
            Some(i) => {
                let swap = &scenario.swap[i];
                let SwapTicks { from, hand_over, until } = swap.ticks(scenario.sample_s());
                // The sample under way is answered already, or by the one active.
                let late = tick + 2 - from.min(tick + 2);
                let ticks = SwapTicks { from: from + late, hand_over: hand_over + late, until: until + late };
                self.trial = Some(Trial::new(scenario, swap, self.topic, ticks, (active, epoch)));
                self.origins.1 = Some(i);
                role.assign(tick as u32, |assignment| Assignment { standby: epoch, ..assignment });
                events.push(Event::new(tick, self.topic.publisher(), epoch, What::OnStandby));
            }
            None => role.set_pending(epoch),
        }
    }

    /// Does what the trial of a candidate has come to; all messages of the ticks before `tick` are known.
    pub fn judge(&mut self, page: &ControlPage, tick: u64, events: &mut Vec<Event>, orders: &mut Vec<Order>) {
        let Some(trial) = &mut self.trial else { return };
        let Some((ruling, why)) = trial.rule(tick) else { return };
        let role = page.role(self.topic);
        let (candidate, old) = (trial.candidate, trial.old);
        let what = match ruling {
            Ruling::HandOver => {
                role.set_pending(candidate); // until it is let in, this is said again and again
                return;
            }
            Ruling::Keep => {
                if let Some(old) = old {
                    self.end(page, old, orders);
                }
                self.origins.1 = None;
                What::Kept
            }
            Ruling::Reject => {
                self.end(page, candidate, orders);
                self.origins.1 = None;
                What::Rejected
            }
            Ruling::Return => {
                self.origins = (self.origins.1, None);
                match old {
                    // Until it is let in, the candidate is active.
                    Some(old) => {
                        role.set_pending(old);
                        self.dismiss(candidate);
                        orders.push(Order::Kill(self.topic, candidate));
                    }
                    None => self.end(page, candidate, orders),
                }
                What::Returned
            }
        };
        self.trial = None;
        events.push(Event::new(tick, self.topic.publisher(), candidate, what).because(why));
        if self.wanted.is_empty() {
            self.count_failure(candidate, tick, events);
        }
    }

    /// Sends a process away, from role or standby.
    fn end(&mut self, page: &ControlPage, epoch: u32, orders: &mut Vec<Order>) {
        self.dismiss(epoch);
        self.vacate(page, epoch);
        orders.push(Order::Kill(self.topic, epoch));
    }
}
