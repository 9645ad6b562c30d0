//! A node as a program: a user's controller is three lines around [`main`]. The launcher runs its own nodes by
//! [`run_as`], as `trefoil node NAME`.

use std::path::Path;
use std::process::ExitCode;

use rustix::process::Signal;

use crate::console;
use crate::domain::Domain;
use crate::error::SessionError;
use crate::realtime;
use crate::session::NodeSession;
use contract::exit;

/// Runs one node as this process: joins the namespace named in the arguments, runs, and reports an error on stderr.
///
/// The process dies with its parent, the launcher.
pub fn main(name: &str, run: fn(NodeSession) -> Result<(), SessionError>) -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let epoch_of = |word: &str| word.parse().ok().filter(|epoch| *epoch > 0);
    let (namespace, epoch, own) = match words.as_slice() {
        ["--namespace", namespace] => (namespace, Some(1), None),
        ["--namespace", namespace, "--epoch", epoch] => (namespace, epoch_of(epoch), None),
        ["--namespace", namespace, "--epoch", epoch, "--settings", own] => (namespace, epoch_of(epoch), Some(own)),
        _ => return usage(name),
    };
    epoch.map_or_else(|| usage(name), |epoch| run_as(name, namespace, epoch, own.map(Path::new), run))
}

/// Runs one node as this process, as [`main`] does, with the arguments already parsed.
pub fn run_as(
    name: &str,
    namespace: &str,
    epoch: u32,
    own: Option<&Path>,
    run: fn(NodeSession) -> Result<(), SessionError>,
) -> ExitCode {
    realtime::name_in_crashes(name);
    realtime::tell_of_crashes();
    let session = die_with_launcher(namespace).and_then(|()| NodeSession::join(namespace, name, epoch, own));
    match session.and_then(run) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::eprint_line(&format!("{name}: {error}"));
            let late = matches!(error, SessionError::Late { .. });
            console::finish(if late { exit::BUDGET_BROKEN } else { exit::PROCESS_LOST }).into()
        }
    }
}

/// Makes the kernel kill this process when its parent ends. The parent must be the launcher of `namespace`, or a
/// debugger that the launcher started and that traces this process; any other parent is an error.
///
/// The launcher binds programs other than ours before they begin ([`realtime::die_with_parent`]).
pub fn die_with_launcher(namespace: &str) -> Result<(), SessionError> {
    // Fails only for a signal number that does not exist.
    let _ = rustix::process::set_parent_process_death_signal(Some(Signal::KILL));
    // If the launcher died before this call, no signal comes any more, and the parent is another process.
    let parent = rustix::process::getppid().map(|pid| pid.as_raw_nonzero().get());
    let launcher = Domain::find(namespace)?.launcher_pid();
    let debugger_of = |parent: i32| {
        (number_of("self", "TracerPid:") == Some(parent)).then(|| number_of(&parent.to_string(), "PPid:")).flatten()
    };
    if parent == launcher || parent.and_then(debugger_of) == launcher {
        Ok(())
    } else {
        Err(SessionError::Orphan(namespace.into()))
    }
}

/// Reads the number in a `field` of the status of a process; `None` if there is no such field or process.
fn number_of(process: &str, field: &str) -> Option<i32> {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    status.lines().find_map(|line| line.strip_prefix(field)?.trim().parse().ok())
}

fn usage(name: &str) -> ExitCode {
    console::eprint_line(&format!(
        "usage: {name} --namespace NAME [--epoch NUMBER [--settings FILE]]\nThe launcher starts this program, which ends with it."
    ));
    console::finish(exit::USAGE).into()
}
