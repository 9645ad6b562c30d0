//! One flight, from scenario to report.

use std::cell::RefCell;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Instant;

use anyhow::ensure;
use clap::ValueEnum;
use contract::exit;
use rustix::process::{Resource, getrlimit};
use settings::{Mode, Scenario};

use crate::beside::Beside;
use crate::new::name;
use crate::progress::ProgressLine;
use crate::web::{self, OpenPage, TokenArgs};
use crate::{mavlink, mission, vehicle};
use flight::guarded;
use flight::hover::Hover;
use flight::interrupts::{catch_interrupts, end_at_once};
use flight::log::Record;
use flight::provenance::{ProcessScheduling, granted, provenance};
use flight::recorder::CountedLog;
use flight::stack::{Ended, FlightResult, Stack};
use folder::run::Folder;
use ground::{Address, Home};
use machine::{Machine, Severity};
use outcome::judge::{Circumstances, Verdict};
use outcome::recorded::TimeSpan;
use outcome::run_record::{Account, RunRecord};
use outcome::summary::Summary;
use outcome::terminal::describe;
use runtime::console::{eprint_line, print};
use view::report;

/// Arguments of `fly`.
#[derive(clap::Args, Default)]
pub struct FlyArgs {
    /// Scenario file (TOML), or the name of a shipped scenario; without one: profile robust, trajectory survey, real
    /// time, 60 s
    pub scenario: Option<PathBuf>,
    /// Mode of the flight
    #[arg(long)]
    pub mode: Option<ModeArg>,
    /// Override a setting, value in TOML: --set run.seed=3 --set profile=paper
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Folder for the results [default: runs/NAME-TIME]
    #[arg(long)]
    pub out: Option<PathBuf>,
    /// Print run.json to stdout instead of the summary
    #[arg(long)]
    pub json: bool,
    /// Do not write flight.mcap and report.html
    #[arg(long)]
    pub no_log: bool,
    /// Name of the stack: several can fly at once under different names
    #[arg(long, default_value = "default")]
    pub namespace: String,
    /// Show the flight to a ground station: udpout:127.0.0.1:14550 is QGroundControl on this machine
    #[arg(long, value_name = "ADDR")]
    pub mavlink: Option<Address>,
    /// Place of the flight's origin for --mavlink: latitude and longitude in degrees, height in m
    #[arg(long, value_name = "LAT,LON,HEIGHT", requires = "mavlink", allow_hyphen_values = true, value_parser = home)]
    pub home: Option<String>,
    /// Show the flight in the browser, live [default ADDR: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = web::address)]
    pub web: Option<SocketAddr>,
    #[command(flatten)]
    pub token: TokenArgs,
}

/// Values of `--mode`.
#[derive(Clone, Copy, ValueEnum)]
pub enum ModeArg {
    /// Processes, released by the clock
    Realtime,
    /// Processes, as fast as they go, bit-identical on every repeat
    Lockstep,
    /// One thread, bit-identical to lockstep
    Inprocess,
}

impl FlyArgs {
    /// Returns the arguments of a flight with its log in the folder `out`.
    pub fn into_folder(out: PathBuf) -> Self {
        Self { out: Some(out), namespace: "default".to_owned(), ..Self::default() }
    }
}

/// Flies the scenario of the arguments; returns the exit code.
pub fn fly(args: &FlyArgs) -> anyhow::Result<u8> {
    fly_scenario(settings(args)?, args)
}

