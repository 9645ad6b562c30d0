//! `measure faults`: flies every fault of the catalogue, and checks whether the flight recovers.
//!
//! | module | holds |
//! |---|---|
//! | [`case`] | the matrix of faults, and the rule for recoverable ones |
//! | [`one_flight`] | one flight through its fault, by processes and by one thread |
//! | [`handling`](mod@handling) | reaction of the supervision to a process fault, in lockstep and in real time |
//!
//! Every case is `scenarios/faults/hover-gusts.toml` with one fault of the default size from 5 s to 6 s. It is flown in
//! lockstep, by real processes that really die, and by one thread; both flights must be equal bit for bit. The profile
//! is the robust one, because the paper's does not survive the gusts, with or without a fault. The paper's profile is
//! flown with the faults of processes and topics in a calm hover. The campaign `brought-down.toml` has flights over
//! ground that cannot continue.

pub mod case;
pub mod handling;
pub mod one_flight;

use std::path::PathBuf;
use std::sync::atomic::AtomicU32;

use campaign::OwnController;
use flight::interrupts::catch_interrupts;
use outcome::percentiles::median;
use serde::Serialize;
use settings::Scenario;

use self::case::{FaultCase, FaultPromise, hover_of_the_paper};
use self::handling::{FaultHandling, Handling};
use self::one_flight::{BACK_M, FaultCourse, FaultFlight, QuietFlight, TERMINATE_S, TILT_DEG};
use crate::findings::Findings;
use crate::flights::hover_in_gusts;
use outcome::target::Target;
use view::table::{Table, cell};

/// Longest time until a hang is noticed: at the third sample without an answer \[ms\].
const HUNG_MS: f64 = 30.0;

#[derive(clap::Args)]
pub struct FaultsArgs {
    /// Fly the catalogue with this attitude controller too: a library or program of yours (repeatable)
    #[arg(long, value_name = "NAME=FILE")]
    pub controller: Vec<OwnController>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
    /// Folder to write the results to, as measure.json
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
}

#[derive(Serialize)]
pub struct FaultResults {
    pub rows: Vec<FaultFlight>,
    /// Flights with faults of processes and topics, with the profile paper, in calm.
    pub paper: Vec<FaultFlight>,
    /// Flights without a fault.
    pub quiet: Vec<QuietFlight>,
    /// Flights of the catalogue with the user's controllers, one entry for each controller.
    pub own: Vec<OwnRows>,
    /// Process faults in lockstep and in real time.
    pub handling: Vec<FaultHandling>,
}

/// Flights of the catalogue with one controller of the user, in the same gusts as ours. They change no verdict.
#[derive(Serialize)]
pub struct OwnRows {
    pub controller: String,
    pub rows: Vec<FaultFlight>,
}

/// Runs the measurement and returns the exit code.
pub fn measure(args: &FaultsArgs) -> anyhow::Result<u8> {
    let interrupts = catch_interrupts()?;
    let results = FaultResults::measure(args, &interrupts)?;
    let found = Findings::new(&results, targets(&results), false)?;
    found.conclude(args.out.as_deref(), "measure.json", args.json, &text(&results))
}

impl FaultResults {
    fn measure(args: &FaultsArgs, interrupts: &AtomicU32) -> anyhow::Result<Self> {
        let (base, calm) = (hover_in_gusts()?, hover_of_the_paper()?);
        let with_own = args.controller.iter().map(|own| Ok((own.name.clone(), case::with_controller(&base, own)?)));
        let with_own: Vec<(String, Scenario)> = with_own.collect::<anyhow::Result<_>>()?;
        let fly = |base: &Scenario, wanted: fn(&FaultCase) -> bool| -> anyhow::Result<Vec<FaultFlight>> {
            let cases = FaultCase::all().into_iter().filter(wanted);
            cases.map(|case| FaultFlight::fly(base, &case, interrupts)).collect()
        };
        let rows = fly(&base, |_| true)?;
        let own =
            with_own.into_iter().map(|(controller, base)| Ok(OwnRows { controller, rows: fly(&base, |_| true)? }));
        let own = own.collect::<anyhow::Result<_>>()?;
        let paper = fly(&calm, FaultCase::is_of_software)?;
        let handling = handling::compare(&base, interrupts)?;
        let quiet = [Scenario::default(), base].into_iter().map(|calm| QuietFlight::fly(calm, interrupts));
        Ok(Self { rows, own, paper, quiet: quiet.collect::<Result<_, _>>()?, handling })
    }
}

