//! A node of the ring as a program with a `main` of its own, in any language. The launcher starts it, as `exec` of a
//! node; it joins the run, and answers to one sample after the other.
//!
//! ```text
//! trefoil_join -> trefoil_setup, trefoil_memory
//!              -> { trefoil_next -> trefoil_remember, trefoil_send }... -> trefoil_leave
//! ```
//!
//! The session is the same as in any other node: deadline, faults, trial and timing see no difference. A replay takes
//! the program's messages from the log.

#![expect(unsafe_code, reason = "the functions are exported to C")]

use std::ffi::{CString, c_char, c_void};
use std::path::Path;

use contract::message::Stamp;
use foreign::abi::{TREFOIL_MEMORY_BYTES, TrefoilSetup};
use foreign::setup::Setup;
use runtime::cycle_loop::CycleLoop;
use runtime::node::Asked;
use runtime::process::die_with_launcher;
use runtime::realtime::ThisProcess;
use runtime::session::NodeSession;

use crate::boundary::{Failure, code, free, given, guarded, handed, taken, text, texts, topic_of};

/// Process of a node that has joined a run.
pub struct TrefoilSession {
    phase: Phase,
    node: Box<dyn Asked>,
    sizes: [usize; 2],
    setup: Setup,
    /// Provenance of the answer that is due.
    due: Option<Stamp>,
    error: CString,
    process: ThisProcess,
}

/// Phase of a session.
enum Phase {
    Joined(Box<NodeSession>),
    Cycling(CycleLoop),
    Over,
}

impl TrefoilSession {
    fn join(node: &str, arguments: &[&str]) -> Result<Self, Failure> {
        let topic = topic_of(node)?;
        let mut session = joined(node, arguments)?;
        let setup = Setup::new(&session.scenario, topic).map_err(Failure::of_usage)?;
        let node = session.open(foreign::open_asked)?;
        let sizes = foreign::sizes(topic).unwrap_or_default();
        let (phase, process) = (Phase::Joined(Box::new(session)), ThisProcess::now());
        Ok(Self { phase, node, sizes, setup, due: None, error: CString::default(), process })
    }

    /// Copies the memory of the process before this one to `memory`; returns its size, 0 if it left none.
    fn take_over(&mut self, memory: &mut [u8]) -> Result<usize, Failure> {
        let Phase::Joined(session) = &self.phase else {
            return Err(Failure::of_usage("ask for the memory before the first trefoil_next"));
        };
        session.take_over_memory(|left| self.node.restore(left));
        let left = self.node.remembered().unwrap_or_default();
        let room = memory.len();
        let memory = memory.get_mut(..left.len()).ok_or_else(|| {
            Failure::of_usage(format!("the memory that was left has {} byte, and there is room for {room}", left.len()))
        })?;
        memory.copy_from_slice(left);
        Ok(left.len())
    }

    /// Waits until the node must answer, and copies the input of the answer; returns `false` if the run is over.
    fn next(&mut self, input: &mut [u8]) -> Result<bool, Failure> {
        if self.due.is_some() {
            return Err(Failure::of_usage("the last sample has no answer: call trefoil_send before trefoil_next"));
        }
        if let Phase::Joined(_) = &self.phase
            && let Phase::Joined(session) = std::mem::replace(&mut self.phase, Phase::Over)
        {
            self.phase = Phase::Cycling(session.ready()?);
        }
        let Phase::Cycling(cycles) = &mut self.phase else { return Ok(false) };
        let Some(tick) = cycles.next(self.node.upstream())? else {
            self.phase = Phase::Over;
            return Ok(false);
        };
        let sample = cycles.provenance(tick);
        input.copy_from_slice(self.node.ask(sample));
        self.due = Some(sample);
        Ok(true)
    }

    /// Sends the answer to the sample.
    fn send(&mut self, answer: &[u8]) -> Result<(), Failure> {
        let (Phase::Cycling(cycles), Some(sample)) = (&self.phase, self.due.take()) else {
            return Err(Failure::of_usage("there is no sample to answer: call trefoil_next before trefoil_send"));
        };
        self.node.give(answer);
        self.node.answer(sample, None)?;
        cycles.done(sample.tick, &self.node.memory());
        Ok(())
    }
}

/// Joins the run that the launcher has started this program for, as `node`; `arguments` include those of the launcher.
pub fn joined(node: &str, arguments: &[&str]) -> Result<NodeSession, Failure> {
    let after = |option: &str| arguments.iter().rposition(|word| *word == option).map(|i| arguments.get(i + 1));
    let option = |name: &str| after(name).flatten().copied();
    let namespace = option("--namespace").ok_or_else(|| {
        Failure::of_usage(format!(
            "the launcher has not started this program: there is no `--namespace NAME` in its arguments; give its \
             file as `exec` of [node.{node}] in a scenario, and fly that"
        ))
    })?;
    let epoch = option("--epoch").map_or(Some(1), |word| word.parse().ok().filter(|epoch| *epoch > 0));
    let epoch = epoch.ok_or_else(|| Failure::of_usage("`--epoch` is no number above 0"))?;
    die_with_launcher(namespace)?;
    Ok(NodeSession::join(namespace, node, epoch, option("--settings").map(Path::new))?)
}

