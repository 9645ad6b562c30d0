//! One flight, from scenario to report.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use anyhow::Context;
use clap::ValueEnum;
use contract::Scenario;
use contract::process::exit;
use contract::scenario::{self, Mode, Policy};
use indicatif::{ProgressBar, ProgressStyle};

use crate::inprocess;
use crate::log::Record;
use crate::provenance::provenance;
use crate::recorder::Log;
use crate::run_record::{Circumstances, describe, exit_code, run_json};
use crate::stack::{Ended, Flown, Stack};
use crate::summary::Summary;
use crate::{print, report};

/// Arguments of `fly`.
#[derive(clap::Args)]
pub struct FlyArgs {
    /// Scenario file (TOML); without one: profile robust, trajectory survey, real time, 60 s
    pub scenario: Option<PathBuf>,
    /// How to turn the ring
    #[arg(long)]
    pub mode: Option<ModeArg>,
    /// Override a setting, value in TOML: --set mpc.np=30 --set profile=paper
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
}

/// `--mode`
#[derive(Clone, Copy, ValueEnum)]
pub enum ModeArg {
    /// Processes, released by the clock
    Realtime,
    /// Processes, as fast as they go, bit-identical on every repeat
    Lockstep,
    /// One thread, bit-identical to lockstep
    Inprocess,
}

impl From<ModeArg> for Mode {
    fn from(mode: ModeArg) -> Self {
        match mode {
            ModeArg::Realtime => Self::Realtime,
            ModeArg::Lockstep => Self::Lockstep,
            ModeArg::Inprocess => Self::Inprocess,
        }
    }
}

/// Flies as the arguments say; the exit code.
pub fn fly(args: &FlyArgs) -> anyhow::Result<u8> {
    let mut scenario = settings(args)?;
    let out = Folder::prepare(&args.out.clone().unwrap_or_else(|| default_folder(&scenario)), &scenario)?;
    let interrupts = catch_interrupts()?;
    let log = (!args.no_log).then(|| out.path.join("flight.mcap"));

    let ordered = scenario.clone();
    let mut summary = Summary::new(&scenario);
    let flown = match scenario.run.mode {
        Mode::Inprocess => fly_inprocess(&scenario, log.as_deref(), &mut summary, &interrupts),
        Mode::Realtime | Mode::Lockstep => {
            fly_processes(args, &mut scenario, log.as_deref(), &mut summary, &interrupts)
        }
    };
    let how = match flown {
        Ok(how) => how,
        Err(error) => {
            out.withdraw();
            return Err(error);
        }
    };

    let settings = || write_whole(&out.path.join("scenario.toml"), scenario::to_toml(&scenario).as_bytes());
    let written = if scenario == ordered { Ok(()) } else { settings() };

    let run = serde_json::to_string_pretty(&run_json(&summary, &scenario, &how))? + "\n";
    let written = written.and_then(|()| write_whole(&out.path.join("run.json"), run.as_bytes()));
    let histograms = || summary.timing.as_ref().map_or(Ok(()), |timing| timing.write_histograms(&out.path));
    let written = written.and_then(|()| histograms());
    let written = written.and_then(|()| if log.is_some() { report::rewrite(&out.path) } else { Ok(()) });
    if args.json {
        print(&run);
    } else {
        print(&describe(&summary, &scenario, &how));
        print(&format!("  {:<22}{}\n", "written to", out.path.display()));
    }
    let log_error = how.log.as_ref().and_then(|log| log.error.clone());
    let write_error = written.as_ref().err().map(|error| format!("{error:#}"));
    for error in [log_error, write_error].into_iter().flatten() {
        eprintln!("error: {error}");
    }
    // What the flight came to is graver than what could not be written of it.
    let code = exit_code(&summary, &scenario, &how);
    Ok(if written.is_err() { code.max(exit::PROCESS_LOST) } else { code })
}

fn settings(args: &FlyArgs) -> anyhow::Result<Scenario> {
    let mut overrides = args.set.clone();
    if let Some(mode) = args.mode {
        let mode = Mode::from(mode);
        overrides.push(format!("run.mode={}", serde_json::to_value(mode)?.as_str().unwrap_or_default()));
    }
    Ok(crate::settings::load(args.scenario.as_deref(), &overrides)?)
}

fn fly_inprocess(
    scenario: &Scenario,
    log: Option<&Path>,
    summary: &mut Summary,
    interrupts: &AtomicU32,
) -> anyhow::Result<Circumstances> {
    let mut log = log.map(|path| Log::create(path, scenario)).transpose()?;
    let started = Instant::now();
    let flown = inprocess::fly(scenario, |record| {
        summary.observe(&record);
        if let Some(log) = &mut log {
            log.write(&record);
        }
        interrupts.load(Ordering::Relaxed) == 0
    });
    let wall_s = started.elapsed().as_secs_f64();
    let inprocess::Flown { ended, events, refused } = flown;
    let log = log.map(|mut log| {
        for event in &events {
            log.event(event);
        }
        log.finish()
    });
    let ended = if interrupts.load(Ordering::Relaxed) > 0 { Ended::Interrupted } else { ended };
    Ok(Circumstances { ended, wall_s, log, provenance: provenance(scenario, &[]), events, refused })
}