/// Flies `scenario`; the scenario, mode and overrides of `args` are not used. Returns the exit code.
pub fn fly_scenario(scenario: Scenario, args: &FlyArgs) -> anyhow::Result<u8> {
    ensure!(
        args.mavlink.is_none() || scenario.run.mode != Mode::Inprocess,
        "--mavlink shows a flight through processes; fly with --mode realtime or lockstep"
    );
    mission::warn(&scenario);
    vehicle::warn_of_weights(&scenario);
    let interrupts = catch_interrupts()?;
    let page = page(&scenario, args)?;
    let out = Folder::prepare(args.out.as_deref(), &scenario).map_err(with_file_limit)?;
    let log = (!args.no_log).then(|| out.path.join("flight.mcap"));

    let mut summary = Summary::new(&scenario);
    let flown = match scenario.run.mode {
        Mode::Inprocess => fly_inprocess(&scenario, log.as_deref(), &mut summary, &interrupts),
        Mode::Realtime | Mode::Lockstep => {
            fly_processes(args, &scenario, page, log.as_deref(), &mut summary, &interrupts)
        }
    };
    let ordered = scenario;
    let FlightResult { mut how, wall, scheduling, scenario } = match flown {
        Ok(flown) => flown,
        Err(error) => {
            out.withdraw();
            return Err(error);
        }
    };
    if matches!(how.ended, Ended::Flown) && !summary.status().is_last() {
        how.ended =
            Ended::Unseen(format!("at {:.2} s, the last that was seen, the plant was flying", summary.time_s()));
    }
    match &how.ended {
        Ended::Lost(name) => eprint_line(&format!("error: lost {name}; the stack was stopped")),
        Ended::Unseen(what) => eprint_line(&format!("error: {what}")),
        Ended::Flown | Ended::Interrupted | Ended::Late(_) => {}
    }

    let settings = || out.write("scenario.toml", &settings::to_toml(&scenario));
    let written = if scenario == ordered { Ok(()) } else { settings() };

    let verdict = Verdict::of(&summary, &scenario, &how);
    let account = Account {
        summary: &summary,
        scenario: &scenario,
        how: &how,
        verdict: &verdict,
        wall_s: wall.as_secs_f64(),
        provenance: Some(provenance(&scenario, &scheduling)),
    };
    // The hover takes several times as long as a flight in process, so it is computed only for a flight with a log.
    let hover = (!args.no_log).then(|| Hover::of(&scenario));
    let record = RunRecord { hover, ..RunRecord::of(account) };
    let run = serde_json::to_string_pretty(&record)? + "\n";
    let written = written.and_then(|()| out.write("run.json", &run));
    let histograms = || summary.timing.as_ref().map_or(Ok(()), |timing| timing.write_histograms(&out.path));
    let written = written.and_then(|()| histograms());
    if args.json {
        print(&run);
    } else {
        print(&describe(&record, &verdict, &scenario));
        print(&format!("  {:<22}{}\n", "written to", out.path.display()));
    }
    // The report comes last: for a long flight it takes a while, and the summary is printed by then.
    let written = written.and_then(|()| if log.is_some() { write_report(&out.path) } else { Ok(()) });
    let log_error = how.log.as_ref().and_then(|log| log.error.clone());
    let write_error = written.as_ref().err().map(|error| format!("{error:#}"));
    let failed = written.is_err();
    for error in [log_error, write_error].into_iter().flatten() {
        eprint_line(&format!("error: {error}"));
    }
    // A failure to write never hides a higher exit code of the flight.
    Ok(if failed { verdict.exit_code.max(exit::PROCESS_LOST) } else { verdict.exit_code })
}

/// Starts the process of the page, if the arguments ask for a page.
fn page(scenario: &Scenario, args: &FlyArgs) -> anyhow::Result<Option<Beside>> {
    ensure!(
        args.web.is_none() || scenario.run.mode != Mode::Inprocess,
        "--web shows a flight through processes; a flight in process is over before a browser is open"
    );
    OpenPage::open(args.web, &args.token)?.map(|page| page.beside(&args.namespace)).transpose()
}

/// Writes the report, which can take longer than the flight: the flight is flown again to find the cost of disturbed
/// ticks.
fn write_report(run: &Path) -> anyhow::Result<()> {
    let path = run.display();
    end_at_once(format!("interrupted before the report was written; `trefoil report {path}` writes it"));
    let progress = ProgressLine::start();
    progress.show(|| "writing report.html: flies again for what disturbed ticks cost   (Ctrl-C leaves it out)".into());
    let written = report::write(run, TimeSpan::ALL, replay::explain::costs);
    progress.finish();
    written.map(drop)
}

fn settings(args: &FlyArgs) -> anyhow::Result<Scenario> {
    let mut overrides = args.set.clone();
    overrides.extend(args.mode.map(|mode| format!("run.mode={}", name(&mode))));
    Ok(flight::scenario::load(args.scenario.as_deref(), &overrides)?)
}

