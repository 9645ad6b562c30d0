//! A cluster that Slurm schedules: a job array whose tasks fly a shard each, in a folder that all nodes share.
//!
//! What is done is told by the shards that are there, and what is under way by `squeue`: nothing else is remembered. A task that
//! is run twice, because its node was thought dead, writes the same shard twice. One that ends without its shard is submitted
//! again as long as others make progress.

use std::fs::{self, OpenOptions};
use std::io::ErrorKind;
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, anyhow, ensure};
use flight::files::write_whole;
use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;
use sha2::{Digest, Sha256};

use crate::folder::CampaignFolder;
use crate::hex::hex;

/// How often is looked.
const LOOK: Duration = Duration::from_secs(2);
/// So long a shard may take to be seen here after its task has ended.
const SEEN_LATE: Duration = Duration::from_secs(4);
/// So long the scheduler may give no answer.
const SILENT: Duration = Duration::from_secs(300);
/// Lines of a task's log that are told when it failed.
const TOLD_LINES: usize = 5;

/// How a task is run.
#[derive(Debug, Clone)]
pub struct Job {
    pub partition: Option<String>,
    pub time: Option<String>,
    pub cpus: u32,
    /// Words of a shell; absent = this program, by its path.
    pub program: Option<String>,
}

#[derive(Debug, PartialEq, Eq)]
pub enum Ended {
    /// Every shard is there.
    Complete,
    /// Its tasks fly on.
    Detached,
    Interrupted,
    /// The tasks ended without shards, and nothing came of submitting them again: why.
    Failed(String),
}

/// The tasks that are in the queue.
#[derive(Debug, Default, PartialEq, Eq)]
struct Queue {
    running: usize,
    pending: usize,
    /// Why the last one that is pending does not run.
    reason: Option<String>,
}

/// Has the missing shards of a campaign flown, and waits for them unless it is to `detach`. `show` is told how far it is.
///
/// # Errors
/// No scheduler, or one that refuses the job.
pub fn fly(
    job: &Job,
    folder: &CampaignFolder,
    detach: bool,
    interrupts: &AtomicU32,
    mut show: impl FnMut(&str),
) -> anyhow::Result<Ended> {
    let mut before = None;
    loop {
        let missing = folder.missing();
        if missing.is_empty() {
            return Ok(Ended::Complete);
        }
        if queue(folder)?.is_empty() {
            // What the last submission has not brought forward the next one will not either.
            if before.as_ref() == Some(&missing) {
                return Ok(Ended::Failed(failed(folder, &missing)));
            }
            submit(job, folder, &missing)?;
            before = Some(missing);
        }
        if detach {
            return Ok(Ended::Detached);
        }
        if !wait(folder, interrupts, &mut show)? {
            return Ok(Ended::Interrupted);
        }
    }
}

/// What the queue has of a campaign, in words; `None` where there is no scheduler, or it knows none of its tasks.
pub fn status(folder: &CampaignFolder) -> Option<String> {
    queue(folder).ok().filter(|queue| !queue.is_empty()).map(|queue| queue.describe())
}

/// Waits until no task is in the queue, or all shards are there; false when interrupted.
fn wait(folder: &CampaignFolder, interrupts: &AtomicU32, show: &mut impl FnMut(&str)) -> anyhow::Result<bool> {
    let mut answered = Instant::now();
    let mut empty_since: Option<Instant> = None;
    loop {
        if interrupts.load(Ordering::Relaxed) > 0 {
            return Ok(false);
        }
        let missing = folder.missing();
        if missing.is_empty() {
            return Ok(true);
        }
        match queue(folder) {
            Ok(queue) => {
                answered = Instant::now();
                let there = folder.layout.shards - missing.len() as u64;
                show(&format!("{there} of {} shards   {}", folder.layout.shards, queue.describe()));
                empty_since = if queue.is_empty() { empty_since.or(Some(answered)) } else { None };
            }
            Err(error) if answered.elapsed() > SILENT => return Err(error),
            Err(_) => {} // it is being restarted
        }
        if empty_since.is_some_and(|since| since.elapsed() > SEEN_LATE) {
            return Ok(true);
        }
        sleep(LOOK);
    }
}

impl Queue {
    fn of(text: &str) -> Self {
        let mut queue = Self::default();
        for line in text.lines() {
            let (state, reason) = line.split_once(' ').unwrap_or((line, ""));
            match state {
                "PENDING" | "CONFIGURING" | "REQUEUED" | "REQUEUE_HOLD" | "SPECIAL_EXIT" => {
                    queue.pending += 1;
                    queue.reason = Some(reason.to_owned()).filter(|reason| !["None", ""].contains(&reason.as_str()));
                }
                "RUNNING" | "COMPLETING" | "SUSPENDED" | "STAGE_OUT" | "SIGNALING" | "STOPPED" | "RESIZING" => {
                    queue.running += 1;
                }
                _ => {} // over
            }
        }
        queue
    }

    fn is_empty(&self) -> bool {
        self.running + self.pending == 0
    }

    fn describe(&self) -> String {
        let reason = self.reason.as_ref().map_or(String::new(), |reason| format!(" ({reason})"));
        format!("{} running, {} pending{reason}", self.running, self.pending)
    }
}

/// The name of a campaign's jobs: of this campaign into this folder.
fn name(folder: &CampaignFolder) -> anyhow::Result<String> {
    let path = fs::canonicalize(&folder.path)?;
    let hash = Sha256::digest(format!("{} {}", folder.layout.campaign, path.display()));
    Ok(format!("trefoil-{}", hex(&hash[..8])))
}

fn queue(folder: &CampaignFolder) -> anyhow::Result<Queue> {
    let mut command = Command::new("squeue");
    command.args(["--noheader", "--array", "--me", "--format=%T %r", "--name"]).arg(name(folder)?);
    Ok(Queue::of(&said(command)?))
}

