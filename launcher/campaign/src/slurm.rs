//! A cluster that Slurm schedules: a job array whose tasks fly a shard each, in a folder that all nodes share.
//!
//! What is done is told by the shards that are there, and what is under way by `squeue`: nothing else is remembered. A task that
//! is run twice, because its node was thought dead, writes the same shard twice. One that ends without its shard is submitted
//! again as long as others make progress.

use std::fs;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;
use std::process::Command;
use std::sync::atomic::{AtomicU32, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, ensure};
use flight::dir::Dir;
use rustix::fs::FlockOperation;
use sha2::{Digest, Sha256};

use crate::folder::CampaignFolder;
use crate::hex::hex;
use crate::scheduler::{self, Said};

/// The folder of what was submitted and of what the tasks said.
const OWN: &str = "slurm";
/// How often is looked.
const LOOK: Duration = Duration::from_secs(2);
/// How often an interrupt is looked for meanwhile.
const NAP: Duration = Duration::from_millis(50);
/// So long a shard may take to be seen here after its task has ended.
const SEEN_LATE: Duration = Duration::from_secs(4);
/// So long the scheduler may give no answer.
const SILENT: Duration = Duration::from_secs(300);
/// Lines of a task's log that are told when it failed, and how much of its end is read for them \[bytes\].
const TOLD_LINES: usize = 5;
const TOLD_BYTES: u64 = 1 << 14;

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
        let missing = folder.missing()?;
        if missing.is_empty() {
            return Ok(Ended::Complete);
        }
        let Some(queue) = queue(folder, interrupts)? else { return Ok(Ended::Interrupted) };
        if queue.is_empty() {
            // What the last submission has not brought forward the next one will not either.
            if before.as_ref() == Some(&missing) {
                return Ok(Ended::Failed(failed(folder, &missing, interrupts)));
            }
            if !submit(job, folder, &missing, interrupts)? {
                return Ok(Ended::Interrupted);
            }
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
    let queue = queue(folder, &AtomicU32::new(0)).ok().flatten();
    queue.filter(|queue| !queue.is_empty()).map(|queue| queue.describe())
}

/// Waits until no task is in the queue, or all shards are there; false when interrupted.
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
            Err(_) => {} // it is being restarted
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
    let path = fs::canonicalize(folder.dir.path())?;
    let hash = Sha256::digest(format!("{} {}", folder.layout.campaign, path.display()));
    Ok(format!("trefoil-{}", hex(&hash[..8])))
}

/// The queue; `None` when interrupted.
fn queue(folder: &CampaignFolder, interrupts: &AtomicU32) -> anyhow::Result<Option<Queue>> {
    let mut command = Command::new("squeue");
    command.args(["--noheader", "--array", "--me", "--format=%T %r", "--name"]).arg(name(folder)?);
    Ok(said(command, "", interrupts)?.map(|text| Queue::of(&text)))
}

/// Submits an array with a task for each of the missing shards; false when interrupted, perhaps too late to keep it from flying.
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
    // For people. The scheduler gets the text itself: what has the name by then may be another's.
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

/// The folder with what was submitted and what the tasks said.
fn own_folder(folder: &CampaignFolder, make: bool) -> anyhow::Result<Dir> {
    let own = if make { folder.dir.make_folder(OWN) } else { folder.dir.folder(OWN) };
    own.with_context(|| format!("cannot use the folder {}", folder.dir.at(OWN).display()))
}

/// Runs a command of the scheduler with `input`; what it said, `None` when interrupted.
fn said(command: Command, input: &str, interrupts: &AtomicU32) -> anyhow::Result<Option<String>> {
    let name = command.get_program().to_string_lossy().into_owned();
    let Some(Said { stdout, stderr, status }) = scheduler::run(command, input, interrupts)? else { return Ok(None) };
    let hint = "`sinfo` says whether Slurm works on this machine";
    ensure!(status.success(), "`{name}` failed: {}; {hint}", stderr.trim());
    Ok(Some(stdout))
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
    let last = if last.is_empty() { "nothing; ask the scheduler what became of it".to_owned() } else { last };
    let state = account(folder, first, interrupts);
    let how = state.map_or(String::new(), |state| format!("; Slurm ended task {first} as {state}"));
    format!(
        "the tasks of {} shards ended without them ({}){how}; {} says:\n  {last}\nthe same command submits them again",
        missing.len(),
        ranges(missing),
        folder.dir.at(OWN).join(log).display()
    )
}

/// The last lines of a file, which may be of any length.
fn end_of(own: &Dir, name: &str) -> anyhow::Result<String> {
    let (mut file, bytes) = own.file(name, u64::MAX)?;
    file.seek(SeekFrom::Start(bytes.saturating_sub(TOLD_BYTES)))?;
    let mut end = vec![];
    file.take(TOLD_BYTES).read_to_end(&mut end)?;
    Ok(String::from_utf8_lossy(&end).into_owned())
}

/// How the last task of a shard ended, as `TIMEOUT`; `None` where Slurm keeps no accounts.
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
