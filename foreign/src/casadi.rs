//! A library with a function that CasADi has generated: `Function.generate`, compiled as it is.
//!
//! The library describes its function itself, by functions beside it (`NAME_n_in`, `NAME_name_in`, ...; CasADi's user
//! guide, "Syntax of generated code"). Inputs and outputs are found by their names:
//!
//! | name | is |
//! |---|---|
//! | names of the node ([`crate::protocol`]) | numbers of its input and answer, in the units of the messages |
//! | `dt` | time between two samples \[s\] |
//! | `tick` | number of the sample |
//! | `p` | the array `p` of the node's settings |
//! | `start` | only for the plant, and required there: position, velocity, attitude and rates at the start |
//! | `z`, output `z_next` | memory from step to step, 0 at the first step |
//! | output `status` | only for attitude-mpc: 0 = the demand is valid |

#![expect(unsafe_code, reason = "functions of other languages are called")]

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;

use bytemuck::{bytes_of, cast_slice, pod_read_unaligned};
use contract::message::Kinematics;
use contract::topic::Topic;
use libloading::os::unix::Library as Handle;
use plant::vehicle::start;
use settings::{NodeSettings, Scenario};

use crate::abi::{TREFOIL_MEMORY_BYTES, TrefoilAttitudeAnswer};
use crate::elf::exported;
use crate::engine::Engine;
use crate::protocol::{MatrixShape, Place, PortLayout};

/// Ending of the name of the function that returns the number of inputs, by which a CasADi function is recognised.
const NUMBER_OF_INPUTS: &str = "_n_in";

type Call = unsafe extern "C" fn(*const *const f64, *mut *mut f64, *mut i64, *mut f64, c_int) -> c_int;
type NameOf = unsafe extern "C" fn(i64) -> *const c_char;
type SparsityOf = unsafe extern "C" fn(i64) -> *const i64;
type Work = unsafe extern "C" fn(*mut i64, *mut i64, *mut i64, *mut i64) -> c_int;

/// Name of a CasADi function in a library.
pub struct Function(String);

/// Meaning of an input or output, by its name.
#[derive(Clone, Copy)]
enum Meaning {
    /// Numbers of the node's input or answer, from this byte.
    Place(usize),
    Dt,
    Tick,
    Parameters,
    Start,
    Memory,
    Status,
}

/// Inputs that every node has beside the numbers of its input.
const INPUTS: &[(&str, Meaning)] =
    &[("dt", Meaning::Dt), ("tick", Meaning::Tick), ("p", Meaning::Parameters), ("z", Meaning::Memory)];

/// Input or output of a function.
struct Argument {
    meaning: Meaning,
    shape: MatrixShape,
    /// Values, column by column.
    values: Vec<f64>,
}

/// CasADi function with its buffers.
pub struct Casadi {
    call: Call,
    release: Option<unsafe extern "C" fn(c_int)>,
    decref: Option<unsafe extern "C" fn()>,
    /// Index of the function's own memory, as its checkout returned it.
    mem: c_int,
    inputs: Vec<Argument>,
    outputs: Vec<Argument>,
    /// Pointers to the inputs and outputs, with the room that the function asks for.
    arg: Vec<*const f64>,
    res: Vec<*mut f64>,
    iw: Vec<i64>,
    w: Vec<f64>,
    /// Number of values in `z`; a snapshot has them if it has room for all.
    memory: usize,
}

