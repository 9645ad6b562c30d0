//! `attitude-mpc` as a program of its own.

fn main() -> std::process::ExitCode {
    runtime::process::main("attitude-mpc", attitude_mpc::run)
}
