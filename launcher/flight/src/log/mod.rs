//! The flight log: every message of every topic, TRUTH, and every event, in one MCAP file that Foxglove, `PlotJuggler`
//! and Python can read.
//!
//! | in the file | is |
//! |---|---|
//! | topics `/state` `/reference` `/controls` `/actuators` | the messages, as the protobuf of `proto/trefoil.proto` |
//! | topic `/truth` | the true motion and actuator positions, likewise |
//! | topic `/memory` | the snapshot of every node, every ten seconds, as protobuf ([`Memory`]) |
//! | topic `/events` | events of the processes, as protobuf ([`crate::event`]) |
//! | `log_time` | simulated time, the stamp's tick times the sample time: one time axis for runs of every mode |
//! | `publish_time` | `CLOCK_MONOTONIC` of the publication; 0 for TRUTH, events and snapshots, and in process |
//! | metadata `scenario`, key `toml` | the run's merged settings, the first record of the file |
//! | metadata `trefoil` | version and commit of the writer, layout of the messages, run, and the two time rules above |
//!
//! The log survives its writer: [`LogWriter`] closes a chunk every 64 KiB and every second, compressed by `lz4.rs`; a
//! killed process loses only the open chunk, and [`read()`] reads all chunks that were closed. No node writes a log,
//! because one write can take milliseconds.

mod channel;
mod index;
mod join;
mod lz4;
mod order;
mod outcome;
mod read;
mod schema;
#[cfg(test)]
mod tests;
mod write;

pub use channel::{Channel, channels};
pub use index::{ALL, LogSpan};
pub use join::{join, memories, part, read_parts, rest, stream};
pub use lz4::Lz4;
pub use order::last_tick;
pub use outcome::LogOutcome;
pub use read::{Log, WrittenBy, read};
pub use ring::count::{Count, counted};
pub use ring::memory::Memory;
pub use ring::record::Record;
pub use ring::samples::Samples;
pub use ring::with_message;
pub use schema::{Column, columns, encode, encode_event, fields, status_name, words};
pub use write::LogWriter;

/// Name of the metadata record that holds the scenario, and the scenario's key in it.
const SCENARIO: (&str, &str) = ("scenario", "toml");
/// Name of the metadata record with the program and the run that wrote the log.
const WRITTEN_BY: &str = "trefoil";
const EVENTS: &str = "/events";
const MEMORY: &str = "/memory";
