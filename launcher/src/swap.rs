//! `swap`: replaces the process of a node of a flying stack, and follows the swap to its end.

use std::path::{Path, absolute};
use std::time::Duration;

use anyhow::{Context, anyhow, ensure};
use contract::Topic;
use contract::exit;
use runtime::domain::Domain;
use runtime::realtime::{ControlPage, phase};
use serde::Deserialize;
use serde_json::{Map, Value};
use settings::{Swap, SwapBounds, suggest, swap_node};

use flight::control::{ControlRequest, ask};
use flight::event::Event;
use flight::programs::pin_swap;
use flight::scenario::check_swap;
use flight::swap_story::{SwapStory, stayed};

use crate::target::{self, TargetArgs};
use flight::duration::seconds;
use runtime::console::{eprint_line, print};

/// Time between two requests for the events of the flight.
const LOOK: Duration = Duration::from_millis(50);

/// Arguments of `swap`.
#[derive(clap::Args)]
#[command(after_help = "The flight itself ends with 1 if the candidate does not stay, unless --may-fail was given.")]
pub struct SwapArgs {
    /// guidance, attitude-mpc or mixer
    #[arg(value_parser = node)]
    pub node: Topic,
    /// Another program; it is started as PROGRAM --namespace NAME --epoch N --settings FILE
    #[arg(long, value_name = "PATH")]
    pub exec: Option<String>,
    /// A setting of the candidate, on top of the run's, value in TOML: --set attitude.law=lqr
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Time for which the candidate is on standby beside the old process: 2s, 500ms
    #[arg(long, default_value = "1s", value_parser = seconds)]
    pub standby: f64,
    /// Time for which the old process stands by after the hand-over
    #[arg(long, default_value = "3s", value_parser = seconds)]
    pub watch: f64,
    /// The flight counts as flown even if the candidate does not stay
    #[arg(long)]
    pub may_fail: bool,
    /// Limits that the candidate must keep: `--bounds difference=0.25,similarity=-0.5,ticks=3,tilt_deg=40,error_m=2`
    #[arg(long, value_name = "KEY=VALUE,...", default_value = "", value_parser = bounds)]
    pub bounds: SwapBounds,
    #[command(flatten)]
    stack: TargetArgs,
    /// Print JSON: the events of the swap
    #[arg(long)]
    pub json: bool,
}

/// Requests the swap, prints its events, and waits for its end; returns the exit code.
pub fn swap(args: &SwapArgs) -> anyhow::Result<u8> {
    let node = args.node;
    let exec = args.exec.as_deref().map(program).transpose()?;
    let (set, standby_s, watch_s) = (args.set.clone(), args.standby, args.watch);
    let (bounds, may_fail) = (args.bounds, args.may_fail);
    let mut swap = Swap { exec, set, standby_s, watch_s, bounds, may_fail, ..Swap::new(node, 0.0) };
    let domain = args.stack.find()?;
    let run = domain.scenario()?;
    pin_swap(&run, &mut swap)?;
    check_swap(&run, &swap)?; // checked here, where it delays no flight
    let flight = target::describe(&domain);
    let ordered = ask(&domain, &ControlRequest::Swap(swap)).map_err(|error| anyhow!("{error:#}\nin {flight}"))?;
    if !args.json {
        print(&format!("{} of {flight}\n", node.publisher()));
    }
    let number = ordered["swap"].as_u64().context("the launcher does not say which swap it is")? as usize;
    let mut told = ordered["since"].as_u64().context("the launcher does not say which events are to come")? as usize;
    let (mut story, mut events) = (vec![], vec![]);
    let has_stayed = loop {
        let Some(news) = news(&domain, told)? else {
            eprint_line("the flight ended before the swap did");
            return Ok(exit::PROCESS_LOST);
        };
        told += news.len();
        events.extend(news.iter().filter_map(|event| Event::deserialize(event).ok()));
        let known = story.len();
        story.extend(news.into_iter().filter(|event| event["node"] == node.publisher()));
        story[known..].iter().filter(|_| !args.json).for_each(|event| print(&line(event)));
        if let Some(end) = SwapStory::of(&events, number).and_then(|story| story.end()) {
            break stayed(end);
        }
        std::thread::sleep(LOOK);
    };
    if args.json {
        print(&(serde_json::to_string_pretty(&story)? + "\n"));
    }
    Ok(if has_stayed { exit::FLOWN } else { exit::OUT_OF_BOUNDS })
}

/// Requests the events of the flight from number `since` on; `None` if the flight is over.
fn news(domain: &Domain, since: usize) -> anyhow::Result<Option<Vec<Value>>> {
    match ask(domain, &ControlRequest::Events { since }) {
        Ok(events) => Ok(Some(serde_json::from_value(events).context("the launcher tells of no events")?)),
        Err(_) if !flies(domain) => Ok(None),
        Err(error) => Err(error),
    }
}

fn flies(domain: &Domain) -> bool {
    domain.is_live() && ControlPage::open(&domain.file("page")).is_ok_and(|page| page.phase.count() == phase::GO)
}

/// Returns the absolute path of a program: the launcher that starts it may run in another folder.
fn program(path: &str) -> anyhow::Result<String> {
    let whole = Path::new(path);
    ensure!(whole.exists(), "cannot find the program '{path}'");
    // Links are not resolved: the program of a virtual environment finds its packages by the path of the link.
    let whole = absolute(whole)?;
    whole.into_os_string().into_string().ok().with_context(|| format!("the path of '{path}' is not text"))
}

fn line(event: &Value) -> String {
    let why = event["why"].as_str().map_or(String::new(), |why| format!(": {why}"));
    let what = event["what"].as_str().unwrap_or_default();
    let at_s = event["at_s"].as_f64().unwrap_or_default();
    format!("{at_s:8.2} s   {} epoch {} {what}{why}\n", event["node"].as_str().unwrap_or_default(), event["epoch"])
}

fn node(word: &str) -> Result<Topic, String> {
    swap_node(Value::from(word)).map_err(|error| suggest(&error.to_string()))
}

fn bounds(text: &str) -> Result<SwapBounds, String> {
    let mut given = Map::new();
    for part in text.split(',').filter(|part| !part.trim().is_empty()) {
        let (key, value) = part.split_once('=').ok_or_else(|| format!("'{part}' is not KEY=VALUE"))?;
        let value: Value = serde_json::from_str(value.trim()).map_err(|_| format!("'{value}' is no finite number"))?;
        given.insert(key.trim().into(), value);
    }
    serde_json::from_value(Value::Object(given)).map_err(|error| suggest(&error.to_string()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_have_the_keys_of_the_scenario() {
        assert_eq!(bounds(""), Ok(SwapBounds::default()));
        let expected = SwapBounds { difference: 0.5, ticks: 7, ..SwapBounds::default() };
        assert_eq!(bounds("difference=0.5, ticks=7"), Ok(expected));
        for (text, reason) in [
            ("tilt=3", "unknown field `tilt`"),
            ("ticks", "KEY=VALUE"),
            ("ticks=x", "no finite number"),
            ("tilt_deg=nan", "no finite number"),
        ] {
            assert!(bounds(text).unwrap_err().contains(reason), "{text}");
        }
    }
}
