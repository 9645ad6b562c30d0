//! One flight with its fault, flown in lockstep and by one thread.

use std::sync::atomic::AtomicU32;

use anyhow::Context;
use contract::message::{Content, Message, SolveStatus, State, Truth, mixer_flags};
use contract::stamp::delivery;
use serde::Serialize;
use settings::{Mode, Profile, Scenario};

use super::case::{AT_S, BACK_S, FOR_S, FaultCase, FaultPromise};
use crate::flights::{in_process, lean_deg, through_processes};
use flight::event::name;
use flight::log::Record;
use flight::stack::{Ended, FlightResult};
use outcome::faults::reacts;
use outcome::summary::Summary;
use outcome::ticks::length_m;

/// Largest roll or pitch allowed in a recoverable fault \[deg\].
pub const TILT_DEG: f64 = 35.0;
/// Largest distance from the hover allowed [`BACK_S`] after a recoverable fault \[m\].
pub const BACK_M: f64 = 0.5;
/// Speed below which a rotor counts as stopped \[rotor speed unit\].
const CUT_SPEED: f64 = 0.1;
/// Time within which the flight must be terminated after a rotor stopped \[s\].
pub const TERMINATE_S: f64 = 0.3;

#[derive(Debug, Clone, Serialize)]
pub struct FaultFlight {
    /// Target and kind of the fault.
    pub fault: String,
    pub promise: FaultPromise,
    #[serde(flatten)]
    pub course: FaultCourse,
    /// `true` if the flights in lockstep and by one thread were equal; `None` if a program cannot fly in one thread.
    pub same: Option<bool>,
}

/// Course of a flight with a fault.
#[derive(Debug, Clone, Default, Serialize)]
pub struct FaultCourse {
    /// Time until the fault was noticed \[s\].
    pub detected_after_s: Option<f64>,
    /// Time until the recovery, as in run.json \[s\].
    pub recovered_after_s: Option<f64>,
    /// Time until the flight was terminated \[s\].
    pub terminated_after_s: Option<f64>,
    /// Largest true roll or pitch from the fault on \[deg\].
    pub tilt_deg: f64,
    /// Largest true distance from the hover, from the fault on \[m\].
    pub position_error_m: f64,
    /// Distance from the hover [`BACK_S`] after the fault \[m\]; `None` if the flight ended before.
    pub back_m: Option<f64>,
    /// Longest time without a STATE that a node accepts, up to the end of the fault \[s\].
    pub blind_s: f64,
    /// `true` if all rotors were slower than `CUT_SPEED` at some sample.
    pub cut: bool,
    /// `true` if the vehicle diverged or the plant died.
    pub diverged: bool,
    /// Number of messages that did not reach the launcher; there is a hash only if it is 0.
    pub missed: u64,
    pub state_hash: Option<String>,
}

impl FaultFlight {
    /// Flies `case` in lockstep and by one thread.
    pub fn fly(base: &Scenario, case: &FaultCase, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let mut scenario = base.clone();
        scenario.fault = vec![case.0];
        scenario.run.mode = Mode::Inprocess; // no time limit for the solver, unlike in real time
        let has_program = scenario.node.has_program();
        let alone = (!has_program).then(|| in_process(&scenario, |_| {}).0.state_hash());
        scenario.run.mode = Mode::Lockstep;
        let fault = format!("{} {}", name(case.0.target), name(case.0.kind));
        let mut watch = Watch::new(&scenario);
        let (summary, flown) = through_processes(&scenario, interrupts, |record| watch.observe(record))
            .with_context(|| format!("the flight with {fault} in lockstep"))?;
        let course = watch.course(&summary, &flown);
        Ok(Self {
            fault,
            promise: case.promise(course.blind_s, course.cut && scenario.profile == Profile::Paper),
            same: alone.map(|alone| course.state_hash.is_some() && course.state_hash == alone),
            course,
        })
    }

    /// Returns whether the promise is kept; `None` if none was made.
    pub fn kept(&self) -> Option<bool> {
        let FaultCourse { tilt_deg, back_m, terminated_after_s, diverged, .. } = self.course;
        match self.promise {
            FaultPromise::Recover => {
                Some(!diverged && tilt_deg <= TILT_DEG && back_m.is_some_and(|back_m| back_m <= BACK_M))
            }
            FaultPromise::Terminate => Some(terminated_after_s.is_some_and(|after_s| after_s <= TERMINATE_S)),
            _ => None,
        }
    }
}

