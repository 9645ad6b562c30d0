//! `status` and `stop`: look at stacks that fly, and end one.

mod table;

use std::time::{Duration, Instant};

use anyhow::bail;
use contract::domain::Domain;
use contract::realtime::{Board, phase};
use contract::scenario;
use serde_json::{Value, json};

use crate::control::{Request, ask};
use crate::print;
use table::describe;

/// How often `status --watch` looks.
const WATCH: Duration = Duration::from_millis(500);

/// Arguments of `status`.
#[derive(clap::Args)]
pub struct StatusArgs {
    /// Print JSON
    #[arg(long, conflicts_with = "watch")]
    json: bool,
    /// Look again twice a second, until Ctrl-C
    #[arg(long)]
    watch: bool,
}

/// Lists the stacks that fly: how far they are, how their nodes are, what is broken, and what happened last.
pub fn status(args: &StatusArgs) -> anyhow::Result<()> {
    loop {
        let stacks: Vec<Value> = Domain::list().iter().map(look).collect();
        if args.json {
            print(&(serde_json::to_string_pretty(&stacks)? + "\n"));
        } else if stacks.is_empty() {
            print("no stack is flying\n");
        } else {
            print(&stacks.iter().map(describe).collect::<Vec<_>>().join("\n"));
        }
        if !args.watch {
            return Ok(());
        }
        std::thread::sleep(WATCH);
        print("\x1b[H\x1b[J"); // an empty screen, from the top
    }
}

/// What can be seen of one stack without joining it: settings and board. A guest that joins while the stack ends would
/// leave its own traces in the shared memory being wiped. What is gone already is absent.
fn look(domain: &Domain) -> Value {
    let mut view = json!({ "namespace": domain.namespace(), "launcher_pid": domain.launcher_pid() });
    let settings = std::fs::read_to_string(domain.file("scenario.toml")).ok();
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
///
/// It is asked by its socket: its process number may be another process's in the PID namespace of who asks.
pub fn stop(namespace: &str) -> anyhow::Result<()> {
    const LIMIT: Duration = Duration::from_secs(30);
    let domain = Domain::find(namespace)?;
    ask(&domain, &Request::Stop)?;
    let deadline = Instant::now() + LIMIT;
    while domain.is_live() {
        if Instant::now() > deadline {
            let pid = domain.launcher_pid().map_or("its launcher".into(), |pid| format!("process {pid}"));
            bail!("the stack in '{namespace}' did not end within 30 s; kill {pid} to force it");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    print(&format!("stack '{namespace}' has ended\n"));
    Ok(())
}
