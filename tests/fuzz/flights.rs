//! Any accepted settings and faults fly without a panic or a hang. Refused settings are reported with their key.
//!
//! `.ci/run` tries this for a minute; `PROPTEST_CASES=400000 cargo test --workspace fuzz::flights` takes an hour.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;

use flight::log::Record;
use flight::{guarded, scenario};
use outcome::judge::{Circumstances, Verdict};
use outcome::run_record::{Account, RunRecord};
use outcome::summary::Summary;
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};
use serde_json::json;
use settings::{Fault, FaultTarget, Profile, Scenario, to_toml};
use toml::{Table, Value};

use super::cases;

/// Time after which a flight of one second counts as hung.
const STUCK: Duration = Duration::from_secs(300);
/// Largest Np Nu that is flown: larger controllers take seconds to build.
const LARGEST_PLAN: usize = 500;
/// Words that some keys take.
const WORDS: [(&str, &[&str]); 13] = [
    ("mission.trajectory", &["survey", "hover", "parts"]),
    ("mission.ramp_s", &["min-jerk"]),
    ("guidance.roll_reference", &["trim", "absolute"]),
    ("guidance.derivative", &["error", "velocity"]),
    ("guidance.rate_reference", &["difference", "zero"]),
    ("attitude.law", &["mpc", "lqr", "pid", "geometric", "indi"]),
    ("attitude.mpc.terminal", &["zero", "q", "dare"]),
    ("attitude.mpc.constraints", &["none", "box", "cone"]),
    ("attitude.mpc.solver", &["clarabel", "active-set"]),
    ("attitude.mpc.state_constraints", &["none", "soft"]),
    ("deadline.late", &["send", "skip", "hold", "stop"]),
    ("realtime.policy", &["fifo", "other"]),
    ("name", &["flight"]),
];

/// Change of a number.
#[derive(Debug, Clone, Copy)]
enum Size {
    Times(f64),
    To(f64),
}

impl Size {
    fn of(self, x: f64) -> f64 {
        match self {
            Self::Times(factor) => x * factor,
            Self::To(y) => y,
        }
    }
}

fn size() -> impl Strategy<Value = Size> {
    let sign = || select(vec![1.0, 1.0, 1.0, -1.0]);
    prop_oneof![
        6 => (sign(), -2.0..2.0_f64).prop_map(|(sign, decades)| Size::Times(sign * 10_f64.powf(decades))),
        2 => (sign(), -12.0..12.0_f64).prop_map(|(sign, decades)| Size::To(sign * 10_f64.powf(decades))),
        1 => (sign(), -320.0..308.0_f64).prop_map(|(sign, decades)| Size::To(sign * 10_f64.powf(decades))),
        1 => select(vec![0.0, 1.0, 2.0, f64::NAN, f64::INFINITY]).prop_map(Size::To),
    ]
}

/// Change of one setting: its index among all settings, the change, and the index of an array element.
type Change = (Index, Size, Index);

fn change() -> impl Strategy<Value = Change> {
    (any::<Index>(), size(), any::<Index>())
}

/// Collects every dotted key that has a value, with its value.
fn leaves(path: &str, table: &Table, found: &mut Vec<(String, Value)>) {
    for (name, value) in table {
        let key = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value {
            Value::Table(table) => leaves(&key, table, found),
            value => found.push((key, value.clone())),
        }
    }
}

/// Returns `value` of `key` after a change; of an array, one element or all elements change.
fn changed(key: &str, value: &Value, (_, size, which): Change) -> Value {
    match value {
        Value::Float(x) => Value::Float(size.of(*x)),
        Value::Integer(x) => Value::Integer(size.of(*x as f64) as i64),
        Value::Boolean(x) => Value::Boolean(!x),
        Value::Array(all) => {
            let one = which.index(all.len() + 1);
            let is_meant = |i: usize| i == one || one == all.len();
            let each = all.iter().enumerate();
            Value::Array(
                each.map(|(i, x)| if is_meant(i) { changed(key, x, (which, size, which)) } else { x.clone() })
                    .collect(),
            )
        }
        Value::String(word) => {
            let words = WORDS.iter().find(|(known, _)| *known == key).map_or(&[][..], |(_, words)| words);
            Value::String(if words.is_empty() { word.clone() } else { (*which.get(words)).to_owned() })
        }
        other => other.clone(),
    }
}

/// Returns the settings of `changes` to a profile, each as after `--set`.
fn sets(profile: Profile, changes: &[Change]) -> Vec<String> {
    let table: Table = to_toml(&Scenario::from(profile)).parse().expect("a scenario is TOML");
    let mut all = vec![];
    leaves("", &table, &mut all);
    all.retain(|(key, _)| !["profile", "run.mode", "run.duration_s", "fault", "swap"].contains(&key.as_str()));
    let one = |change: &Change| {
        let (key, value) = change.0.get(&all);
        format!("{key}={}", changed(key, value, *change))
    };
    changes.iter().map(one).collect()
}