/// Gathers the course of a flight with one fault.
struct Watch {
    /// First tick of the fault, first tick after it, and the tick at which the vehicle must be back.
    begins: u64,
    ended: u64,
    back: u64,
    sample_s: f64,
    /// Newest tick of any STATE, and newest tick of an accepted one.
    newest: Option<u64>,
    taken: u64,
    course: FaultCourse,
}

impl Watch {
    fn new(scenario: &Scenario) -> Self {
        let tick = |time_s: f64| (time_s / scenario.sample_s()).round() as u64;
        Self {
            begins: tick(AT_S),
            ended: tick(AT_S + FOR_S),
            back: tick(AT_S + FOR_S + BACK_S),
            sample_s: scenario.sample_s(),
            newest: None,
            taken: 0,
            course: FaultCourse::default(),
        }
    }

    fn observe(&mut self, record: &Record) {
        match record {
            Record::State(state) => self.state(state),
            Record::Truth(truth) if truth.tick >= self.begins => self.truth(truth),
            Record::Actuators(actuators) if actuators.flags & mixer_flags::TERMINATED != 0 => {
                let after_s = actuators.stamp.tick.saturating_sub(self.begins) as f64 * self.sample_s;
                self.course.terminated_after_s.get_or_insert(after_s);
            }
            _ => {}
        }
    }

    fn state(&mut self, state: &State) {
        let (stamp, measured) = (&state.stamp, &state.measured);
        let there = measured.position_m.iter().chain(&measured.velocity_mps).all(|value| value.is_finite());
        if state.is_intact() && stamp.delivery == delivery::DELIVERED && state.plausible() && there {
            self.taken = self.taken.max(stamp.tick);
        }
        if !state.is_intact() || self.newest.is_some_and(|newest| stamp.tick <= newest) {
            return; // a damaged or repeated STATE, made by a fault
        }
        self.newest = Some(stamp.tick);
        let course = &mut self.course;
        if stamp.tick <= self.ended {
            course.blind_s = course.blind_s.max(stamp.tick.saturating_sub(self.taken) as f64 * self.sample_s);
        }
    }

    fn truth(&mut self, truth: &Truth) {
        let course = &mut self.course;
        course.tilt_deg = course.tilt_deg.max(lean_deg(truth));
        course.cut |= truth.actuators.rotor_speed.iter().all(|speed| *speed < CUT_SPEED);
        let error_m = length_m(truth.actual.position_m);
        course.position_error_m = course.position_error_m.max(error_m);
        if truth.tick == self.back {
            course.back_m = Some(error_m);
        }
    }

    fn course(self, summary: &Summary, flown: &FlightResult) -> FaultCourse {
        let fault = &summary.faults.records(&flown.how.events)[0];
        FaultCourse {
            detected_after_s: fault.detected_after_s,
            recovered_after_s: fault.recovered_after_s,
            diverged: matches!(flown.how.ended, Ended::Lost(_)) || summary.status().diverged(),
            missed: summary.missed,
            state_hash: summary.state_hash(),
            ..self.course
        }
    }
}

/// Flight without a fault, and counts of the reactions in it, which must be 0.
#[derive(Debug, Clone, Serialize)]
pub struct QuietFlight {
    /// Name of the scenario.
    pub name: String,
    /// Messages that report an old, missing or bad input, or a failed solve.
    pub flagged: u64,
    pub refused: u64,
    pub events: u64,
}

impl QuietFlight {
    /// Flies `scenario` for 60 s in lockstep.
    pub fn fly(mut scenario: Scenario, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        scenario.run.mode = Mode::Lockstep;
        scenario.run.duration_s = 60.0;
        let mut flagged = 0;
        let (_, flown) = through_processes(&scenario, interrupts, |record| {
            let failed = matches!(record, Record::Controls(c) if c.status > SolveStatus::Solved as u64);
            flagged += u64::from(failed || reacts(record));
        })?;
        Ok(Self {
            name: scenario.name,
            flagged,
            refused: flown.how.refused.iter().flat_map(|(_, counts)| counts).map(|count| u64::from(*count)).sum(),
            events: flown.how.events.len() as u64,
        })
    }
}
