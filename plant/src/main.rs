//! `plant` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::session::main("plant", plant::run)
}
