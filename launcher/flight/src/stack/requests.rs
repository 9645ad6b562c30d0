//! Requests of users to a stack that flies: its status, and orders to inject or clear faults, to swap, and to stop.

use std::collections::BTreeMap;

use contract::guard::Refusal;
use contract::topic::Topic;
use runtime::domain::Domain;
use runtime::realtime::{now_ns, phase};
use serde_json::{Value, json};
use settings::fault_schedule::{MAX_LIVE_FAULTS, MAX_SENSOR_DELAY_MS};
use settings::{Fault, FaultKind, FaultTarget, Mode, Swap, check_fault, check_swaps};

use super::end::refused;
use super::run::FlightRun;
use super::swaps::settle;
use crate::control::server::Server;
use crate::control::view::rung;
use crate::control::{ControlRequest, Response};
use crate::event::{Event, Sender, TimedEvent, What};
use crate::limits::{ANSWER_EVENTS, STATUS_EVENTS};
use crate::log::Record;
use ring::states::{self, length_m};

/// Socket of a run, and the orders that came through it.
pub struct Requests {
    pub server: Server,
    /// `true` if the flight was asked to end.
    pub stopped: bool,
    /// Sender of each swap that was ordered in flight, by the number of the swap.
    orderers: BTreeMap<usize, Sender>,
}

impl Requests {
    pub fn open(domain: &Domain) -> std::io::Result<Self> {
        Ok(Self { server: Server::open(domain)?, stopped: false, orderers: BTreeMap::new() })
    }

    /// Answers one request, if there is any. The next request waits until the processes have been looked at again.
    pub fn answer_one(&mut self, run: &mut FlightRun) {
        if let Some((request, reply)) = self.server.request() {
            let done = self.answer(run, request, reply.sender());
            reply.send(&done.map_or_else(Response::Error, Response::Ok));
        }
    }

    /// Tells the recorder the new events. The first event of a swap that was ordered in flight names the sender.
    pub fn tell_recorder(&self, run: &mut FlightRun) {
        for event in run.events.iter_mut().skip(run.children.told) {
            event.by = event.by.or_else(|| self.orderers.get(&event.swap?).copied());
        }
        run.children.tell(&run.events);
    }

    /// Carries out `request`, which came from `sender`.
    fn answer(
        &mut self,
        run: &mut FlightRun,
        request: ControlRequest,
        sender: Option<Sender>,
    ) -> Result<Value, String> {
        match request {
            ControlRequest::Status => Ok(status(run)),
            ControlRequest::Events { since } => {
                let news = run.events.iter().skip(since).take(ANSWER_EVENTS);
                Ok(json!(TimedEvent::all(news, run.scenario.run.rate_hz)))
            }
            ControlRequest::Inject { fault } => inject(run, fault, sender),
            ControlRequest::Clear { target } => clear(run, target, sender),
            ControlRequest::Swap(swap) => {
                let number = order_swap(run, swap)?;
                self.orderers.extend(sender.map(|sender| (number, sender)));
                Ok(json!({ "swap": number, "since": run.events.len() }))
            }
            ControlRequest::Stop => {
                self.stopped = true;
                Ok(Value::Null)
            }
        }
    }
}

/// Reports the state of the nodes, the faults in force and the last events.
fn status(run: &FlightRun) -> Value {
    let last = run.events.iter().skip(run.events.len().saturating_sub(STATUS_EVENTS));
    let (tick, sample_s) = (run.page.plant_tick(), run.scenario.sample_s());
    let at_work = |fault: &&Fault| fault.is_active(tick, sample_s) && !fault.is_momentary();
    json!({
        "position_error_m": position_error_m(run),
        "mixer": run.newest[Topic::Actuators as usize].map(|record| rung(&record)),
        "nodes": Topic::ALL.map(|topic| node_status(run, topic)),
        "faults": run.scenario.fault.iter().filter(at_work).collect::<Vec<_>>(),
        "events": TimedEvent::all(last, run.scenario.run.rate_hz),
    })
}

/// Distance of the vehicle from its trajectory at the newest sample \[m\]; `None` before the first sample.
fn position_error_m(run: &FlightRun) -> Option<f64> {
    let Some(Record::Truth(truth)) = &run.newest[Topic::COUNT] else { return None };
    let wanted_m = run.trajectory.at(run.time_s(truth.tick)).position_m;
    Some(length_m(states::position_error_m(wanted_m, truth)))
}

/// Reports the state of one node. The field `tick` is the number of ticks done since the first tick of the run.
fn node_status(run: &FlightRun, topic: Topic) -> Value {
    let role = run.page.role(topic);
    let (epoch, standby) = (role.active(), role.assignment().standby);
    let done = (epoch > 0).then(|| u64::from(role.done(epoch).get()));
    let sent_ns = run.newest_ns[topic as usize];
    let is_restart =
        |event: &&Event| event.node == topic.publisher() && event.what == What::Started && event.swap.is_none();
    json!({
        "node": topic.publisher(),
        "epoch": epoch,
        "standby": (standby > 0).then_some(standby),
        "pid": run.children.all.iter().find(|p| p.topic == Some(topic) && p.epoch == epoch).map(|p| p.child.id()),
        "tick": done,
        "behind": done.map(|done| run.page.samples_taken().saturating_sub(done)),
        "age_ms": (sent_ns > 0).then(|| now_ns().saturating_sub(sent_ns) as f64 / 1e6),
        "misses": run.newest[topic as usize].as_ref().and_then(Record::stamped).map(|(_, stamp)| stamp.misses),
        "restarts": run.events.iter().filter(is_restart).count(),
        "refused": refused(&Refusal::ALL.map(|r| role.refused[r as usize].get())),
    })
}

