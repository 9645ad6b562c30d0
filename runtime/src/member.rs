//! The member: data that the ports and the loop of a process share, or the ports of a node in process.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use crate::cycle_timing::CycleTiming;
use crate::process_faults::ProcessFaults;
use crate::realtime::{ControlPage, ThisProcess};
use crate::release::{Caller, Release};
use crate::shared_role::Origin;
use contract::Topic;
use settings::Scenario;

/// One process of a node, or one node in process.
#[derive(Clone)]
pub struct Member {
    /// Control page of the run.
    pub page: Arc<ControlPage>,
    /// Topic that the node publishes.
    pub topic: Topic,
    /// Epoch of the process.
    pub epoch: u32,
    /// Caller of the node.
    pub caller: Caller,
    /// Timing of the process's cycles.
    pub timing: Rc<CycleTiming>,
    /// Faults of the process.
    pub faults: Rc<ProcessFaults>,
    /// Origin of the snapshot that the process began with; the default if there was none.
    pub continues: Rc<Cell<Origin>>,
    /// Process that has joined the run; `None` in process, where a copy (`fork`) would share no ports.
    pub process: Option<ThisProcess>,
    /// `true` if sent messages carry checksums and received ones are checked. May be `false` only in process, when no
    /// log is written.
    pub with_checksums: bool,
}

impl Member {
    /// Makes a process with the settings `scenario`. With `acts` the process carries out the faults `exit` and `hog`
    /// itself; otherwise the launcher does.
    pub fn new(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario, acts: bool) -> Self {
        let release = Release::of(scenario);
        let timing = Rc::new(CycleTiming::new(release.deadline(scenario.deadline_of(topic as usize))));
        let faults = Rc::new(ProcessFaults::new(page.clone(), topic, scenario, acts));
        let caller = Caller::Loop(release);
        Self {
            page,
            topic,
            epoch,
            caller,
            timing,
            faults,
            continues: Rc::default(),
            process: None,
            with_checksums: true,
        }
    }

    /// Makes a node in process, which reads no clock.
    pub fn in_process(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario, acts: bool) -> Self {
        let deadline = Release::Barrier.deadline(scenario.deadline_of(topic as usize));
        let timing = Rc::new(CycleTiming::without_clock(deadline));
        Self { caller: Caller::Loop(Release::Barrier), timing, ..Self::new(page, topic, epoch, scenario, acts) }
    }

    /// Makes a node in a replay, whose clock the caller sets.
    pub fn of_recording(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario) -> Self {
        let deadline = Release::of(scenario).deadline(scenario.deadline_of(topic as usize));
        let timing = Rc::new(CycleTiming::without_clock(deadline));
        Self { caller: Caller::Recording, timing, ..Self::new(page, topic, epoch, scenario, false) }
    }

    /// Ends the calling process if it is a copy of the one that joined the run: two must not send through one port.
    pub fn leave_if_copied(&self) {
        self.process.iter().for_each(|process| process.leave_if_copied());
    }
}
