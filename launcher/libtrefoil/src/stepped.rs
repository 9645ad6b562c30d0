//! A flight in process whose caller is one of its nodes: `trefoil_flight_next` flies to the next sample that this node
//! must answer, and returns. The bits are those of `trefoil fly --mode inprocess` with the same answers.

#![expect(unsafe_code, reason = "the functions are exported to C")]

use std::ffi::{CString, c_char, c_void};
use std::path::Path;
use std::time::Instant;

use contract::topic::Topic;
use flight::log::Record;
use flight::nodes::{self, Stepped};
use flight::provenance::provenance;
use flight::scenario;
use foreign::abi::TrefoilSetup;
use foreign::setup::Setup;
use outcome::judge::{Circumstances, Verdict};
use outcome::run_record::{Account, RunRecord};
use outcome::summary::Summary;
use runtime::console::eprint_line;
use runtime::error::SessionError;
use runtime::member::Member;
use runtime::node::Node;
use runtime::ports::Ports;
use settings::{Mode, ProgramKind, Scenario};

use crate::boundary::{Failure, c_text, code, free, given, guarded, handed, taken, text, texts, topic_of};
use crate::process::fits;

/// Flight whose caller is one of its nodes.
pub struct TrefoilFlight {
    scenario: Scenario,
    /// Topic of the caller's answers.
    topic: Topic,
    /// The ring; `None` when the flight is over.
    ring: Option<Stepped>,
    summary: Summary,
    started: Instant,
    setup: Setup,
    sizes: [usize; 2],
    /// `true` while the newest sample has no answer.
    due: bool,
    /// Content of run.json once the flight is over; empty before.
    record: CString,
    error: CString,
}

impl TrefoilFlight {
    fn open(scenario: Option<&str>, given: &[&str], node: &str) -> Result<Self, Failure> {
        let topic = topic_of(node)?;
        let given = std::iter::once("run.mode=inprocess").chain(given.iter().copied()).map(str::to_owned);
        let scenario = scenario::load_untried(scenario.map(Path::new), &given.collect::<Vec<_>>());
        let scenario = scenario.map_err(|error| Failure::of_usage(error.to_string()))?;
        check(&scenario, topic)?;
        foreign::in_program_of_others();
        let mut open = [nodes::open as runtime::node::Open; Topic::OF_CONTROLLERS.len()];
        open[place(topic)] = open_asked;
        Ok(Self {
            ring: Some(Stepped::new(&scenario, nodes::vehicle(&scenario)?, true, open)?),
            summary: Summary::new(&scenario),
            started: Instant::now(),
            setup: Setup::new(&scenario, topic).map_err(Failure::of_usage)?,
            sizes: foreign::sizes(topic).unwrap_or_default(),
            topic,
            scenario,
            due: false,
            record: CString::default(),
            error: CString::default(),
        })
    }

    /// Flies to the next sample that the caller must answer, and copies its input; returns `false` when the flight is
    /// over.
    fn next(&mut self, input: &mut [u8]) -> Result<bool, Failure> {
        if self.due {
            let call = "call trefoil_flight_answer before trefoil_flight_next";
            return Err(Failure::of_usage(format!("the last sample has no answer: {call}")));
        }
        while let Some(ring) = &mut self.ring {
            if !ring.begin()? {
                self.end()?;
                break;
            }
            ring.answer(&Topic::OF_CONTROLLERS[..place(self.topic)]);
            if let Some((node, sample)) = ring.asked(self.topic) {
                input.copy_from_slice(node.ask(sample));
                self.due = true;
                return Ok(true);
            }
            self.finish_tick(); // no process of the node works
        }
        Ok(false)
    }

    /// Sends the answer to the sample, and flies on to the end of its tick.
    fn answer(&mut self, answer: &[u8]) -> Result<(), Failure> {
        let node = self.ring.as_mut().filter(|_| std::mem::take(&mut self.due)).and_then(|ring| ring.asked(self.topic));
        let Some((node, _)) = node else {
            let call = "call trefoil_flight_next before trefoil_flight_answer";
            return Err(Failure::of_usage(format!("there is no sample to answer: {call}")));
        };
        node.give(answer);
        self.finish_tick();
        Ok(())
    }

    /// Lets the caller's node and those after it answer, and ends the tick.
    fn finish_tick(&mut self) {
        let Some(ring) = &mut self.ring else { return };
        ring.answer(&Topic::OF_CONTROLLERS[place(self.topic)..]);
        ring.end(|record: &Record| {
            self.summary.observe(record);
            true
        });
    }

    /// Ends the flight, and makes its record.
    fn end(&mut self) -> Result<(), Failure> {
        let Some(ring) = self.ring.take() else { return Ok(()) };
        self.due = false;
        let flown = ring.over();
        flown.failures.iter().for_each(|why| eprint_line(why));
        let (summary, scenario, how) = (&self.summary, &self.scenario, &Circumstances::from(flown));
        let verdict = &Verdict::of(summary, scenario, how);
        let wall_s = self.started.elapsed().as_secs_f64();
        let provenance = Some(provenance(scenario, &[]));
        let record = RunRecord::of(Account { summary, scenario, how, verdict, wall_s, provenance });
        let mut record = serde_json::to_value(record).map_err(|error| Failure::of_usage(error.to_string()))?;
        record["stepped"] = self.topic.publisher().into();
        self.record = c_text(&record.to_string());
        Ok(())
    }
}

