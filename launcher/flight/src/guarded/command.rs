//! Runs a whole command in a child process with the same arguments, because a library that the command loads may crash.

use std::process::Command;
use std::sync::OnceLock;
use std::{env, io};

use contract::exit;
use runtime::console::{eprint_line, keep_stdout};
use runtime::realtime::die_of_crashes;
use rustix::process::getppid;

use super::host::in_words;
use crate::strays::ChildMark;

/// Environment variable with the process ID of the child's parent: a process that the child starts inherits the
/// variable, but has another parent.
const CHILD_OF: &str = "TREFOIL_CHILD_OF";
/// Offset that the child adds to the exit code of the command, so that a library that calls `exit` is detected.
const TO_THE_END: u8 = 100;

/// Set in the child before it loads a library, which may clear the environment variables.
static IS_CHILD: OnceLock<()> = OnceLock::new();

/// Runs this command in a child, and prints an error if a library has ended the child. Returns the exit code; `None` in
/// the child itself.
///
/// # Errors
/// No child can be started.
pub fn command() -> io::Result<Option<u8>> {
    let parent = getppid().map(|parent| parent.as_raw_nonzero().get().to_string());
    if parent.is_some() && env::var(CHILD_OF).ok() == parent {
        IS_CHILD.get_or_init(|| ());
        die_of_crashes();
        keep_stdout()?;
        return Ok(None);
    }
    let mut child = Command::new(env::current_exe()?);
    let mark = ChildMark::on(&mut child);
    let status = child.args(env::args_os().skip(1)).env(CHILD_OF, std::process::id().to_string()).status();
    mark.kill_all();
    let status = status?;
    let code = status.code().and_then(|code| u8::try_from(code).ok()?.checked_sub(TO_THE_END));
    if code.is_none() {
        eprint_line(&format!("error: a library {}", in_words(status)));
    }
    Ok(code.or(Some(exit::PROCESS_LOST)))
}

/// Returns the exit code of this process, child or not, for a command that ended with `code`.
pub fn exit_code(code: u8) -> u8 {
    if IS_CHILD.get().is_some() { TO_THE_END + code } else { code }
}
