//! `guidance` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("guidance", guidance::run)
}
