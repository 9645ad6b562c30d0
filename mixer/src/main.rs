//! `mixer` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("mixer", mixer::run)
}
