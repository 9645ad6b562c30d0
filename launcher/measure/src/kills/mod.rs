//! `measure kills`: kills processes of short flights with SIGKILL, any process at any moment.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | victims and moments, a function of the seed and the flight's number |
//! | [`one_flight`] | one `trefoil fly` through its kills |
//! | [`logged`] | traces of the kills in the log, and its holes |
//! | [`judge`] | the rules for a flight after its kills |
//!
//! Every flight is the survey of `trefoil fly` without a file, 3 s in real time, started by the command. Two flights
//! run at once. Each has a namespace that later flights use again, so that every start follows a kill.

pub mod judge;
pub mod logged;
pub mod one_flight;
pub mod plan;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{bail, ensure};
use flight::interrupts::catch_interrupts;
use flight::stack::StartError;
use outcome::percentiles::median;
use serde::Serialize;

use self::judge::{GONE_MS, NEAR_M, complaint};
use self::logged::Kill;
use self::one_flight::KillFlight;
use self::plan::{Moment, Victim};
use crate::findings::Findings;
use crate::flights::namespace;
use outcome::target::Target;
use view::table::{Table, cell};

/// Number of flights at once.
const LANES: usize = 2;
/// Largest number of failed flights that are listed by number.
const LISTED: usize = 5;
const HEADINGS: [&str; 13] = [
    "victim",
    "kills",
    "flights",
    "exit 0",
    "exit 3",
    "other",
    "error",
    "successor",
    "max",
    "lost",
    "gone",
    "max",
    "left",
];

#[derive(clap::Args)]
pub struct KillsArgs {
    /// Number of processes to kill
    #[arg(long, default_value_t = 1000)]
    pub kills: usize,
    /// Seed of the victims and moments
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
    /// Flights, sorted by number.
    pub rows: Vec<KillFlight>,
    pub wall_s: f64,
}

/// Returns the exit code.
pub fn measure(args: &KillsArgs) -> anyhow::Result<u8> {
    ensure!(args.kills > 0, "--kills {}: nothing to measure; ask for one or more", args.kills);
    let interrupts = catch_interrupts()?;
    let results = KillResults::measure(args.kills, args.seed, &interrupts)?;
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(args.out.as_deref(), "measure.json", args.json, &text(&results))
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

fn text(results: &KillResults) -> String {
    let at = |moment| results.kills().filter(|kill| kill.moment == moment).count();
    let title = format!(
        "{} kills in {} flights, {:.0} s: {} at start-up, {} within the first ticks, {} of candidates; {} given up\n\
         exit codes and worst error [m] are of the flights with such a kill; successor: until its first message [ms];\n\
         lost: messages that the logs of flights that went on lack;\n\
         gone: until the last process of a dead launcher has ended [ms]\n",
        results.kills().count(),
        results.rows.len(),
        results.wall_s,
        at(Moment::Starting),
        at(Moment::FirstTicks),
        at(Moment::Candidate),
        results.rows.iter().map(|row| row.given_up.len()).sum::<usize>(),
    );
    Table::new(&title, &HEADINGS, Victim::ALL.map(|victim| cells(results, victim)).into()).text()
}

fn cells(results: &KillResults, victim: Victim) -> Vec<String> {
    let has_kill = |row: &&KillFlight| row.kills.iter().any(|kill| kill.victim == victim);
    let flights: Vec<&KillFlight> = results.rows.iter().filter(has_kill).collect();
    let coded = |code| flights.iter().filter(|row| row.code == Some(code)).count();
    let kills = || results.kills().filter(|kill| kill.victim == victim);
    let successors = || kills().filter_map(|kill| kill.successor_ms);
    let gone = || flights.iter().filter(|_| victim == Victim::Launcher).filter_map(|row| row.gone_ms);
    let counts = [kills().count(), flights.len(), coded(0), coded(3), flights.len() - coded(0) - coded(3)];
    let times = [median(successors()), most(successors()), median(gone()), most(gone())];
    let mut cells = vec![victim.name()];
    cells.extend(counts.map(|count| count.to_string()));
    cells.push(cell(farthest(flights.iter().copied()), 3));
    let [successor, longest, gone, last] = times.map(|ms| cell(ms, 1));
    let lost: u64 = flights.iter().filter(|row| row.code == Some(0)).map(|row| row.dropped).sum();
    cells.extend([successor, longest, lost.to_string(), gone, last]);
    cells.push(flights.iter().map(|row| row.left.len()).sum::<usize>().to_string());
    cells
}

fn targets(results: &KillResults) -> Vec<Target> {
    let rows = &results.rows;
    let kills = results.kills().count();
    let wrong: Vec<String> =
        rows.iter().filter_map(|row| Some(format!("flight {}: {}", row.flight, complaint(row)?))).collect();
    let left = rows.iter().map(|row| row.left.len()).sum::<usize>();
    let successor_ms = median(results.kills().filter_map(|kill| kill.successor_ms));
    let went_on = rows.iter().filter(|row| row.code == Some(0));
    let lost: u64 = went_on.map(|row| row.dropped + row.holes as u64).sum();
    let gone = || rows.iter().filter_map(|row| row.gone_ms);
    vec![
        Target::none(format!("flights of {} that did not go as they must", rows.len()), wrong.len())
            .noting(wrong[..wrong.len().min(LISTED)].join("; ")),
        Target::none(format!("left in memory or running after {kills} kills"), left),
        Target::at_most("farthest from the trajectory, flights that went on", farthest(rows), NEAR_M, "m"),
        Target::at_most("killed, until its successor's first message, median", successor_ms, 150.0, "ms"),
        Target::none("messages and spans missing in the logs of flights that went on", lost as usize),
        Target::at_most("launcher killed, until its last process is gone, median", median(gone()), GONE_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, max", most(gone()), GONE_MS, "ms"),
    ]
}

fn most(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// Returns the largest error of the flights that flew to their end.
fn farthest<'a>(rows: impl IntoIterator<Item = &'a KillFlight>) -> Option<f64> {
    most(rows.into_iter().filter(|row| row.code == Some(0)).filter_map(|row| row.position_error_m))
}
