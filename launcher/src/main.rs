//! `launcher`: the program users run.

use std::process::ExitCode;

fn main() -> ExitCode {
    launcher::cli::main()
}