/// Place of `topic` in [`Topic::OF_CONTROLLERS`].
fn place(topic: Topic) -> usize {
    topic as usize - 1 // the plant, on the first topic, answers to nothing
}

/// Checks that the node on `topic` is free for the caller.
fn check(scenario: &Scenario, topic: Topic) -> Result<(), Failure> {
    let name = topic.publisher();
    if scenario.run.mode != Mode::Inprocess {
        let mode = "`run.mode` is not \"inprocess\": a stepped flight is in process; remove the setting";
        return Err(Failure::of_usage(mode));
    }
    if scenario.node.of(topic).kind() != ProgramKind::Own {
        let program = format!("`node.{name}.exec` has no effect: the caller is {name}; remove it, or be another node");
        return Err(Failure::of_usage(program));
    }
    if scenario.swap.iter().any(|swap| swap.node == topic) {
        let swap = format!("a `[[swap]]` of {name} replaces the caller; remove it, or be another node");
        return Err(Failure::of_usage(swap));
    }
    Ok(())
}

fn open_asked(ports: &mut Ports, member: &Member, scenario: &Scenario) -> Result<Box<dyn Node>, SessionError> {
    Ok(foreign::open_asked(ports, member, scenario)?)
}

/// Opens a flight of the file `scenario`, or of the defaults if it is NULL, with `count` settings `KEY=VALUE` on top,
/// as `trefoil fly --mode inprocess --set KEY=VALUE`. The caller is `node`: `guidance`, `attitude-mpc` or `mixer`. On
/// an error writes its reason to `error`, of `error_bytes`, and returns NULL. A flight is used from one thread.
///
/// Libraries of other nodes are loaded without a trial: one that crashes ends this process.
///
/// # Safety
/// All text ends with a zero; `error` is NULL or has `error_bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_open(
    scenario: *const c_char,
    settings: *const *const c_char,
    count: usize,
    node: *const c_char,
    error: *mut c_char,
    error_bytes: usize,
) -> *mut TrefoilFlight {
    let opened = guarded(|| {
        // SAFETY: the caller gives text.
        let file = (!scenario.is_null()).then(|| unsafe { text(scenario, "the scenario") }).transpose()?;
        // SAFETY: the caller gives text.
        let (given, node) = unsafe { (texts(settings, count, "settings")?, text(node, "the node's name")?) };
        TrefoilFlight::open(file, &given, node)
    });
    // SAFETY: the caller gives room for the reason.
    unsafe { handed(opened, error, error_bytes) }
}

/// Returns vehicle and settings; valid until `trefoil_flight_close`.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_setup(flight: *const TrefoilFlight) -> *const TrefoilSetup {
    // SAFETY: the flight lives until `trefoil_flight_close`.
    unsafe { (*flight).setup.as_ptr() }
}

/// Flies to the next sample to answer, and writes it to `input`, of `bytes`: the size of the node's type in
/// `trefoil.h`. Samples at which a fault leaves the node without a process are flown without an answer. Returns 1:
/// answer by `trefoil_flight_answer`. 0: the flight is over. Below 0: an error.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`; `input` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_next(flight: *mut TrefoilFlight, input: *mut c_void, bytes: usize) -> i32 {
    // SAFETY: the flight lives until `trefoil_flight_close`, and is used from one thread.
    let flight = unsafe { &mut *flight };
    let next = guarded(|| {
        fits("input", bytes, flight.sizes[0])?;
        // SAFETY: the caller gives `bytes` of memory.
        flight.next(unsafe { taken(input, bytes, "input") }?)
    });
    code(next.map(i32::from), &mut flight.error)
}

/// Sends `answer`, of `bytes`: the size of the node's type in `trefoil.h`. Returns 0, or below 0 on an error.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`; `answer` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_answer(flight: *mut TrefoilFlight, answer: *const c_void, bytes: usize) -> i32 {
    // SAFETY: the flight lives until `trefoil_flight_close`, and is used from one thread.
    let flight = unsafe { &mut *flight };
    let answered = guarded(|| {
        fits("answer", bytes, flight.sizes[1])?;
        // SAFETY: the caller gives `bytes` of memory.
        flight.answer(unsafe { given(answer, bytes, "answer") }?)
    });
    code(answered.map(|()| 0), &mut flight.error)
}

/// Returns the record of the flight: run.json as text, with `stepped`, the caller's node. A flight that is not over
/// ends here, as interrupted. Valid until `trefoil_flight_close`; NULL on an error.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_record(flight: *mut TrefoilFlight) -> *const c_char {
    // SAFETY: the flight lives until `trefoil_flight_close`, and is used from one thread.
    let flight = unsafe { &mut *flight };
    let ended = guarded(|| flight.end());
    match code(ended.map(|()| 0), &mut flight.error) {
        0 => flight.record.as_ptr(),
        _ => std::ptr::null(),
    }
}

/// Returns the reason of the last error; valid until the next call.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_error(flight: *const TrefoilFlight) -> *const c_char {
    // SAFETY: the flight lives until `trefoil_flight_close`.
    unsafe { (*flight).error.as_ptr() }
}

/// Frees the flight. Does nothing if `flight` is NULL.
///
/// # Safety
/// `flight` came from `trefoil_flight_open`, and is not used any more.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_flight_close(flight: *mut TrefoilFlight) {
    // SAFETY: `flight` is NULL or a box from `trefoil_flight_open`.
    unsafe { free(flight) };
}
