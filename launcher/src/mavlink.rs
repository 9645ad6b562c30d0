//! `mavlink`: shows a flying stack to a ground station. `fly --mavlink` starts this command beside the flight.

use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use contract::exit;
use flight::interrupts::catch_interrupts;
use flight::own_program;
use ground::{Address, Home};
use runtime::console::print;
use runtime::realtime::die_with_parent;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::read;
use rustix::time::Timespec;

use crate::beside::{Beside, be_nice};
use crate::target::{self, TargetArgs};

/// Longest wait of `fly --mavlink` until this command observes the flight \[s\].
const JOIN_LIMIT_S: i64 = 30;

/// Arguments of `mavlink`.
#[derive(clap::Args)]
pub struct MavlinkArgs {
    /// Ground station: udpout:HOST:PORT sends there, udpin:HOST:PORT waits there for one
    #[arg(value_name = "ADDR")]
    address: Address,
    /// Place of the flight's origin: latitude and longitude in degrees, height in m
    #[arg(long, value_name = "LAT,LON,HEIGHT", default_value = Home::USUAL, allow_hyphen_values = true)]
    home: Home,
    #[command(flatten)]
    stack: TargetArgs,
}

/// Shows a flight until it ends, or until Ctrl-C; returns the exit code.
pub fn mavlink(args: &MavlinkArgs) -> anyhow::Result<u8> {
    be_nice();
    let interrupts = catch_interrupts()?;
    let domain = args.stack.find()?;
    let tell = || print(&format!("showing {} at {}; Ctrl-C ends it\n", target::describe(&domain), args.address));
    ground::show(domain.namespace(), &args.address, args.home, &interrupts, tell)?;
    Ok(exit::FLOWN)
}

/// Starts this command as a process for the flight in `namespace`, and waits until the process observes the flight.
pub fn beside(namespace: &str, address: &Address, home: &str) -> anyhow::Result<Beside> {
    let mut command: Command = own_program();
    command.args(["mavlink", "--namespace", namespace, "--home", home]).arg(address.to_string());
    command.stdin(Stdio::null()).stdout(Stdio::piped());
    die_with_parent(&mut command);
    let mut beside = Beside::start("--mavlink", &mut command)?;
    // The process prints a line when it has joined, and closes the pipe when it ends.
    let output = beside.child.stdout.take().context("the pipe was asked for")?;
    let limit = Timespec { tv_sec: JOIN_LIMIT_S, tv_nsec: 0 };
    let is_told = poll(&mut [PollFd::new(&output, PollFlags::IN)], Some(&limit)).is_ok_and(|ready| ready > 0);
    let mut line = [0; 1];
    ensure!(is_told && read(&output, &mut line).is_ok_and(|bytes| bytes > 0), "--mavlink cannot observe the flight");
    Ok(beside)
}
