//! `measure faults`: every fault of the catalogue, and what the flight bears.
//!
//! | module | holds |
//! |---|---|
//! | [`case`] | the matrix, and which faults count as recoverable |
//! | [`one_flight`] | one flight through its fault, by processes and by one thread |
//! | [`strike`] | processes killed and stopped in real time, against the clock |
//! | [`relay`] | candidates in flight, good and wrong ones |
//! | [`targets`], [`table`] | what is printed |
//!
//! Every case is `scenarios/faults/hover-gusts.toml` with one fault of the default size from 5 s to 6 s. It is flown in
//! lockstep, by real processes that really die, and by one thread: the two must be the same flight, bit for bit. The
//! profile is the robust one: the paper's does not bear the gusts, with or without a fault. That one has the faults of
//! processes and topics in a calm hover.

pub mod case;
pub mod one_flight;
pub mod relay;
pub mod strike;
pub mod table;
pub mod targets;

use std::path::PathBuf;
use std::sync::atomic::AtomicU32;

use contract::Scenario;
use contract::scenario::{from_merged, load};
use serde::Serialize;

use self::case::Case;
use self::one_flight::{Quiet, Row};
use self::relay::Relay;
use self::strike::Strikes;
use super::Findings;
use flight::interrupts::catch_interrupts;

/// Arguments of `measure faults`.
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

/// Everything measured.
#[derive(Debug, Serialize)]
pub struct Results {
    /// One row per case.
    pub rows: Vec<Row>,
    /// The same of processes and topics, profile paper, in calm.
    pub paper: Vec<Row>,
    /// Flights without a fault.
    pub quiet: Vec<Quiet>,
    /// Candidates.
    pub relays: Vec<Relay>,
    /// Strikes in real time.
    pub strikes: Strikes,
}

/// Measures as the arguments say; the exit code.
pub fn measure(args: &FaultsArgs) -> anyhow::Result<u8> {
    let interrupts = catch_interrupts()?;
    let results = Results::measure(args.quick, &interrupts)?;
    let targets = targets::targets(&results);
    let table = table::table(&results);
    let found = Findings::new(&results, targets, args.quick)?;
    if let Some(out) = &args.out {
        found.save(out, "measure.json")?;
    }
    found.conclude(args.json, &table)
}

impl Results {
    fn measure(quick: bool, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let (base, calm) = (hover_in_gusts()?, hover_of_the_paper()?);
        let fly = |base: &Scenario, wanted: fn(&Case) -> bool| -> anyhow::Result<Vec<Row>> {
            let cases = Case::all().into_iter().filter(wanted);
            cases.map(|case| Row::fly(base, &case, interrupts)).collect()
        };
        let rows = fly(&base, if quick { Case::is_of_a_process } else { |_| true })?;
        let paper = fly(&calm, if quick { |_| false } else { Case::is_of_software })?;
        let quiet = [Scenario::default(), base].into_iter().map(|calm| Quiet::fly(calm, interrupts));
        Ok(Self {
            rows,
            paper,
            quiet: quiet.collect::<Result<_, _>>()?,
            relays: Relay::fly_all(if quick { 1 } else { relay::ROUNDS }, interrupts)?,
            strikes: Strikes::measure(if quick { 1 } else { 5 }, interrupts)?,
        })
    }
}

/// What every fault is put into, aboard so that the command works anywhere.
fn hover_in_gusts() -> anyhow::Result<Scenario> {
    let text = include_str!("../../../../scenarios/faults/hover-gusts.toml");
    Ok(from_merged(text, "scenarios/faults/hover-gusts.toml")?)
}

/// A hover in calm with the paper's controller.
fn hover_of_the_paper() -> anyhow::Result<Scenario> {
    let settings = ["profile=paper", "mission.trajectory=hover", "run.duration_s=12.0"].map(str::to_owned);
    Ok(load(None, &settings)?)
}

#[cfg(test)]
mod tests;
