//! `measure replay`: flies flights in real time and replays each bit for bit from its log.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | kinds of flights, and orders given in flight |
//! | [`one_flight`] | one flight through processes, and its replay |
//!
//! Every flight is the survey of `trefoil fly` without a file, started by the command. One flight runs at a time.

pub mod one_flight;
pub mod plan;

use std::path::PathBuf;
use std::time::Instant;

use anyhow::ensure;
use flight::duration::seconds;
use flight::interrupts::catch_interrupts;
use outcome::percentiles::median;
use serde::Serialize;
use view::table::Table;

use self::one_flight::ReplayFlight;
use self::plan::Kind;
use crate::findings::Findings;
use outcome::target::Target;

/// Largest number of differing flights that are listed.
const LISTED: usize = 5;
/// Duration of flight that the target is for \[s\].
const MINUTE_S: f64 = 60.0;
const HEADINGS: [&str; 12] = [
    "",
    "flight",
    "exit",
    "flown [s]",
    "messages",
    "misses",
    "faults",
    "deaths",
    "swaps",
    "read [s]",
    "replay [s]",
    "replay",
];

#[derive(clap::Args)]
pub struct ReplayArgs {
    /// Number of flights: of 20, 5 are disturbed by kills, a swap and live faults, 3 fly under stress-ng, 2 at 500 Hz
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(1..=1000))]
    pub flights: u16,
    /// Duration of each flight
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = seconds)]
    pub seconds: f64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as measure.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Debug, Serialize)]
pub struct ReplayResults {
    /// Flights, sorted by number.
    pub rows: Vec<ReplayFlight>,
    /// Number of flights not flown, because `stress-ng` is not installed.
    pub without_stress: usize,
    pub wall_s: f64,
}

/// Returns the exit code.
pub fn measure(args: &ReplayArgs) -> anyhow::Result<u8> {
    let (flights, duration_s) = (usize::from(args.flights), args.seconds);
    ensure!((1.0..=3600.0).contains(&duration_s), "--seconds {duration_s}: a flight takes 1s to 1h");
    let interrupts = catch_interrupts()?;
    let started = Instant::now();
    let (mut rows, mut without_stress) = (vec![], 0);
    for number in 0..flights {
        match ReplayFlight::fly(number, duration_s, &interrupts)? {
            Some(row) => rows.push(row),
            None => without_stress += 1,
        }
    }
    let results = ReplayResults { rows, without_stress, wall_s: started.elapsed().as_secs_f64() };
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(args.out.as_deref(), "measure.json", args.json, &text(&results))
}

impl ReplayResults {
    fn of(&self, kind: Kind) -> impl Iterator<Item = &ReplayFlight> {
        self.rows.iter().filter(move |row| row.kind == kind)
    }
}

fn text(results: &ReplayResults) -> String {
    let cells = |row: &ReplayFlight| {
        let ReplayFlight { flight, code, flown_s, messages, misses, faults, deaths, swaps, read_s, replay_s, .. } = row;
        vec![
            flight.to_string(),
            row.kind.words().into(),
            code.to_string(),
            format!("{flown_s:.2}"),
            messages.to_string(),
            misses.to_string(),
            faults.to_string(),
            deaths.to_string(),
            swaps.to_string(),
            format!("{read_s:.2}"),
            format!("{replay_s:.2}"),
            row.differs.clone().unwrap_or_else(|| "equal".into()),
        ]
    };
    let title = format!("{} flights in real time and their replays, {:.0} s\n", results.rows.len(), results.wall_s);
    Table::new(&title, &HEADINGS, results.rows.iter().map(cells).collect()).text()
}

fn targets(results: &ReplayResults) -> Vec<Target> {
    let rows = &results.rows;
    let differs: Vec<String> =
        rows.iter().filter_map(|row| Some(format!("flight {}: {}", row.flight, row.differs.as_ref()?))).collect();
    let minute_s = median(rows.iter().map(ReplayFlight::minute_s));
    let minute = Target::at_most("flown again, a minute of flight, median", minute_s, 1.0, "s");
    let whole = rows.iter().all(|row| row.flown_s >= MINUTE_S);
    let disturbed = results.of(Kind::Disturbed).filter(|row| row.deaths > 0 && row.swaps > 0 && row.faults > 0).count();
    let missed = results.of(Kind::Loaded).filter(|row| row.misses > 0).count();
    let mut targets = vec![
        Target::none(format!("flights of {} whose replay differs", rows.len()), differs.len())
            .noting(differs[..differs.len().min(LISTED)].join("; ")),
        if whole { minute } else { minute.in_doubt("flights of less than a minute") },
        Target::at_least(
            "disturbed flights with a death, a swap kept and live faults",
            Some(disturbed as f64),
            results.of(Kind::Disturbed).count() as f64,
        )
        .in_doubt("the machine delayed what was ordered"),
    ];
    let figure = "flights under stress-ng --cpu 4 with misses";
    let loaded = results.of(Kind::Loaded).count();
    if results.without_stress > 0 {
        targets
            .push(Target::at_least(figure, None, results.without_stress as f64).noting("stress-ng is not installed"));
    } else if loaded > 0 {
        let target = Target::at_least(figure, Some(missed as f64), loaded as f64);
        targets.push(target.in_doubt("the machine kept up under the load"));
    }
    targets
}