fn text(results: &FaultResults) -> String {
    let mut text = String::new();
    for (title, rows) in [("Robust profile, in gusts", &results.rows), ("Paper's profile, in calm", &results.paper)] {
        let units = "detected and recovered [s], worst roll or pitch [deg], worst and remaining position error [m]";
        text += &matrix(&format!("{title}: {units}"), rows).text();
        text.push('\n');
    }
    for OwnRows { controller, rows } in &results.own {
        text += &matrix(&format!("{controller}, in gusts: the same"), rows).text();
        text += &promises_of(controller, rows);
    }
    text + &handling(&results.handling).text()
}

/// States how many of the promises that hold for our controller a controller of the user keeps.
fn promises_of(controller: &str, rows: &[FaultFlight]) -> String {
    let promised = rows.iter().filter(|row| row.kept().is_some()).count();
    let broken: Vec<&FaultFlight> = rows.iter().filter(|row| row.kept() == Some(false)).collect();
    let which = if broken.is_empty() { String::new() } else { format!("; broken: {}", names(broken.iter().copied())) };
    let differ: Vec<&FaultFlight> = rows.iter().filter(|row| row.same == Some(false)).collect();
    let differ = match differ.len() {
        0 => String::new(),
        _ => format!("; not the same by one thread: {}", names(differ.iter().copied())),
    };
    let alone = match rows.iter().filter(|row| row.same.is_none()).count() {
        0 => String::new(),
        count => format!("; {count} not flown by one thread, where there are no programs"),
    };
    format!("{controller}: {} of {promised} promises kept{which}{differ}{alone}\n\n", promised - broken.len())
}

fn matrix(title: &str, rows: &[FaultFlight]) -> Table {
    let cells = |row: &FaultFlight| {
        let course = &row.course;
        vec![
            row.fault.clone(),
            cell(course.detected_after_s, 2),
            cell(course.recovered_after_s, 2),
            if course.tilt_deg > 90.0 { "> 90".into() } else { format!("{:.1}", course.tilt_deg) },
            format!("{:.2}", course.position_error_m),
            cell(course.back_m, 2),
            outcome(row),
        ]
    };
    let headings = ["fault", "detected", "recovered", "tilt", "error", "after 5 s", "outcome"];
    Table::new(title, &headings, rows.iter().map(cells).collect())
}

/// Describes the outcome of a flight, and the reason if nothing was promised.
fn outcome(row: &FaultFlight) -> String {
    let fate = if row.course.diverged { "diverged" } else { "flew on" };
    match (row.promise, row.kept()) {
        (FaultPromise::Recover, Some(true)) => "ok".into(),
        (FaultPromise::Recover, _) => format!("SHORT: {fate}"),
        (FaultPromise::Terminate, Some(true)) => {
            format!("terminated after {:.2} s", row.course.terminated_after_s.unwrap_or_default())
        }
        (FaultPromise::Terminate, _) => format!("SHORT: {fate}, not terminated"),
        (FaultPromise::NoPlant, _) => "ended: no plant".into(),
        (FaultPromise::NoActuator, _) => format!("{fate}: an actuator that does not obey"),
        (FaultPromise::Lie, _) => format!("{fate}: a sensor that is wrong"),
        (FaultPromise::Error, _) => format!("{fate}: a node that errs"),
        (FaultPromise::Late, _) => format!("{fate}: a sensor that is late"),
        (FaultPromise::Fall, _) => format!("{fate}: no thrust for a while"),
        (FaultPromise::Blind, _) => format!("{fate}: state unknown for {:.2} s", row.course.blind_s),
    }
}

