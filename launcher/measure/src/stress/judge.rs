//! Rules for a flight after its kills, and their checks.
//!
//! | killed | must |
//! |---|---|
//! | launcher | every process is gone within 1 s, and the next flight in the namespace flies |
//! | plant | exit 3, and the launcher names it |
//! | a node or the recorder, in flight | exit 0, near the trajectory, and replaced within 1 s |
//! | a node or the recorder, too often | exit 3, and the vehicle does not diverge |
//! | a node or the recorder, before the first tick or after the last | exit 3, and the launcher names it |
//!
//! A long flight ends with exit code 0. A disturbed or loaded flight, or one with good candidates, may also end with 1,
//! beyond its bounds or because a candidate was late. Flights with candidates have targets of their own.
//!
//! After exit 0 the log can be read to its end and is complete, whatever process died.
//!
//! After every flight no shared memory and no process is left.

use super::logged::Kill;
use super::one_flight::{DURATION_S, StressFlight};
use super::orders::Conditions;
use super::plan::Victim;

/// Largest distance from the trajectory in a flight that continues \[m\].
///
/// Half a second without guidance, attitude-mpc or mixer costs the survey at most 0.25 m. A node that is not given up
/// is away for less: its three starts take about 40 ms each, and the delays before them 0.15 s together.
pub const NEAR_M: f64 = 0.3;
/// Longest time until the processes of a dead launcher have ended \[ms\].
pub const GONE_MS: f64 = 1_000.0;
/// Time within which a killed process must be replaced \[ns\].
const BACK_NS: u64 = 1_000_000_000;

/// Returns the first rule that the flight broke; `None` if it broke none.
pub fn complaint(flight: &StressFlight) -> Option<String> {
    if !flight.left.is_empty() {
        return Some(format!("left {}", flight.left.join(", ")));
    }
    if flight.kills.last().is_some_and(|kill| kill.victim == Victim::Launcher) {
        return without_launcher(flight);
    }
    match (flight.kind, flight.code) {
        (Conditions::Killed, Some(0)) => after_exit_0(flight),
        (Conditions::Killed, Some(3)) => after_exit_3(flight),
        (_, Some(0)) | (Conditions::Disturbed | Conditions::Loaded | Conditions::Good, Some(1)) => {
            missing_in_log(flight)
        }
        (_, Some(code)) => Some(format!("exit {code}: {}", flight.said.trim())),
        (_, None) => Some(format!("did not end: {}", flight.said.trim())),
    }
}

fn without_launcher(flight: &StressFlight) -> Option<String> {
    if flight.gone_ms.is_none_or(|gone_ms| gone_ms > GONE_MS) {
        return Some("processes outlived their launcher by a second".into());
    }
    (flight.next_code != Some(0)).then(|| format!("the next flight: exit {:?}", flight.next_code))
}

fn after_exit_0(flight: &StressFlight) -> Option<String> {
    if flight.diverged {
        return Some("diverged".into());
    }
    if let Some(kill) = flight.kills.iter().find(|kill| !kill.victim.is_replaced() && !is_complete(flight)) {
        return Some(format!("exit 0 without the {}", kill.victim.name()));
    }
    if let Some(error_m) = flight.position_error_m.filter(|error_m| *error_m > NEAR_M) {
        return Some(format!("{error_m:.2} m from the trajectory"));
    }
    if let Some(kill) = flight.kills.iter().find(|kill| is_missed(flight, kill)) {
        return Some(format!("{} did not come back", kill.victim.name()));
    }
    missing_in_log(flight)
}

fn missing_in_log(flight: &StressFlight) -> Option<String> {
    if let Some(defect) = &flight.log_defect {
        return Some(format!("the log cannot be read to its end: {defect}"));
    }
    if flight.dropped > 0 {
        return Some(format!("{} messages are missing in the log", flight.dropped));
    }
    (flight.holes > 0).then(|| format!("{} holes in the log", flight.holes))
}

fn after_exit_3(flight: &StressFlight) -> Option<String> {
    let named = flight.kills.iter().any(|kill| flight.said.contains(&kill.victim.name()));
    let ended = flight.kills.iter().any(|kill| !kill.victim.is_replaced());
    let in_flight = flight.flown_s.is_some() && !is_complete(flight);
    let fine = !flight.diverged && (!flight.given_up.is_empty() || named && (ended || !in_flight));
    (!fine).then(|| format!("exit 3: {}", flight.said.trim()))
}

fn is_complete(flight: &StressFlight) -> bool {
    flight.flown_s.is_some_and(|flown_s| flown_s > DURATION_S - 0.05)
}

