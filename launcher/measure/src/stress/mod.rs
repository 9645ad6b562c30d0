//! `measure stress`: flies in real time through kills, swaps, live faults and load, judges each flight, and flies it
//! again from its log, bit for bit.
//!
//! | module | holds |
//! |---|---|
//! | [`plan`] | victims and moments of the kills of a short flight, a function of the seed and the flight's number |
//! | [`orders`] | kinds of long flights, and orders given to them |
//! | [`candidates`] | flights with many swaps |
//! | [`one_flight`] | one `trefoil fly` through kills, swaps, faults or load, and its replay |
//! | [`logged`] | traces of the kills in the log, and its holes |
//! | [`judge`] | the rules for a flight after its kills |
//!
//! Every flight is the survey of `trefoil fly` without a file, except that wrong candidates fly the hover in gusts. Two
//! short flights of 3 s run at once, each in a namespace that later flights use again, so that every start follows a
//! kill. Long flights run one at a time.

pub mod candidates;
pub mod judge;
pub mod logged;
pub mod one_flight;
pub mod orders;
pub mod plan;

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU32, AtomicU64, AtomicUsize, Ordering};
use std::time::Instant;

use anyhow::{bail, ensure};
use flight::duration::seconds;
use flight::interrupts::catch_interrupts;
use flight::stack::StartError;
use outcome::percentiles::median;
use outcome::target::Target;
use serde::Serialize;
use view::table::{Table, cell};

use self::candidates::GOOD;
use self::judge::{GONE_MS, NEAR_M, complaint};
use self::logged::Kill;
use self::one_flight::{Again, StressFlight};
use self::orders::Conditions;
use self::plan::{Moment, Victim};
use crate::faults::one_flight::TILT_DEG;
use crate::findings::Findings;
use crate::flights::namespace;

/// Number of short flights that run at once.
const LANES: usize = 2;
/// Largest number of failed flights that are listed by number.
const LISTED: usize = 5;
/// Duration of flight for which the target limits the time of the replay \[s\].
const MINUTE_S: f64 = 60.0;
/// Largest distance from the trajectory with good candidates \[m\].
const SWAP_M: f64 = 0.1;
const VICTIMS: [&str; 13] = [
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
const KINDS: [&str; 10] =
    ["", "flights", "exit 0", "flown [s]", "messages", "misses", "faults", "deaths", "swaps", "flown again, equal"];

#[derive(clap::Args)]
pub struct StressArgs {
    /// Number of processes to kill in short flights; 0 = none
    #[arg(long, default_value_t = 1000)]
    pub kills: usize,
    /// Long flights: of 20, 5 disturbed by kills, a swap and faults, 3 under stress-ng, 2 at 500 Hz, 2 with candidates
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u16).range(0..=1000))]
    pub replays: u16,
    /// Duration of each long flight but those with candidates
    #[arg(long, value_name = "TIME", default_value = "60s", value_parser = seconds)]
    pub seconds: f64,
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

#[derive(Debug, Default, Serialize)]
pub struct StressResults {
    /// Short flights, then long ones, each sorted by number.
    pub rows: Vec<StressFlight>,
    /// Number of flights not flown, because `stress-ng` is not installed.
    pub without_stress: usize,
    pub wall_s: f64,
}

/// Runs the measurement and returns the exit code.
pub fn measure(args: &StressArgs) -> anyhow::Result<u8> {
    let StressArgs { kills, replays, seconds, seed, .. } = *args;
    ensure!(kills > 0 || replays > 0, "--kills 0 and --replays 0: nothing to measure; ask for one or more");
    ensure!((1.0..=3600.0).contains(&seconds), "--seconds {seconds}: a flight takes 1s to 1h");
    let interrupts = catch_interrupts()?;
    let started = Instant::now();
    let mut results = StressResults { rows: fly_short(kills, seed, &interrupts)?, ..StressResults::default() };
    for number in 0..u64::from(replays) {
        match StressFlight::long(number, seconds, &interrupts)? {
            Some(row) => results.rows.push(row),
            None => results.without_stress += 1,
        }
    }
    results.wall_s = started.elapsed().as_secs_f64();
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(args.out.as_deref(), "measure.json", args.json, &text(&results))
}

