//! `inject` and `clear`: inject a fault into a flying stack, and end faults.

use anyhow::{Context, anyhow, bail};
use runtime::domain::Domain;
use serde::de::DeserializeOwned;
use serde_json::json;
use settings::{Fault, FaultKind, FaultTarget, check_sizes, suggest};

use crate::target::{self, TargetArgs};
use flight::control::{ControlRequest, ask};
use flight::duration::{seconds, seconds_or_inf, signed_milliseconds};
use flight::event::name;
use outcome::faults::course;
use runtime::console::print;

/// Duration of a fault without `--for` \[s\].
const USUAL_S: f64 = 0.5;

/// Arguments of `inject`: a `[[fault]]` of a scenario, word for word.
#[derive(clap::Args)]
#[command(after_help = targets() + ". Sizes have defaults: see docs/faults.md.")]
pub struct InjectArgs {
    /// Target of the fault: see below
    target: String,
    /// Kind of the fault: see below
    kind: String,
    #[command(flatten)]
    stack: TargetArgs,
    /// Duration: 500ms, 2s, 1min; inf = until it is cleared [default: 0.5s, and no end for kill and
    /// exit]
    #[arg(long = "for", value_name = "TIME", value_parser = seconds_or_inf)]
    for_s: Option<f64>,
    /// Time from the next sample but one to the beginning of the fault
    #[arg(long = "in", value_name = "TIME", default_value = "0s", value_parser = seconds)]
    in_s: f64,
    /// A delay or a time constant: 20ms, 0.1s, or plain milliseconds
    #[arg(long, value_name = "TIME", allow_hyphen_values = true, value_parser = signed_milliseconds)]
    ms: Option<f64>,
    /// A bias, a factor, a deviation, a mass; degrees for angles
    #[arg(long, allow_negative_numbers = true)]
    value: Option<f64>,
    /// Wind NED [m/s], for example 5,0,0
    #[arg(long, value_name = "N,E,D", value_delimiter = ',', allow_hyphen_values = true)]
    vector: Option<Vec<f64>>,
    /// Share of the ticks that the fault affects
    #[arg(long)]
    probability: Option<f64>,
    /// Number of messages, or of bits
    #[arg(long)]
    count: Option<u64>,
    /// Error of a sensor or a topic that is wrong: bias, scale or sign
    #[arg(long)]
    how: Option<String>,
}

/// Arguments of `clear`.
#[derive(clap::Args)]
pub struct ClearArgs {
    /// End the faults of this target only
    target: Option<String>,
    #[command(flatten)]
    stack: TargetArgs,
}

/// Lists the targets of faults given in flight, targets with the same kinds together, with the kinds in brackets.
fn targets() -> String {
    let mut groups: Vec<(Vec<FaultKind>, Vec<&str>)> = vec![];
    for (target, name) in FaultTarget::ALL {
        let kinds: Vec<FaultKind> = target.kinds_in_flight().collect();
        match groups.iter_mut().find(|(known, _)| *known == kinds) {
            Some((_, names)) => names.push(name),
            None if kinds.is_empty() => {}
            None => groups.push((kinds, vec![name])),
        }
    }
    let group = |(kinds, names): &(Vec<FaultKind>, Vec<&str>)| {
        let kinds: Vec<String> = kinds.iter().map(name).collect();
        format!("{} ({})", names.join(" "), kinds.join(" "))
    };
    format!("Targets: {}", groups.iter().map(group).collect::<Vec<_>>().join("; "))
}

/// Injects a fault into a flying stack.
pub fn inject(args: &InjectArgs) -> anyhow::Result<()> {
    let InjectArgs { target, kind, .. } = args;
    if word::<FaultTarget>("target", kind).is_ok() && word::<FaultKind>("kind", target).is_ok() {
        bail!("`{target}` is a kind and `{kind}` a target, which comes first: `trefoil inject {kind} {target}`");
    }
    let mut fault = Fault {
        ms: args.ms,
        value: args.value,
        vector: args.vector.as_deref().map(vector).transpose()?,
        probability: args.probability,
        count: args.count,
        how: args.how.as_deref().map(|how| word("how", how)).transpose()?,
        ..Fault::new(word("target", &args.target)?, word("kind", &args.kind)?, args.in_s, args.for_s)
    };
    if fault.for_s.is_none() && !fault.is_momentary() {
        fault.for_s = Some(USUAL_S);
    }
    fault.for_s = fault.for_s.filter(|for_s| *for_s != f64::INFINITY);
    if fault.for_s.is_some_and(|for_s| for_s <= 0.0) {
        bail!("--for 0: a fault that lasts no time; give a time above 0");
    }
    check_sizes(&fault)?; // JSON has no NaN: the fault would get the default size
    let domain = args.stack.find()?;
    tell("injected", &domain, &ControlRequest::Inject { fault })
}

/// Ends faults of a flying stack.
pub fn clear(args: &ClearArgs) -> anyhow::Result<()> {
    let target = args.target.as_deref().map(|target| word("target", target)).transpose()?;
    let domain = args.stack.find()?;
    tell("cleared", &domain, &ControlRequest::Clear { target })
}

/// Sends the `request`, and prints the faults in the answer, each after the word `done`, and the flight.
fn tell(done: &str, domain: &Domain, request: &ControlRequest) -> anyhow::Result<()> {
    let flight = target::describe(domain);
    let told = ask(domain, request).map_err(|error| anyhow!("{error:#}\nin {flight}"))?;
    let faults: Vec<Fault> = serde_json::from_value(told).context("the launcher's answer cannot be read")?;
    if faults.is_empty() {
        print("no fault was active\n");
    }
    for fault in faults {
        print(&format!("{done}: {}\n", course(&fault, fault.at_s)));
    }
    print(&format!("in {flight}\n"));
    Ok(())
}

/// Parses a `word` of the scenario file; the error begins with `what`, and names the known words and the nearest of
/// them.
pub fn word<T: DeserializeOwned>(what: &str, word: &str) -> anyhow::Result<T> {
    serde_json::from_value(json!(word)).map_err(|error| anyhow!("{what}: {}", suggest(&error.to_string())))
}

fn vector(axes: &[f64]) -> anyhow::Result<[f64; 3]> {
    axes.try_into().map_err(|_| anyhow!("--vector has {} numbers; give three, for example 5,0,0", axes.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_help_names_every_fault_that_is_given_in_flight_and_no_other() {
        let help = targets();
        for (target, name) in FaultTarget::ALL {
            let is_there = help.split([' ', ':', ';']).any(|word| word == name);
            assert_eq!(is_there, !matches!(target, FaultTarget::Clock | FaultTarget::Host), "{name}: {help}");
        }
        for group in
            ["acceleration height field flow (off ", "wind (step gust)", "state (drop burst ", "iteration-cap)"]
        {
            assert!(help.contains(group), "{group}: {help}");
        }
    }
}
