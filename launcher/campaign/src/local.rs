//! Flies shards on all cores of this machine. A free core takes the next flight in order, and a shard is written after
//! its last flight. So no core waits for a shard to end, an interrupt loses only the shards begun, and the memory use
//! does not grow with the campaign.

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
use crate::table::{Cell, FlightTable};

/// Progress of a campaign.
#[derive(Debug, Clone, Copy)]
pub struct Progress {
    /// Flights flown so far by this call of [`fly`].
    pub flown: u64,
    /// Flights that this call of [`fly`] has to fly.
    pub all: u64,
    /// Word for what is flown: flights, or searches of several flights.
    units: &'static str,
    pub failed: u64,
    pub invalid: u64,
    started: Instant,
}

impl Progress {
    /// Returns the progress in one line, with the time left.
    pub fn describe(&self) -> String {
        let Self { flown, all, units, failed, invalid, started } = self;
        let per_s = *flown as f64 / started.elapsed().as_secs_f64().max(1e-9);
        let left_s = (all - flown) as f64 / per_s.max(1e-9);
        let invalid = if *invalid > 0 { format!(", {invalid} invalid") } else { String::new() };
        format!(
            "{flown} of {all} {units}   {per_s:.0} per second   {} left   {failed} failed{invalid}",
            duration(left_s)
        )
    }
}

/// Formats a time in seconds, minutes or hours.
fn duration(time_s: f64) -> String {
    match time_s {
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 6000.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

/// Flies all flights of a small plan on all cores, without a folder.
#[cfg(test)]
pub fn fly_all(plan: &Plan) -> FlightTable {
    let row = |number| row::of(plan, number, || true).map_or(vec![], |row| row.cells);
    let rows: Vec<_> = rayon::iter::IntoParallelIterator::into_par_iter(0..plan.flights()).map(row).collect();
    let mut table = FlightTable::new(&shard::columns_of(plan));
    for row in rows {
        table.push(row);
    }
    table
}

/// Flies `shards`, and writes each when it is complete. Returns `false` if `interrupts` ended the call before the last
/// flight. Calls `show` after each flight with the progress and the flight's row.
///
/// # Errors
/// A shard cannot be written; those already written stay.
pub fn fly(
    plan: &Plan,
    folder: &CampaignFolder,
    shards: &[u64],
    interrupts: &AtomicU32,
    mut show: impl FnMut(&Progress, &[Cell]),
) -> anyhow::Result<bool> {
    let range = |shard: u64| shard::range(folder.layout.flights, shard, folder.layout.shards);
    let all = shards.iter().map(|shard| range(*shard)).map(|range| range.end - range.start).sum();
    let mut progress =
        Progress { flown: 0, all, units: plan.campaign.units(), failed: 0, invalid: 0, started: Instant::now() };
    let columns = shard::columns_of(plan);
    let is_over = AtomicU32::new(0);
    let go_on = || interrupts.load(Ordering::Relaxed) + is_over.load(Ordering::Relaxed) == 0;
    let flights = shards.iter().flat_map(|shard| range(*shard).map(|number| (*shard, number)));
    let (done, rows) = sync_channel(4 * rayon::current_num_threads());
    thread::scope(|scope| {
        scope.spawn(|| {
            let one = |(shard, number): (u64, u64)| {
                let row = go_on().then(|| row::of(plan, number, go_on))??;
                Some((shard, number, row.standing, row.cells))
            };
            // Shards are flown in order, because `par_bridge` gives the next flight to the next free core.
            flights.par_bridge().filter_map(one).for_each_with(done, |done, row| {
                let _ = done.send(row); // fails only after the receiver returned an error
            });
        });
        // Rows of the shards that are not yet complete, by shard and number.
        let mut gathering: BTreeMap<u64, BTreeMap<u64, Vec<Cell>>> = BTreeMap::new();
        for (shard, number, standing, row) in rows {
            progress.flown += 1;
            progress.failed += u64::from(standing == Standing::Failed);
            progress.invalid += u64::from(standing == Standing::Invalid);
            show(&progress, &row);
            let open = gathering.entry(shard).or_default();
            open.insert(number, row);
            if range(shard).end - range(shard).start == open.len() as u64 {
                let mut table = FlightTable::new(&columns);
                for row in gathering.remove(&shard).unwrap_or_default().into_values() {
                    table.push(row);
                }
                if let Err(error) = folder.write(shard, &table) {
                    is_over.store(1, Ordering::Relaxed);
                    return Err(error);
                }
            }
        }
        Ok(progress.flown == progress.all)
    })
}
