//! Flies a campaign on a Slurm cluster: a job array whose tasks fly a shard each, in a folder that all nodes share.
//!
//! The shards in the folder tell what is done, and `squeue` tells what is under way; no other state is kept. A task
//! that runs twice, because its node was thought dead, writes the same shard twice. A task that ends without its shard
//! is submitted again, unless the last submission added no shard.

use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use flight::programs::hex;
use folder::dir::Dir;
use rustix::fs::FlockOperation;
use sha2::{Digest, Sha256};

use crate::folder::CampaignFolder;
use crate::scheduler::{self, Said};

/// Folder of the submitted script and of the logs of the tasks.
const OWN: &str = "slurm";
/// Interval between two calls of `squeue`.
const LOOK: Duration = Duration::from_secs(2);
/// Interval between two checks for an interrupt.
const NAP: Duration = Duration::from_millis(50);
/// Longest delay until a shard is visible here after its task ended.
const SEEN_LATE: Duration = Duration::from_secs(4);
/// Longest time that the scheduler may give no answer.
const SILENT: Duration = Duration::from_secs(300);
/// Number of lines of a failed task's log that are shown, and of bytes at its end that are read for them.
const TOLD_LINES: usize = 5;
const TOLD_BYTES: u64 = 1 << 14;

/// Options of a task.
#[derive(Debug, Clone)]
pub struct Job {
    pub partition: Option<String>,
    pub time: Option<String>,
    pub cpus: u32,
    /// Command for a shell; `None` = the path of this program.
    pub program: Option<String>,
}

#[derive(Debug, PartialEq, Eq)]
pub enum ArrayEnd {
    /// All shards exist.
    Complete,
    /// Returned without waiting; the tasks continue.
    Detached,
    Interrupted,
    /// Tasks ended without their shards, and the last submission added no shard; holds the reason.
    Failed(String),
}

/// Tasks in the queue.
#[derive(Debug, Default, PartialEq, Eq)]
struct Queue {
    running: usize,
    pending: usize,
    /// Reason that Slurm gives for the last pending task.
    reason: Option<String>,
}

/// Submits the missing shards of a campaign, and waits for them unless `detach`. Calls `show` with the progress.
///
/// # Errors
/// There is no scheduler, or it refuses the job.
pub fn fly(
    job: &Job,
    folder: &CampaignFolder,
    detach: bool,
    interrupts: &AtomicU32,
    mut show: impl FnMut(&str),
) -> anyhow::Result<ArrayEnd> {
    let mut before = None;
    loop {
        let missing = folder.missing()?;
        if missing.is_empty() {
            return Ok(ArrayEnd::Complete);
        }
        let Some(queue) = queue(folder, interrupts)? else { return Ok(ArrayEnd::Interrupted) };
        if queue.is_empty() {
            // Give up: the last submission added no shard.
            if before.as_ref() == Some(&missing) {
                return Ok(ArrayEnd::Failed(failed(folder, &missing, interrupts)));
            }
            if !submit(job, folder, &missing, interrupts)? {
                return Ok(ArrayEnd::Interrupted);
            }
            before = Some(missing);
        }
        if detach {
            return Ok(ArrayEnd::Detached);
        }
        if !wait(folder, interrupts, &mut show)? {
            return Ok(ArrayEnd::Interrupted);
        }
    }
}

/// Describes the tasks of a campaign in the queue; `None` if there is no scheduler or it knows none of them.
pub fn status(folder: &CampaignFolder) -> Option<String> {
    let queue = queue(folder, &AtomicU32::new(0)).ok().flatten();
    queue.filter(|queue| !queue.is_empty()).map(|queue| queue.describe())
}