impl Function {
    /// Finds the CasADi function of the library at `path`; `None` if it has none. Of several, the settings of the
    /// `program` name one as `function`.
    pub fn find(handle: &Handle, path: &Path, program: &NodeSettings) -> Option<Result<Self, String>> {
        // SAFETY: the addresses are only compared with null.
        let has = |symbol: &str| unsafe { handle.get::<*const c_void>(symbol.as_bytes()) }.is_ok();
        let wanted = program.settings.get("function").and_then(toml::Value::as_str);
        if let Some(wanted) = wanted.filter(|wanted| has(wanted) && has(&format!("{wanted}{NUMBER_OF_INPUTS}"))) {
            return Some(Ok(Self(wanted.into())));
        }
        let bytes = std::fs::read(path).ok()?;
        let names = functions(&bytes).map_err(|error| format!("its dynamic symbol table cannot be read: {error}"));
        match (names.as_deref(), wanted) {
            (Err(why), _) => Some(Err(why.clone())),
            (Ok([]), _) => None,
            (Ok(names), Some(wanted)) => Some(Err(format!("it has no CasADi function `{wanted}`, but {names:?}"))),
            (Ok([only]), None) => Some(Ok(Self((*only).into()))),
            (Ok(names), None) => {
                Some(Err(format!("it has several CasADi functions: give `settings.function` one of {names:?}")))
            }
        }
    }

    /// Opens the function as the node that answers on `topic`, whose types have this `layout`.
    pub fn open(
        &self,
        handle: &Handle,
        scenario: &Scenario,
        topic: Topic,
        layout: &PortLayout,
    ) -> Result<Box<dyn Engine>, String> {
        // SAFETY: these are the types that CasADi generates for functions of these names.
        unsafe {
            for size in ["_casadi_int_size", "_casadi_real_size", "_int_size", "_real_size"] {
                let size_of = self.optional::<extern "C" fn() -> c_int>(handle, size);
                if size_of.is_some_and(|size_of| size_of() != 8) {
                    return Err(format!("`{}{size}` is not 8: generate it with 64-bit numbers", self.0));
                }
            }
            self.optional::<unsafe extern "C" fn()>(handle, "_incref").inspect(|incref| incref());
            let checkout = self.optional::<unsafe extern "C" fn() -> c_int>(handle, "_checkout");
            let mem = checkout.map_or(0, |checkout| checkout());
            let [inputs, outputs] = [
                self.arguments(handle, "in", layout.names[0], topic)?,
                self.arguments(handle, "out", layout.names[1], topic)?,
            ];
            let mut sizes = [0_i64; 4];
            let [arg, res, iw, w] = &mut sizes;
            let work: Work = self.required(handle, "_work")?;
            if work(arg, res, iw, w) != 0 || sizes.iter().any(|size| !(0..=MOST_WORK).contains(size)) {
                return Err(format!("`{}_work` asks for {sizes:?} places", self.0));
            }
            let [arg, res, iw, w] = sizes.map(|size| size as usize);
            let mut function = Casadi {
                call: self.required(handle, "")?,
                release: self.optional(handle, "_release"),
                decref: self.optional(handle, "_decref"),
                mem,
                arg: vec![std::ptr::null(); arg.max(inputs.len())],
                res: vec![std::ptr::null_mut(); res.max(outputs.len())],
                iw: vec![0; iw],
                w: vec![0.0; w],
                memory: 0,
                inputs,
                outputs,
            };
            function.check(scenario, topic)?;
            Ok(Box::new(function))
        }
    }

