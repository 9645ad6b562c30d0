//! What must come of a flight, and whether it did.
//!
//! | killed | must |
//! |---|---|
//! | launcher | every process is gone within 1 s, and the next flight in the namespace flies |
//! | plant | exit 3, and the launcher names it |
//! | a node or the recorder, in flight | exit 0, near the trajectory, and who was killed is back within 1 s |
//! | one of them too often | exit 3, and the vehicle is not lost |
//! | one of them before the first tick or after the last | exit 3, and the launcher names it |
//!
//! After exit 0 the log reads to its end. What is missing in it was sent around the death of a recorder: about a second
//! before it at most ([`flight::log`]), and until the next one recorded.
//!
//! And whatever was killed: nothing is left.

use super::draw::Victim;
use super::one_flight::{DURATION_S, Kill, Row};

/// Largest distance from the trajectory in a flight that goes on \[m\].
///
/// Half a second without any one of the three costs the survey 0.25 m at most. A node that is not given up is away for
/// less: its three starts take some 40 ms each, and the waits before them 0.15 s together.
pub const NEAR_M: f64 = 0.3;
/// Within which the processes of a dead launcher end \[ms\].
pub const GONE_MS: f64 = 1_000.0;
/// So much of the log may die with a recorder \[ms\]: it brings what it has written into safety with the first message
/// that comes a second after the last time, and has to get the processor for that.
pub const LOST_MS: f64 = 1_200.0;
/// Within which a process is back for certain \[ns\].
const BACK_NS: u64 = 1_000_000_000;

impl Row {
    /// What is not as it must be.
    pub fn complaint(&self) -> Option<String> {
        if !self.left.is_empty() {
            return Some(format!("left {}", self.left.join(", ")));
        }
        if self.kills.last().is_some_and(|kill| kill.victim == Victim::Launcher) {
            return self.after_the_launcher();
        }
        match self.code {
            Some(0) => self.flown(),
            Some(3) => self.lost(),
            Some(code) => Some(format!("exit {code}: {}", self.said.trim())),
            None => Some(format!("did not end: {}", self.said.trim())),
        }
    }

    fn after_the_launcher(&self) -> Option<String> {
        if self.gone_ms.is_none_or(|gone_ms| gone_ms > GONE_MS) {
            return Some("processes outlived their launcher by a second".into());
        }
        (self.next_code != Some(0)).then(|| format!("the next flight: exit {:?}", self.next_code))
    }

    fn flown(&self) -> Option<String> {
        if self.diverged {
            return Some("diverged".into());
        }
        if let Some(kill) = self.kills.iter().find(|kill| !kill.victim.is_replaced() && !self.is_intact()) {
            return Some(format!("exit 0 without the {}", kill.victim.name()));
        }
        if let Some(error_m) = self.position_error_m.filter(|error_m| *error_m > NEAR_M) {
            return Some(format!("{error_m:.2} m from the trajectory"));
        }
        if let Some(kill) = self.kills.iter().find(|kill| self.is_missed(kill)) {
            return Some(format!("{} did not come back", kill.victim.name()));
        }
        self.unlogged()
    }

    fn unlogged(&self) -> Option<String> {
        if let Some(defect) = &self.log_defect {
            return Some(format!("the log cannot be read to its end: {defect}"));
        }
        if self.holes > 0 {
            return Some(format!("{} holes in the log that nobody's death explains", self.holes));
        }
        let lost_ms = self.kills.iter().filter_map(|kill| kill.lost_ms).find(|lost_ms| *lost_ms > LOST_MS);
        lost_ms.map(|lost_ms| format!("{lost_ms:.0} ms of the log died with the recorder"))
    }

    fn lost(&self) -> Option<String> {
        let named = self.kills.iter().any(|kill| self.said.contains(kill.victim.name()));
        let ended = self.kills.iter().any(|kill| !kill.victim.is_replaced());
        let in_flight = self.flown_s.is_some() && !self.is_intact();
        let fine = !self.diverged && (!self.given_up.is_empty() || named && (ended || !in_flight));
        (!fine).then(|| format!("exit 3: {}", self.said.trim()))
    }

    /// Whether it flew to its end.
    fn is_intact(&self) -> bool {
        self.flown_s.is_some_and(|flown_s| flown_s > DURATION_S - 0.05)
    }

