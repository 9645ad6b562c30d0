//! A shard: consecutive flights in one file, which is either complete or absent.
//!
//! The file names its program, campaign, index and number of shards. A file in which one of these differs is refused,
//! so that each flight counts once.

use std::cell::Cell as Flag;
use std::ops::Range;
use std::panic::{UnwindSafe, catch_unwind, set_hook, take_hook};
use std::path::Path;
use std::sync::{Once, OnceLock};

use anyhow::{Context, anyhow, bail, ensure};
use flight::programs::sha256_of;
use flight::provenance::BUILT_FROM;
use folder::dir::Dir;
use settings::file::MAX_RESULTS_BYTES;

use crate::layout::CampaignLayout;
use crate::plan::Plan;
use crate::table::{Cell, ColumnType, FlightTable};
use crate::{columns, limit};

/// Numbers of the flights of shard `index` of `of`, for a campaign of `flights` flights.
pub fn range(flights: u64, index: u64, of: u64) -> Range<u64> {
    let at = |i: u64| (u128::from(flights) * u128::from(i) / u128::from(of)) as u64;
    at(index)..at(index + 1)
}

/// Identifies the program, because results of different programs are not mixed. If it was built from no commit or from
/// changed sources, the hash of its bytes is included.
pub fn program() -> &'static str {
    static PROGRAM: OnceLock<String> = OnceLock::new();
    PROGRAM.get_or_init(|| {
        let built = match BUILT_FROM.get() {
            Some(built) if !built.changed => built.commit.clone(),
            Some(built) => format!("{}, changed, {}", built.commit, own_digest()),
            None => own_digest(),
        };
        format!("{} {built}", env!("CARGO_PKG_VERSION"))
    })
}

/// Start of the SHA-256 of the running executable.
fn own_digest() -> String {
    sha256_of(Path::new("/proc/self/exe")).map_or("unknown".into(), |digest| format!("sha256 {}", &digest[..16]))
}

/// File name of a shard.
pub fn name(index: u64) -> String {
    format!("{index:05}.parquet")
}

/// Columns of all tables of a campaign.
pub fn columns_of(plan: &Plan) -> Vec<(String, ColumnType)> {
    let of_a_search = plan.campaign.limit().map(|_| limit::columns());
    [plan.columns(), of_a_search.unwrap_or_default(), columns::of_the_outcome()].concat()
}

/// Metadata that the file of a shard must have.
fn words(layout: &CampaignLayout, index: u64) -> [(&'static str, String); 4] {
    let CampaignLayout { program, campaign, shards, .. } = layout;
    [
        ("program", program.clone()),
        ("campaign", campaign.clone()),
        ("index", index.to_string()),
        ("of", shards.to_string()),
    ]
}

/// Writes the rows of a shard, completely or not at all.
pub fn write(shards: &Dir, layout: &CampaignLayout, index: u64, rows: &FlightTable) -> anyhow::Result<()> {
    shards.write_whole(name(index), &rows.to_parquet(&words(layout, index))?)
}

/// Reads the rows of shard `index`.
///
/// # Errors
/// The file does not hold each of its flights once; the message says what to do.
pub fn read(shards: &Dir, plan: &Plan, layout: &CampaignLayout, index: u64) -> anyhow::Result<FlightTable> {
    let again = "remove the file, and the same command flies its flights again";
    let read = || -> anyhow::Result<FlightTable> {
        let bytes = shards.read(name(index), MAX_RESULTS_BYTES)?;
        let flights = range(layout.flights, index, layout.shards);
        let read = quietly(|| FlightTable::from_parquet(bytes, flights.end - flights.start));
        let (table, said) = read.context("it is damaged")?;
        for (key, expected) in words(layout, index) {
            let Some((_, said)) = said.iter().find(|(of, _)| of == key) else { bail!("it does not say its {key}") };
            ensure!(*said == expected, "it is of another {key}: {said}, not {expected}");
        }
        let expected = columns_of(plan);
        ensure!(table.names().eq(expected.iter().map(|(name, _)| name.as_str())), "it has other columns");
        let numbers = table.column("flight").context("it does not say which flights it has")?;
        let all = (0..table.rows()).map(|row| numbers.cell(row)).eq(flights.clone().map(|n| Cell::Int(n as i64)));
        ensure!(all, "it does not have the flights {} to {}", flights.start, flights.end.saturating_sub(1));
        Ok(table)
    };
    read().with_context(|| format!("shard {index} ({}) is not counted; {again}", shards.at(name(index)).display()))
}

/// Calls `read`. Parquet's readers may panic on a damaged file; that panic becomes an error and is not printed.
fn quietly<T>(read: impl FnOnce() -> anyhow::Result<T> + UnwindSafe) -> anyhow::Result<T> {
    thread_local!(static READS: Flag<bool> = const { Flag::new(false) });
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let usual = take_hook();
        set_hook(Box::new(move |panic| {
            if !READS.get() {
                usual(panic);
            }
        }));
    });
    READS.set(true);
    let found = catch_unwind(read);
    READS.set(false);
    found.unwrap_or_else(|_| Err(anyhow!("it is no Parquet file")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shards_have_every_flight_once() {
        for (flights, of) in [(10, 3), (7, 7), (1, 1), (10_000_000, 999), (5, 4)] {
            let all: Vec<Range<u64>> = (0..of).map(|index| range(flights, index, of)).collect();
            assert_eq!((all[0].start, all[all.len() - 1].end), (0, flights));
            assert!(all.windows(2).all(|two| two[0].end == two[1].start));
            assert!(all.iter().all(|range| !range.is_empty() && range.end - range.start <= flights.div_ceil(of)));
        }
    }
}
