//! `attitude-mpc` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("attitude-mpc", runtime::node::run::<attitude_mpc::Node>)
}
