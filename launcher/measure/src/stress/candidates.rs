//! Flights with many swaps: twenty good candidates of each node in the survey, or thirty wrong ones in gusts.
//!
//! Every other good candidate has other settings. Each wrong candidate fails either on standby or, if it gets that far,
//! while active, in one of these ways:
//!
//! | way | its answers |
//! |---|---|
//! | garbage | numbers that are not finite, with a correct checksum |
//! | drop | none |
//! | wrong | finite and plausible, times -1 |
//! | slow | 30 ms late |
//! | exit | none, because the process has ended |

use contract::topic::Topic;
use settings::{Mode, Scenario, Swap};

use crate::flights::hover_in_gusts;

/// Nodes in the order of their swaps, by their topics, with the settings of every other good candidate.
const NODES: [(Topic, &str); 3] = [
    (Topic::Reference, "guidance.disturbance_observer_radps=4.0"),
    (Topic::Controls, "attitude.law=\"lqr\""),
    (Topic::Actuators, "mixer.projection=true"),
];
/// Faults of the wrong candidates: target, kind, and the delays after which they begin \[s\]. An exit is momentary, so
/// a second one follows for a candidate that started after the first. The other faults last, and two would add up.
const WAYS: [(FaultTargetOf, &str, &[f64]); 5] = [
    (Topic::name, "kind=\"garbage\"", &[0.0]),
    (Topic::name, "kind=\"drop\", probability=1.0", &[0.0]),
    (Topic::name, "kind=\"wrong\", how=\"sign\"", &[0.0]),
    (Topic::publisher, "kind=\"slow\", ms=30.0", &[0.0]),
    (Topic::publisher, "kind=\"exit\"", &[0.0, 0.25]),
];
/// Function that returns the target of a fault for a topic: the topic itself, or its publisher.
type FaultTargetOf = fn(Topic) -> &'static str;
/// Number of good candidates of each node.
const ROUNDS: usize = 20;
/// Number of all good candidates.
pub const GOOD: usize = ROUNDS * NODES.len();
/// Time at which the first swap begins \[s\].
const FIRST_S: f64 = 1.0;
/// Duration of standby of a good candidate, and interval between two swaps \[s\].
const GOOD_S: (f64, f64) = (0.1, 0.4);
/// Duration and interval for wrong candidates, long enough for the error to show \[s\].
const WRONG_S: (f64, f64) = (0.2, 1.0);
/// Pause between the end of a swap and the next one \[s\].
const REST_S: f64 = 0.1;
/// Delays from the beginning of a swap until its candidate fails, on standby or active \[s\]. Both leave the candidate
/// time to start.
const WRONG_AFTER_S: [f64; 2] = [0.15, 0.4];
/// Interval between two gusts \[s\].
const GUST_S: f64 = 2.0;

/// Adds the good candidates to the `survey`.
pub fn good(survey: Scenario) -> Scenario {
    let mut swaps = vec![];
    for round in 0..ROUNDS {
        for (node, other) in NODES {
            let set = if round % 2 == 1 { vec![other.to_owned()] } else { vec![] };
            swaps.push(swap(swaps.len(), GOOD_S, node, set));
        }
    }
    with_swaps(survey, swaps)
}

/// Returns a hover in repeated gusts, with one wrong candidate for every node and every way to fail, on standby and
/// while active.
pub fn wrong() -> anyhow::Result<Scenario> {
    let (mut gusts, mut swaps) = (hover_in_gusts()?, vec![]);
    for ((target, fault, times_s), after_s) in
        WAYS.into_iter().flat_map(|way| WRONG_AFTER_S.map(|after_s| (way, after_s)))
    {
        for (node, _) in NODES {
            let at_s = begins_s(swaps.len(), WRONG_S) + after_s;
            let begins = |later_s| format!("{{at_s={:?}, target=\"{}\", {fault}}}", at_s + later_s, target(node));
            let faults: Vec<String> = times_s.iter().map(begins).collect();
            let set = format!("fault=[{}]", faults.join(", "));
            swaps.push(Swap { may_fail: true, ..swap(swaps.len(), WRONG_S, node, vec![set]) });
        }
    }
    let gust = gusts.plant.wind_ned_mps.split_off(1); // the first entry is the steady wind
    for i in 1..(begins_s(swaps.len(), WRONG_S) / GUST_S) as usize {
        let later_s = FIRST_S + GUST_S * i as f64 - gust[0].0;
        gusts.plant.wind_ned_mps.extend(gust.iter().map(|(at_s, wind_mps)| (at_s + later_s, *wind_mps)));
    }
    gusts.run.mode = Mode::Realtime;
    Ok(with_swaps(gusts, swaps))
}

fn begins_s(i: usize, (_, apart_s): (f64, f64)) -> f64 {
    FIRST_S + apart_s * i as f64
}

/// Returns swap number `i`, with standby and interval in `times_s`.
fn swap(i: usize, times_s: (f64, f64), node: Topic, set: Vec<String>) -> Swap {
    let (standby_s, apart_s) = times_s;
    Swap { set, standby_s, watch_s: apart_s - standby_s - REST_S, ..Swap::new(node, begins_s(i, times_s)) }
}

fn with_swaps(mut scenario: Scenario, swaps: Vec<Swap>) -> Scenario {
    let end_s = swaps.last().map_or(0.0, |last| last.at_s + last.standby_s + last.watch_s);
    scenario.run.duration_s = (end_s + 1.0).ceil();
    scenario.swap = swaps;
    scenario
}
