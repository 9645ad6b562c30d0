//! `replay` and `explain`: fly a flight again from its folder.

use std::net::SocketAddr;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, bail, ensure};
use contract::exit;
use contract::topic::{NODES, Topic};
use flight::duration::seconds;
use flight::provenance::status_of;
use flight::{guarded, programs};
use folder::files::write_whole;
use replay::{Recording, ReplayPlan};
use runtime::console::{eprint_line, keep_stdout, print};
use rustix::process::{Signal, getpid, kill_process};
use settings::{Mode, Scenario, Swap, candidate};

use crate::progress::ProgressLine;
use crate::run_folder::PartOfRun;
use crate::web::{self, OpenPage, TokenArgs};
use live::player::Player;
use outcome::recorded::{Recorded, TimeSpan};
use replay::explain::{Work, explain as explain_ticks};
use replay::verdict::replay_and_judge;
use serde_json::json;
use view::comparison;
use view::explain::ShownCosts;

/// Arguments of `replay`.
#[derive(clap::Args)]
pub struct ReplayArgs {
    #[command(flatten)]
    pub of: PartOfRun,
    /// Replay only this node, on its recorded inputs: guidance, attitude-mpc, mixer or plant
    #[arg(long, value_name = "NODE")]
    node: Option<String>,
    /// Other settings for the node, to compute its answers to the same inputs
    #[arg(long = "set", value_name = "KEY=VALUE", requires = "node")]
    set: Vec<String>,
    /// Stop for a debugger before this node answers the sample of this time
    #[arg(long = "break", value_name = "NODE@TIME")]
    stop: Option<String>,
    /// Another program for the node, started as by `trefoil swap --exec`
    #[arg(long, value_name = "PROGRAM", requires = "node")]
    exec: Option<String>,
    #[command(flatten)]
    trusted: Trusted,
    /// With --set or --exec: close the loop, so that all other nodes read the new answers
    #[arg(long)]
    closed: bool,
    /// Then play the log of the flight in the browser, until Ctrl-C [default ADDR: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = web::address)]
    web: Option<SocketAddr>,
    #[command(flatten)]
    token: TokenArgs,
}

/// Libraries that a replay may load.
#[derive(clap::Args)]
pub struct Trusted {
    /// File of a library that the node flew: it is loaded, and its answers are computed
    #[arg(long = "program", value_name = "NODE=FILE")]
    programs: Vec<String>,
}

impl Trusted {
    fn trust(&self, recording: &mut Recording) -> anyhow::Result<()> {
        for program in &self.programs {
            let (name, file) = program.split_once('=').context("--program takes NODE=FILE, for example mixer=my.so")?;
            recording.trust(node(name)?, file)?;
        }
        Ok(())
    }
}

/// Arguments of `explain`.
#[derive(clap::Args)]
pub struct ExplainArgs {
    #[command(flatten)]
    pub of: PartOfRun,
    /// Print the costs as JSON instead of the tables
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    trusted: Trusted,
    /// Compute the cost of every single disturbed tick; without this option many ticks are only undone all together
    #[arg(long)]
    all: bool,
}

/// Prints the cost of the disturbed ticks of a run, and writes explain.html into its folder; returns the exit code.
pub fn explain(args: &ExplainArgs) -> anyhow::Result<u8> {
    if let Some(code) = in_child(!args.trusted.programs.is_empty())? {
        return Ok(code);
    }
    let part = args.of.part()?;
    let recorded = Recorded::read_each(&args.of.run, part, |_, _| {})?;
    let missing = recorded.missing();
    let mut recording = Recording::of(&recorded)?;
    args.trusted.trust(&mut recording)?;
    let (from, until) = ticks(part, &recording);
    let script = recording.script(from, until.unwrap_or(u64::MAX))?;
    let work = Work::of(&recording, &script, until)?;
    let each = args.all || work.is_little();
    for told in missing.iter().chain([&work.describe()]) {
        eprint_line(&format!("note: {told}"));
    }
    if !each {
        eprint_line(
            "note: too many to leave out one by one: here is what all together cost; --all flies without each of them too",
        );
    }
    let progress = Mutex::new(ProgressLine::start());
    let show = |done, of| progress.lock().iter().for_each(|line| line.show(|| format!("{done} of {of} flights")));
    let explained = explain_ticks(&recording, &script, &work, each, show);
    progress.into_inner().into_iter().for_each(ProgressLine::finish);
    let explained = explained?;
    let page = recorded.path.with_file_name("explain.html");
    let shown = ShownCosts { explained: &explained, happened: &recorded.run.happenings() };
    write_whole(&page, shown.page(missing.as_deref()).as_bytes())?;
    if args.json {
        let mut costs = shown.to_json();
        costs["missing"] = json!(missing);
        print(&(serde_json::to_string_pretty(&costs)? + "\n"));
    } else {
        print(&shown.text());
        print(&format!("\nwritten to {}\n", page.display()));
    }
    Ok(if missing.is_none() { exit::FLOWN } else { exit::OUT_OF_BOUNDS })
}

