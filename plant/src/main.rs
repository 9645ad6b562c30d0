//! `plant` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("plant", plant::run)
}
