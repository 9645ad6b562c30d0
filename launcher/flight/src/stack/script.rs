//! Lockstep: the plant asks who works on a tick, and this says it.
//!
//! ```text
//! plant: asked = tick + 1 -> launcher: all messages of the ticks before are here -> succession -> processes ended,
//! started, ready -> appointed -> ruled = tick + 1 -> plant: STATE of that tick
//! ```
//!
//! Everything stands still meanwhile, so it does not matter how long that takes.

use std::time::{Duration, Instant};

use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::realtime::ControlPage;
use runtime::release::LEAD_TICKS;
use runtime::shared_role::Assignment;

use crate::event::{Event, What};
use crate::succession::{Step, Succession};
use crate::supervisor::{Order, plant_tick};

/// On the wall clock, a process that works on the same sample for so long hangs.
const HANG: Duration = Duration::from_secs(2);
/// On the wall clock, a process that is not ready by then never will be.
const START_LIMIT: Duration = Duration::from_secs(5);

/// The succession of a lockstep run, and what it waits for.
pub struct Script {
    /// Who works when.
    pub succession: Succession,
    awaited: Option<Awaited>,
    /// What the ring had done when it last moved, and when that was.
    progress: ([[u32; 2]; Topic::COUNT], Instant),
}

/// The tick that is asked for, once it has been decided.
struct Awaited {
    tick: u64,
    /// Who is to be ready for it.
    starting: Vec<(Topic, u32)>,
    /// Since when.
    since: Instant,
}

impl Script {
    /// For a run of `scenario`.
    pub fn new(scenario: &Scenario) -> Self {
        let progress = ([[u32::MAX; 2]; Topic::COUNT], Instant::now()); // the first look is a change
        Self { succession: Succession::new(scenario), awaited: None, progress }
    }

    /// The tick that the plant asks for, unless that was answered: all messages of the ticks before have been sent.
    pub fn question(page: &ControlPage) -> Option<u64> {
        let asked = page.asked().count();
        (asked > page.ruled().count()).then(|| u64::from(asked) - 1)
    }

    /// Decides the `question`, when all of the messages before it have been observed; what is to be done.
    pub fn orders(&mut self, page: &ControlPage, question: Option<u64>) -> Vec<Order> {
        let mut orders = vec![];
        if let Some(tick) = question
            && self.awaited.is_none()
        {
            let mut starting = vec![];
            for step in self.succession.begin(tick) {
                orders.push(match step {
                    Step::End(topic, epoch) => Order::Kill(topic, epoch),
                    Step::Begin(topic, epoch, origin) => {
                        starting.push((topic, epoch));
                        Order::Start(topic, epoch, origin)
                    }
                });
            }
            self.awaited = Some(Awaited { tick, starting, since: Instant::now() });
        }
        orders.extend(self.hung(page));
        orders
    }

    /// Answers the plant, when everybody is ready and all orders have been carried out.
    pub fn answer(&mut self, page: &ControlPage) {
        let ready = |(topic, epoch): &(Topic, u32)| page.role(*topic).met.get() == *epoch;
        let Some(Awaited { tick, starting, .. }) = &self.awaited else { return };
        if !starting.iter().all(ready) || self.succession.assignment(Topic::State).active == 0 {
            return; // without a plant nobody hears it
        }
        for topic in Topic::ALL {
            let assignment = self.succession.assignment(topic);
            page.role(topic).assign(*tick as u32, |_| assignment);
        }
        page.ruled().raise(*tick as u32 + 1);
        self.awaited = None;
    }

    /// A process has ended that was not asked to. False when the run cannot go on without it.
    pub fn died(&mut self, page: &ControlPage, topic: Topic, epoch: u32) -> bool {
        let tick = self.awaited.as_ref().map_or_else(|| plant_tick(page), |awaited| awaited.tick);
        if topic == Topic::State {
            return false;
        }
        self.succession.lost(topic, epoch, tick);
        if let Some(Awaited { starting, .. }) = &mut self.awaited {
            starting.retain(|started| *started != (topic, epoch));
        }
        page.role(topic).dismiss(epoch);
        page.doorbell(topic).ring();
        true
    }

    /// The process `epoch` of a node works, but not with the others, and `why`: it counts as hung.
    pub fn delivery(&mut self, page: &ControlPage, topic: Topic, epoch: u32, why: &str) -> Order {
        let event = Event::new(plant_tick(page), topic.publisher(), epoch, What::Hung).because(why);
        self.succession.events.push(event);
        Order::Kill(topic, epoch)
    }

    /// Who keeps the ring waiting for too long.
    fn hung(&mut self, page: &ControlPage) -> Option<Order> {
        if let Some(Awaited { starting, since, .. }) = &mut self.awaited {
            self.progress.1 = Instant::now();
            let ready = |(topic, epoch): &&(Topic, u32)| page.role(*topic).met.get() == *epoch;
            let never = starting.iter().find(|started| !ready(started));
            let (topic, epoch) = *never.filter(|_| since.elapsed() > START_LIMIT)?;
            *since = Instant::now(); // it is dead soon
            return Some(Order::Kill(topic, epoch));
        }
        let employed = |topic: Topic| {
            let Assignment { active, standby } = self.succession.assignment(topic);
            [active, standby]
        };
        let done = |topic: Topic| employed(topic).map(|epoch| page.role(topic).done(epoch).get());
        let all = Topic::ALL.map(done);
        if all != self.progress.0 {
            self.progress = (all, Instant::now());
        }
        let sampled = all[Topic::State as usize][0];
        if self.progress.1.elapsed() < if sampled == 0 { START_LIMIT } else { HANG } {
            return None;
        }
        self.progress.1 = Instant::now();
        let late = |topic: Topic| (0..2).find(|i| employed(topic)[*i] != 0 && done(topic)[*i] < sampled);
        let late = Topic::ALL.into_iter().find_map(|topic| Some((topic, employed(topic)[late(topic)?])));
        // When all have answered it is for the plant to go on, unless it waits for a recorder that is behind.
        let behind = u64::from(sampled) > u64::from(page.recorded().count()) + LEAD_TICKS;
        let plant = || (!behind).then_some((Topic::State, employed(Topic::State)[0]));
        let (topic, epoch) = late.or_else(plant)?;
        Some(self.delivery(page, topic, epoch, "it stands still"))
    }
}
