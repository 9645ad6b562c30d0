//! The stack as a whole: flights in process, in lockstep and in real time, and the promises of the repository itself.

mod architecture;
mod bad_input;
mod control;
mod deadlines;
mod faults;
mod fuzz;
mod harness;
mod inherited;
mod isolation;
mod lockstep;
mod measure;
mod output;
mod paper;
mod processes;
mod promise;
mod recorded;
mod recorder;
mod sensitivity;
mod shared_memory;
mod solver;
mod surroundings;
mod swap;
mod swap_live;
mod tidy;
mod trace;