fn fault() -> impl Strategy<Value = Fault> {
    let times = (0.0..0.5_f64, prop::option::of(0.0..0.5_f64));
    (times, any::<Index>(), any::<Index>(), any::<Index>(), size(), any::<bool>()).prop_map(
        |((at_s, for_s), target, kind, how, size, sized)| {
            let (target, _) = *target.get(&FaultTarget::ALL);
            let mut fault = Fault::new(target, *kind.get(target.kinds()), at_s, for_s);
            for key in fault.keys().iter().filter(|_| sized) {
                match *key {
                    "ms" => fault.ms = Some(size.of(50.0)),
                    "value" => fault.value = Some(size.of(0.5)),
                    "vector" => fault.vector = Some([size.of(5.0), -1.0, 0.5]),
                    "probability" => fault.probability = Some(size.of(0.5)),
                    "count" => fault.count = Some(u64::from(size.of(5.0) as u32)),
                    _ => fault.how = serde_json::from_value(json!(how.get(&["bias", "scale", "sign"]))).ok(),
                }
            }
            fault
        },
    )
}

/// Flies `overrides`, if they are accepted.
fn check(overrides: &[String]) {
    let scenario = match scenario::load(None, overrides) {
        Ok(scenario) => scenario,
        Err(error) => return assert!(error.to_string().contains('`'), "no key is named: {error}"),
    };
    let (told, result) = channel();
    let fly = move || {
        let mut summary = Summary::new(&scenario);
        let watch = |record: &Record| {
            summary.observe(record);
            true
        };
        let flown = guarded::fly(&scenario, true, watch, |_| {}).expect("it is flown");
        let how = Circumstances::from(flown);
        let verdict = Verdict::of(&summary, &scenario, &how);
        let (summary, scenario, how, verdict) = (&summary, &scenario, &how, &verdict);
        let account = Account { summary, scenario, how, verdict, wall_s: 1.0, provenance: None };
        told.send(RunRecord::of(account)).expect("it is waited for");
    };
    let flight = thread::spawn(fly);
    match result.recv_timeout(STUCK) {
        Ok(run) => assert!(!run.ended.is_empty() && run.flown_s.is_finite(), "{run:?}"),
        Err(RecvTimeoutError::Timeout) => panic!("it hangs"),
        Err(RecvTimeoutError::Disconnected) => std::panic::resume_unwind(flight.join().expect_err("it panicked")),
    }
}

/// Returns whether the controller is at most [`LARGEST_PLAN`] large, or the settings are refused.
fn is_small(overrides: &[String]) -> bool {
    let scenario = settings::load(None, overrides);
    scenario.is_err() || scenario.is_ok_and(|scenario| scenario.np() * scenario.nu() <= LARGEST_PLAN)
}

proptest! {
    #![proptest_config(cases(300))]

    #[test]
    fn what_is_accepted_flies(
        profile in select(vec![Profile::Paper, Profile::Robust]),
        changes in vec(change(), 0..5),
        faults in vec(fault(), 0..3),
        candidate in prop::option::of(vec(change(), 0..3)),
        duration_s in 0.05..1.0_f64,
        seed in 0..1000_u64,
    ) {
        let mut overrides = vec![
            format!("profile={}", if profile == Profile::Paper { "paper" } else { "robust" }),
            "run.mode=inprocess".into(),
            format!("run.duration_s={duration_s:?}"),
            format!("run.seed={seed}"),
        ];
        overrides.extend(sets(profile, &changes));
        let drag = "plant.drag_linear_nspm=[0.2, 0.2, 0.1]".to_owned();
        overrides.extend(faults.iter().any(|fault| fault.target == FaultTarget::Wind).then_some(drag));
        if !faults.is_empty() {
            let faults: Vec<Value> = faults.iter().map(|fault| Value::try_from(fault).expect("a fault is TOML")).collect();
            overrides.push(format!("fault={}", Value::Array(faults)));
        }
        if let Some(changes) = candidate {
            let mut small = sets(profile, &changes);
            small.retain(|set| is_small(&[&overrides[..], std::slice::from_ref(set)].concat()));
            let set = Value::from(small);
            let node = ["guidance", "attitude-mpc", "mixer"][seed as usize % 3];
            overrides.push(format!("swap=[{{at_s=0.1, node=\"{node}\", standby_s=0.1, watch_s=0.2, set={set}}}]"));
        }
        if is_small(&overrides) {
            check(&overrides);
        }
    }
}