/// Joins the run that the launcher has started this program for, as `node`: `guidance`, `attitude-mpc` or `mixer`. Give
/// the arguments of `main`: those of the launcher are found among them. On an error writes its reason to `error`, of
/// `error_bytes`, and returns NULL. A session is used from one thread.
///
/// # Safety
/// `node` and the `argc` texts in `argv` end with a zero; `error` is NULL or has `error_bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_join(
    node: *const c_char,
    argc: i32,
    argv: *const *const c_char,
    error: *mut c_char,
    error_bytes: usize,
) -> *mut TrefoilSession {
    let joined = guarded(|| {
        // SAFETY: the caller gives text.
        let (node, arguments) = unsafe { (text(node, "the node's name")?, texts(argv, argc.max(0) as usize, "argv")?) };
        TrefoilSession::join(node, &arguments)
    });
    // SAFETY: the caller gives room for the reason.
    unsafe { handed(joined, error, error_bytes) }
}

/// Returns vehicle and settings; valid until `trefoil_leave`.
///
/// # Safety
/// `session` came from `trefoil_join`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_setup(session: *const TrefoilSession) -> *const TrefoilSetup {
    // SAFETY: the session lives until `trefoil_leave`.
    unsafe { (*session).setup.as_ptr() }
}

/// Copies the memory that the process before this one left by `trefoil_remember` to `memory`, of `bytes`, and returns
/// its size: 0 = none, begin cold. Call it before the first `trefoil_next`; without this call a program begins cold.
/// A negative result is an error.
///
/// # Safety
/// `session` came from `trefoil_join`; `memory` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_memory(session: *mut TrefoilSession, memory: *mut c_void, bytes: usize) -> i32 {
    // SAFETY: the session lives until `trefoil_leave`, and is used from one thread.
    let session = unsafe { &mut *session };
    // SAFETY: the caller gives `bytes` of memory.
    let taken = guarded(|| session.take_over(unsafe { taken(memory, bytes, "memory") }?));
    code(taken.map(|bytes| bytes as i32), &mut session.error)
}

/// Waits for the next sample to answer, and writes it to `input`, of `bytes`: the size of the node's type in
/// `trefoil.h`. The first call says that this process is ready: allocate and load everything before it.
///
/// Returns 1: answer by `trefoil_send`. 0: the run is over, or another process has taken over; leave. Below 0: an
/// error; end the process with this number as its exit code, without the sign.
///
/// # Safety
/// `session` came from `trefoil_join`; `input` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_next(session: *mut TrefoilSession, input: *mut c_void, bytes: usize) -> i32 {
    // SAFETY: the session lives until `trefoil_leave`, and is used from one thread.
    let session = unsafe { &mut *session };
    let next = guarded(|| {
        fits("input", bytes, session.sizes[0])?;
        // SAFETY: the caller gives `bytes` of memory.
        session.next(unsafe { taken(input, bytes, "input") }?)
    });
    code(next.map(i32::from), &mut session.error)
}

/// Gives `memory`, of at most `TREFOIL_MEMORY_BYTES`, to the process that continues after this one. Call it before
/// `trefoil_send`, whose answer it belongs to. Returns 0, or below 0 on an error.
///
/// # Safety
/// `session` came from `trefoil_join`; `memory` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_remember(session: *mut TrefoilSession, memory: *const c_void, bytes: usize) -> i32 {
    // SAFETY: the session lives until `trefoil_leave`, and is used from one thread.
    let session = unsafe { &mut *session };
    let remembered = guarded(|| {
        if bytes > TREFOIL_MEMORY_BYTES as usize {
            let most = format!("a memory has at most {TREFOIL_MEMORY_BYTES} byte, not {bytes}");
            return Err(Failure::of_usage(most));
        }
        // SAFETY: the caller gives `bytes` of memory.
        session.node.remember(unsafe { given(memory, bytes, "memory") }?);
        Ok(0)
    });
    code(remembered, &mut session.error)
}

/// Sends `answer`, of `bytes`: the size of the node's type in `trefoil.h`. Returns 0, or below 0 as `trefoil_next`.
///
/// # Safety
/// `session` came from `trefoil_join`; `answer` has `bytes`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_send(session: *mut TrefoilSession, answer: *const c_void, bytes: usize) -> i32 {
    // SAFETY: the session lives until `trefoil_leave`, and is used from one thread.
    let session = unsafe { &mut *session };
    let sent = guarded(|| {
        fits("answer", bytes, session.sizes[1])?;
        // SAFETY: the caller gives `bytes` of memory.
        session.send(unsafe { given(answer, bytes, "answer") }?)
    });
    code(sent.map(|()| 0), &mut session.error)
}

/// Returns the reason of the last error; valid until the next call.
///
/// # Safety
/// `session` came from `trefoil_join`.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_error(session: *const TrefoilSession) -> *const c_char {
    // SAFETY: the session lives until `trefoil_leave`.
    unsafe { (*session).error.as_ptr() }
}

/// Leaves the run, and frees the session. Does nothing if `session` is NULL, or in a child process made by `fork`: the
/// session belongs to the process that joined.
///
/// # Safety
/// `session` came from `trefoil_join`, and is not used any more.
// SAFETY: no other library of this process has a function of this name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn trefoil_leave(session: *mut TrefoilSession) {
    // SAFETY: it is a box that `trefoil_join` gave away, or NULL.
    unsafe {
        if session.as_ref().is_some_and(|session| session.process.is_this()) {
            free(session);
        }
    }
}

/// Checks that the caller's size of `what`, `bytes`, is the size that this library has for the node, `own`.
pub fn fits(what: &str, bytes: usize, own: usize) -> Result<(), Failure> {
    if bytes == own {
        return Ok(());
    }
    let other = format!("its {what} has {bytes} byte, and that of trefoil.h {own}");
    Err(Failure::of_usage(other + ": build it with the header of this library"))
}