    /// Returns the inputs (`side` is `in`) or outputs (`out`) of the function; `known` has the numbers of the node by
    /// their names.
    ///
    /// # Safety
    /// The functions beside this one are those that CasADi generates.
    unsafe fn arguments(
        &self,
        handle: &Handle,
        side: &str,
        known: &[Place],
        topic: Topic,
    ) -> Result<Vec<Argument>, String> {
        // SAFETY: the caller vouches for the types of the functions; their pointers live as long as the library.
        let (count, name_of, sparsity_of) = unsafe {
            let count: extern "C" fn() -> i64 = self.required(handle, &format!("_n_{side}"))?;
            let name_of: NameOf = self.required(handle, &format!("_name_{side}"))?;
            let sparsity_of: SparsityOf = self.required(handle, &format!("_sparsity_{side}"))?;
            (count(), name_of, sparsity_of)
        };
        if count < 0 {
            return Err(format!("`{}_n_{side}` says that there are {count}", self.0));
        }
        let own: &[(&str, Meaning)] = match (side, topic) {
            ("in", Topic::State) => &[INPUTS, &[("start", Meaning::Start)]].concat(),
            ("in", _) => INPUTS,
            (_, Topic::Controls) => &[("status", Meaning::Status), ("z_next", Meaning::Memory)],
            _ => &[("z_next", Meaning::Memory)],
        };
        let (mut all, mut names) = (vec![], BTreeSet::new());
        for i in 0..count {
            // SAFETY: the index is below the number of names, which are C strings.
            let (name, sparsity) = unsafe { (name_of(i), sparsity_of(i)) };
            if name.is_null() || sparsity.is_null() {
                return Err(format!("{side}put {i} of `{}` has no name or no shape", self.0));
            }
            // SAFETY: CasADi gives each name as a C string.
            let name = unsafe { CStr::from_ptr(name) }.to_string_lossy().into_owned();
            let it = format!("{side}put `{name}` of `{}`", self.0);
            // SAFETY: the pattern is the one that CasADi gives.
            let shape = unsafe { dense(sparsity) }.map_err(|why| format!("{it} {why}"))?;
            let place = known.iter().find(|place| place.name == name);
            let (meaning, wanted) = match (place, own.iter().find(|(own, _)| *own == name)) {
                (Some(place), _) => (Meaning::Place(place.at), Some(place.shape)),
                (None, Some((_, meaning @ (Meaning::Parameters | Meaning::Memory)))) => (*meaning, None),
                (None, Some((_, meaning @ Meaning::Start))) => {
                    (*meaning, Some(MatrixShape { rows: START, columns: 1 }))
                }
                (None, Some((_, meaning))) => (*meaning, Some(MatrixShape { rows: 1, columns: 1 })),
                (None, None) => {
                    let known: Vec<&str> =
                        known.iter().map(|place| place.name).chain(own.iter().map(|own| own.0)).collect();
                    let known = known.join(", ");
                    return Err(format!("no {side}put of {} is called `{name}`; there are {known}", topic.publisher()));
                }
            };
            if let Some(wanted) = wanted.filter(|wanted| !wanted.fits(shape)) {
                return Err(format!("{it} is {shape}, not {wanted}"));
            }
            if !names.insert(name) {
                return Err(format!("{it} is there twice"));
            }
            all.push(Argument { meaning, shape, values: vec![0.0; shape.count()] });
        }
        Ok(all)
    }

    /// Returns the function whose name is the name of this one followed by `ending`.
    ///
    /// # Safety
    /// `F` is the type of the returned function.
    unsafe fn required<F: Copy>(&self, handle: &Handle, ending: &str) -> Result<F, String> {
        // SAFETY: the caller vouches for the type.
        let found = unsafe { self.optional(handle, ending) };
        found.ok_or_else(|| format!("`{}{ending}` is missing: was it generated by CasADi?", self.0))
    }

    /// Returns the function of [`required`](Self::required), if there is one.
    ///
    /// # Safety
    /// `F` is the type of the returned function.
    unsafe fn optional<F: Copy>(&self, handle: &Handle, ending: &str) -> Option<F> {
        // SAFETY: the caller vouches for the type.
        unsafe { handle.get::<F>(format!("{}{ending}", self.0).as_bytes()) }.ok().map(|found| *found)
    }
}

/// Returns the names of the CasADi functions that the library of these `bytes` exports, in order.
fn functions(bytes: &[u8]) -> object::Result<Vec<&str>> {
    let symbols = exported(bytes)?;
    let names = symbols.iter().filter_map(|symbol| symbol.strip_suffix(NUMBER_OF_INPUTS));
    Ok(names.filter(|name| symbols.contains(name)).collect())
}

