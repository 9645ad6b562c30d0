//! The stack as a whole: flights in process, in lockstep and in real time, and the promises of the repository itself.

#![allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion")]

mod accuracy;
mod architecture;
mod bad_input;
mod campaign;
mod compare;
mod control;
mod controllers;
mod deadlines;
mod faults;
mod foreign;
mod foreign_campaigns;
mod fuzz;
mod harness;
mod inherited;
mod isolation;
mod lockstep;
mod measure;
mod output;
mod paper;
mod paper_table;
mod processes;
mod promise;
mod recorded;
mod recorder;
mod replay;
mod same_bits;
mod sensitivity;
mod shared_memory;
mod solver;
mod surroundings;
mod swap;
mod swap_live;
mod tidy;
mod trace;
mod vehicle;
