//! `campaign`: many flights, on all cores of this machine or on a cluster, and their statistics.

mod results;

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::AtomicU32;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, bail, ensure};
use campaign::folder::{CampaignFolder, FolderAccess};
use campaign::layout::MAX_SHARDS;
use campaign::page::under_way;
use campaign::row;
use campaign::table::Cell;
use campaign::{Campaign, OwnController, Plan, local, seeds, slurm};
use clap::{Args, Subcommand};
use contract::exit;
use flight::interrupts::catch_interrupts;
use folder::shipped::ShippedKind;
use runtime::console::{eprint_line, is_read, print};

use crate::progress::ProgressLine;
use crate::web::{self, OpenPage, TokenArgs};
use crate::{fly, scenarios};
use results::{ResultsView, conclude};

/// Arguments of `campaign`.
#[derive(Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "The same command continues where an earlier one ended. docs/campaigns.md has the form of FILE and an example. \
Exit code 0 says that every flight has passed or failed, every promise is kept, and the results are written."
)]
pub struct CampaignArgs {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    what: Option<What>,
    /// Print the table of flights and fly none
    #[arg(long, conflicts_with_all = ["slurm", "only", "status", "collect", "shard"])]
    plan: bool,
    /// Fly this flight again, with its log and report, into flight-N of the folder
    #[arg(long, value_name = "FLIGHT", conflicts_with_all = ["slurm", "status", "collect", "shard"])]
    only: Option<u64>,
    /// Flights of a shard; an interruption loses only shards that are not complete [default: 100]
    #[arg(long, value_name = "N", value_parser = one_or_more::<u64>)]
    shard: Option<u64>,
    /// Print the progress of the campaign, and fly nothing
    #[arg(long, conflicts_with_all = ["slurm", "shard"])]
    status: bool,
    /// Write the results of the shards that are there, and fly nothing
    #[arg(long, conflicts_with_all = ["slurm", "status", "shard"])]
    collect: bool,
    /// Show the campaign in the browser while it flies [default ADDR: 127.0.0.1:8080]
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = "127.0.0.1:8080", value_parser = web::address)]
    web: Option<SocketAddr>,
    #[command(flatten)]
    token: TokenArgs,
    /// Run in real time whose measured delay, jitter or share of missed deadlines is shown beside that limit
    #[arg(long, value_name = "RUN", conflicts_with_all = ["plan", "only", "status"])]
    observed: Option<PathBuf>,
    #[command(flatten)]
    cluster: Cluster,
}

/// Campaign file, and folder of the results.
#[derive(Args)]
struct What {
    /// Campaign file (TOML), or the name of a shipped campaign
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Folder of the campaign [default: runs/NAME]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Fly this attitude controller too: a library of yours (repeatable)
    #[arg(long, value_name = "NAME=FILE")]
    controller: Vec<OwnController>,
}

#[derive(Subcommand)]
enum Command {
    /// Fly one shard, as a task of any scheduler
    #[command(hide = true)]
    Shard {
        #[command(flatten)]
        what: What,
        /// Index of the shard, from 0 on
        #[arg(long)]
        index: u64,
        /// Number of shards of the campaign
        #[arg(long, value_parser = clap::value_parser!(u64).range(1..=MAX_SHARDS))]
        of: u64,
    },
}

/// Options for flying on a cluster.
#[derive(Args)]
struct Cluster {
    /// Submit the shards to Slurm as a job array, and wait for them
    #[arg(long)]
    slurm: bool,
    /// Slurm: partition
    #[arg(long, requires = "slurm")]
    partition: Option<String>,
    /// Slurm: time limit of a task, in the form of `sbatch --time`
    #[arg(long, requires = "slurm")]
    time: Option<String>,
    /// Slurm: cores of a task
    #[arg(long, requires = "slurm", default_value_t = 1, value_parser = one_or_more::<u32>)]
    cpus: u32,
    /// Slurm: command of the program that flies, as the compute nodes see it, instead of this one
    #[arg(long, requires = "slurm", value_name = "COMMAND")]
    program: Option<String>,
    /// Slurm: submit and do not wait
    #[arg(long, requires = "slurm")]
    detach: bool,
}

/// Parses a whole number above 0. Clap's own range is not used, because its error names the largest number of the type.
fn one_or_more<T: FromStr + PartialOrd + From<u8>>(text: &str) -> Result<T, String> {
    text.parse().ok().filter(|number| *number >= T::from(1)).ok_or_else(|| "give a whole number, 1 or more".to_owned())
}

