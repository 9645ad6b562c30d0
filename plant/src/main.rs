//! `plant` as a program of its own.

fn main() -> std::process::ExitCode {
    contract::process::main("plant", plant::run)
}