/// Returns `true` if `kill` was the last of its node and no successor followed, although there was time. A successor
/// that a hole of the log may hide is not missed.
fn is_missed(flight: &StressFlight, kill: &Kill) -> bool {
    let again = flight.kills.iter().any(|other| other.victim == kill.victim && other.epoch > kill.epoch);
    let in_time = kill.successor_ms.is_some_and(|ms| ms < BACK_NS as f64 / 1e6);
    kill.victim.is_replaced() && !again && !in_time && !kill.unseen && flight.end_ns > kill.at_ns + BACK_NS
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stress::plan::Moment;

    fn kill(victim: Victim, successor_ms: Option<f64>) -> Kill {
        Kill { successor_ms, ..Kill::new(victim, 1, Moment::Flying, 1_000_000_000) }
    }

    fn flown(victim: Victim) -> StressFlight {
        StressFlight {
            kills: vec![kill(victim, victim.is_replaced().then_some(30.0))],
            code: Some(0),
            flown_s: Some(DURATION_S),
            position_error_m: Some(0.1),
            end_ns: 4_000_000_000,
            ..StressFlight::default()
        }
    }

    fn ended(victim: Victim, said: &str) -> StressFlight {
        StressFlight { code: Some(3), flown_s: Some(1.0), said: said.into(), ..flown(victim) }
    }

    fn check(row: &StressFlight, expected: Option<&str>) {
        let found = complaint(row);
        let fits = match (&found, expected) {
            (Some(found), Some(part)) => found.contains(part),
            (found, part) => found.is_none() && part.is_none(),
        };
        assert!(fits, "{found:?} instead of {expected:?}");
    }

    #[test]
    fn a_flight_goes_on_without_a_node() {
        let row = flown(Victim::Mixer);
        check(&row, None);
        check(&StressFlight { diverged: true, ..row.clone() }, Some("diverged"));
        check(&StressFlight { position_error_m: Some(0.35), ..row.clone() }, Some("0.35 m"));
        check(&StressFlight { kills: vec![kill(Victim::Mixer, None)], ..row.clone() }, Some("mixer did not come back"));
        check(&StressFlight { kills: vec![kill(Victim::Mixer, None)], end_ns: 1_900_000_000, ..row.clone() }, None);
        check(&StressFlight { code: Some(2), ..row.clone() }, Some("exit 2"));
        check(&StressFlight { code: None, ..row.clone() }, Some("did not end"));
        check(&StressFlight { left: vec!["mixer".into()], ..row }, Some("left mixer"));
    }

    #[test]
    fn a_recorder_is_replaced_and_costs_the_log_nothing() {
        let row = flown(Victim::Recorder);
        check(&row, None);
        check(&StressFlight { dropped: 1, ..row.clone() }, Some("1 messages are missing"));
        check(
            &StressFlight { kills: vec![kill(Victim::Recorder, None)], ..row.clone() },
            Some("recorder did not come back"),
        );
        check(&StressFlight { holes: 1, ..row.clone() }, Some("1 holes"));
        check(&StressFlight { log_defect: Some("torn".into()), ..row.clone() }, Some("torn"));
        check(&StressFlight { code: Some(3), given_up: vec!["recorder".into()], ..row }, None);
    }

    #[test]
    fn a_victim_without_replacement_ends_the_flight_and_is_named() {
        check(&ended(Victim::Plant, "error: lost plant"), None);
        check(&ended(Victim::Plant, "error: lost"), Some("exit 3"));
        check(&StressFlight { flown_s: Some(1.0), ..flown(Victim::Plant) }, Some("exit 0 without"));
    }

    #[test]
    fn exit_3_needs_a_node_given_up_or_killed_outside_the_flight() {
        let row = ended(Victim::Mixer, "error: lost mixer");
        check(&row, Some("exit 3"));
        check(&StressFlight { given_up: vec!["mixer".into()], ..row.clone() }, None);
        check(&StressFlight { given_up: vec!["mixer".into()], diverged: true, ..row.clone() }, Some("exit 3"));
        check(&StressFlight { flown_s: None, ..row.clone() }, None);
        check(&StressFlight { flown_s: Some(DURATION_S), ..row }, None);
    }

    #[test]
    fn a_dead_launcher_leaves_no_process_and_the_next_flight_flies() {
        let row = StressFlight { code: None, gone_ms: Some(5.0), next_code: Some(0), ..flown(Victim::Launcher) };
        check(&row, None);
        check(&StressFlight { gone_ms: Some(1_001.0), ..row.clone() }, Some("outlived"));
        check(&StressFlight { gone_ms: None, ..row.clone() }, Some("outlived"));
        check(&StressFlight { next_code: Some(3), ..row }, Some("next flight"));
    }
}
