//! `launcher`: the program users run.

use std::alloc::System;
use std::process::ExitCode;

use stats_alloc::{INSTRUMENTED_SYSTEM, StatsAlloc};

/// The system's allocator, counting: `measure mpc` tells how often a step asks for memory. It costs four additions per
/// block, and a step that asks for none pays nothing.
#[global_allocator]
static ALLOCATOR: &StatsAlloc<System> = &INSTRUMENTED_SYSTEM;

fn main() -> ExitCode {
    launcher::cli::main()
}
