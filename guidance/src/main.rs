//! `guidance` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("guidance", runtime::node::run::<guidance::Node>)
}
