//! `attitude-mpc` as a program of its own.

fn main() -> std::process::ExitCode {
    contract::process::main("attitude-mpc", attitude_mpc::run)
}