/// Flies a run again and judges the result; returns the exit code.
pub fn replay(args: &ReplayArgs) -> anyhow::Result<u8> {
    let loads = args.exec.is_some() || !args.trusted.programs.is_empty();
    ensure!(
        !(loads && args.web.is_some()),
        "--web goes without --exec and --program, which replay in a process of their own; the page shows the log alone"
    );
    // A debugger attaches to this process, so `--break` starts no child.
    if let Some(code) = in_child(loads && args.stop.is_none())? {
        return Ok(code);
    }
    if loads {
        keep_stdout()?;
    }
    let part = args.of.part()?;
    let page = OpenPage::open(args.web, &args.token)?;
    let recorded = Recorded::read_each(&args.of.run, part, |_, _| {})?;
    let mut recording = Recording::of(&recorded)?;
    args.trusted.trust(&mut recording)?;
    let plan = plan(args, part, &recording)?;
    let started = Instant::now();
    let mut came_to_break = false;
    let verdict = replay_and_judge(&recorded, &recording, &plan, |replayed, summary| {
        let flown_s = replayed.last_tick.saturating_sub(replayed.begun_at) as f64 * recording.scenario.sample_s();
        let (wall_s, name) = (started.elapsed().as_secs_f64(), &recording.scenario.name);
        let computed = replayed.computed();
        came_to_break = replayed.came_to_break;
        print(&format!("{name}: {flown_s:.2} s flown again in {wall_s:.2} s, {computed} messages computed\n"));
        if let Some(other) = recorded.log.written_by.other_program().filter(|_| replayed.first.is_some()) {
            print(&format!("{other}: a difference may be the program's\n"));
        }
        if args.closed {
            let flights = [recorded.summary.metrics(), summary.metrics()];
            print(&(comparison::metrics(&["flight", "with these settings"], &flights).text() + "\n"));
        }
    })?;
    if let Some(stop) = args.stop.as_ref().filter(|_| !came_to_break) {
        bail!("--break {stop}: the node did not answer to that sample in this flight");
    }
    print(&verdict.text);
    if let Some(page) = page {
        page.play(Player::read(&args.of.run, part, &recorded.run.events)?)?;
    }
    Ok(verdict.exit_code)
}

/// Runs this command in a child if it `loads` libraries, and returns its exit code; `None` if the command is to run
/// here.
fn in_child(loads: bool) -> anyhow::Result<Option<u8>> {
    Ok(if loads { guarded::command()? } else { None })
}

fn plan(args: &ReplayArgs, part: TimeSpan, recording: &Recording) -> anyhow::Result<ReplayPlan> {
    let only = args.node.as_deref().map(node).transpose()?;
    let changed = only.filter(|_| !args.set.is_empty() || args.exec.is_some());
    let settings = changed.map(|topic| anyhow::Ok((topic, Box::new(settings(recording, topic, args)?)))).transpose()?;
    let (from, until) = ticks(part, recording);
    if args.closed && settings.is_none() {
        bail!("--closed goes with --set or --exec: without them `trefoil replay` is the flight as it was");
    }
    let before = args.stop.as_deref().map(|stop| breakpoint(stop, recording)).transpose()?;
    Ok(ReplayPlan { only: only.filter(|_| !args.closed), settings, from, until, before })
}

/// Returns the first and the last tick of a part; `None` as the last if the part has no end.
fn ticks(part: TimeSpan, recording: &Recording) -> (u64, Option<u64>) {
    let (from, until) = part.ticks(recording.scenario.sample_s()).into_inner();
    (from, Some(until).filter(|_| part.to_s < TimeSpan::ALL.to_s))
}

/// Parses `NODE@TIME`; returns topic and tick of the cycle named, and the function to call before the cycle.
fn breakpoint(stop: &str, recording: &Recording) -> anyhow::Result<(Topic, u64, fn())> {
    let (name, time) = stop.split_once('@').context("--break takes NODE@TIME, for example attitude-mpc@12.34s")?;
    let (topic, time_s) = (node(name)?, seconds(time).map_err(|why| anyhow!("--break {stop}: {why}"))?);
    let tick = (time_s / recording.scenario.sample_s()).round() as u64;
    Ok((topic, tick, wait_for_debugger))
}

/// Stops this process in its debugger; if there is no debugger, prints how to attach one, and waits until one has
/// attached.
fn wait_for_debugger() {
    let pid = std::process::id();
    let is_traced = || status_of(pid, "TracerPid:").is_some_and(|tracer| tracer != "0");
    if !is_traced() {
        eprint_line(&format!(
            "stopped before the cycle; attach with `gdb -p {pid}` or `lldb -p {pid}` and continue: it stops again there"
        ));
    }
    while !is_traced() {
        std::thread::sleep(LOOK_FOR_DEBUGGER);
    }
    let _ = kill_process(getpid(), Signal::TRAP); // the debugger takes the signal
}

/// Time between two checks whether a debugger has attached.
const LOOK_FOR_DEBUGGER: Duration = Duration::from_millis(100);

fn node(name: &str) -> anyhow::Result<Topic> {
    let known = Topic::of_node(name);
    known.ok_or_else(|| anyhow!("no node is called '{name}'; there are {}", NODES.join(", ")))
}

fn settings(recording: &Recording, topic: Topic, args: &ReplayArgs) -> anyhow::Result<Scenario> {
    ensure!(
        topic != Topic::State,
        "the plant is the vehicle of the run; `--set` and `--exec` are for {}",
        NODES[1..].join(", ")
    );
    let is_named = args.exec.is_some() || args.set.iter().any(|set| set.starts_with("node."));
    ensure!(
        is_named || !recording.is_foreign(topic, 1),
        "{0} flew {1}, which this replay does not start by itself: name it with --program {0}=FILE",
        topic.publisher(),
        recording.scenario.node.of(topic).exec
    );
    let mut recorded = recording.scenario.clone();
    recorded.run.mode = Mode::Lockstep; // a program of its own is not allowed in process
    let mut own =
        candidate(&recorded, &Swap { exec: args.exec.clone(), set: args.set.clone(), ..Swap::new(topic, 0.0) })?;
    programs::pin(own.node.of_mut(topic), topic.publisher())?;
    programs::check_one(&own, topic)?;
    own.run.mode = recording.scenario.run.mode;
    Ok(own)
}
