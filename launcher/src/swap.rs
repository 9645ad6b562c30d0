//! `swap`: another process for a node of a flying stack, and what becomes of it.

use std::time::Duration;

use anyhow::Context;
use contract::domain::Domain;
use contract::process::exit;
use contract::scenario::{Swap, SwapBounds, SwapNode};
use serde_json::{Map, Value, json};

use crate::control::{Request, ask};
use crate::print;

/// How often the launcher of the stack is asked how it goes.
const LOOK: Duration = Duration::from_millis(50);

/// Arguments of `swap`.
#[derive(clap::Args)]
#[command(after_help = "Exit codes: 0 the newcomer stays; 1 it was sent away, and the old one has the office; \
2 the swap is refused; 3 the flight ended first.")]
pub struct SwapArgs {
    /// guidance, attitude-mpc, mixer or recorder
    pub node: String,
    /// Another program; it is started as PROGRAM --namespace NAME --epoch N --settings FILE
    #[arg(long, value_name = "PATH")]
    pub exec: Option<String>,
    /// A setting of the newcomer, on top of the run's, value in TOML: --set mpc.law=lqr
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// How long it works in the shadow of the old one, unheard: 2s, 500ms
    #[arg(long, default_value = "1s", value_parser = seconds)]
    pub shadow: f64,
    /// How long the old one stands by after the hand-over
    #[arg(long, default_value = "3s", value_parser = seconds)]
    pub watch: f64,
    /// What the newcomer may not do: `--bounds difference=0.25,accord=-0.5,ticks=3,tilt_deg=40,error_m=2`
    #[arg(long, value_name = "KEY=VALUE,...", default_value = "", value_parser = bounds)]
    pub bounds: SwapBounds,
    /// Which stack
    #[arg(long, default_value = "default")]
    pub namespace: String,
    /// Print JSON: the events of the swap
    #[arg(long)]
    pub json: bool,
}

/// Swaps as the arguments say, and waits for what becomes of it; the exit code.
pub fn swap(args: &SwapArgs) -> anyhow::Result<u8> {
    let node: SwapNode = serde_json::from_value(json!(args.node))
        .map_err(|_| anyhow::anyhow!("'{}' is no process: guidance, attitude-mpc, mixer, recorder", args.node))?;
    let exec = args.exec.as_deref().map(program).transpose()?;
    let (set, shadow_s, watch_s) = (args.set.clone(), args.shadow, args.watch);
    let swap = Swap { exec, set, shadow_s, watch_s, bounds: args.bounds, ..Swap::new(node, 0.0) };
    let domain = Domain::find(&args.namespace)?;
    let before = events_of(&domain, node)?.len();
    ask(&domain, &Request::Swap(swap))?;
    let ending = |event: &Value| {
        let what = event["what"].as_str().unwrap_or_default();
        let ends: &[&str] =
            if node == SwapNode::Recorder { &["took-over", "rejected"] } else { &["kept", "rejected", "returned"] };
        ends.contains(&what).then(|| what.to_owned())
    };
    let mut told = before;
    let what = loop {
        let Ok(events) = events_of(&domain, node) else {
            eprintln!("the flight ended before the swap did");
            return Ok(exit::PROCESS_LOST);
        };
        events.iter().skip(told).filter(|_| !args.json).for_each(|event| print(&line(event)));
        told = events.len();
        if let Some(what) = events.iter().skip(before).find_map(ending) {
            if args.json {
                print(&(serde_json::to_string_pretty(&events[before..])? + "\n"));
            }
            break what;
        }
        std::thread::sleep(LOOK);
    };
    Ok(if ["kept", "took-over"].contains(&what.as_str()) { exit::FLOWN } else { exit::OUT_OF_BOUNDS })
}

/// What has happened to `node` so far.
fn events_of(domain: &Domain, node: SwapNode) -> anyhow::Result<Vec<Value>> {
    let view = ask(domain, &Request::Events)?;
    let all = view.as_array().context("the launcher tells of no events")?;
    Ok(all.iter().filter(|event| event["node"] == node.name()).cloned().collect())
}

/// The whole path of a program: the launcher that starts it may stand in another folder.
fn program(path: &str) -> anyhow::Result<String> {
    let whole = std::fs::canonicalize(path).with_context(|| format!("cannot find the program '{path}'"))?;
    whole.into_os_string().into_string().ok().with_context(|| format!("the path of '{path}' is not text"))
}

fn line(event: &Value) -> String {
    let why = event["why"].as_str().map_or(String::new(), |why| format!(": {why}"));
    let what = event["what"].as_str().unwrap_or_default();
    let at_s = event["at_s"].as_f64().unwrap_or_default();
    format!("{at_s:8.2} s   {} epoch {} {what}{why}\n", event["node"].as_str().unwrap_or_default(), event["epoch"])
}

/// A time with its unit, in seconds.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    let (number, factor) = match (text.strip_suffix("ms"), text.strip_suffix('s')) {
        (Some(number), _) => (number, 1e-3),
        (None, Some(number)) => (number, 1.0),
        (None, None) => (text, 1.0),
    };
    let value: f64 = number.trim().parse().map_err(|_| format!("'{text}' is no time: 2s, 500ms, 0.5"))?;
    if value.is_finite() && value >= 0.0 { Ok(value * factor) } else { Err("a time of 0 or more".into()) }
}

fn bounds(text: &str) -> Result<SwapBounds, String> {
    let mut given = Map::new();
    for part in text.split(',').filter(|part| !part.trim().is_empty()) {
        let (key, value) = part.split_once('=').ok_or_else(|| format!("'{part}' is not KEY=VALUE"))?;
        let value: Value = serde_json::from_str(value.trim()).map_err(|_| format!("'{value}' is no number"))?;
        given.insert(key.trim().into(), value);
    }
    serde_json::from_value(Value::Object(given)).map_err(|error| error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_units() {
        for (text, expected) in [("2s", 2.0), ("500ms", 0.5), ("0.25", 0.25), ("0s", 0.0)] {
            assert_eq!(seconds(text), Ok(expected));
        }
        for text in ["", "s", "-1s", "1h", "NaN"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn bounds_are_the_scenarios() {
        assert_eq!(bounds(""), Ok(SwapBounds::default()));
        let expected = SwapBounds { difference: 0.5, ticks: 7, ..SwapBounds::default() };
        assert_eq!(bounds("difference=0.5, ticks=7"), Ok(expected));
        for (text, reason) in [("tilt=3", "unknown field `tilt`"), ("ticks", "KEY=VALUE"), ("ticks=x", "no number")] {
            assert!(bounds(text).unwrap_err().contains(reason), "{text}");
        }
    }
}
