//! `libtrefoil`: the testbed for programs in other languages. The header is `foreign/include/trefoil_process.h`.
//!
//! | module | holds |
//! |---|---|
//! | [`plant`] | `trefoil_plant_run`: the plant as a program, with the vehicle of its caller |
//! | [`process`] | `trefoil_join` and what follows: a node of the ring as a program with a `main` of its own |
//! | [`stepped`] | `trefoil_flight_open` and what follows: a flight in process whose caller is one of its nodes |
//! | [`sizes`] | number and sizes of the interface, to compare with those of the caller |
//! | `boundary` | text, memory, errors and panics on their way between Rust and C |
//!
//! Inputs and answers have the types of `trefoil.h`, which [`foreign`] makes of messages. Every function returns an
//! error where Rust would panic: no panic crosses into C.

mod boundary;
pub mod plant;
pub mod process;
pub mod sizes;
pub mod stepped;
