//! `inject` and `clear`: break something in a flying stack, and end it.

use anyhow::{Context, anyhow, bail};
use contract::domain::Domain;
use contract::scenario::{Fault, FaultTarget};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::request::{Request, ask};
use super::target::{self, TargetArgs};
use crate::faults::course;
use crate::print;

/// How long a fault lasts that is given no time \[s\].
const USUAL_S: f64 = 0.5;

/// Arguments of `inject`: a `[[fault]]` of a scenario, word for word.
#[derive(clap::Args)]
#[command(
    after_help = "Targets: plant guidance attitude-mpc mixer (kill stop slow hog exit); state reference controls actuators \
(drop burst delay duplicate reorder corrupt garbage stale rate; wrong, but for state); position velocity attitude rates (off stuck garbage wrong \
slow delayed intermittent noise); rotor1 rotor2 rotor3 tilt (off stuck wrong slow saturated); wind (step gust); payload \
(mass); mpc (infeasible, nan, iteration-cap). Sizes have defaults: see docs/faults.md."
)]
pub struct InjectArgs {
    /// What to break: see below
    target: String,
    /// How: see below
    kind: String,
    #[command(flatten)]
    stack: TargetArgs,
    /// How long it lasts [s]; inf = until it is cleared [default: 0.5, and no end for kill and exit]
    #[arg(long = "for", value_name = "S")]
    for_s: Option<f64>,
    /// How long after the next sample it begins [s]
    #[arg(long = "in", value_name = "S", default_value_t = 0.0)]
    in_s: f64,
    /// A delay or a time constant
    #[arg(long)]
    ms: Option<f64>,
    /// A bias, a factor, a deviation, a mass; degrees for angles
    #[arg(long, allow_negative_numbers = true)]
    value: Option<f64>,
    /// Wind NED [m/s], for example 5,0,0
    #[arg(long, value_name = "N,E,D", value_delimiter = ',', allow_hyphen_values = true)]
    vector: Option<Vec<f64>>,
    /// Share of the ticks struck
    #[arg(long)]
    probability: Option<f64>,
    /// Messages, or bits
    #[arg(long)]
    count: Option<u64>,
    /// In which way a sensor or a topic is wrong: bias, scale or sign
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

/// Gives a flying stack a fault.
pub fn inject(args: &InjectArgs) -> anyhow::Result<()> {
    let domain = args.stack.find()?;
    let mut fault = Fault {
        ms: args.ms,
        value: args.value,
        vector: args.vector.as_ref().map(|axes| read("vector", json!(axes))).transpose()?,
        probability: args.probability,
        count: args.count,
        how: args.how.as_ref().map(|word| read("how", json!(word))).transpose()?,
        ..Fault::new(part(&args.target)?, read("kind", json!(args.kind))?, args.in_s, args.for_s)
    };
    if fault.for_s.is_none() && !fault.is_momentary() {
        fault.for_s = Some(USUAL_S);
    }
    fault.for_s = fault.for_s.filter(|for_s| *for_s != f64::INFINITY);
    if !fault.at_s.is_finite() || fault.for_s.is_some_and(|for_s| for_s.is_nan() || for_s <= 0.0) {
        bail!("a fault in {} s for {} s: give numbers, a time above 0", args.in_s, args.for_s.unwrap_or_default());
    }
    tell("injected", &domain, &Request::Inject { fault })
}

/// Ends faults of a flying stack.
pub fn clear(args: &ClearArgs) -> anyhow::Result<()> {
    let domain = args.stack.find()?;
    let target = args.target.as_deref().map(part).transpose()?;
    tell("cleared", &domain, &Request::Clear { target })
}

/// Makes the `request`, and prints the faults to which something was `done`, as they are now, and in which flight.
fn tell(done: &str, domain: &Domain, request: &Request) -> anyhow::Result<()> {
    let flight = target::describe(domain);
    let told = ask(domain, request).map_err(|error| anyhow!("{error:#}\nin {flight}"))?;
    let faults: Vec<Fault> = read("response", told)?;
    if faults.is_empty() {
        print("nothing is broken\n");
    }
    for fault in faults {
        print(&format!("{done}: {}\n", course(&fault, fault.at_s)));
    }
    print(&format!("in {flight}\n"));
    Ok(())
}

fn part(word: &str) -> anyhow::Result<FaultTarget> {
    read("target", json!(word))
}

/// A word of the scenario's language; the error names those there are.
fn read<T: DeserializeOwned>(what: &str, value: Value) -> anyhow::Result<T> {
    serde_json::from_value(value).with_context(|| format!("{what} cannot be read"))
}
