//! Who is to be killed when: drawn from the seed and the flight's number, so that a flight's plan can be had again.
//!
//! | moment | the kill comes | hits |
//! |---|---|---|
//! | starting | up to 0.15 s after the launcher was started | the stack while it comes up |
//! | first ticks | up to 50 ms after the first tick | who has only just begun |
//! | candidate | up to 40 ms after the victim's successor was started | a process before it is ready |
//! | flying | up to 0.7 s after the last | anybody |

use std::time::Duration;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::Serialize;

/// Kills planned for one flight, at most. More of them, and most flights would end with a node given up.
const MOST: usize = 8;

/// Who is killed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Victim {
    /// A node that is replaced.
    Guidance,
    /// A node that is replaced.
    AttitudeMpc,
    /// A node that is replaced.
    Mixer,
    /// The vehicle.
    Plant,
    /// Who writes the log; replaced too.
    Recorder,
    /// Who looks after all of them.
    Launcher,
}

impl Victim {
    /// All of them, as the table shows them.
    pub const ALL: [Self; 6] =
        [Self::Guidance, Self::AttitudeMpc, Self::Mixer, Self::Plant, Self::Recorder, Self::Launcher];

    /// The process's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Guidance => "guidance",
            Self::AttitudeMpc => "attitude-mpc",
            Self::Mixer => "mixer",
            Self::Plant => "plant",
            Self::Recorder => "recorder",
            Self::Launcher => "launcher",
        }
    }

    /// Whether another process takes its place in flight.
    pub fn is_replaced(self) -> bool {
        !matches!(self, Self::Plant | Self::Launcher)
    }

    /// Seven of thirty kills for each process that is replaced, one for each of the others: with those a flight ends.
    fn draw(rng: &mut ChaCha8Rng) -> Self {
        match rng.random_range(0..30) {
            0 => Self::Plant,
            1 => Self::Launcher,
            n => [Self::Guidance, Self::AttitudeMpc, Self::Mixer, Self::Recorder][n % 4],
        }
    }
}

/// What a kill is to hit: see the table above.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Moment {
    /// The stack while it comes up.
    Starting,
    /// The first ticks.
    FirstTicks,
    /// The successor of the last victim.
    Candidate,
    /// Anything.
    Flying,
}

/// One kill to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Blow {
    /// Who.
    pub victim: Victim,
    /// What is waited for.
    pub moment: Moment,
    /// How much longer.
    pub after: Duration,
}

/// The plan of flight `number`, in order.
pub fn blows(seed: u64, number: u64) -> Vec<Blow> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(number);
    let mut blows: Vec<Blow> = vec![];
    for _ in 0..rng.random_range(1..=MOST) {
        let last = blows.last().map(|blow| blow.victim);
        let (moment, up_to_ms) = match (last, rng.random_range(0..10)) {
            (None, 0) => (Moment::Starting, 150.0),
            (None, 1..4) => (Moment::FirstTicks, 50.0),
            (Some(last), 0..3) if last.is_replaced() => (Moment::Candidate, 40.0),
            _ => (Moment::Flying, 700.0),
        };
        let victim = last.filter(|_| moment == Moment::Candidate).unwrap_or_else(|| Victim::draw(&mut rng));
        let after = Duration::from_secs_f64(rng.random_range(0.0..up_to_ms) / 1e3);
        blows.push(Blow { victim, moment, after });
    }
    blows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plan_is_a_function_of_seed_and_number() {
        assert_eq!(blows(1, 7), blows(1, 7));
        assert_ne!(blows(1, 7), blows(1, 8));
        assert_ne!(blows(1, 7), blows(2, 7));
    }

    #[test]
    fn every_victim_and_every_moment_is_met() {
        let all: Vec<Blow> = (0..300).flat_map(|number| blows(1, number)).collect();
        let count = |victim| all.iter().filter(|blow| blow.victim == victim).count();
        for victim in Victim::ALL {
            let least = if victim.is_replaced() { all.len() / 6 } else { all.len() / 100 };
            assert!(count(victim) > least, "{victim:?}: {} of {}", count(victim), all.len());
        }
        for moment in [Moment::Starting, Moment::FirstTicks, Moment::Candidate, Moment::Flying] {
            assert!(all.iter().filter(|blow| blow.moment == moment).count() > all.len() / 100, "{moment:?}");
        }
    }

    #[test]
    fn a_candidate_comes_in_the_last_victims_place() {
        for blows in (0..100).map(|number| blows(3, number)) {
            assert_ne!(blows[0].moment, Moment::Candidate);
            for pair in blows.windows(2).filter(|pair| pair[1].moment == Moment::Candidate) {
                assert!(pair[0].victim == pair[1].victim && pair[1].victim.is_replaced(), "{pair:?}");
            }
        }
    }
}
