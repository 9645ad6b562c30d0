//! A library with the function table of `trefoil.h`.

#![expect(unsafe_code, reason = "functions of other languages are called")]

use std::ffi::{CStr, CString, c_char, c_void};

use contract::topic::Topic;
use libloading::os::unix::Library as Handle;
use settings::Scenario;

use crate::abi::{FindNode, TREFOIL_ABI, TREFOIL_MEMORY_BYTES, TrefoilNode};
use crate::engine::Engine;
use crate::protocol::PortLayout;
use crate::setup::Setup;

/// Name of the exported function, without the number of the interface at its end.
const EXPORT: &str = "trefoil_node_v";
/// Numbers of other interfaces to look for, to name them in the error.
const OTHER_ABIS: std::ops::Range<u32> = 0..100;
/// Longest reason that a library may give for an error \[byte\].
const ERROR_BYTES: usize = 512;

/// Node that a library has created.
pub struct FunctionTable {
    /// Pointer of the library to its node, not null.
    node: *mut c_void,
    step: unsafe extern "C" fn(*mut c_void, *const c_void, *mut c_void) -> i32,
    destroy: unsafe extern "C" fn(*mut c_void),
    /// Functions of the memory; `None` if the node keeps none.
    memory: Option<(TakeSnapshot, Restore)>,
    memory_bytes: usize,
}

type TakeSnapshot = unsafe extern "C" fn(*const c_void, *mut c_void);
type Restore = unsafe extern "C" fn(*mut c_void, *const c_void) -> i32;

impl FunctionTable {
    /// Returns whether a library exports the function table.
    pub fn is_in(handle: &Handle) -> bool {
        export_of(handle, TREFOIL_ABI)
    }

    /// Creates the node that answers on `topic`, whose types have this `layout`.
    pub fn open(
        handle: &Handle,
        scenario: &Scenario,
        topic: Topic,
        layout: &PortLayout,
    ) -> Result<Box<dyn Engine>, String> {
        Self::create(&table_of(handle, topic.publisher())?, scenario, topic, layout)
    }

    /// Creates the node that answers on `topic`, whose types have this `layout`, by the functions of `table`.
    pub fn create(
        table: &TrefoilNode,
        scenario: &Scenario,
        topic: Topic,
        layout: &PortLayout,
    ) -> Result<Box<dyn Engine>, String> {
        let name = topic.publisher();
        if table.abi != TREFOIL_ABI {
            return Err(format!("it has interface {}, and this launcher has {TREFOIL_ABI}", table.abi));
        }
        let bytes = [table.input_bytes, table.answer_bytes].map(|bytes| bytes as usize);
        if bytes != layout.bytes {
            let what = format!("its {name} has an input and an answer of {bytes:?} byte, and those of trefoil.h have");
            return Err(format!("{what} {:?}: build it with the header of this launcher", layout.bytes));
        }
        if table.memory_bytes > TREFOIL_MEMORY_BYTES {
            let most = format!("at most {TREFOIL_MEMORY_BYTES}; return 0 for a restart without memory");
            return Err(format!("its memory has {} byte: {most}", table.memory_bytes));
        }
        let memory = table.snapshot.zip(table.restore).filter(|_| table.memory_bytes > 0);
        let (Some(create), Some(step), Some(destroy)) = (table.create, table.step, table.destroy) else {
            return Err("create, step or destroy is NULL".into());
        };
        if memory.is_none() && table.memory_bytes > 0 {
            return Err("it has a memory, but snapshot or restore is NULL".into());
        }
        let setup = Setup::new(scenario, topic)?;
        let mut why = [0 as c_char; ERROR_BYTES];
        // SAFETY: `setup` and `why` outlive the call, and `why` is one byte longer than told.
        let node = unsafe { create(setup.as_ptr(), why.as_mut_ptr(), ERROR_BYTES - 1) };
        if node.is_null() {
            // SAFETY: the last byte of `why` was not given away, so a zero ends the text.
            let why = unsafe { CStr::from_ptr(why.as_ptr()) }.to_string_lossy();
            return Err(format!("it cannot create {name}: {why}"));
        }
        Ok(Box::new(Self { node, step, destroy, memory, memory_bytes: table.memory_bytes as usize }))
    }
}

impl Engine for FunctionTable {
    fn step(&mut self, input: &[u8], answer: &mut [u8]) -> Result<(), String> {
        // SAFETY: both have the sizes that the library was built with, which `create` has compared.
        match unsafe { (self.step)(self.node, input.as_ptr().cast(), answer.as_mut_ptr().cast()) } {
            0 => Ok(()),
            result => Err(format!("`step` returned {result}")),
        }
    }

    fn memory_bytes(&self) -> usize {
        self.memory_bytes
    }

    fn snapshot(&self, memory: &mut [u8]) {
        assert_eq!(memory.len(), self.memory_bytes);
        if let Some((take, _)) = self.memory {
            // SAFETY: `memory` has as many bytes as the library says that it writes.
            unsafe { take(self.node, memory.as_mut_ptr().cast()) };
        }
    }

    fn restore(&mut self, memory: &[u8]) -> bool {
        assert_eq!(memory.len(), self.memory_bytes);
        // SAFETY: `memory` has as many bytes as the library says that it reads.
        self.memory.is_some_and(|(_, restore)| unsafe { restore(self.node, memory.as_ptr().cast()) } == 0)
    }
}

impl Drop for FunctionTable {
    fn drop(&mut self) {
        // SAFETY: the node came from `create` of the same library, and is not used any more.
        unsafe { (self.destroy)(self.node) };
    }
}

/// Returns whether a library exports the function table of the interface `abi`.
fn export_of(handle: &Handle, abi: u32) -> bool {
    // SAFETY: the address is only compared with null.
    unsafe { handle.get::<*const c_void>(format!("{EXPORT}{abi}").as_bytes()) }.is_ok()
}

/// Finds the functions of the node `name` in a library.
fn table_of(handle: &Handle, name: &str) -> Result<TrefoilNode, String> {
    let export = |abi: u32| format!("{EXPORT}{abi}");
    // SAFETY: a function of this name has this type: the name contains the number of the interface.
    let find = unsafe { handle.get::<FindNode>(export(TREFOIL_ABI).as_bytes()) };
    let Ok(find) = find else {
        let other = OTHER_ABIS.into_iter().find(|abi| export_of(handle, *abi));
        let own = export(TREFOIL_ABI);
        return Err(other.map_or_else(
            || format!("it does not export `{own}`: see docs/controllers.md"),
            |other| format!("it has interface {other} (`{}`), and this launcher has {TREFOIL_ABI}", export(other)),
        ));
    };
    let c_name = CString::new(name).map_err(|error| error.to_string())?;
    // SAFETY: the name is text with a zero at its end. The table is read before anything else is called.
    let table = unsafe { find(c_name.as_ptr()).as_ref() };
    table.copied().ok_or_else(|| format!("it has no node `{name}`"))
}