/// Waits until no task is in the queue or all shards exist; returns `false` if interrupted.
fn wait(folder: &CampaignFolder, interrupts: &AtomicU32, show: &mut impl FnMut(&str)) -> anyhow::Result<bool> {
    let mut answered = Instant::now();
    let mut empty_since: Option<Instant> = None;
    loop {
        if interrupts.load(Ordering::Relaxed) > 0 {
            return Ok(false);
        }
        let missing = folder.missing()?;
        if missing.is_empty() {
            return Ok(true);
        }
        match queue(folder, interrupts) {
            Ok(None) => return Ok(false),
            Ok(Some(queue)) => {
                answered = Instant::now();
                let there = folder.layout.shards - missing.len() as u64;
                show(&format!("{there} of {} shards   {}", folder.layout.shards, queue.describe()));
                empty_since = if queue.is_empty() { empty_since.or(Some(answered)) } else { None };
            }
            Err(error) if answered.elapsed() > SILENT => return Err(error),
            Err(_) => {} // the scheduler may be restarting
        }
        if empty_since.is_some_and(|since| since.elapsed() > SEEN_LATE) {
            return Ok(true);
        }
        let looked = Instant::now();
        while looked.elapsed() < LOOK && interrupts.load(Ordering::Relaxed) == 0 {
            sleep(NAP);
        }
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
                _ => {} // ended
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

/// Returns the name of the jobs of this campaign in this folder.
fn name(folder: &CampaignFolder) -> anyhow::Result<String> {
    let path = fs::canonicalize(folder.dir.path())?;
    let hash = Sha256::digest(format!("{} {}", folder.layout.campaign, path.display()));
    Ok(format!("trefoil-{}", hex(&hash[..8])))
}

/// Asks for the queue; `None` if interrupted.
fn queue(folder: &CampaignFolder, interrupts: &AtomicU32) -> anyhow::Result<Option<Queue>> {
    let mut command = Command::new("squeue");
    command.args(["--noheader", "--array", "--me", "--format=%T %r", "--name"]).arg(name(folder)?);
    Ok(said(command, "", interrupts)?.map(|text| Queue::of(&text)))
}

/// Submits an array with a task for each missing shard; returns `false` if interrupted, perhaps after the submission.
fn submit(job: &Job, folder: &CampaignFolder, missing: &[u64], interrupts: &AtomicU32) -> anyhow::Result<bool> {
    let path = fs::canonicalize(folder.dir.path())?;
    let own = own_folder(folder, true)?;
    let lock = own.lock("lock", FlockOperation::NonBlockingLockExclusive)?;
    let _lock = lock.with_context(|| format!("another campaign is submitting from {}; wait for it", path.display()))?;
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
    // The file is for the user. The scheduler gets the text itself, because another program could replace the file.
    own.write_whole("shard.sh", script.as_bytes())?;
    let mut command = Command::new("sbatch");
    command
        .args(["--parsable", "--requeue", "--open-mode=append", "--job-name", &name(folder)?])
        .arg(format!("--array={}", ranges(missing)))
        .arg(format!("--cpus-per-task={}", job.cpus))
        .arg(format!("--output={}", path.join(OWN).join("%a.log").display()))
        .args(job.partition.iter().map(|partition| format!("--partition={partition}")))
        .args(job.time.iter().map(|time| format!("--time={time}")));
    Ok(said(command, &script, interrupts).context("the shards are not submitted")?.is_some())
}

/// Opens the folder of the script and the logs; with `make` an absent folder is created.
fn own_folder(folder: &CampaignFolder, make: bool) -> anyhow::Result<Dir> {
    let own = if make { folder.dir.make_folder(OWN) } else { folder.dir.folder(OWN) };
    own.with_context(|| format!("cannot use the folder {}", folder.dir.at(OWN).display()))
}

/// Runs a command of the scheduler with `input` and returns its output; `None` if interrupted.
fn said(command: Command, input: &str, interrupts: &AtomicU32) -> anyhow::Result<Option<String>> {
    let name = command.get_program().to_string_lossy().into_owned();
    let Some(Said { stdout, stderr, status }) = scheduler::run(command, input, interrupts)? else { return Ok(None) };
    let hint = "`sinfo` says whether Slurm works on this machine";
    ensure!(status.success(), "`{name}` failed: {}; {hint}", stderr.trim());
    Ok(Some(stdout))
}

/// Formats rising numbers for `--array`: `0-3,7`.
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

/// Quotes a path as one word of a shell.
fn quoted(path: &Path) -> anyhow::Result<String> {
    let text = path.to_str().with_context(|| format!("the path {} is not text", path.display()))?;
    Ok(format!("'{}'", text.replace('\'', r"'\''")))
}

/// Explains missing shards: the last log lines of the first one's task, and the task's end state if Slurm keeps
/// accounts.
fn failed(folder: &CampaignFolder, missing: &[u64], interrupts: &AtomicU32) -> String {
    let first = missing.first().copied().unwrap_or_default();
    let log = format!("{first}.log");
    let last = match own_folder(folder, false).and_then(|own| end_of(&own, &log)) {
        Ok(text) => {
            let lines: Vec<&str> = text.lines().collect();
            lines[lines.len().saturating_sub(TOLD_LINES)..].join("\n  ")
        }
        Err(error) => format!("nothing that can be read: {error:#}"),
    };
    let last = if last.is_empty() { "nothing; ask the scheduler for the state of the task".to_owned() } else { last };
    let state = account(folder, first, interrupts);
    let how = state.map_or(String::new(), |state| format!("; Slurm ended task {first} as {state}"));
    format!(
        "the tasks of {} shards ended without them ({}){how}; {} says:\n  {last}\nthe same command submits them again",
        missing.len(),
        ranges(missing),
        folder.dir.at(OWN).join(log).display()
    )
}

/// Reads the last [`TOLD_BYTES`] of a file of any length.
fn end_of(own: &Dir, name: &str) -> anyhow::Result<String> {
    let (mut file, bytes) = own.file(name, u64::MAX)?;
    file.seek(SeekFrom::Start(bytes.saturating_sub(TOLD_BYTES)))?;
    let mut end = vec![];
    file.take(TOLD_BYTES).read_to_end(&mut end)?;
    Ok(String::from_utf8_lossy(&end).into_owned())
}

/// Returns the end state of the last task of a shard, for instance `TIMEOUT`; `None` if Slurm keeps no accounts.
fn account(folder: &CampaignFolder, shard: u64, interrupts: &AtomicU32) -> Option<String> {
    let mut command = Command::new("sacct");
    command.args(["-XnP", "--format=JobID,State", "--starttime=now-30days", "--name"]).arg(name(folder).ok()?);
    let task = format!("_{shard}");
    let of_task =
        |line: &str| line.split_once('|').filter(|(id, _)| id.ends_with(&task)).map(|(_, state)| state.to_owned());
    said(command, "", interrupts).ok()??.lines().rev().find_map(of_task)
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
    fn a_queue_counts_tasks_that_have_not_ended() {
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
