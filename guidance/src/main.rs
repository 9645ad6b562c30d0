//! `guidance` as a program of its own.

fn main() -> std::process::ExitCode {
    contract::process::main("guidance", guidance::run)
}
