//! Victims and moments of the kills of a flight, drawn from the seed and the flight's number.
//!
//! | moment | the kill comes | hits |
//! |---|---|---|
//! | starting | up to 0.15 s after the launcher was started | the stack while it comes up |
//! | first ticks | up to 50 ms after the first tick | processes that have only just begun |
//! | candidate | up to 40 ms after the successor of the last victim was started | a process before it is ready |
//! | flying | up to 0.7 s after the last kill; without one, after the first tick | any process |

use std::time::Duration;

use flight::event::name;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Largest number of kills planned for one flight. With more, most flights would end with a node given up.
const MOST: usize = 8;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Victim {
    Guidance,
    AttitudeMpc,
    Mixer,
    Plant,
    Recorder,
    Launcher,
}

impl Victim {
    /// All victims, in the order of the printed table.
    pub const ALL: [Self; 6] =
        [Self::Guidance, Self::AttitudeMpc, Self::Mixer, Self::Plant, Self::Recorder, Self::Launcher];

    /// Returns the name of the victim's processes.
    pub fn name(self) -> String {
        name(self)
    }

    /// Returns whether another process replaces the victim in flight.
    pub fn is_replaced(self) -> bool {
        !matches!(self, Self::Plant | Self::Launcher)
    }

    /// Draws a victim: each process that is replaced gets 7 of 30 kills; the others, which end the flight, 1 each.
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        match rng.random_range(0..30) {
            0 => Self::Plant,
            1 => Self::Launcher,
            n => [Self::Guidance, Self::AttitudeMpc, Self::Mixer, Self::Recorder][n % 4],
        }
    }
}

/// Moment of a kill, see the table above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    Starting,
    FirstTicks,
    Candidate,
    Flying,
}

/// One kill of a plan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PlannedKill {
    pub victim: Victim,
    pub moment: Moment,
    /// Delay of the kill after the beginning of `moment`.
    pub after: Duration,
}

/// Returns the kills planned for flight `number`, in order.
pub fn plan(seed: u64, number: u64) -> Vec<PlannedKill> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    let mut kills: Vec<PlannedKill> = vec![];
    for _ in 0..rng.random_range(1..=MOST) {
        let last = kills.last().map(|kill| kill.victim);
        let (moment, up_to_ms) = match (last, rng.random_range(0..10)) {
            (None, 0) => (Moment::Starting, 150.0),
            (None, 1..4) => (Moment::FirstTicks, 50.0),
            (Some(last), 0..3) if last.is_replaced() => (Moment::Candidate, 40.0),
            _ => (Moment::Flying, 700.0),
        };
        let victim = last.filter(|_| moment == Moment::Candidate).unwrap_or_else(|| Victim::draw(&mut rng));
        let after = Duration::from_secs_f64(rng.random_range(0.0..up_to_ms) / 1e3);
        kills.push(PlannedKill { victim, moment, after });
    }
    kills
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_a_function_of_seed_and_number() {
        assert_eq!(plan(1, 7), plan(1, 7));
        assert_ne!(plan(1, 7), plan(1, 8));
        assert_ne!(plan(1, 7), plan(2, 7));
    }

    #[test]
    fn every_victim_and_every_moment_occurs() {
        let all: Vec<PlannedKill> = (0..300).flat_map(|number| plan(1, number)).collect();
        let count = |victim| all.iter().filter(|kill| kill.victim == victim).count();
        for victim in Victim::ALL {
            let least = if victim.is_replaced() { all.len() / 6 } else { all.len() / 100 };
            assert!(count(victim) > least, "{victim:?}: {} of {}", count(victim), all.len());
        }
        for moment in [Moment::Starting, Moment::FirstTicks, Moment::Candidate, Moment::Flying] {
            assert!(all.iter().filter(|kill| kill.moment == moment).count() > all.len() / 100, "{moment:?}");
        }
    }

    #[test]
    fn a_kill_of_a_candidate_hits_the_last_victims_successor() {
        for kills in (0..100).map(|number| plan(3, number)) {
            assert_ne!(kills[0].moment, Moment::Candidate);
            for pair in kills.windows(2).filter(|pair| pair[1].moment == Moment::Candidate) {
                assert!(pair[0].victim == pair[1].victim && pair[1].victim.is_replaced(), "{pair:?}");
            }
        }
    }
}
