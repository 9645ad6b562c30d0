//! `attitude-mpc` as a program of its own.

use attitude_mpc::AttitudeMpc;
use runtime::{node, process};

fn main() -> std::process::ExitCode {
    process::main("attitude-mpc", |session| node::run(session, node::open::<AttitudeMpc>))
}
