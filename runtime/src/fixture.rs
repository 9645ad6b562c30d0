//! A ring in this process, for tests: sessions of several nodes may join it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::error::SessionError;
use crate::input::Input;
use crate::output::Output;
use crate::ports::{Ports, Transport};
use crate::queue::Queues;
use crate::realtime::{ControlPage, phase};
use crate::session::NodeSession;
use crate::shared_role::Assignment;
use contract::message::Message;
use contract::topic::Topic;
use settings::{Mode, Scenario, SchedulingPolicy};

pub struct TestRing {
    pub page: Arc<ControlPage>,
    pub queues: Queues,
    pub run: Scenario,
}

impl TestRing {
    pub fn new(mode: Mode) -> Self {
        let mut run = Scenario::default();
        run.run.mode = mode;
        run.realtime.policy = SchedulingPolicy::Other;
        run.realtime.lock_memory = false;
        run.realtime.rttime_ms = 0.0;
        Self { page: Arc::new(ControlPage::private().expect("memory")), queues: Queues::default(), run }
    }

    /// Makes a ring that has begun, with epoch 1 active in every role.
    pub fn flying(mode: Mode) -> Self {
        let ring = Self::new(mode);
        for topic in Topic::ALL {
            ring.page.role(topic).assign(0, |_| Assignment { active: 1, standby: 0 });
            ring.page.role(topic).offer(1);
        }
        ring.page.set_phase(phase::GO);
        ring
    }

    /// Joins as process `epoch` of the node that publishes `topic`.
    pub fn session(&self, topic: Topic, epoch: u32) -> NodeSession {
        let ports = Ports::new(self.page.clone(), Transport::Queues(self.queues.clone()));
        NodeSession::new(ports, topic, epoch, self.run.clone(), &self.run)
    }
}

impl NodeSession {
    /// Opens the input on which this node receives `M`.
    pub fn input<M: Message>(&mut self) -> Result<Input<M>, SessionError> {
        self.open(|ports, member, _| Input::open(ports, member))
    }

    /// Opens the output on which this node sends `M`.
    pub fn output<M: Message>(&mut self) -> Result<Output<M>, SessionError> {
        self.open(Output::open)
    }
}

/// Returns the result of `wait`, and checks that it did not return before `event` in another thread.
pub fn only_after<T>(event: impl FnOnce() + Send, wait: impl FnOnce() -> T) -> T {
    let happened = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(5));
            happened.store(true, Ordering::SeqCst);
            event();
        });
        let result = wait();
        assert!(happened.load(Ordering::SeqCst), "it did not wait");
        result
    })
}
