//! `status` and `stop`: look at stacks that fly, and end one.

use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use contract::Scenario;
use contract::domain::Domain;
use contract::message::State;
use contract::port::Receive;
use contract::process::Seat;
use contract::realtime::phase;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::print;

/// Lists the stacks that fly, newest sample included.
pub fn status(as_json: bool) -> anyhow::Result<()> {
    let stacks: Vec<Value> = Domain::list().iter().map(look).collect();
    if as_json {
        print(&(serde_json::to_string_pretty(&stacks)? + "\n"));
    } else if stacks.is_empty() {
        print("no stack is flying\n");
    }
    for s in stacks.iter().filter(|_| !as_json) {
        let text = |key: &str| s[key].as_str().unwrap_or("?").to_owned();
        print(&format!(
            "{:<16} {:<12} {:<10} {:<9} t = {:.2} s of {:.0} s   launcher {}\n",
            text("namespace"),
            text("name"),
            text("mode"),
            text("phase"),
            s["time_s"].as_f64().unwrap_or(0.0),
            s["duration_s"].as_f64().unwrap_or(0.0),
            s["launcher_pid"],
        ));
    }
    Ok(())
}

/// What can be seen of one stack from outside; a stack that ends meanwhile shows what was left.
fn look(domain: &Domain) -> Value {
    let namespace = domain.namespace();
    let mut view = json!({ "namespace": namespace, "launcher_pid": domain.launcher_pid() });
    if let Ok(seat) = Seat::join(namespace, "status") {
        view["name"] = json!(seat.scenario.name);
        view["mode"] = json!(seat.scenario.run.mode);
        view["profile"] = json!(seat.scenario.profile);
        view["duration_s"] = json!(seat.scenario.run.duration_s);
        view["phase"] = json!(match seat.board.phase().count() {
            phase::JOIN => "starting",
            phase::GO => "flying",
            _ => "ending",
        });
        // A stack that is still starting counts its queues: a guest comes later.
        let flying = seat.board.phase().count() == phase::GO;
        if flying && let Some(state) = seat.observer::<State>().ok().and_then(|port| newest(&*port)) {
            view["time_s"] = json!(state.stamp.tick as f64 * Scenario::SAMPLE_S);
            view["position_m"] = json!(state.actual.position_m);
        }
    }
    view
}

/// The newest state within a few periods: a publisher greets a new queue only when it sends.
fn newest(port: &dyn Receive<State>) -> Option<State> {
    const LIMIT: Duration = Duration::from_millis(100);
    let deadline = Instant::now() + LIMIT;
    loop {
        match std::iter::from_fn(|| port.receive()).last() {
            None if Instant::now() < deadline => std::thread::sleep(Duration::from_millis(1)),
            found => return found,
        }
    }
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
