//! `measure kills`: kill -9 of any process at any moment, again and again.
//!
//! | module | holds |
//! |---|---|
//! | [`draw`] | who is to be killed when: a function of the seed and the flight's number |
//! | [`one_flight`] | one `launcher fly` through its kills, and what was seen of it |
//! | [`logged`] | what the flight's log tells of the kills, and what is missing in it |
//! | [`judge`] | what must come of a flight, and whether it did |
//! | [`targets`], [`table`] | what is printed |
//!
//! Every flight is the survey of `launcher fly` without a file, 3 s in real time, started as a user starts it. Two fly at
//! once, each in a namespace of its own that its flights use one after the other: every start is one after a killing.

pub mod draw;
pub mod judge;
pub mod logged;
pub mod one_flight;
pub mod table;
pub mod targets;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{bail, ensure};
use serde::Serialize;

use self::one_flight::{Kill, Row};
use super::Findings;
use super::timing::rings::namespace;
use flight::interrupts::catch_interrupts;
use flight::stack::StartError;

/// Flights at once.
const LANES: usize = 2;

/// Arguments of `measure kills`.
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

/// Everything measured.
#[derive(Debug, Serialize)]
pub struct Results {
    /// One row per flight, in the order of their numbers.
    pub rows: Vec<Row>,
    /// How long all of it took \[s\].
    pub wall_s: f64,
}

/// Measures as the arguments say; the exit code.
pub fn measure(args: &KillsArgs) -> anyhow::Result<u8> {
    ensure!(args.kills > 0, "--kills {}: nothing to measure; ask for one or more", args.kills);
    let interrupts = catch_interrupts()?;
    let results = Results::measure(args.kills, args.seed, &interrupts)?;
    let targets = targets::targets(&results);
    let table = table::table(&results);
    let found = Findings::new(&results, targets, false)?;
    if let Some(out) = &args.out {
        found.save(out, "measure.json")?;
    }
    found.conclude(args.json, &table)
}

impl Results {
    /// All kills, flight by flight.
    pub fn kills(&self) -> impl Iterator<Item = &Kill> {
        self.rows.iter().flat_map(|row| &row.kills)
    }

    fn measure(kills: usize, seed: u64, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let (next, killed, rows) = (AtomicU64::new(1), AtomicUsize::new(0), Mutex::new(vec![]));
        let lane = || -> anyhow::Result<()> {
            let namespace = namespace();
            while killed.load(Ordering::Relaxed) < kills {
                let number = next.fetch_add(1, Ordering::Relaxed);
                let row = Row::fly(number, &draw::blows(seed, number), &namespace)?;
                if interrupts.load(Ordering::Relaxed) > 0 {
                    bail!(StartError::Interrupted);
                }
                killed.fetch_add(row.kills.len(), Ordering::Relaxed);
                rows.lock().expect("nobody panics with it").push(row);
            }
            Ok(())
        };
        let started = Instant::now();
        std::thread::scope(|scope| {
            let lanes: Vec<_> = (0..LANES).map(|_| scope.spawn(lane)).collect();
            lanes.into_iter().try_for_each(|lane| lane.join().expect("a lane does not panic"))
        })?;
        let mut rows = rows.into_inner().expect("nobody panics with it");
        rows.sort_by_key(|row| row.flight);
        Ok(Self { rows, wall_s: started.elapsed().as_secs_f64() })
    }
}