fn fly_inprocess(
    scenario: &Scenario,
    log: Option<&Path>,
    summary: &mut Summary,
    interrupts: &AtomicU32,
) -> anyhow::Result<FlightResult> {
    let log = log.map(|path| CountedLog::create(path, scenario)).transpose().map_err(with_file_limit)?;
    let log = log.map(RefCell::new);
    let started = Instant::now();
    let watch = |record: &Record| {
        summary.observe(record);
        if let Some(log) = &log {
            log.borrow_mut().write(record);
        }
        interrupts.load(Ordering::Relaxed) == 0
    };
    let flown = guarded::fly(scenario, true, watch, |memory| {
        if let Some(log) = &log {
            log.borrow_mut().write_memory(memory);
        }
    })?;
    let wall = started.elapsed();
    flown.failures.iter().for_each(|why| eprint_line(why));
    let mut how = Circumstances::from(flown);
    how.log = log.map(RefCell::into_inner).map(|mut log| {
        for event in &how.events {
            log.write_event(event);
        }
        log.finish()
    });
    if interrupts.load(Ordering::Relaxed) > 0 {
        how.ended = Ended::Interrupted;
    }
    Ok(FlightResult { how, wall, scheduling: vec![], scenario: scenario.clone() })
}

/// Flies with processes. The process of the `page`, if given, ends with the flight.
fn fly_processes(
    args: &FlyArgs,
    scenario: &Scenario,
    page: Option<Beside>,
    log: Option<&Path>,
    summary: &mut Summary,
    interrupts: &AtomicU32,
) -> anyhow::Result<FlightResult> {
    let stack = Stack::start(&args.namespace, scenario, log, interrupts).map_err(with_file_limit)?;
    tell_shortfalls(scenario, &stack.scheduling);
    let home = args.home.as_deref().unwrap_or(Home::USUAL);
    let mavlink = args.mavlink.map(|address| mavlink::beside(&args.namespace, &address, home)).transpose()?;
    let progress = ProgressLine::start();
    let summary = RefCell::new(summary);
    let mut flown = stack.fly(
        interrupts,
        |record: &Record| summary.borrow_mut().observe(record),
        |faults| {
            summary.borrow_mut().faults.follow(faults);
            progress.show(|| describe_now(&summary.borrow(), scenario));
        },
    );
    progress.finish();
    flown.how.observers = Beside::finish(page.into_iter().chain(mavlink).collect());
    Ok(flown)
}

/// Prints, as `doctor` does, what the scenario asks for but the processes did not get; leaves out a repeated remedy.
fn tell_shortfalls(scenario: &Scenario, scheduling: &[(String, ProcessScheduling)]) {
    let granted = granted(scheduling.iter().map(|(name, got)| (name, got)));
    let findings = machine::scheduling(&Machine::this(), scenario, granted, &program());
    let mut told = None;
    for mut finding in findings.into_iter().filter(|finding| finding.level == Severity::Bad) {
        let again = finding.remedy.take_if(|remedy| told.as_ref() == Some(remedy));
        told = again.or_else(|| finding.remedy.clone()).or(told);
        eprint_line(&format!("note: {}: {}", finding.check, finding.lines().join("\n      ")));
    }
}

/// Returns the path of this program, for commands that change its file.
pub fn program() -> String {
    std::env::current_exe().map_or("target/release/trefoil".into(), |path| path.display().to_string())
}

/// Checks the text of a home position; the process of `--mavlink` gets the text unchanged.
fn home(text: &str) -> Result<String, String> {
    text.parse::<Home>().map(|_| text.to_owned())
}

/// Adds the limit on file sizes to an error that this limit caused: the kernel's text does not name the limit.
fn with_file_limit(error: anyhow::Error) -> anyhow::Error {
    let is_too_large = |cause: &(dyn std::error::Error + 'static)| {
        cause.downcast_ref::<std::io::Error>().is_some_and(|io| io.kind() == std::io::ErrorKind::FileTooLarge)
    };
    match getrlimit(Resource::Fsize).current.filter(|_| error.chain().any(is_too_large)) {
        Some(bytes) => {
            error.context(format!("no file may be larger than {} kB here; raise the limit (`ulimit -f`)", bytes / 1024))
        }
        None => error,
    }
}

/// Describes the present state of the flight in one line.
fn describe_now(summary: &Summary, scenario: &Scenario) -> String {
    let error_m = summary.metrics().final_position_error_m;
    let (age_us, misses) = summary.timing.as_ref().map_or((0.0, 0), |t| (t.age().p50_us, t.misses()));
    format!(
        "{:5.1} of {:.0} s   error {error_m:.3} m   age at actuator {:.2} ms   misses {misses}",
        summary.time_s(),
        scenario.run.duration_s,
        age_us / 1e3,
    )
}
