//! Newcomers of a node against the clock: invited, let into the shadow, judged.

use std::time::Instant;

use contract::scenario::{Scenario, SwapTicks};
use runtime::office::Staff;
use runtime::realtime::Board;

use super::Order;
use super::node::{Node, Started};
use crate::event::{Event, What};
use crate::succession::successor;
use crate::succession::trial::{Ruling, Trial};

impl Node {
    /// Whether somebody is on trial, or was started and does not work yet.
    pub fn has_newcomer(&self) -> bool {
        self.trial.is_some() || self.started.is_some()
    }

    /// Whether a newcomer may come; why not.
    pub fn may_swap(&self, board: &Board) -> Result<(), String> {
        let name = self.topic.publisher();
        if self.has_newcomer() {
            return Err(format!("{name} has a newcomer already; wait until its trial is over"));
        }
        if board.office(self.topic).holder() == 0 {
            return Err(format!("{name} has nobody in office to take over from"));
        }
        Ok(())
    }

    /// Starts the newcomer of swap number `i`.
    pub fn invite(
        &mut self,
        board: &Board,
        i: usize,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        if let Err(why) = self.may_swap(board) {
            let rejected = Event::new(tick, self.topic.publisher(), self.newest, What::Rejected);
            events.push(rejected.because(why).begins(Some(i)));
            return;
        }
        self.newest = successor(self.newest, board.office(self.topic).holder());
        self.start(Some(i), tick, now, events, orders);
    }

    /// Gives work to who was started and is ready.
    pub fn welcome(&mut self, board: &Board, scenario: &Scenario, tick: u64, events: &mut Vec<Event>) {
        let office = board.office(self.topic);
        if tick == 0 {
            return;
        }
        let holder = office.holder();
        // Who comes by a swap is tried beside somebody, or not at all: see `Node::died`.
        let has_work = |swap: Option<usize>| swap.is_none() || holder != 0;
        let is_ready = |started: &mut Started| office.met.get() == started.epoch && has_work(started.swap);
        let Some(Started { epoch, swap, .. }) = self.started.take_if(is_ready) else { return };
        match swap {
            Some(i) => {
                let swap = &scenario.swap[i];
                let SwapTicks { from, hand_over, until } = swap.ticks(scenario.sample_s());
                // The sample under way is answered already, or by the one in office.
                let late = tick + 2 - from.min(tick + 2);
                let ticks = SwapTicks { from: from + late, hand_over: hand_over + late, until: until + late };
                self.trial = Some(Trial::new(scenario, swap, self.topic, ticks, (holder, epoch)));
                self.origins.1 = Some(i);
                office.appoint(tick as u32, |staff| Staff { shadow: epoch, ..staff });
                events.push(Event::new(tick, self.topic.publisher(), epoch, What::InShadow));
            }
            None => office.name_heir(epoch),
        }
    }

    /// Does what the trial of a newcomer has come to; all messages of the ticks before `tick` are known.
    pub fn judge(&mut self, board: &Board, tick: u64, events: &mut Vec<Event>, orders: &mut Vec<Order>) {
        let Some(trial) = &mut self.trial else { return };
        let Some((ruling, why)) = trial.rule(tick) else { return };
        let office = board.office(self.topic);
        let (newcomer, old) = (trial.newcomer, trial.old);
        let what = match ruling {
            Ruling::HandOver => {
                office.name_heir(newcomer); // until it is let in, this is said again and again
                return;
            }
            Ruling::Keep => {
                if let Some(old) = old {
                    self.end(board, old, orders);
                }
                self.origins.1 = None;
                What::Kept
            }
            Ruling::Reject => {
                self.end(board, newcomer, orders);
                self.origins.1 = None;
                What::Rejected
            }
            Ruling::Return => {
                self.origins = (self.origins.1, None);
                match old {
                    // Until it is let in, the newcomer has the office.
                    Some(old) => {
                        office.name_heir(old);
                        self.dismiss(newcomer);
                        orders.push(Order::Kill(self.topic, newcomer));
                    }
                    None => self.end(board, newcomer, orders),
                }
                What::Returned
            }
        };
        self.trial = None;
        events.push(Event::new(tick, self.topic.publisher(), newcomer, what).because(why));
        if self.wanted.is_empty() {
            self.mourn(newcomer, tick, events);
        }
    }

    /// Sends a process away, from office or shadow.
    fn end(&mut self, board: &Board, epoch: u32, orders: &mut Vec<Order>) {
        self.dismiss(epoch);
        self.vacate(board, epoch);
        orders.push(Order::Kill(self.topic, epoch));
    }
}
