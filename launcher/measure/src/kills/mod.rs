//! `measure kills`: kill -9 of any process at any moment, again and again.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | victims and moments: a function of the seed and the flight's number |
//! | [`one_flight`] | one `launcher fly` through its kills |
//! | [`logged`] | what the log has of the kills, and what is missing in it |
//! | [`judge`] | what a flight must do after its kills |
//! | [`report`] | table and targets |
//!
//! Every flight is the survey of `launcher fly` without a file, 3 s in real time, started as a user starts it. Two fly at
//! once, each in a namespace of its own that its flights use one after the other: every start follows a killing.

pub mod judge;
pub mod logged;
pub mod one_flight;
pub mod plan;
pub mod report;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{bail, ensure};
use flight::interrupts::catch_interrupts;
use flight::stack::StartError;
use serde::Serialize;

use self::logged::Kill;
use self::one_flight::KillFlight;
use crate::findings::Findings;
use crate::killer::namespace;

/// Flights at once.
const LANES: usize = 2;

#[derive(clap::Args)]
pub struct KillsArgs {
    /// How many processes to kill
    #[arg(long, default_value_t = 1000)]
    pub kills: usize,
    /// Another seed, other victims and moments
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as measure.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
pub struct KillResults {
    /// By number.
    pub rows: Vec<KillFlight>,
    pub wall_s: f64,
}

/// Returns the exit code.
pub fn measure(args: &KillsArgs) -> anyhow::Result<u8> {
    ensure!(args.kills > 0, "--kills {}: nothing to measure; ask for one or more", args.kills);
    let interrupts = catch_interrupts()?;
    let results = KillResults::measure(args.kills, args.seed, &interrupts)?;
    let found = Findings::new(&results, report::targets(&results), false)?;
    if let Some(out) = &args.out {
        found.save(out, "measure.json")?;
    }
    found.conclude(args.json, &report::text(&results))
}

impl KillResults {
    pub fn kills(&self) -> impl Iterator<Item = &Kill> {
        self.rows.iter().flat_map(|row| &row.kills)
    }

    fn measure(kills: usize, seed: u64, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let (next, killed, rows) = (AtomicU64::new(1), AtomicUsize::new(0), Mutex::new(vec![]));
        let lane = || -> anyhow::Result<()> {
            let namespace = namespace();
            while killed.load(Ordering::Relaxed) < kills {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let row = KillFlight::fly(number, &plan::plan(seed, number), &namespace)?;
                if interrupts.load(Ordering::Relaxed) > 0 {
                    bail!(StartError::Interrupted);
                }
                killed.fetch_add(row.kills.len(), Ordering::Relaxed);
                rows.lock().expect("no thread panics with it").push(row);
            }
            Ok(())
        };
        let started = Instant::now();
        std::thread::scope(|scope| {
            let lanes: Vec<_> = (0..LANES).map(|_| scope.spawn(lane)).collect();
            lanes.into_iter().try_for_each(|lane| lane.join().expect("a lane does not panic"))
        })?;
        let mut rows = rows.into_inner().expect("no thread panics with it");
        rows.sort_by_key(|row| row.flight);
        Ok(Self { rows, wall_s: started.elapsed().as_secs_f64() })
    }
}
