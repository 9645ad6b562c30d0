//! `measure faults`: every fault of the catalogue, and what the flight bears.
//!
//! | module | holds |
//! |---|---|
//! | [`case`] | the matrix, and which faults count as recoverable |
//! | [`one_flight`] | one flight through its fault, by processes and by one thread |
//! | [`handling`] | what the supervision does about a process fault, in lockstep and in real time |
//! | [`strike`] | processes killed and stopped from outside, in real time |
//! | [`relay`] | candidates in flight, good and wrong ones |
//! | [`report`] | tables and targets |
//!
//! Every case is `scenarios/faults/hover-gusts.toml` with one fault of the default size from 5 s to 6 s. It is flown in
//! lockstep, by real processes that really die, and by one thread: the two must be the same flight, bit for bit. The
//! profile is the robust one: the paper's does not bear the gusts, with or without a fault. That one has the faults of
//! processes and topics in a calm hover.

pub mod case;
pub mod handling;
pub mod one_flight;
pub mod relay;
pub mod report;
pub mod strike;

use std::path::PathBuf;
use std::sync::atomic::AtomicU32;

use contract::Scenario;
use flight::interrupts::catch_interrupts;
use serde::Serialize;

use self::case::{Case, hover_in_gusts, hover_of_the_paper};
use self::handling::FaultHandling;
use self::one_flight::{FaultFlight, QuietFlight};
use self::relay::Relay;
use self::strike::Strikes;
use crate::findings::Findings;

#[derive(clap::Args)]
pub struct FaultsArgs {
    /// Only the process faults, one swap of each node and one flight of each sort in real time: shows that everything works
    #[arg(long)]
    pub quick: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as measure.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
pub struct FaultResults {
    pub rows: Vec<FaultFlight>,
    /// Faults of processes and topics with the profile paper, in calm.
    pub paper: Vec<FaultFlight>,
    /// Flights without a fault.
    pub quiet: Vec<QuietFlight>,
    /// Process faults in lockstep and in real time.
    pub handling: Vec<FaultHandling>,
    pub relays: Vec<Relay>,
    pub strikes: Strikes,
}

/// Returns the exit code.
pub fn measure(args: &FaultsArgs) -> anyhow::Result<u8> {
    let interrupts = catch_interrupts()?;
    let results = FaultResults::measure(args.quick, &interrupts)?;
    let found = Findings::new(&results, report::targets(&results), args.quick)?;
    if let Some(out) = &args.out {
        found.save(out, "measure.json")?;
    }
    found.conclude(args.json, &report::text(&results))
}

impl FaultResults {
    fn measure(quick: bool, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let (base, calm) = (hover_in_gusts()?, hover_of_the_paper()?);
        let fly = |base: &Scenario, wanted: fn(&Case) -> bool| -> anyhow::Result<Vec<FaultFlight>> {
            let cases = Case::all().into_iter().filter(wanted);
            cases.map(|case| FaultFlight::fly(base, &case, interrupts)).collect()
        };
        let rows = fly(&base, if quick { Case::is_of_a_process } else { |_| true })?;
        let paper = fly(&calm, if quick { |_| false } else { Case::is_of_software })?;
        let handling = handling::compare(&base, quick, interrupts)?;
        let quiet = [Scenario::default(), base].into_iter().map(|calm| QuietFlight::fly(calm, interrupts));
        Ok(Self {
            rows,
            paper,
            quiet: quiet.collect::<Result<_, _>>()?,
            handling,
            relays: Relay::fly_all(if quick { 1 } else { relay::ROUNDS }, interrupts)?,
            strikes: Strikes::measure(if quick { 1 } else { 5 }, interrupts)?,
        })
    }
}
