//! The member: one process of a node in a run, or one node in process; what its ports and its loop have in common.

use std::cell::Cell;
use std::rc::Rc;
use std::sync::Arc;

use crate::cycle_timing::CycleTiming;
use crate::process_faults::ProcessFaults;
use crate::realtime::ControlPage;
use crate::release::Release;
use crate::shared_role::Origin;
use contract::Topic;
use contract::scenario::Scenario;

/// One process of a node, or what would be one.
#[derive(Clone)]
pub struct Member {
    /// The page of its run.
    pub page: Arc<ControlPage>,
    /// The topic that its node answers on.
    pub topic: Topic,
    /// Which process of the node it is.
    pub epoch: u32,
    /// What begins its cycles.
    pub release: Release,
    /// The timing of its cycles.
    pub timing: Rc<CycleTiming>,
    /// Its faults.
    pub faults: Rc<ProcessFaults>,
    /// Whose memory it began with; none if it began with nothing.
    pub continues: Rc<Cell<Origin>>,
    /// Whether its messages carry checksums, and those that it receives are checked. Only where one thread hands them on and
    /// nobody keeps them they may do without.
    pub with_checksums: bool,
}

impl Member {
    /// A process with the settings `scenario`; with `acts` it acts out its exits and hogs by itself.
    pub fn new(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario, acts: bool) -> Self {
        let release = Release::of(scenario);
        let deadline = release.deadline(scenario.deadline_of(topic as usize));
        let timing = Rc::new(CycleTiming::new(deadline));
        let faults = Rc::new(ProcessFaults::new(page.clone(), topic, scenario, acts));
        Self { page, topic, epoch, release, timing, faults, continues: Rc::default(), with_checksums: true }
    }

    /// The same in process: no clock is read.
    pub fn in_process(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario, acts: bool) -> Self {
        let deadline = Release::Barrier.deadline(scenario.deadline_of(topic as usize));
        let timing = Rc::new(CycleTiming::without_clock(deadline));
        Self { release: Release::Barrier, timing, ..Self::new(page, topic, epoch, scenario, acts) }
    }

    /// The same in a replay: the caller sets what its clock shows.
    pub fn of_recording(page: Arc<ControlPage>, topic: Topic, epoch: u32, scenario: &Scenario) -> Self {
        let deadline = Release::of(scenario).deadline(scenario.deadline_of(topic as usize));
        let timing = Rc::new(CycleTiming::without_clock(deadline));
        Self { release: Release::Recording, timing, ..Self::new(page, topic, epoch, scenario, false) }
    }
}
