//! Runs a command of a scheduler to its end or to an interrupt, and limits its output.

use std::io::{ErrorKind, Read, Write};
use std::process::{Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use anyhow::{anyhow, ensure};

/// Largest output of a command \[bytes\]: `squeue` prints a line of about 20 bytes for each of 99 999 tasks.
const MAX_SAID: u64 = 16 << 20;
/// Length of the error output that is kept \[bytes\].
const MAX_ERRORS: usize = 2000;
/// Interval between two checks whether the command has ended.
const NAP: Duration = Duration::from_millis(20);
/// Longest wait for output after the command ended, because a process that it started may hold the pipe.
const LAST_OUTPUT: Duration = Duration::from_secs(2);

/// Output and exit status of a command.
pub struct Said {
    pub stdout: String,
    pub stderr: String,
    pub status: ExitStatus,
}

/// Runs a command with `input`; returns `None` if `interrupts` ended it.
///
/// # Errors
/// The command does not exist, cannot be run, or prints more than [`MAX_SAID`]; then it is killed.
pub fn run(mut command: Command, input: &str, interrupts: &AtomicU32) -> anyhow::Result<Option<Said>> {
    let name = command.get_program().to_string_lossy().into_owned();
    let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.map_err(|error| match error.kind() {
        ErrorKind::NotFound => anyhow!(
            "there is no `{name}` here: --slurm needs the commands of Slurm in PATH; without it the campaign flies on this machine"
        ),
        _ => anyhow!("cannot run `{name}`: {error}"),
    })?;
    if let Some(mut stdin) = child.stdin.take() {
        let input = input.as_bytes().to_vec();
        thread::spawn(move || stdin.write_all(&input)); // fails if the command does not read it: no harm
    }
    let stdout = read(child.stdout.take());
    let stderr = read(child.stderr.take());
    let (mut said, mut is_interrupted) = (None, false);
    let status = loop {
        said = said.or_else(|| stdout.try_recv().ok());
        let is_too_much = said.as_ref().is_some_and(|said: &Vec<u8>| said.len() as u64 > MAX_SAID);
        is_interrupted |= interrupts.load(Ordering::Relaxed) > 0;
        if is_too_much || is_interrupted {
            let _ = child.kill(); // fails if the command has ended
        }
        match child.try_wait()? {
            Some(status) => break status,
            None => thread::sleep(NAP),
        }
    };
    if is_interrupted {
        return Ok(None);
    }
    let said = said.or_else(|| stdout.recv_timeout(LAST_OUTPUT).ok()).unwrap_or_default();
    let megabytes = MAX_SAID >> 20;
    ensure!(said.len() as u64 <= MAX_SAID, "`{name}` says more than {megabytes} MB: is it the one of Slurm?");
    let mut stderr = stderr.recv_timeout(LAST_OUTPUT).unwrap_or_default();
    stderr.truncate(MAX_ERRORS);
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    Ok(Some(Said { stdout: text(&said), stderr: text(&stderr), status }))
}

/// Reads in a thread to the end or to [`MAX_SAID`] + 1 bytes; closing the pipe then ends a writer that continues.
fn read(from: Option<impl Read + Send + 'static>) -> Receiver<Vec<u8>> {
    let (done, bytes) = channel();
    thread::spawn(move || {
        let Some(from) = from else { return };
        let mut read = vec![];
        let _ = from.take(MAX_SAID + 1).read_to_end(&mut read); // keeps what was read before an error
        let _ = done.send(read); // the caller may no longer wait
    });
    bytes
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use super::*;

    fn sh(script: &str, input: &str, interrupts: u32) -> anyhow::Result<Option<Said>> {
        let mut command = Command::new("sh");
        command.args(["-c", script]);
        run(command, input, &AtomicU32::new(interrupts))
    }

    #[test]
    fn output_and_exit_status_of_a_command_are_returned() {
        let said = sh("cat; echo twice >&2; exit 3", "input", 0).unwrap().unwrap();
        assert_eq!((said.stdout.as_str(), said.stderr.as_str(), said.status.code()), ("input", "twice\n", Some(3)));
    }

    #[test]
    fn endless_output_of_a_command_is_cut() {
        let said = format!("{:#}", sh("yes", "", 0).err().expect("refused"));
        assert!(said.contains("`sh` says more than 16 MB"), "{said}");
        let errors = sh("yes | head -c 300000000 >&2", "", 0).unwrap().unwrap();
        assert_eq!(errors.stderr.len(), MAX_ERRORS);
    }

    #[test]
    fn a_command_that_hangs_ends_with_an_interrupt() {
        assert!(sh("exec sleep 1000", "", 1).unwrap().is_none());
        let begun = Instant::now();
        assert!(sh("sleep 5 & exit 0", "", 0).unwrap().is_some(), "one that it started holds the pipe");
        assert!(begun.elapsed() >= LAST_OUTPUT);
    }
}
