//! A loaded library, whichever of the known interfaces it has, and the guard around every call into it.
//!
//! A library is never unloaded: its threads and exit handlers may still use its code.

use std::path::absolute;

use contract::scenario::Scenario;
use contract::topic::Topic;
use runtime::error::SessionError;

use crate::abi::TrefoilNode;
use crate::casadi::Function;
use crate::engine::Engine;
use crate::loading;
use crate::protocol::Layout;
use crate::rounding::Rounding;
use crate::table::Table;

/// Node of a library.
pub struct Library {
    file: String,
    engine: Box<dyn Engine>,
    rounding: Rounding,
}

impl Library {
    /// Loads the library that `scenario` names for the node that publishes `topic`, whose types have this `layout`, and
    /// creates its node.
    ///
    /// # Errors
    /// The file cannot be loaded, has no known interface, changes the mode of the floating-point unit, or cannot create
    /// the node.
    pub fn load(scenario: &Scenario, topic: Topic, layout: &Layout) -> Result<Self, SessionError> {
        let file = &scenario.node.of(topic).exec;
        let refused = |why: String| SessionError::Foreign { file: file.clone(), why };
        let rounding = Rounding::now();
        // dlopen takes a name without a slash for one in the system's folders.
        let path = absolute(file).map_err(|error| refused(error.to_string()))?;
        let handle = loading::load(&path);
        let loaded = unchanged(rounding).map_err(|why| refused(format!("{why} while it was loaded")));
        let handle = handle.map_err(refused)?;
        loaded?;
        let function = || Function::find(&handle, &path, scenario.node.of(topic));
        let engine = match if Table::is_in(&handle) { None } else { function() } {
            Some(function) => function.and_then(|function| function.open(&handle, scenario, topic, layout)),
            None => Table::open(&handle, scenario, topic, layout),
        };
        unchanged(rounding).map_err(|why| refused(format!("{why} when it was created")))?;
        Ok(Self { file: file.clone(), engine: engine.map_err(refused)?, rounding })
    }

    /// Creates the node that publishes `topic`, whose types have this `layout`, by the functions of this program.
    ///
    /// # Errors
    /// The functions have another interface, change the mode of the floating-point unit, or cannot create the node.
    pub fn of_program(
        functions: &TrefoilNode,
        scenario: &Scenario,
        topic: Topic,
        layout: &Layout,
    ) -> Result<Self, SessionError> {
        let file = &scenario.node.of(topic).exec;
        let refused = |why: String| SessionError::Foreign { file: file.clone(), why };
        let rounding = Rounding::now();
        let engine = Table::create(functions, scenario, topic, layout).map_err(refused)?;
        unchanged(rounding).map_err(|why| refused(format!("{why} when it was created")))?;
        Ok(Self { file: file.clone(), engine, rounding })
    }

    /// Answers to one sample; `input` and `answer` have the types of the node in `trefoil.h`.
    ///
    /// # Errors
    /// The library fails, or has changed the mode of the floating-point unit, which is set back.
    pub fn step(&mut self, input: &[u8], answer: &mut [u8]) -> Result<(), SessionError> {
        let stepped = self.engine.step(input, answer);
        let stepped = unchanged(self.rounding).map_err(|why| format!("{why} in `step`")).and(stepped);
        stepped.map_err(|why| SessionError::Foreign { file: self.file.clone(), why })
    }

    /// Returns the node behind its interface.
    pub fn engine(&self) -> &dyn Engine {
        &*self.engine
    }

    /// Continues from `memory`; returns `false` if the node refuses it.
    pub fn restore(&mut self, memory: &[u8]) -> bool {
        self.engine.restore(memory)
    }
}

/// Returns the first word of the snapshots of the library or program that publishes `topic`: part of the hashes of its
/// files.
pub fn layout_of(scenario: &Scenario, topic: Topic) -> u64 {
    let program = scenario.node.of(topic);
    let part = |sha256: &String| sha256.get(..16).and_then(|digits| u64::from_str_radix(digits, 16).ok());
    let all = std::iter::once(&program.sha256).chain(program.files.values());
    all.map(|sha256| part(sha256).unwrap_or(u64::MAX)).fold(0, |layout, part| layout ^ part)
}

/// Fails if the mode of the floating-point unit is not `usual` any more, and sets it back.
fn unchanged(usual: Rounding) -> Result<(), String> {
    if Rounding::now() == usual {
        return Ok(());
    }
    usual.set();
    Err("it changed the rounding mode of the processor (was it built with -ffast-math?)".into())
}
