//! All cores of this machine: flights are taken in order by whichever core is free, and a shard is written when its last
//! flight is there. So a campaign ends without waiting, an end before its time costs the shards begun, and the memory it takes
//! does not grow.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Instant;

use rayon::iter::{ParallelBridge, ParallelIterator};

use crate::folder::CampaignFolder;
use crate::plan::Plan;
use crate::row::{self, Standing};
use crate::shard;
use crate::table::{Cell, Table};

/// How far a campaign is.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Flights flown now.
    pub flown: u64,
    /// Flights to fly now.
    pub all: u64,
    pub failed: u64,
    pub invalid: u64,
    started: Instant,
}

impl Progress {
    /// In one line, with the time left.
    pub fn describe(&self) -> String {
        let Self { flown, all, failed, invalid, started } = self;
        let per_s = *flown as f64 / started.elapsed().as_secs_f64().max(1e-9);
        let left_s = (all - flown) as f64 / per_s.max(1e-9);
        let invalid = if *invalid > 0 { format!(", {invalid} invalid") } else { String::new() };
        format!(
            "{flown} of {all} flights   {per_s:.0} per second   {} left   {failed} failed{invalid}",
            duration(left_s)
        )
    }
}

/// A time as people say it.
fn duration(time_s: f64) -> String {
    match time_s {
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// The rows of one shard while they come.
struct Gathering {
    rows: Vec<Option<Vec<Cell>>>,
    absent: usize,
}

/// Flies `shards`, and writes each when it is complete; false when `interrupts` ended it before all were. `show` is told after
/// each flight.
///
/// # Errors
/// A shard that cannot be written; those that were written stay.
pub fn fly(
    plan: &Plan,
    folder: &CampaignFolder,
    shards: &[u64],
    interrupts: &AtomicU32,
    mut show: impl FnMut(&Progress),
) -> anyhow::Result<bool> {
    let range = |shard: u64| shard::range(folder.layout.flights, shard, folder.layout.shards);
    let all = shards.iter().map(|shard| range(*shard)).map(|range| range.end - range.start).sum();
    let mut progress = Progress { flown: 0, all, failed: 0, invalid: 0, started: Instant::now() };
    let columns = shard::columns(plan);
    let is_over = AtomicU32::new(0);
    let go_on = || interrupts.load(Ordering::Relaxed) + is_over.load(Ordering::Relaxed) == 0;
    let flights = shards.iter().flat_map(|shard| range(*shard).map(|number| (*shard, number)));
    let (done, rows) = sync_channel(4 * rayon::current_num_threads());
    thread::scope(|scope| {
        scope.spawn(|| {
            let one = |(shard, number): (u64, u64)| {
                let flight = go_on().then(|| plan.flight(number))?;
                let outcome = row::fly(&flight, go_on, |_| {})?;
                let row = [plan.cells(&flight), outcome.cells].concat();
                Some((shard, number, outcome.standing, row))
            };
            // In order: of a bridge the next free core takes the next one.
            flights.par_bridge().filter_map(one).for_each_with(done, |done, row| {
                let _ = done.send(row); // the other side has failed
            });
        });
        let mut gathering: BTreeMap<u64, Gathering> = BTreeMap::new();
        for (shard, number, verdict, row) in rows {
            let numbers = range(shard);
            let length = (numbers.end - numbers.start) as usize;
            let open = gathering.entry(shard).or_insert_with(|| Gathering { rows: vec![None; length], absent: length });
            open.rows[(number - numbers.start) as usize] = Some(row);
            open.absent -= 1;
            if open.absent == 0 {
                let mut table = Table::new(&columns);
                let rows = gathering.remove(&shard).map_or(vec![], |open| open.rows);
                rows.into_iter().flatten().for_each(|row| table.push(row));
                if let Err(error) = folder.write(shard, &table) {
                    is_over.store(1, Ordering::Relaxed);
                    return Err(error);
                }
            }
            progress.flown += 1;
            progress.failed += u64::from(verdict == Standing::Failed);
            progress.invalid += u64::from(verdict == Standing::Invalid);
            show(&progress);
        }
        Ok(progress.flown == progress.all)
    })
}
