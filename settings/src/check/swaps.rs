//! Checks of `[[swap]]`.

use contract::topic::Topic;
use toml::Value;

use crate::check::found::Found;
use crate::check::{idle, ranges};
use crate::table::fault::{FaultKind, FaultTarget};
use crate::table::run::{Mode, Scenario};
use crate::table::swap::{Swap, SwapTicks};
use crate::text::report::ScenarioError;
use crate::words::word;

/// Function that loads the settings of a swap's candidate on top of the run's, and checks them.
pub type LoadCandidate = fn(&Scenario, &Swap) -> Result<Scenario, ScenarioError>;

const KEYS: [&str; 1] = ["swap"];

/// Finds every rule that the swaps of `scenario` break.
pub fn check(scenario: &Scenario, candidate: LoadCandidate, found: &mut Found) {
    for (i, swap) in scenario.swap.iter().enumerate() {
        let sizes = Value::try_from(swap);
        let what = "a swap with a number that no scenario file can hold".into();
        found.require(sizes.is_ok(), &KEYS, what, "numbers below 2^63");
        ranges::check(&ranges::collect(&format!("swap.{i}"), sizes.unwrap_or(false.into())), found);
        idle::check_begin("swap", swap.at_s, swap.ticks(scenario.sample_s()).from, scenario, found);
        if swap.node == Topic::State {
            let what =
                "the plant cannot be swapped: it is the vehicle, and there is no second one to take over from it";
            found.require(
                false,
                &KEYS,
                what.into(),
                "guidance, attitude-mpc, mixer; to fly another plant, start it with the run",
            );
            continue;
        }
        let mut others = scenario.swap[..i].iter().filter(|other| other.node == swap.node);
        let ticks = |swap: &Swap| swap.ticks(scenario.sample_s());
        let apart = |other: SwapTicks, own: SwapTicks| other.until < own.from || own.until < other.from;
        found.require(
            others.all(|other| apart(ticks(other), ticks(swap))),
            &KEYS,
            format!("two swaps of {} at once", swap.node.publisher()),
            "one after the other: from `at_s` to `at_s` + `standby_s` + `watch_s` the node is taken",
        );
        check_candidate(scenario, swap, candidate(scenario, swap), found);
    }
}

/// Checks the candidate's own settings.
fn check_candidate(scenario: &Scenario, swap: &Swap, own: Result<Scenario, ScenarioError>, found: &mut Found) {
    let own = match own {
        Ok(own) => own,
        Err(error) => {
            let text = error.to_string();
            let what = text.lines().next().unwrap_or_default().trim_start_matches("error: ").to_owned();
            return found.require(
                false,
                &KEYS,
                format!("`swap.set`: {what}"),
                "settings in the form of `--set key=value`",
            );
        }
    };
    found.require(
        own.run == scenario.run,
        &KEYS,
        "`swap.set` changes the run".into(),
        "settings of the candidate: everything but `run`",
    );
    if own.fault == scenario.fault {
        return;
    }
    let topic = swap.node;
    let clocked = scenario.run.mode == Mode::Realtime;
    for fault in &own.fault {
        let of_itself = fault.target.process() == Some(topic)
            && matches!(fault.kind, FaultKind::Slow | FaultKind::Exit)
            || fault.target.process() == Some(topic) && fault.kind == FaultKind::Hog && clocked;
        let of_its_word = fault.target.topic() == Some(topic);
        let of_its_solver = fault.target == FaultTarget::Mpc && swap.node == Topic::Controls;
        found.require(
            of_itself || of_its_word || of_its_solver,
            &KEYS,
            format!("a fault of the candidate: {} {}", fault.target.name(), word(fault.kind)),
            "faults of the process itself (slow, exit, in real time hog), of its topic, of its solver",
        );
    }
}