/// Flies through processes; `scenario` gets what was ordered meanwhile.
fn fly_processes(
    args: &FlyArgs,
    scenario: &mut Scenario,
    log: Option<&Path>,
    summary: &mut Summary,
    interrupts: &AtomicU32,
) -> anyhow::Result<Circumstances> {
    let stack = Stack::start(&args.namespace, scenario, log, interrupts)?;
    let progress = Progress::new();
    let summary = std::cell::RefCell::new(summary);
    let flown = stack.fly(
        interrupts,
        |record: Record| summary.borrow_mut().observe(&record),
        |faults| {
            summary.borrow_mut().faults.follow(faults);
            progress.show(&summary.borrow(), scenario);
        },
    );
    progress.bar.finish_and_clear();
    let fifo = flown.scheduling.iter().all(|(name, s)| name == "recorder" || s.policy == "fifo");
    if scenario.run.mode == Mode::Realtime && scenario.realtime.policy == Policy::Fifo && !fifo {
        eprintln!("note: flew as SCHED_OTHER, without the privilege for SCHED_FIFO; timing is worse for it");
    }
    if let Ended::Lost(name) = &flown.ended {
        eprintln!("error: lost {name}; the stack was stopped");
    }
    let Flown { ended, log, wall, scheduling, events, scenario: flown_scenario, refused } = flown;
    *scenario = flown_scenario;
    let provenance = provenance(scenario, &scheduling);
    Ok(Circumstances { ended, wall_s: wall.as_secs_f64(), log, provenance, events, refused })
}

/// Counts Ctrl-C, SIGTERM and SIGHUP: the first stops the flight cleanly, the second kills the processes, the third
/// ends the launcher on the spot (the next flight then wipes what it left in shared memory).
pub(crate) fn catch_interrupts() -> anyhow::Result<Arc<AtomicU32>> {
    let count = Arc::new(AtomicU32::new(0));
    let handler = count.clone();
    ctrlc::set_handler(move || {
        if handler.fetch_add(1, Ordering::Relaxed) >= 2 {
            std::process::exit(i32::from(exit::INTERRUPTED));
        }
    })
    .context("cannot catch Ctrl-C")?;
    Ok(count)
}

/// The line shown while flying, on a terminal only.
struct Progress {
    bar: ProgressBar,
}

impl Progress {
    fn new() -> Self {
        let bar = ProgressBar::new_spinner();
        bar.set_style(ProgressStyle::with_template("{spinner} {msg}").expect("the template is a constant"));
        Self { bar }
    }

    fn show(&self, summary: &Summary, scenario: &Scenario) {
        let error_m = summary.metrics().final_position_error_m;
        let (age_us, misses) = summary.timing.as_ref().map_or((0.0, 0), |t| (t.age().p50_us, t.misses()));
        self.bar.set_message(format!(
            "{:5.1} of {:.0} s   error {error_m:.3} m   age at actuator {:.2} ms   misses {misses}",
            summary.time_s(),
            scenario.run.duration_s,
            age_us / 1e3,
        ));
        self.bar.tick();
    }
}

/// The folder of a run.
struct Folder {
    path: PathBuf,
    /// Whether it was there before.
    found: bool,
    /// Where an earlier run went.
    aside: Option<PathBuf>,
}

impl Folder {
    /// Makes the folder, moves an earlier run in it aside, and proves that it can be written to.
    fn prepare(path: &Path, scenario: &Scenario) -> anyhow::Result<Self> {
        let path: PathBuf = path.components().collect(); // without a slash at the end
        let holds_a_run = ["run.json", "flight.mcap", "scenario.toml"].iter().any(|name| path.join(name).exists());
        let aside = if holds_a_run { Some(move_aside(&path)?) } else { None };
        let folder = Self { found: path.exists(), aside, path };
        let path = &folder.path;
        let made = fs::create_dir_all(path).map_err(anyhow::Error::from);
        let written =
            made.and_then(|()| write_whole(&path.join("scenario.toml"), scenario::to_toml(scenario).as_bytes()));
        let cannot = || format!("cannot write to the output folder {}; choose another with --out", path.display());
        written.with_context(cannot).inspect_err(|_| folder.withdraw())?;
        if let Some(aside) = &folder.aside {
            eprintln!("note: {} held an earlier run; it is now {}", path.display(), aside.display());
        }
        Ok(folder)
    }

    /// Takes back what a run that never flew has written, and puts an earlier run where it was.
    fn withdraw(&self) {
        // Each may not be there, and a folder stays when somebody else put a file into it.
        for name in ["scenario.toml", "flight.mcap"] {
            let _ = fs::remove_file(self.path.join(name));
        }
        if !self.found {
            let _ = fs::remove_dir(&self.path);
        }
        if let Some(aside) = &self.aside {
            let _ = fs::rename(aside, &self.path);
        }
    }
}

/// Renames the folder of an earlier run to the first free of `<path>.1`, `<path>.2`, ...
fn move_aside(path: &Path) -> anyhow::Result<PathBuf> {
    let numbered = |i: u32| PathBuf::from(format!("{}.{i}", path.display()));
    let aside = (1..=9999).map(numbered).find(|p| !p.exists()).context("no free name for the earlier run")?;
    fs::rename(path, &aside).with_context(|| format!("cannot move the earlier run in {}", path.display()))?;
    Ok(aside)
}

/// Writes a file whole or not at all.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let part = path.with_extension("part");
    let written = fs::File::create(&part).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()?;
        fs::rename(&part, path)
    });
    written.map_err(|error| {
        let _ = fs::remove_file(&part); // may not have been made
        anyhow::Error::new(error).context(format!("cannot write {}", path.display()))
    })
}

fn default_folder(scenario: &Scenario) -> PathBuf {
    let name: String = scenario.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Path::new("runs").join(format!("{name}-{}", since_epoch.as_millis()))
}
