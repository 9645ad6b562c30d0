//! `guidance` as a program of its own.

use guidance::Guidance;
use runtime::{node, process};

fn main() -> std::process::ExitCode {
    process::main("guidance", |session| node::run(session, node::open::<Guidance>))
}