/// Submits an array with a task for each of the missing shards.
fn submit(job: &Job, folder: &CampaignFolder, missing: &[u64]) -> anyhow::Result<()> {
    let path = fs::canonicalize(&folder.path)?;
    let own = path.join("slurm");
    fs::create_dir_all(&own)?;
    let lock = OpenOptions::new().create(true).truncate(false).write(true).open(own.join("lock"))?;
    ensure!(
        flock(&lock, FlockOperation::NonBlockingLockExclusive) != Err(Errno::WOULDBLOCK),
        "another campaign is submitting from {}; wait for it",
        path.display()
    );
    let program = match &job.program {
        Some(words) => words.clone(),
        None => {
            quoted(&std::env::current_exe().context("cannot find the path of this program; give it with --program")?)?
        }
    };
    let (campaign, out) = (quoted(&path.join("campaign.toml"))?, quoted(&path)?);
    let of = folder.layout.shards;
    let script = format!(
        "#!/bin/sh\nexec {program} campaign shard {campaign} --index \"$SLURM_ARRAY_TASK_ID\" --of {of} --out {out}\n"
    );
    let file = own.join("shard.sh");
    write_whole(&file, script.as_bytes())?;
    let mut command = Command::new("sbatch");
    command
        .args(["--parsable", "--requeue", "--open-mode=append", "--job-name", &name(folder)?])
        .arg(format!("--array={}", ranges(missing)))
        .arg(format!("--cpus-per-task={}", job.cpus))
        .arg(format!("--output={}", own.join("%a.log").display()))
        .args(job.partition.iter().map(|partition| format!("--partition={partition}")))
        .args(job.time.iter().map(|time| format!("--time={time}")))
        .arg(&file);
    said(command).context("the shards are not submitted").map(drop)
}

/// Runs a command of the scheduler; what it said.
fn said(mut command: Command) -> anyhow::Result<String> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| match error.kind() {
        ErrorKind::NotFound => anyhow!(
            "there is no `{name}` here: --slurm needs the commands of Slurm in PATH; without it the campaign flies on this machine"
        ),
        _ => anyhow!("cannot run `{name}`: {error}"),
    })?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    let hint = "`sinfo` says whether Slurm works on this machine";
    ensure!(output.status.success(), "`{name}` failed: {}; {hint}", stderr.trim());
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// Numbers in order, as `--array` has them: `0-3,7`.
fn ranges(numbers: &[u64]) -> String {
    let mut ranges: Vec<[u64; 2]> = vec![];
    for number in numbers {
        match ranges.last_mut() {
            Some([_, last]) if *last + 1 == *number => *last = *number,
            _ => ranges.push([*number; 2]),
        }
    }
    let one = |[first, last]: &[u64; 2]| if first == last { first.to_string() } else { format!("{first}-{last}") };
    ranges.iter().map(one).collect::<Vec<_>>().join(",")
}

/// A path as one word of a shell.
fn quoted(path: &Path) -> anyhow::Result<String> {
    let text = path.to_str().with_context(|| format!("the path {} is not text", path.display()))?;
    Ok(format!("'{}'", text.replace('\'', r"'\''")))
}

/// Why nothing comes of the missing shards: what the first of their tasks said last, and how it ended where Slurm keeps accounts.
fn failed(folder: &CampaignFolder, missing: &[u64]) -> String {
    let first = missing.first().copied().unwrap_or_default();
    let path = folder.path.join("slurm").join(format!("{first}.log"));
    let log = fs::read_to_string(&path).unwrap_or_default();
    let lines: Vec<&str> = log.lines().collect();
    let last = lines[lines.len().saturating_sub(TOLD_LINES)..].join("\n  ");
    let last = if last.is_empty() { "nothing; ask the scheduler what became of it".to_owned() } else { last };
    let how = account(folder, first).map_or(String::new(), |state| format!("; Slurm ended task {first} as {state}"));
    format!(
        "the tasks of {} shards ended without them ({}){how}; {} says:\n  {last}\nthe same command submits them again",
        missing.len(),
        ranges(missing),
        path.display()
    )
}

/// How the last task of a shard ended, as `TIMEOUT`; `None` where Slurm keeps no accounts.
fn account(folder: &CampaignFolder, shard: u64) -> Option<String> {
    let mut command = Command::new("sacct");
    command.args(["-XnP", "--format=JobID,State", "--starttime=now-30days", "--name"]).arg(name(folder).ok()?);
    let task = format!("_{shard}");
    let of_task =
        |line: &str| line.split_once('|').filter(|(id, _)| id.ends_with(&task)).map(|(_, state)| state.to_owned());
    said(command).ok()?.lines().rev().find_map(of_task)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_names_the_missing_shards() {
        assert_eq!(ranges(&[0, 1, 2, 5, 7, 8]), "0-2,5,7-8");
        assert_eq!(ranges(&[3]), "3");
    }

    #[test]
    fn a_queue_is_what_has_not_ended() {
        let queue =
            Queue::of("RUNNING None\nPENDING Resources\nCOMPLETING None\nNODE_FAIL NodeDown\nPENDING BeginTime\n");
        assert_eq!(queue, Queue { running: 2, pending: 2, reason: Some("BeginTime".into()) });
        assert_eq!(queue.describe(), "2 running, 2 pending (BeginTime)");
        assert!(Queue::of("").is_empty() && Queue::of("FAILED NonZeroExitCode").is_empty());
    }

    #[test]
    fn a_path_is_one_word_of_a_shell() {
        assert_eq!(quoted(Path::new("/a b/it's")).unwrap(), r"'/a b/it'\''s'");
    }
}