    /// Whether nobody came in the place of this one though there was time: the last of its node.
    fn is_missed(&self, kill: &Kill) -> bool {
        let again = self.kills.iter().any(|other| other.victim == kill.victim && other.epoch > kill.epoch);
        let in_time = kill.successor_ms.is_some_and(|ms| ms < BACK_NS as f64 / 1e6);
        kill.victim.is_replaced() && !again && !in_time && !kill.unseen && self.end_ns > kill.at_ns + BACK_NS
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kills::draw::Moment;

    fn kill(victim: Victim, successor_ms: Option<f64>) -> Kill {
        Kill {
            victim,
            epoch: 1,
            moment: Moment::Flying,
            at_ns: 1_000_000_000,
            successor_ms,
            unseen: false,
            lost_ms: None,
        }
    }

    fn flown(victim: Victim) -> Row {
        Row {
            kills: vec![kill(victim, victim.is_replaced().then_some(30.0))],
            code: Some(0),
            flown_s: Some(DURATION_S),
            position_error_m: Some(0.1),
            end_ns: 4_000_000_000,
            ..Row::default()
        }
    }

    fn ended(victim: Victim, said: &str) -> Row {
        Row { code: Some(3), flown_s: Some(1.0), said: said.into(), ..flown(victim) }
    }

    fn check(row: &Row, complaint: Option<&str>) {
        let found = row.complaint();
        let fits = match (&found, complaint) {
            (Some(found), Some(part)) => found.contains(part),
            (found, part) => found.is_none() && part.is_none(),
        };
        assert!(fits, "{found:?} instead of {complaint:?}");
    }

    #[test]
    fn a_node_is_flown_on_without() {
        let row = flown(Victim::Mixer);
        check(&row, None);
        check(&Row { diverged: true, ..row.clone() }, Some("diverged"));
        check(&Row { position_error_m: Some(0.35), ..row.clone() }, Some("0.35 m"));
        check(&Row { kills: vec![kill(Victim::Mixer, None)], ..row.clone() }, Some("mixer did not come back"));
        check(&Row { kills: vec![kill(Victim::Mixer, None)], end_ns: 1_900_000_000, ..row.clone() }, None);
        check(&Row { code: Some(2), ..row.clone() }, Some("exit 2"));
        check(&Row { code: None, ..row.clone() }, Some("did not end"));
        check(&Row { left: vec!["mixer".into()], ..row }, Some("left mixer"));
    }

    #[test]
    fn a_recorder_is_replaced_and_costs_about_a_second_of_the_log() {
        let row = flown(Victim::Recorder);
        let losing = |lost_ms| Kill { lost_ms: Some(lost_ms), ..kill(Victim::Recorder, Some(30.0)) };
        check(&Row { kills: vec![losing(1_199.0)], ..row.clone() }, None);
        check(&Row { kills: vec![losing(1_201.0)], ..row.clone() }, Some("1201 ms of the log"));
        check(&Row { kills: vec![kill(Victim::Recorder, None)], ..row.clone() }, Some("recorder did not come back"));
        check(&Row { holes: 1, ..row.clone() }, Some("1 holes"));
        check(&Row { log_defect: Some("torn".into()), ..row.clone() }, Some("torn"));
        check(&Row { code: Some(3), given_up: vec!["recorder".into()], ..row }, None);
    }

    #[test]
    fn what_nobody_replaces_ends_the_flight_by_name() {
        check(&ended(Victim::Plant, "error: lost plant"), None);
        check(&ended(Victim::Plant, "error: lost"), Some("exit 3"));
        check(&Row { flown_s: Some(1.0), ..flown(Victim::Plant) }, Some("exit 0 without"));
    }

    #[test]
    fn a_lost_node_has_died_too_often_or_out_of_flight() {
        let row = ended(Victim::Mixer, "error: lost mixer");
        check(&row, Some("exit 3"));
        check(&Row { given_up: vec!["mixer".into()], ..row.clone() }, None);
        check(&Row { given_up: vec!["mixer".into()], diverged: true, ..row.clone() }, Some("exit 3"));
        check(&Row { flown_s: None, ..row.clone() }, None);
        check(&Row { flown_s: Some(DURATION_S), ..row }, None);
    }

    #[test]
    fn a_dead_launcher_leaves_nobody_and_hinders_nobody() {
        let row = Row { code: None, gone_ms: Some(5.0), next_code: Some(0), ..flown(Victim::Launcher) };
        check(&row, None);
        check(&Row { gone_ms: Some(1_001.0), ..row.clone() }, Some("outlived"));
        check(&Row { gone_ms: None, ..row.clone() }, Some("outlived"));
        check(&Row { next_code: Some(3), ..row }, Some("next flight"));
    }
}
