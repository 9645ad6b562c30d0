//! One node under supervision: who holds its office, who was started, who is under trial.

use std::time::{Duration, Instant};

use contract::plan::HANG_TICKS;
use contract::realtime::Board;
use contract::scenario::{Scenario, SwapTicks};
use contract::topic::Topic;

use super::Order;
use crate::event::{Event, What};
use crate::succession::successor;
use crate::succession::trial::{Ruling, Trial};

/// Waits before the first, second, third new start within `WINDOW`; after that the node is given up.
const BACK_OFF_MS: [u64; 3] = [0, 50, 100];
const WINDOW: Duration = Duration::from_secs(5);
/// At high rates a few ticks are no longer than the machine may hold a process up for reasons of its own.
const LEAST_HANG: Duration = Duration::from_millis(20);
/// The plant has nobody to answer for it: its motors are off after this time, so it is the end of the flight.
const PLANT_HANG: Duration = Duration::from_millis(500);
/// Who has been started is to be ready by then.
const START_LIMIT: Duration = Duration::from_secs(5);

/// One node.
pub struct Node {
    /// The topic it speaks on.
    pub topic: Topic,
    /// A newcomer, once it works.
    pub trial: Option<Trial>,
    /// Nobody is started any more.
    pub given_up: bool,
    /// How long it may make no progress.
    hang: Duration,
    /// The newest epoch.
    newest: u32,
    /// Who has been started and does not work yet.
    started: Option<Started>,
    /// New starts within the window.
    starts: Vec<Instant>,
    restart_at: Option<Instant>,
    /// A newcomer that was sent away.
    dismissed: u32,
    /// The swaps that the holder and the shadow came with.
    origins: (Option<usize>, Option<usize>),
    /// Ticks the holder had done when it last made progress, and when that was.
    progress: (u32, Instant),
    /// The holder when last looked at.
    holder: u32,
}

#[derive(Clone, Copy)]
struct Started {
    epoch: u32,
    at: Instant,
    /// The swap that it comes with, when it is a newcomer.
    swap: Option<usize>,
}

impl Node {
    /// With its first process.
    pub fn new(topic: Topic, sample_s: f64) -> Self {
        let now = Instant::now();
        // A little less than the ticks say, because the look around comes late too.
        let ticks = Duration::from_secs_f64(sample_s * (HANG_TICKS as f64 - 1.0));
        Self {
            topic,
            trial: None,
            given_up: false,
            hang: if topic == Topic::State { PLANT_HANG } else { ticks.max(LEAST_HANG) },
            newest: 1,
            started: None,
            starts: vec![],
            restart_at: None,
            dismissed: 0,
            origins: (None, None),
            progress: (0, now),
            holder: 1,
        }
    }

    /// Whether a newcomer may come; why not.
    pub fn may_swap(&self, board: &Board) -> Result<(), String> {
        let name = self.topic.publisher();
        if self.trial.is_some() || self.started.is_some() {
            return Err(format!("{name} has a newcomer already; wait until its trial is over"));
        }
        if board.office(self.topic).holder() == 0 {
            return Err(format!("{name} has nobody in office to take over from"));
        }
        Ok(())
    }

    /// A process of it has ended.
    pub fn died(&mut self, board: &Board, epoch: u32, tick: u64, events: &mut Vec<Event>) {
        let office = board.office(self.topic);
        let staff = office.staff();
        office.appoint(tick as u32, |staff| staff.without(epoch));
        // Nor can it take the office any more, should it have been about to.
        for word in [&office.ready, &office.heir] {
            if word.get() == epoch {
                word.set(0);
            }
        }
        let started = self.started.take_if(|started| started.epoch == epoch);
        if started.is_none() && !staff.employs(epoch) {
            return; // it was sent away, or its time was over
        }
        if epoch != self.dismissed {
            events.push(Event::new(tick, self.topic.publisher(), epoch, What::Died));
        }
        if started.is_some_and(|started| started.swap.is_some()) {
            events.push(
                Event::new(tick, self.topic.publisher(), epoch, What::Rejected).because("it died before it was ready"),
            );
            return;
        }
        if let Some(trial) = self.trial.take() {
            let what = match epoch == trial.newcomer {
                true if trial.in_office => What::Returned,
                true => What::Rejected,
                false => What::Kept,
            };
            events.push(
                Event::new(tick, self.topic.publisher(), trial.newcomer, what).because(format!("epoch {epoch} died")),
            );
        }
        let stand_in = office.staff().without(epoch);
        if stand_in.holder == 0 && stand_in.shadow != 0 {
            office.heir.set(stand_in.shadow);
            self.origins = (self.origins.1, None);
        } else if stand_in.holder == 0 {
            self.mourn(epoch, tick, events);
        }
        board.bell(self.topic).ring();
    }