/// Adds `fault` to the flight, to begin `at_s` after the next sample but one; returns it with its time in the flight.
fn inject(run: &mut FlightRun, mut fault: Fault, sender: Option<Sender>) -> Result<Value, String> {
    needs_a_clock(run)?;
    let (is_known, kind) = (fault.target.kinds().contains(&fault.kind), fault.kind);
    if is_known && !fault.target.kinds_in_flight().any(|given| given == kind) {
        return Err("faults of clock and host are not given while it flies: write them into the scenario".into());
    }
    check(run, &fault)?;
    if fault.kind == FaultKind::Delayed && fault.ms.is_some_and(|ms| ms > MAX_SENSOR_DELAY_MS) {
        return Err(format!(
            "a sensor can be delayed by {MAX_SENSOR_DELAY_MS} ms at most while it flies; write more into the scenario"
        ));
    }
    fault.at_s += run.time_s(run.next_tick());
    fault.at_s = run.time_s(fault.ticks(run.scenario.sample_s()).start);
    check(run, &fault)?; // checked again, because the fault may begin too late
    let number = run.scenario.fault.len();
    if !run.page.fault_table.enter(number, &fault) {
        return Err(format!(
            "a flight takes {MAX_LIVE_FAULTS} faults, and this one has had them all; `trefoil stop` it and fly again"
        ));
    }
    run.driver.apply_fault(number, &fault);
    run.scenario.fault.push(fault);
    note(run, number, &fault, What::Injected, sender);
    Ok(json!([fault]))
}

/// Ends the faults of `target`, or all if it is `None`; returns the faults that this ended, with the time that they
/// lasted.
fn clear(run: &mut FlightRun, target: Option<FaultTarget>, sender: Option<Sender>) -> Result<Value, String> {
    needs_a_clock(run)?;
    let end = run.next_tick();
    let sought = |fault: &Fault| target.is_none_or(|target| target == fault.target) && !is_over(run, fault);
    let had = |fault: &Fault| end.saturating_sub(fault.ticks(run.scenario.sample_s()).start);
    let cut = |fault: &Fault| Fault { for_s: Some(run.time_s(had(fault))), ..*fault };
    let faults = run.scenario.fault.iter().enumerate().filter(|(_, fault)| sought(fault));
    let cleared: Vec<(usize, Fault)> = faults.map(|(number, fault)| (number, cut(fault))).collect();
    if !run.page.fault_table.has_room_for(cleared.iter().map(|(number, _)| *number)) {
        return Err(format!(
            "a flight takes {MAX_LIVE_FAULTS} changes to its faults; name a target, or `trefoil stop` it and fly again"
        ));
    }
    for (number, fault) in &cleared {
        run.page.fault_table.enter(*number, fault);
        run.driver.apply_fault(*number, fault);
        run.scenario.fault[*number] = *fault;
        note(run, *number, fault, What::Cleared, sender);
    }
    Ok(cleared.iter().map(|(_, fault)| json!(fault)).collect())
}

fn check(run: &FlightRun, fault: &Fault) -> Result<(), String> {
    check_fault(&run.scenario, fault).map_err(|error| error.to_string())
}

fn needs_a_clock(run: &FlightRun) -> Result<(), String> {
    match run.scenario.run.mode {
        Mode::Realtime => Ok(()),
        _ => Err("a flight in lockstep must be repeatable: write the fault into its scenario".into()),
    }
}

/// Returns whether `fault` affects no tick that is still to come.
fn is_over(run: &FlightRun, fault: &Fault) -> bool {
    let ticks = fault.ticks(run.scenario.sample_s());
    let last = if fault.is_momentary() { ticks.start.saturating_add(1) } else { ticks.end };
    ticks.is_empty() || last <= run.next_tick()
}

fn note(run: &mut FlightRun, number: usize, fault: &Fault, what: What, by: Option<Sender>) {
    let tick = run.page.plant_tick();
    run.events.push(Event {
        by,
        fault: Some(Box::new((number, *fault))),
        ..Event::new(tick, fault.target.name(), 0, what)
    });
}

/// Orders a swap, to begin with the next sample but one, if it obeys the rules of the scenario; returns its number.
fn order_swap(run: &mut FlightRun, swap: Swap) -> Result<usize, String> {
    if run.page.phase.count() != phase::GO {
        return Err("the stack is starting or ending".into());
    }
    run.driver.may_swap(swap.node)?;
    let swap = Swap { at_s: run.time_s(run.next_tick()), ..swap };
    let mut with_it = run.scenario.clone();
    settle(&mut with_it, &run.events);
    with_it.swap.push(swap.clone());
    check_swaps(&with_it).map_err(|error| error.to_string())?;
    run.scenario.swap.push(swap);
    Ok(run.scenario.swap.len() - 1)
}
