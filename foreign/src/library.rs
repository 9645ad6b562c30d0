//! A loaded library, whichever of the known interfaces it has, and the guard around every call into it.
//!
//! A library is never unloaded: its threads and exit handlers may still use its code.

use std::cell::Cell;
use std::path::absolute;

use contract::topic::Topic;
use runtime::console::eprint_line;
use runtime::error::SessionError;
use runtime::realtime::ThisProcess;
use settings::Scenario;

use crate::abi::TrefoilNode;
use crate::casadi::Function;
use crate::engine::Engine;
use crate::protocol::PortLayout;
use crate::rounding::Rounding;
use crate::table::FunctionTable;
use crate::{elf, loading};

/// Node of a library.
pub struct Library {
    file: String,
    /// `None` after the node was destroyed.
    engine: Option<Box<dyn Engine>>,
    guard: Guard,
    /// Error of the library in a call that cannot return an error; the next step fails with it.
    wrong: Cell<Option<String>>,
}

/// Guard around every call into a library: it may neither change the mode of the floating-point unit, nor return twice.
#[derive(Clone, Copy)]
struct Guard {
    rounding: Rounding,
}

impl Guard {
    fn new() -> Self {
        Self { rounding: Rounding::now() }
    }

    /// Makes a call into the library, named `what` in an error. A child process that the library has forked ends when
    /// it returns from the call.
    ///
    /// # Errors
    /// The call has changed the mode of the floating-point unit, which is set back.
    fn call<T>(self, what: &str, call: impl FnOnce() -> T) -> Result<T, String> {
        let process = ThisProcess::now();
        let result = call();
        process.leave_if_copied();
        if Rounding::now() == self.rounding {
            return Ok(result);
        }
        self.rounding.set();
        Err(format!("it changed the rounding mode of the processor (was it built with -ffast-math?) {what}"))
    }
}

impl Library {
    /// Loads the library that `scenario` names for the node that publishes `topic`, whose types have this `layout`, and
    /// creates its node.
    ///
    /// # Errors
    /// The file is cut short or cannot be loaded, has no known interface, changes the mode of the floating-point unit,
    /// or cannot create the node.
    pub fn load(scenario: &Scenario, topic: Topic, layout: &PortLayout) -> Result<Self, SessionError> {
        let file = &scenario.node.of(topic).exec;
        let refused = |why: String| SessionError::Foreign { file: file.clone(), why };
        let guard = Guard::new();
        // dlopen searches a name without a slash in the system's folders.
        let path = absolute(file).map_err(|error| refused(error.to_string()))?;
        elf::check_length(&path).map_err(refused)?;
        let handle = guard.call("while it was loaded", || loading::load(&path)).map_err(refused)?.map_err(refused)?;
        let function = || Function::find(&handle, &path, scenario.node.of(topic));
        let create = || match if FunctionTable::is_in(&handle) { None } else { function() } {
            Some(function) => function.and_then(|function| function.open(&handle, scenario, topic, layout)),
            None => FunctionTable::open(&handle, scenario, topic, layout),
        };
        Self::created(file, guard, create)
    }

    /// Creates the node that publishes `topic`, whose types have this `layout`, by the functions of this program.
    ///
    /// # Errors
    /// The functions have another interface, change the mode of the floating-point unit, or cannot create the node.
    pub fn of_program(
        functions: &TrefoilNode,
        scenario: &Scenario,
        topic: Topic,
        layout: &PortLayout,
    ) -> Result<Self, SessionError> {
        let file = &scenario.node.of(topic).exec;
        Self::created(file, Guard::new(), || FunctionTable::create(functions, scenario, topic, layout))
    }

    /// Makes the library of a `file` whose node is created by `create`.
    fn created(
        file: &str,
        guard: Guard,
        create: impl FnOnce() -> Result<Box<dyn Engine>, String>,
    ) -> Result<Self, SessionError> {
        let engine = guard.call("in `create`", create).and_then(|engine| engine);
        let engine = engine.map_err(|why| SessionError::Foreign { file: file.into(), why })?;
        Ok(Self { file: file.into(), engine: Some(engine), guard, wrong: Cell::new(None) })
    }

    /// Answers to one sample; `input` and `answer` have the types of the node in `trefoil.h`.
    ///
    /// # Errors
    /// The library fails, or has changed the mode of the floating-point unit, now or in another call since the last
    /// step.
    pub fn step(&mut self, input: &[u8], answer: &mut [u8]) -> Result<(), SessionError> {
        self.fail()?;
        let (guard, engine) = (self.guard, self.engine.as_mut().expect(NOT_DESTROYED));
        let stepped = guard.call("in `step`", || engine.step(input, answer)).and_then(|stepped| stepped);
        stepped.map_err(|why| SessionError::Foreign { file: self.file.clone(), why })
    }

    /// Size of the memory \[byte\]; 0 if the node keeps none.
    pub fn memory_bytes(&self) -> usize {
        self.engine.as_ref().expect(NOT_DESTROYED).memory_bytes()
    }

    /// Writes the memory to `memory`, of [`memory_bytes`](Self::memory_bytes).
    pub fn snapshot(&self, memory: &mut [u8]) {
        let engine = self.engine.as_ref().expect(NOT_DESTROYED);
        self.note(self.guard.call("in `snapshot`", || engine.snapshot(memory)));
    }

    /// Continues from `memory`; returns `false` if the node refuses it, or changes the mode of the floating-point unit.
    pub fn restore(&mut self, memory: &[u8]) -> bool {
        let (guard, engine) = (self.guard, self.engine.as_mut().expect(NOT_DESTROYED));
        let restored = guard.call("in `restore`", || engine.restore(memory));
        self.note(restored).unwrap_or(false)
    }

    /// Destroys the node.
    ///
    /// # Errors
    /// The library has changed the mode of the floating-point unit, now or in another call since the last step.
    pub fn destroy(mut self) -> Result<(), SessionError> {
        self.end();
        self.fail()
    }

    fn end(&mut self) {
        if let Some(engine) = self.engine.take() {
            self.note(self.guard.call("in `destroy`", || drop(engine)));
        }
    }

    /// Returns the result of a call, or keeps its error for the next step and returns `None`.
    fn note<T>(&self, done: Result<T, String>) -> Option<T> {
        done.map_err(|why| self.wrong.set(Some(why))).ok()
    }

    /// Fails with the error of an earlier call that could not return it, if there is one.
    fn fail(&self) -> Result<(), SessionError> {
        let wrong = self.wrong.take();
        wrong.map_or(Ok(()), |why| Err(SessionError::Foreign { file: self.file.clone(), why }))
    }
}

/// Reason why there is a node: only `end` takes the node, and no function of it is called after that.
const NOT_DESTROYED: &str = "a node that was not destroyed";

impl Drop for Library {
    /// Destroys the node. An error changes no answer any more, so it is only reported.
    fn drop(&mut self) {
        self.end();
        if let Err(why) = self.fail() {
            eprint_line(&format!("error: {why}"));
        }
    }
}

/// Returns the first word of the snapshots of the library or program that publishes `topic`, made of the hashes of its
/// files.
pub fn layout_of(scenario: &Scenario, topic: Topic) -> u64 {
    let program = scenario.node.of(topic);
    let part = |sha256: &String| sha256.get(..16).and_then(|digits| u64::from_str_radix(digits, 16).ok());
    program.files.values().map(|sha256| part(sha256).unwrap_or(u64::MAX)).fold(0, |layout, part| layout ^ part)
}
