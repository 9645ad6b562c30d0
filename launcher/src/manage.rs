//! `status` and `stop`: list the flying stacks, and end one.

mod table;

use std::time::{Duration, Instant};

use anyhow::bail;
use runtime::console::is_read;
use runtime::domain::Domain;
use serde_json::Value;

use flight::control::view::view;
use flight::control::{ControlRequest, ask};

use crate::target::{self, TargetArgs};
use runtime::console::{print, print_anew};
use table::describe;

/// Period of `status --watch`.
const WATCH: Duration = Duration::from_millis(500);

/// Arguments of `status`.
#[derive(clap::Args)]
pub struct StatusArgs {
    /// Namespace of the only stack to list
    #[arg(long)]
    namespace: Option<String>,
    /// Print JSON; with --watch, one document per line
    #[arg(long)]
    json: bool,
    /// Look again twice a second, until Ctrl-C
    #[arg(long)]
    watch: bool,
}

/// Prints the flying stacks: their time, their nodes, active faults, and the last events.
pub fn status(args: &StatusArgs) -> anyhow::Result<()> {
    let mut looked = false;
    loop {
        let is_meant = |domain: &&Domain| args.namespace.as_ref().is_none_or(|name| domain.namespace() == *name);
        let stacks: Vec<Value> = Domain::list().iter().filter(is_meant).map(view).collect();
        if let Some(name) = args.namespace.as_ref().filter(|_| stacks.is_empty() && !args.watch) {
            bail!("no stack is flying in namespace '{name}'; `trefoil status` lists those that do");
        }
        let text = match args {
            StatusArgs { json: true, watch: true, .. } => serde_json::to_string(&stacks)? + "\n",
            StatusArgs { json: true, .. } => serde_json::to_string_pretty(&stacks)? + "\n",
            _ if stacks.is_empty() => "no stack is flying\n".to_owned(),
            _ => stacks.iter().map(describe).collect::<Vec<_>>().join("\n"),
        };
        if looked && !args.json {
            print_anew(&text);
        } else {
            print(&text);
        }
        if !args.watch || !is_read() {
            return Ok(()); // a reader that has gone, as in `trefoil status --watch | head`, is no error
        }
        looked = true;
        std::thread::sleep(WATCH);
    }
}

/// Asks the launcher of a flight to end the flight, and waits until it has ended.
///
/// The request is not sent as a signal, because another process may have the launcher's ID in the PID namespace of this
/// process.
pub fn stop(args: &TargetArgs) -> anyhow::Result<()> {
    const LIMIT: Duration = Duration::from_secs(30);
    let domain = args.find()?;
    let flight = target::describe(&domain);
    let namespace = domain.namespace();
    ask(&domain, &ControlRequest::Stop)?;
    let deadline = Instant::now() + LIMIT;
    while domain.is_live() {
        if Instant::now() > deadline {
            let pid = domain.launcher_pid().map_or("its launcher".into(), |pid| format!("process {pid}"));
            bail!("the stack in '{namespace}' did not end within 30 s; kill {pid} to force it");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    print(&format!("stopped: {flight}\n"));
    Ok(())
}