/// Flies short flights until `kills` processes were killed.
fn fly_short(kills: usize, seed: u64, interrupts: &AtomicU32) -> anyhow::Result<Vec<StressFlight>> {
    let (next, killed, rows) = (AtomicU64::new(1), AtomicUsize::new(0), Mutex::new(vec![]));
    let lane = || -> anyhow::Result<()> {
        let namespace = namespace();
        while killed.load(Ordering::Relaxed) < kills {
            let number = next.fetch_add(1, Ordering::Relaxed);
            let row = StressFlight::short(number, &plan::plan(seed, number), &namespace)?;
            if interrupts.load(Ordering::Relaxed) > 0 {
                bail!(StartError::Interrupted);
            }
            killed.fetch_add(row.kills.len(), Ordering::Relaxed);
            rows.lock().expect("no thread panics with it").push(row);
        }
        Ok(())
    };
    std::thread::scope(|scope| {
        let lanes: Vec<_> = (0..LANES).map(|_| scope.spawn(lane)).collect();
        lanes.into_iter().try_for_each(|lane| lane.join().expect("a lane does not panic"))
    })?;
    let mut rows = rows.into_inner().expect("no thread panics with it");
    rows.sort_by_key(|row: &StressFlight| row.flight);
    Ok(rows)
}

impl StressResults {
    fn of(&self, kind: Conditions) -> impl Iterator<Item = &StressFlight> {
        self.rows.iter().filter(move |row| row.kind == kind)
    }

    fn kills(&self) -> impl Iterator<Item = &Kill> {
        self.rows.iter().flat_map(|row| &row.kills)
    }

    /// Flights that were flown again, each with its replay.
    fn again(&self) -> impl Iterator<Item = (&StressFlight, &Again)> {
        self.rows.iter().filter_map(|row| Some((row, row.again.as_ref()?)))
    }
}

fn text(results: &StressResults) -> String {
    let kinds = Conditions::ALL.into_iter().filter(|kind| results.of(*kind).next().is_some());
    let title = format!("{} flights in real time and their replays, {:.0} s", results.rows.len(), results.wall_s);
    let mut text = Table::new(&title, &KINDS, kinds.map(|kind| of_kind(results, kind)).collect()).text();
    if results.of(Conditions::Killed).next().is_some() {
        let at = |moment| results.kills().filter(|kill| kill.moment == moment).count();
        let title = format!(
            "\n{} kills: {} at start-up, {} within the first ticks, {} of candidates; {} given up\n\
             exit codes and worst error [m] are of the flights with such a kill; successor: until its first message \
             [ms];\nlost: messages that the logs of flights that went on lack;\n\
             gone: until the last process of a dead launcher has ended [ms]",
            results.kills().count(),
            at(Moment::Starting),
            at(Moment::FirstTicks),
            at(Moment::Candidate),
            results.rows.iter().map(|row| row.given_up.len()).sum::<usize>(),
        );
        text += &Table::new(&title, &VICTIMS, Victim::ALL.map(|victim| of_victim(results, victim)).into()).text();
    }
    text
}

fn of_kind(results: &StressResults, kind: Conditions) -> Vec<String> {
    let again = || results.of(kind).filter_map(|row| row.again.as_ref());
    let sum = |of: fn(&Again) -> u64| again().map(of).sum::<u64>().to_string();
    let flown_s: f64 = results.of(kind).filter_map(|row| row.flown_s).sum();
    vec![
        kind.words().into(),
        results.of(kind).count().to_string(),
        results.of(kind).filter(|row| row.code == Some(0)).count().to_string(),
        format!("{flown_s:.0}"),
        sum(|again| again.messages),
        sum(|again| again.misses),
        sum(|again| again.faults as u64),
        sum(|again| again.deaths as u64),
        sum(|again| again.kept.len() as u64),
        format!("{} of {}", again().filter(|again| again.differs.is_none()).count(), again().count()),
    ]
}