fn handling(rows: &[FaultHandling]) -> Table {
    let both = |row: &FaultHandling, of: fn(&Handling) -> Option<f64>| [of(&row.lockstep), of(&row.realtime)];
    let cells = |row: &FaultHandling| {
        let columns: [fn(&Handling) -> Option<f64>; 4] = [
            |handling| handling.noticed_ms,
            |handling| handling.next_active_ms,
            |handling| Some(handling.ticks_without_active as f64),
            |handling| Some(handling.restarts as f64),
        ];
        let pairs = columns.into_iter().flat_map(|of| both(row, of)).map(|value| cell(value, 0));
        [row.fault.clone()].into_iter().chain(pairs).collect()
    };
    Table::new(
        "The same process fault for 1 s in lockstep and in real time (rt): until noticed [ms], until the next process is \
         active [ms], ticks without an active process, restarts",
        &["fault", "noticed", "rt", "next active", "rt", "ticks", "rt", "restarts", "rt"],
        rows.iter().map(cells).collect(),
    )
}

fn targets(results: &FaultResults) -> Vec<Target> {
    let mut targets = of_the_matrix(&results.rows);
    targets.push(of_the_paper(&results.paper));
    let alarms: u64 = results.quiet.iter().map(|quiet| quiet.flagged + quiet.refused + quiet.events).sum();
    targets.push(Target::at_most("false alarms in 60 quiet seconds, two flights", Some(alarms as f64), 0.0, ""));
    let other = results.handling.iter().filter(|row| row.lockstep.restarts != row.realtime.restarts);
    let other: Vec<&str> = other.map(|row| row.fault.as_str()).collect();
    let figure = format!("of {} process faults: restarts differ in real time", results.handling.len());
    targets.push(Target::none(figure, other.len()).noting(other.join(", ")));
    let hung = results.handling.iter().filter(|row| row.fault.ends_with("stop"));
    let noticed_ms = median(hung.filter_map(|row| row.realtime.noticed_ms));
    targets.push(Target::at_most("hang noticed in real time, in whole samples, median", noticed_ms, HUNG_MS, "ms"));
    targets
}

fn of_the_matrix(rows: &[FaultFlight]) -> Vec<Target> {
    let those = |promise| rows.iter().filter(move |row| row.promise == promise);
    let recoverable = those(FaultPromise::Recover).count();
    let worst = |promise, of: fn(&FaultCourse) -> f64| those(promise).map(|row| of(&row.course)).reduce(f64::max);
    let recovered = |figure: String, of: fn(&FaultCourse) -> f64, limit, unit| {
        let beyond = those(FaultPromise::Recover).filter(|row| of(&row.course) > limit);
        Target::at_most(figure, worst(FaultPromise::Recover, of), limit, unit).noting(names(beyond))
    };
    let back_m = |course: &FaultCourse| course.back_m.unwrap_or(f64::INFINITY);
    let terminated_s = worst(FaultPromise::Terminate, |course| course.terminated_after_s.unwrap_or(f64::INFINITY));
    let silent = rows.iter().find(|row| row.fault == "attitude-mpc kill").map(|row| row.course.tilt_deg);
    let differs = || rows.iter().filter(|row| row.same == Some(false));
    let figure = format!("flights of {} that differ between lockstep and one thread", rows.len());
    vec![
        recovered(format!("worst tilt in {recoverable} recoverable faults"), |course| course.tilt_deg, TILT_DEG, "deg"),
        Target::at_most("worst tilt, 1 s without attitude-mpc in gusts", silent, TILT_DEG, "deg"),
        recovered(format!("farthest 5 s after {recoverable} recoverable faults"), back_m, BACK_M, "m"),
        Target::at_most("dead rotor, until the flight is terminated", terminated_s, TERMINATE_S, "s"),
        Target::none(figure, differs().count()).noting(names(differs())),
    ]
}

fn of_the_paper(rows: &[FaultFlight]) -> Target {
    let short = || rows.iter().filter(|row| row.kept() == Some(false) || row.same == Some(false));
    let figure = format!("profile paper in calm, {} faults: promises broken", rows.len());
    Target::none(figure, short().count()).noting(names(short()))
}

fn names<'a>(rows: impl Iterator<Item = &'a FaultFlight>) -> String {
    rows.map(|row| row.fault.as_str()).collect::<Vec<_>>().join(", ")
}
