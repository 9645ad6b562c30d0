//! Controllers from other languages, as cores of nodes: a shared library in the place of a core of the launcher.
//!
//! ```text
//! [node.mixer] exec = "my.so"
//!   -> Library: dlopen, a guard around every call                                    (loading, library)
//!   -> Engine: the function table of trefoil.h, or a function of CasADi              (table, casadi)
//!   -> Foreign<Protocol>: messages to the types of trefoil.h, answers back           (core, protocol)
//!   -> runtime::node: the same ports, loop and faults as for every core
//! [node.plant] exec = "my.so"
//!   -> ForeignVehicle: the motion; commands, sensors and loop are the plant's           (vehicle)
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`abi`] | the types of `trefoil.h` |
//! | `loading` | dlopen, and which dependencies a library gets |
//! | `library` | a loaded library, and the guard around every call into it |
//! | `elf` | check of the length of a library's file, and the names that it exports |
//! | `engine` | functions that every interface of a library offers |
//! | `table` | a library with the function table of `trefoil.h` |
//! | `casadi` | a library with a function that CasADi has generated |
//! | [`rounding`] | the mode of the floating-point unit, which a library must leave as it is |
//! | `protocol` | input and answer of each node |
//! | `core` | a library as the core of a node that answers |
//! | `vehicle` | a library, or functions of a program, as the vehicle of the plant |
//! | `asked` | a node whose answers its caller computes, in this process |
//! | [`setup`] | vehicle and settings, as a node in another language gets them |
//!
//! A controller gets sensor measurements, not the true motion.

pub mod abi;
mod asked;
mod casadi;
mod core;
mod elf;
mod engine;
mod library;
mod loading;
mod protocol;
pub mod rounding;
pub mod setup;
mod table;
mod vehicle;

pub use asked::{open_asked, sizes};
pub use core::{Foreign, open, try_out};
pub use loading::in_program_of_others;
pub use protocol::AttitudeMpcProtocol;
pub use vehicle::{vehicle, vehicle_of_program};