fn of_victim(results: &StressResults, victim: Victim) -> Vec<String> {
    let has_kill = |row: &&StressFlight| row.kills.iter().any(|kill| kill.victim == victim);
    let flights: Vec<&StressFlight> = results.rows.iter().filter(has_kill).collect();
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

fn targets(results: &StressResults) -> Vec<Target> {
    let mut targets = vec![];
    if results.of(Conditions::Killed).next().is_some() {
        targets.extend(of_kills(results));
    }
    let wrong: Vec<String> = results.rows.iter().filter_map(|row| Some(named(row, &complaint(row)?))).collect();
    targets.push(
        Target::none(format!("flights of {} that did not go as they must", results.rows.len()), wrong.len())
            .noting(some_of(&wrong)),
    );
    let left = results.rows.iter().map(|row| row.left.len()).sum::<usize>();
    targets.push(Target::none(format!("left in memory or running after {} flights", results.rows.len()), left));
    let differs: Vec<String> =
        results.again().filter_map(|(row, again)| Some(named(row, again.differs.as_ref()?))).collect();
    targets.push(
        Target::none(format!("flights of {} whose replay differs", results.again().count()), differs.len())
            .noting(some_of(&differs)),
    );
    let minutes = || results.again().filter(|(_, again)| again.flown_s >= MINUTE_S);
    let minute_s = median(minutes().map(|(_, again)| again.replay_s * MINUTE_S / again.flown_s));
    if results.rows.iter().any(|row| row.kind != Conditions::Killed) {
        let minute = Target::at_most("flown again, a minute of flight, median", minute_s, 1.0, "s");
        targets.push(if minute_s.is_some() { minute } else { minute.noting("flights of less than a minute") });
    }
    targets.extend(results.of(Conditions::Good).chain(results.of(Conditions::Wrong)).flat_map(of_candidates));
    let count = |kind, is_it: fn(&Again) -> bool| {
        results.of(kind).filter(|row| row.again.as_ref().is_some_and(is_it)).count() as f64
    };
    let of_all = |figure, kind, is_it| {
        let all = results.of(kind).count() as f64;
        (all > 0.0).then(|| Target::at_least(figure, Some(count(kind, is_it)), all))
    };
    let figure = "disturbed flights with a death, a swap kept and live faults";
    let disturbed =
        of_all(figure, Conditions::Disturbed, |again| again.deaths > 0 && !again.kept.is_empty() && again.faults > 0);
    targets.extend(disturbed.map(|target| target.in_doubt("the machine delayed what was ordered")));
    let figure = "flights under stress-ng --cpu 4 with misses";
    if results.without_stress > 0 {
        let wanted = results.without_stress as f64;
        targets.push(Target::at_least(figure, None, wanted).noting("stress-ng is not installed"));
    }
    let loaded = of_all(figure, Conditions::Loaded, |again| again.misses > 0);
    targets.extend(loaded.map(|target| target.in_doubt("the machine kept up under the load")));
    targets
}

/// Returns the targets of a flight with candidates, whose lateness on a busy host is inconclusive.
fn of_candidates(row: &StressFlight) -> Vec<Target> {
    let kept = row.again.as_ref().map_or(&[][..], |again| &again.kept);
    let figure = |what| format!("{}: {what}", row.kind.words());
    let judged = |target: Target| match &row.doubt {
        Some(why) => target.in_doubt(why),
        None => target,
    };
    let more = match row.explained_ticks {
        0 => String::new(),
        more => format!("the canary explains {more} more"),
    };
    match row.kind {
        Conditions::Good => vec![
            judged(Target::none(figure("not kept, of 60"), GOOD - kept.len())),
            judged(Target::none(figure("ticks lost"), row.lost_ticks).noting(more)),
            Target::at_most(figure("error"), row.position_error_m, SWAP_M, "m"),
        ],
        _ => vec![
            judged(Target::none(figure("kept, of 30"), kept.len()).noting(some_of(kept))),
            Target::at_most(figure("worst tilt"), Some(row.tilt_deg), TILT_DEG, "deg"),
        ],
    }
}

fn of_kills(results: &StressResults) -> [Target; 6] {
    let rows = || results.of(Conditions::Killed);
    let noticed_ms = median(results.kills().filter_map(|kill| kill.noticed_ms));
    let successor_ms = median(results.kills().filter_map(|kill| kill.successor_ms));
    let went_on = rows().filter(|row| row.code == Some(0));
    let lost: u64 = went_on.map(|row| row.dropped + row.holes as u64).sum();
    let gone = || rows().filter_map(|row| row.gone_ms);
    [
        Target::at_most("farthest from the trajectory, flights that went on", farthest(rows()), NEAR_M, "m"),
        Target::at_most("killed, until that is noticed, median", noticed_ms, 5.0, "ms"),
        Target::at_most("killed, until its successor's first message, median", successor_ms, 150.0, "ms"),
        Target::none("messages and spans missing in the logs of flights that went on", lost as usize),
        Target::at_most("launcher killed, until its last process is gone, median", median(gone()), GONE_MS, "ms"),
        Target::at_most("launcher killed, until its last process is gone, max", most(gone()), GONE_MS, "ms"),
    ]
}

/// Names a flight in a note, with its kind, because short and long flights are numbered separately.
fn named(row: &StressFlight, what: &str) -> String {
    format!("flight {} ({}): {what}", row.flight, row.kind.words())
}

fn some_of(all: &[String]) -> String {
    all[..all.len().min(LISTED)].join("; ")
}

fn most(values: impl Iterator<Item = f64>) -> Option<f64> {
    values.reduce(f64::max)
}

/// Returns the largest position error of the flights that ended with exit code 0 \[m\].
fn farthest<'a>(rows: impl IntoIterator<Item = &'a StressFlight>) -> Option<f64> {
    most(rows.into_iter().filter(|row| row.code == Some(0)).filter_map(|row| row.position_error_m))
}