/// Largest size of a work vector, and largest number of values of an input or output.
const MOST_WORK: i64 = 1 << 26;

/// Returns the shape of a dense pattern. A pattern has rows, columns, then 1, or else the offsets of the columns in the
/// values, and the row of each value.
///
/// # Errors
/// The pattern is sparse or invalid.
///
/// # Safety
/// `pattern` is one of CasADi's if its rows and columns are not negative.
unsafe fn dense(pattern: *const i64) -> Result<MatrixShape, String> {
    // SAFETY: the caller vouches for rows, columns and what follows them; nothing follows those of an empty pattern.
    unsafe {
        let (rows, columns) = (*pattern, *pattern.add(1));
        if rows < 0 || columns < 0 || rows.checked_mul(columns).is_none_or(|all| all > MOST_WORK) {
            return Err(format!("is {rows} x {columns}, which is no shape"));
        }
        let shape = MatrixShape { rows: rows as usize, columns: columns as usize };
        if shape.count() == 0 || *pattern.add(2) == 1 {
            return Ok(shape);
        }
        let offsets = std::slice::from_raw_parts(pattern.add(2), shape.columns + 1);
        if !offsets.iter().zip(0..).all(|(offset, column)| *offset == column * rows) {
            return Err("is sparse: make it dense (`densify`)".into());
        }
        let rows_of_values = std::slice::from_raw_parts(pattern.add(3 + shape.columns), shape.count());
        if !rows_of_values.iter().zip((0..rows).cycle()).all(|(row, expected)| *row == expected) {
            return Err("has a pattern that is none of CasADi's".into());
        }
        Ok(shape)
    }
}

/// Number of values of `start`.
const START: usize = 12;

/// Returns position, velocity, attitude and rates at the start of `scenario`.
fn state_at_start(scenario: &Scenario) -> [f64; START] {
    let (Kinematics { position_m, velocity_mps, attitude_rad, rates_radps }, _) = start(scenario);
    let mut state = [0.0; START];
    state.copy_from_slice([position_m, velocity_mps, attitude_rad, rates_radps].as_flattened());
    state
}

impl Casadi {
    /// Sets the inputs that do not change from step to step, and checks that inputs and outputs fit each other.
    fn check(&mut self, scenario: &Scenario, topic: Topic) -> Result<(), String> {
        let settings = &scenario.node.of(topic).settings;
        let given = settings.get("p").map(|p| p.clone().try_into::<Vec<f64>>());
        let given =
            given.transpose().map_err(|_| "`settings.p` is no array of numbers".to_owned())?.unwrap_or_default();
        if let Some(key) = settings.keys().find(|key| !["p", "function"].contains(&key.as_str())) {
            return Err(format!("`settings.{key}` has no effect on a CasADi function; it has `p` and `function`"));
        }
        let mut parameters = 0;
        for input in &mut self.inputs {
            match input.meaning {
                Meaning::Dt => input.values[0] = scenario.sample_s(),
                Meaning::Parameters if given.len() == input.values.len() => {
                    parameters = given.len();
                    input.values.clone_from(&given);
                }
                Meaning::Parameters => {
                    let (needs, has) = (input.values.len(), given.len());
                    return Err(format!("input `p` has {needs} numbers, and `settings.p` has {has}"));
                }
                Meaning::Start => input.values.copy_from_slice(&state_at_start(scenario)),
                Meaning::Memory => self.memory = input.values.len(),
                _ => {}
            }
        }
        if parameters == 0 && !given.is_empty() {
            return Err("`settings.p` is given, and the function has no input `p`".into());
        }
        if topic == Topic::State && !self.inputs.iter().any(|input| matches!(input.meaning, Meaning::Start)) {
            return Err("a vehicle needs the input `start`: its state when the flight begins".into());
        }
        let [z, z_next] = [&self.inputs, &self.outputs].map(|arguments| {
            let memory = arguments.iter().find(|argument| matches!(argument.meaning, Meaning::Memory));
            memory.map_or(MatrixShape { rows: 0, columns: 0 }, |memory| memory.shape)
        });
        if !z.fits(z_next) {
            return Err(format!("input `z` and output `z_next` go together, and are {z} and {z_next}"));
        }
        if !self.outputs.iter().any(|output| matches!(output.meaning, Meaning::Place(_))) {
            return Err(format!("the function has no output for {}", topic.publisher()));
        }
        Ok(())
    }

