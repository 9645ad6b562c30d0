//! `mixer` as a program of its own.

use mixer::Mixer;
use runtime::{node, process};

fn main() -> std::process::ExitCode {
    process::main("mixer", |session| node::run(session, node::open::<Mixer>))
}
