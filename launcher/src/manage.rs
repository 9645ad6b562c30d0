//! `status` and `stop`: look at stacks that fly, and end one.

mod table;

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use contract::domain::Domain;
use contract::file::{self, LARGEST_TEXT};
use contract::realtime::{Board, phase};
use contract::scenario;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::control::{Request, ask};
use crate::print;
use table::describe;

/// How often `status --watch` looks.
const WATCH: Duration = Duration::from_millis(500);

/// What makes an empty screen of a terminal, and begins at its top.
const CLEAR: &str = "\x1b[H\x1b[J";

/// Arguments of `status`.
#[derive(clap::Args)]
pub struct StatusArgs {
    /// Print JSON; with --watch, one document per line
    #[arg(long)]
    json: bool,
    /// Look again twice a second, until Ctrl-C
    #[arg(long)]
    watch: bool,
}

/// Lists the stacks that fly: how far they are, how their nodes are, what is broken, and what happened last.
pub fn status(args: &StatusArgs) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    let between = if out.is_terminal() { CLEAR } else { "\n" };
    let mut looked = false;
    loop {
        let stacks: Vec<Value> = Domain::list().iter().map(look).collect();
        let text = match args {
            StatusArgs { json: true, watch: true } => serde_json::to_string(&stacks)? + "\n",
            StatusArgs { json: true, .. } => serde_json::to_string_pretty(&stacks)? + "\n",
            _ if stacks.is_empty() => "no stack is flying\n".to_owned(),
            _ => stacks.iter().map(describe).collect::<Vec<_>>().join("\n"),
        };
        let between = if looked && !args.json { between } else { "" };
        let told = out.write_all((between.to_owned() + &text).as_bytes()).and_then(|()| out.flush());
        if !args.watch || told.is_err() {
            return Ok(()); // a reader that has gone, as in `launcher status --watch | head`, is no error
        }
        looked = true;
        std::thread::sleep(WATCH);
    }
}

/// What can be seen of one stack without joining it: settings and board. A guest that joins while the stack ends would
/// leave its own traces in the shared memory being wiped. What is gone already is absent.
fn look(domain: &Domain) -> Value {
    let mut view = json!({ "namespace": domain.namespace(), "launcher_pid": domain.launcher_pid() });
    let settings = file::read_text(&domain.file("scenario.toml"), LARGEST_TEXT).ok();
    let mut rate_hz = None;
    if let Some(scenario) = settings.and_then(|text| scenario::from_merged(&text, "settings").ok()) {
        view["name"] = json!(scenario.name);
        view["mode"] = json!(scenario.run.mode);
        view["profile"] = json!(scenario.profile);
        view["duration_s"] = json!(scenario.run.duration_s);
        rate_hz = Some(scenario.run.rate_hz);
    }
    if let Ok(board) = Board::open(&domain.file("board")) {
        view["time_s"] = json!(rate_hz.map(|rate_hz| f64::from(board.watched().count()) / f64::from(rate_hz)));
        view["phase"] = json!(match board.phase().count() {
            phase::JOIN => "starting",
            phase::GO => "flying",
            _ => "ending",
        });
    }
    // What only the launcher knows; one that is ending tells nothing any more.
    if let (Some(view), Ok(Value::Object(told))) = (view.as_object_mut(), ask(domain, &Request::Status)) {
        view.extend(told);
    }
    view
}

/// Asks the launcher of `namespace` to end its flight, and waits until it has.
pub fn stop(namespace: &str) -> anyhow::Result<()> {
    const LIMIT: Duration = Duration::from_secs(30);
    let domain = Domain::find(namespace)?;
    let pid = domain.launcher_pid().and_then(Pid::from_raw).context("the stack's folder names no process")?;
    kill_process(pid, Signal::INT).with_context(|| format!("cannot signal the launcher of '{namespace}'"))?;
    let deadline = Instant::now() + LIMIT;
    while domain.folder.exists() {
        if Instant::now() > deadline {
            bail!(
                "the stack in '{namespace}' did not end within 30 s; kill process {} to force it",
                pid.as_raw_nonzero()
            );
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    print(&format!("stack '{namespace}' has ended\n"));
    Ok(())
}