    /// Returns the memory: the values of `z` for the next step.
    fn z(&self) -> &[f64] {
        let z = self.inputs.iter().find(|input| matches!(input.meaning, Meaning::Memory));
        z.map_or(&[], |z| &z.values)
    }
}

impl Engine for Casadi {
    fn step(&mut self, input: &[u8], answer: &mut [u8]) -> Result<(), String> {
        for Argument { meaning, values, .. } in &mut self.inputs {
            match *meaning {
                Meaning::Place(at) => {
                    for (value, bytes) in values.iter_mut().zip(input[at..].chunks_exact(8)) {
                        *value = pod_read_unaligned(bytes);
                    }
                }
                Meaning::Tick => values[0] = pod_read_unaligned::<u64>(&input[..8]) as f64, // first in every input
                Meaning::Dt | Meaning::Parameters | Meaning::Start | Meaning::Memory | Meaning::Status => {}
            }
        }
        for (place, input) in self.arg.iter_mut().zip(&self.inputs) {
            *place = input.values.as_ptr();
        }
        for (place, output) in self.res.iter_mut().zip(&mut self.outputs) {
            *place = output.values.as_mut_ptr();
        }
        let (iw, w) = (self.iw.as_mut_ptr(), self.w.as_mut_ptr());
        // SAFETY: all vectors have the sizes that the function asked for, and each input and output that of its shape.
        let result = unsafe { (self.call)(self.arg.as_ptr(), self.res.as_mut_ptr(), iw, w, self.mem) };
        if result != 0 {
            return Err(format!("the function returned {result}"));
        }
        for Argument { meaning, values, .. } in &self.outputs {
            match *meaning {
                Meaning::Place(at) => answer[at..at + 8 * values.len()].copy_from_slice(cast_slice(values)),
                Meaning::Status => {
                    let at = std::mem::offset_of!(TrefoilAttitudeAnswer, status);
                    answer[at..at + 8].copy_from_slice(bytes_of(&u64::from(values[0] != 0.0)));
                }
                Meaning::Memory => {
                    if let Some(z) = self.inputs.iter_mut().find(|input| matches!(input.meaning, Meaning::Memory)) {
                        z.values.copy_from_slice(values);
                    }
                }
                Meaning::Dt | Meaning::Tick | Meaning::Parameters | Meaning::Start => {}
            }
        }
        Ok(())
    }

    fn memory_bytes(&self) -> usize {
        let bytes = 8 * self.memory;
        if bytes <= TREFOIL_MEMORY_BYTES as usize { bytes } else { 0 }
    }

    fn snapshot(&self, memory: &mut [u8]) {
        memory.copy_from_slice(cast_slice(self.z()));
    }

    fn restore(&mut self, memory: &[u8]) -> bool {
        let z = self.inputs.iter_mut().find(|input| matches!(input.meaning, Meaning::Memory));
        for (value, bytes) in z.into_iter().flat_map(|z| &mut z.values).zip(memory.chunks_exact(8)) {
            *value = pod_read_unaligned(bytes);
        }
        true
    }
}

impl Drop for Casadi {
    fn drop(&mut self) {
        // SAFETY: `mem` came from the function's own checkout, and is not used any more.
        unsafe {
            self.release.inspect(|release| release(self.mem));
            self.decref.inspect(|decref| decref());
        }
    }
}
