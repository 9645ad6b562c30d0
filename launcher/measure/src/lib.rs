//! Measurements of the stack's figures on this machine, each with targets.
//!
//! | module | holds |
//! |---|---|
//! | [`mpc`] | `measure mpc`: times of the controller's steps by law, path and solver, and of the navigation unit |
//! | [`faults`] | `measure faults`: every fault of the catalogue, and the recovery of the flight |
//! | [`stress`] | `measure stress`: kills of any process at any moment, swaps, faults and load, and the replay of each flight |
//! | [`timing`] | `measure timing`: latency of the stack, compared with the kernel's own wake-up |
//! | [`flights`] | flights that a measurement flies itself, by one thread or by processes |
//! | [`findings`] | targets and results |
//! | [`launched`] | processes of a stack seen from outside, and signals to them |

#![allow(missing_docs)]
#![cfg_attr(test, allow(clippy::disallowed_methods, reason = "a test asks the platform for a second opinion"))]

pub mod faults;
pub mod findings;
pub mod flights;
pub mod launched;
pub mod mpc;
pub mod stress;
pub mod timing;

use clap::Subcommand;

#[derive(Subcommand)]
pub enum Measure {
    /// Time a step of the controller on recorded problems, by law, path and solver, and the navigation unit
    Mpc(mpc::MpcArgs),
    /// Fly with every fault of the catalogue, and compare faults of processes with real time
    Faults(faults::FaultsArgs),
    /// Kill, swap and disturb processes of flights in real time, and fly each flight again from its log
    Stress(stress::StressArgs),
    /// Time the stack against cyclictest, raw rings, load and rates
    Timing(timing::TimingArgs),
    /// One process of a ring that `timing` compares with; `timing` starts these itself
    #[command(hide = true)]
    RingPeer(timing::ring_peer::RingPeerArgs),
}

impl Measure {
    /// Runs the measurement and returns the exit code.
    pub fn run(&self) -> anyhow::Result<u8> {
        match self {
            Self::Mpc(args) => mpc::measure(args),
            Self::Faults(args) => faults::measure(args),
            Self::Stress(args) => stress::measure(args),
            Self::Timing(args) => timing::measure(args),
            Self::RingPeer(args) => timing::ring_peer::run(args),
        }
    }
}