/// Runs the command; returns the exit code.
pub fn campaign(args: &CampaignArgs) -> anyhow::Result<u8> {
    if let Some(Command::Shard { what, index, of }) = &args.command {
        return fly_shard(what, *index, *of);
    }
    let what = args.what.as_ref().context("no campaign file")?;
    let plan = what.plan()?;
    let out = what.out(&plan);
    let shards = args.shard.map(|flights| plan.flights().div_ceil(flights));
    let flies_here = !(args.plan || args.only.is_some() || args.status || args.collect || args.cluster.slurm);
    ensure!(
        flies_here || args.web.is_none(),
        "--web shows a campaign that this command flies on this machine; --slurm, --only, --plan, --status and --collect \
         have no page, and `trefoil campaign FILE --collect` writes campaign.html of the flights that are there"
    );
    let shown = ResultsView::new(what.again(), &plan, args.observed.as_deref())?;
    let page = OpenPage::open(args.web, &args.token)?;
    if args.plan {
        print_plan(&plan);
        return Ok(exit::FLOWN);
    }
    if let Some(number) = args.only {
        return fly_again(&plan, number, &out);
    }
    if args.status || args.collect {
        let folder = CampaignFolder::open(&out, &plan, None, FolderAccess::Reading)?;
        return if args.status { status(&plan, &folder) } else { conclude(&plan, &folder, &shown) };
    }
    plan.check().and_then(|()| seeds::check(&plan)).with_context(|| what.file.display().to_string())?;
    if args.cluster.slurm {
        on_slurm(&args.cluster, &out, &plan, shards, &shown)
    } else {
        fly_here(&out, &plan, shards, page, &shown)
    }
}

impl What {
    fn plan(&self) -> anyhow::Result<Plan> {
        scenarios::tell(ShippedKind::Campaign, &self.file);
        Plan::new(Campaign::load_with(&self.file, &self.controller)?).with_context(|| self.file.display().to_string())
    }

    fn out(&self, plan: &Plan) -> PathBuf {
        self.out.clone().unwrap_or_else(|| Path::new("runs").join(plan.campaign.name()))
    }

    /// Returns the command that flies one flight of this campaign again; the caller appends the number.
    fn again(&self) -> String {
        let out = self.out.as_ref().map_or(String::new(), |out| format!(" --out {}", out.display()));
        let own = self.controller.iter().fold(String::new(), |all, own| all + " " + &own.argument());
        format!("trefoil campaign {}{own}{out} --only", self.file.display())
    }
}

/// Flies the missing shards on all cores of this machine; returns the exit code.
fn fly_here(
    out: &Path,
    plan: &Plan,
    shards: Option<u64>,
    page: Option<OpenPage>,
    shown: &ResultsView,
) -> anyhow::Result<u8> {
    let folder = CampaignFolder::open(out, plan, shards, FolderAccess::Alone)?;
    // Reads the shards that exist, so that a damaged shard is an error before any flight.
    let (there, missing) = folder.collect(plan)?;
    if there.rows() > 0 {
        let more =
            if missing.is_empty() { ", and none is flown again; --out flies them into another folder" } else { "" };
        eprint_line(&format!(
            "{} of {} {} are there already{more}",
            there.rows(),
            plan.flights(),
            plan.campaign.units()
        ));
    }
    // Signals are caught only from here on: until now nothing has begun, and a signal may end the program.
    let interrupts = catch_interrupts()?;
    let fly = |landed: &mut dyn FnMut(&local::Progress, &[Cell])| {
        let code = fly_missing(plan, &folder, &missing, &interrupts, landed);
        let concluded = conclude(plan, &folder, shown)?;
        Ok(if code == exit::FLOWN { concluded } else { code })
    };
    let Some(page) = page else {
        drop(there);
        return fly(&mut |_, _| {});
    };
    // Flights so far, in the order in which they came, and words on the state of the campaign.
    let so_far = Mutex::new((there, "no flight has ended yet".to_owned()));
    let lock = || so_far.lock().unwrap_or_else(PoisonError::into_inner);
    page.while_running(
        || {
            let (flights, words) = lock().clone();
            under_way::page(plan, &flights, &words, &shown.again)
        },
        || {
            let code = fly(&mut |now, row| {
                let mut so_far = lock();
                so_far.0.push(row.to_vec());
                so_far.1 = now.describe().replace("   ", ", ");
            });
            lock().1 = "no more flights are flown; campaign.html in the campaign's folder has the rest".into();
            code
        },
    )?
}

/// Flies the missing shards, and prints the reason if it stops early; `landed` gets each flight. Returns the exit code.
fn fly_missing(
    plan: &Plan,
    folder: &CampaignFolder,
    missing: &[u64],
    interrupts: &AtomicU32,
    landed: &mut dyn FnMut(&local::Progress, &[Cell]),
) -> u8 {
    let progress = ProgressLine::start();
    let flown = local::fly(plan, folder, missing, interrupts, |now, row| {
        landed(now, row);
        progress.show(|| now.describe());
    });
    progress.finish();
    match flown {
        Ok(true) => exit::FLOWN,
        Ok(false) => {
            eprint_line("interrupted; the same command continues");
            exit::INTERRUPTED
        }
        Err(error) => {
            eprint_line(&format!("error: {error:#}; when there is room again, the same command continues"));
            exit::PROCESS_LOST
        }
    }
}