    /// Sees to it that another is started; after too many deaths nobody is.
    fn mourn(&mut self, epoch: u32, tick: u64, events: &mut Vec<Event>) {
        let now = Instant::now();
        self.starts.retain(|start| now.duration_since(*start) < WINDOW);
        if let Some(wait_ms) = BACK_OFF_MS.get(self.starts.len()) {
            self.starts.push(now);
            self.restart_at = Some(now + Duration::from_millis(*wait_ms));
        } else {
            self.given_up = true;
            events.push(Event::new(tick, self.topic.publisher(), epoch, What::GivenUp));
        }
    }

    /// Starts who is due.
    pub fn restart(
        &mut self,
        board: &Board,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        // Somebody who is on the way already has the office when it arrives.
        if self.started.is_none() && self.restart_at.take_if(|at| now >= *at).is_some() {
            self.newest = successor(self.newest, board.office(self.topic).staff().shadow);
            self.start(None, tick, now, events, orders);
        }
        if let Some(started) = self.started
            && now.duration_since(started.at) > START_LIMIT
        {
            orders.push(Order::Kill(self.topic, started.epoch));
        }
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
            events.push(Event::new(tick, self.topic.publisher(), self.newest, What::Rejected).because(why));
            return;
        }
        self.newest = successor(self.newest, board.office(self.topic).holder());
        self.start(Some(i), tick, now, events, orders);
    }

    fn start(
        &mut self,
        swap: Option<usize>,
        tick: u64,
        now: Instant,
        events: &mut Vec<Event>,
        orders: &mut Vec<Order>,
    ) {
        self.started = Some(Started { epoch: self.newest, at: now, swap });
        events.push(Event::new(tick, self.topic.publisher(), self.newest, What::Started));
        orders.push(Order::Start(self.topic, self.newest, swap.or(self.origins.0)));
    }

    /// Gives work to who was started and is ready.
    pub fn welcome(&mut self, board: &Board, scenario: &Scenario, tick: u64, events: &mut Vec<Event>) {
        let office = board.office(self.topic);
        if tick == 0 {
            return;
        }
        let Some(Started { epoch, swap, .. }) = self.started.take_if(|started| office.ready.get() == started.epoch)
        else {
            return;
        };
        let holder = office.holder();
        match swap {
            Some(i) if holder != 0 => {
                let swap = &scenario.swap[i];
                let SwapTicks { from, hand_over, until } = swap.ticks(scenario.sample_s());
                // The sample under way is answered already, or by the one in office.
                let late = tick + 2 - from.min(tick + 2);
                let ticks = SwapTicks { from: from + late, hand_over: hand_over + late, until: until + late };
                self.trial = Some(Trial::new(scenario, swap, self.topic, ticks, (holder, epoch)));
                self.origins.1 = Some(i);
                office.appoint(tick as u32, |staff| contract::office::Staff { shadow: epoch, ..staff });
                events.push(Event::new(tick, self.topic.publisher(), epoch, What::InShadow));
            }
            _ => {
                if swap.is_some() {
                    self.origins.0 = swap;
                }
                self.restart_at = None;
                office.heir.set(epoch);
            }
        }
    }

    /// Offices that changed hands, holders that hang.
    pub fn notice(&mut self, board: &Board, tick: u64, now: Instant, events: &mut Vec<Event>, orders: &mut Vec<Order>) {
        let office = board.office(self.topic);
        let holder = office.holder();
        if holder != self.holder && holder != 0 {
            let mut event = Event::new(tick, self.topic.publisher(), holder, What::TookOver);
            if let Some(trial) = self.trial.as_mut().filter(|trial| trial.newcomer == holder) {
                trial.in_office = true;
                event = event.because(trial.describe());
                self.origins = (self.origins.1, self.origins.0);
            }
            events.push(event);
        }
        let done = office.done(holder).get();
        if holder == 0 || holder != self.holder || done != self.progress.0 {
            self.progress = (done, now);
        }
        self.holder = holder;
        // The sample after the newest it has done is number `done`: that many have come since without an answer.
        let behind = self.topic == Topic::State || tick + 1 >= u64::from(done) + HANG_TICKS;
        if holder != 0 && tick > 0 && behind && now.duration_since(self.progress.1) > self.hang {
            events.push(Event::new(tick, self.topic.publisher(), holder, What::Hung));
            self.progress.1 = now;
            orders.push(Order::Kill(self.topic, holder));
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
                office.heir.set(newcomer); // until it is let in, this is said again and again
                return;
            }
            Ruling::Keep => {
                office.appoint(tick as u32, |staff| staff.without(old)); // and so it leaves
                self.origins.1 = None;
                What::Kept
            }
            Ruling::Reject => {
                office.heir.set(0);
                office.appoint(tick as u32, |staff| staff.without(newcomer));
                self.origins.1 = None;
                self.dismissed = newcomer;
                orders.push(Order::Kill(self.topic, newcomer));
                What::Rejected
            }
            Ruling::Return => {
                office.heir.set(old);
                self.origins = (self.origins.1, None);
                self.dismissed = newcomer;
                orders.push(Order::Kill(self.topic, newcomer));
                What::Returned
            }
        };
        self.trial = None;
        events.push(Event::new(tick, self.topic.publisher(), newcomer, what).because(why));
    }
}
