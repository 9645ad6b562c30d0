//! Another program in the place of a process. It flies in lockstep in a namespace of its own, where the replay stands
//! for all other processes. It is started as in a flight (`trefoil swap --exec`), and answers every sample from tick 0.
//!
//! The program has no clock, and its link has no faults: all its answers are delivered.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use anyhow::bail;
use contract::Topic;
use flight::limits::JOIN_LIMIT;
use flight::log::Record;
use flight::recorder::Observers;
use flight::stack::children::{Children, SpawnRequest};
use flight::stack::own_domain::OwnDomain;
use runtime::error::SessionError;
use runtime::realtime::{ControlPage, phase};
use settings::{Mode, Scenario};

use crate::script::Cycle;
use crate::sender::{self, SendRecord};

const A_DAY: Duration = Duration::from_secs(86_400);
/// Longest wait for a program between two looks \[ns\].
const LOOK_NS: u64 = 1_000_000;

/// Program that answers in the place of a node.
pub struct Program {
    topic: Topic,
    page: Arc<ControlPage>,
    /// Senders of the messages that the program may read, by topic.
    senders: HashMap<Topic, SendRecord>,
    /// Number of messages sent to the program so far, by topic.
    sent: [u64; Topic::COUNT],
    observers: Observers,
    wall_limit: Duration,
    children: Children,
    _domain: OwnDomain,
}

impl Program {
    /// Starts the program that `scenario` names for the node that answers on `topic`, with the settings `scenario`.
    ///
    /// # Errors
    /// The program cannot be started, or is not ready in time.
    pub fn start(topic: Topic, scenario: &Scenario) -> anyhow::Result<Self> {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let namespace = format!("replay-{}-{}", std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let mut scenario = Scenario { fault: vec![], swap: vec![], ..scenario.clone() };
        scenario.run.mode = Mode::Lockstep;
        let (own, mut ports) = OwnDomain::open(&namespace, &scenario)?;
        let page = ports.page.clone();
        for each in Topic::ALL {
            page.role(each).offer(1);
        }
        let children = Children::new(own.domain(), None);
        let program = scenario.node.of(topic).clone();
        let request = SpawnRequest { topic: Some(topic), epoch: 1, program: Some(&program), ..SpawnRequest::default() };
        let senders = topic.sources().map(|other| Ok((other, sender::open(&mut ports, other, 1)?)));
        let mut started = Self {
            topic,
            senders: senders.collect::<Result<_, SessionError>>()?,
            sent: [0; Topic::COUNT],
            observers: Observers::open(&mut ports, &scenario)?,
            wall_limit: match scenario.supervision.wall_limit_s {
                0.0 => A_DAY, // 0 means no limit
                limit_s => Duration::from_secs_f64(limit_s),
            },
            page,
            children,
            _domain: own,
        };
        started.children.spawn(&request)?;
        let page = started.page.clone();
        let probe = || Ok(ports.probe_once().map(drop)?);
        started.wait(JOIN_LIMIT, &program.exec, || page.role(topic).ready.get() == 1, probe)?;
        started.page.set_phase(phase::GO);
        Ok(started)
    }

    /// Sends `message` to the program, as the newest of its topic.
    pub fn read(&mut self, message: &Record) {
        let Some((of, _)) = message.stamped() else { return };
        let Some(sender) = self.senders.get(&of) else { return }; // the program does not listen to this topic
        let number = &mut self.sent[of as usize];
        *number += 1;
        sender(&message.with_stamp(|stamp| (stamp.epoch, stamp.sequence) = (1, *number)));
        self.page.doorbell(of).mark();
    }

    /// Lets the program answer up to the tick of `cycle`; `each` gets its answer to that tick.
    ///
    /// # Errors
    /// The program ends, or does not answer in time.
    pub fn run(&mut self, cycle: &Cycle, mut each: impl FnMut(&Record)) -> anyhow::Result<()> {
        let done = cycle.tick as u32 + 1;
        for upstream in Topic::ALL.into_iter().filter(|topic| *topic != self.topic) {
            self.page.role(upstream).done(1).set(done);
            self.page.doorbell(upstream).ring();
        }
        let (page, topic) = (self.page.clone(), self.topic);
        let limit = self.wall_limit;
        self.wait(limit, topic.publisher(), || page.role(topic).done(1).get() >= done, || Ok(()))?;
        self.observers.drain(|record| {
            if record.stamped().is_some_and(|(of, stamp)| of == topic && stamp.tick == cycle.tick) {
                each(record);
            }
        });
        Ok(())
    }

    /// Waits until `is_so` holds, and calls `meanwhile` before each look; fails if the program ends, or after `limit`.
    fn wait(
        &mut self,
        limit: Duration,
        name: &str,
        is_so: impl Fn() -> bool,
        mut meanwhile: impl FnMut() -> anyhow::Result<()>,
    ) -> anyhow::Result<()> {
        let deadline = Instant::now() + limit;
        let bell = self.page.clone();
        while !is_so() {
            meanwhile()?;
            if self.children.exited().is_some() {
                bail!("{name} has ended instead of answering as {}", self.topic.publisher());
            }
            if Instant::now() > deadline {
                bail!("{name} did not answer for {} s", limit.as_secs());
            }
            let doorbell = bell.doorbell(self.topic);
            let rung = doorbell.count();
            if !is_so() {
                doorbell.wait(rung, runtime::realtime::now_ns() + LOOK_NS);
            }
        }
        Ok(())
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        self.page.set_phase(phase::LEAVE); // a process that does not leave is killed with the children
    }
}