/// Flies one shard, as a task of any scheduler; returns the exit code.
fn fly_shard(what: &What, index: u64, of: u64) -> anyhow::Result<u8> {
    let plan = what.plan()?;
    ensure!(
        of <= plan.flights(),
        "--of {of}: the campaign has {} flights, and each shard at least one",
        plan.flights()
    );
    ensure!(index < of, "--index {index}: the shards have the numbers 0 to {}", of - 1);
    plan.check().with_context(|| what.file.display().to_string())?;
    let folder = CampaignFolder::open(&what.out(&plan), &plan, Some(of), FolderAccess::WithShards)?;
    if folder.read(&plan, index)?.is_some() {
        eprint_line(&format!("shard {index} is there already"));
        return Ok(exit::FLOWN);
    }
    let code = fly_missing(&plan, &folder, &[index], &*catch_interrupts()?, &mut |_, _| {});
    if code == exit::FLOWN {
        eprint_line(&format!("shard {index} of {of} is flown"));
    }
    Ok(code)
}

/// Submits the missing shards to Slurm, and waits for them unless detached; returns the exit code.
fn on_slurm(
    cluster: &Cluster,
    out: &Path,
    plan: &Plan,
    shards: Option<u64>,
    shown: &ResultsView,
) -> anyhow::Result<u8> {
    let interrupts = catch_interrupts()?;
    let folder = CampaignFolder::open(out, plan, shards, FolderAccess::WithShards)?;
    let job = slurm::Job {
        partition: cluster.partition.clone(),
        time: cluster.time.clone(),
        cpus: cluster.cpus,
        program: cluster.program.clone(),
    };
    let progress = ProgressLine::start();
    let detach = cluster.detach;
    let ended = slurm::fly(&job, &folder, detach, &interrupts, |line| progress.show(|| line.to_owned()));
    progress.finish();
    match ended? {
        slurm::ArrayEnd::Complete => conclude(plan, &folder, shown),
        slurm::ArrayEnd::Detached => {
            eprint_line("submitted; `--status` says how far it is, the same command without `--detach` waits for it");
            Ok(exit::FLOWN)
        }
        slurm::ArrayEnd::Failed(why) => {
            eprint_line(&format!("error: {why}"));
            Ok(exit::PROCESS_LOST)
        }
        slurm::ArrayEnd::Interrupted => {
            eprint_line("no longer waiting, but the tasks fly on: the same command waits again, `scancel` ends them");
            Ok(exit::INTERRUPTED)
        }
    }
}

fn status(plan: &Plan, folder: &CampaignFolder) -> anyhow::Result<u8> {
    let (_, missing) = folder.collect(plan)?;
    let there = folder.layout.shards - missing.len() as u64;
    let (shards, units) = (folder.layout.shards, plan.campaign.units());
    print(&format!("{there} of {shards} shards of {} {units} are there\n", folder.layout.flights));
    if let Some(tasks) = slurm::status(folder) {
        print(&format!("{tasks}\n"));
    }
    Ok(if missing.is_empty() { exit::FLOWN } else { exit::PROCESS_LOST })
}

fn print_plan(plan: &Plan) {
    let names: Vec<String> = plan.columns().into_iter().map(|(name, _)| name).collect();
    let word = |cell: Cell| match cell {
        Cell::None => "-".to_owned(),
        Cell::Bool(yes) => yes.to_string(),
        Cell::Int(n) => n.to_string(),
        Cell::Real(x) => format!("{x:?}"),
        Cell::Text(text) => text,
    };
    print(&(names.join("\t") + "\n"));
    for number in 0..plan.flights() {
        let flight = plan.flight(number);
        let mut line: Vec<String> = plan.cells(&flight).into_iter().map(word).collect();
        line.push(flight.refusal().map_or(String::new(), |why| format!("invalid: {why}")));
        print(&(line.join("\t").trim_end().to_owned() + "\n"));
        if !is_read() {
            return;
        }
    }
}

/// Flies one flight again, with its log; an error if its shard is there and has another result for the flight.
fn fly_again(plan: &Plan, number: u64, out: &Path) -> anyhow::Result<u8> {
    ensure!(number < plan.flights(), "--only {number}: the flights have the numbers 0 to {}", plan.flights() - 1);
    let flight = row::told_of(plan, number);
    if CampaignFolder::is_there(out) {
        let folder = CampaignFolder::open(out, plan, None, FolderAccess::Reading)?;
        if let Some((table, row)) = folder.shard_with(plan, number)? {
            row::fly_again(&flight, &table, row, |_| {})?;
            print(&format!("flight {number} is the one of the table\n"));
        }
    }
    match flight.scenario {
        Ok(scenario) => fly::fly_scenario(scenario, &fly::FlyArgs::into_folder(out.join(format!("flight-{number}")))),
        Err(error) => bail!("flight {number} cannot be flown: {}", error.in_one_line()),
    }
}
