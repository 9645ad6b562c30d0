//! `guidance` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::session::main("guidance", guidance::run)
}
