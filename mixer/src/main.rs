//! `mixer` as a program of its own.

fn main() -> std::process::ExitCode {
    contract::process::main("mixer", mixer::run)
}
