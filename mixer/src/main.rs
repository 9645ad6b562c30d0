//! `mixer` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("mixer", runtime::node::run::<mixer::Node>)
}
