//! `[[fault]]`: what goes wrong, and when. A function of the tick and the run's seed, so that a faulty run repeats.
//!
//! | group | target | kinds |
//! |---|---|---|
//! | process | plant guidance attitude-mpc mixer | kill stop slow hog exit |
//! | topic | state reference controls actuators | drop burst delay duplicate reorder corrupt garbage stale rate; wrong but for state |
//! | sensor | position velocity attitude rates | off stuck garbage wrong slow delayed intermittent noise |
//! | actuator | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated |
//! | environment | wind, payload | step gust, mass |
//! | solver | mpc | infeasible, nan, iteration cap |
//!
//! A kind that a target cannot suffer is refused, and so is a size that its kind has no use for ([`Fault::keys`]). Every
//! size has a default ([`Fault::ms`] and its neighbours).

use serde::{Deserialize, Serialize};

use crate::Topic;

/// No fault begins later than this, or lasts longer \[s\].
pub const LONGEST_S: f64 = 86_400.0;
/// No time of [`Fault::ms`] is longer \[ms\].
pub const LONGEST_MS: f64 = 60_000.0;

/// One `[[fault]]`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Fault {
    /// When it begins \[s\].
    pub at_s: f64,
    /// How long it lasts \[s\]; absent = until the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub for_s: Option<f64>,
    /// What it strikes.
    pub target: FaultTarget,
    /// What happens to it.
    pub kind: FaultKind,
    /// A time \[ms\]: how late (slow, delay, delayed), how old (stale), the time constant (slow sensor or actuator).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ms: Option<f64>,
    /// A size: standard deviation (noise), bias or factor (wrong), share of the range (saturated), mass \[kg\].
    /// Degrees for angles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Wind NED \[m/s\].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub vector: Option<[f64; 3]>,
    /// Share of the ticks struck (drop, duplicate, reorder, corrupt, garbage, intermittent).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// Messages lost in a row (burst), bits flipped (corrupt), every how many-th message passes (rate).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u64>,
    /// In which way a sensor or a topic is wrong; absent = bias for a sensor, sign for a topic.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub how: Option<Wrong>,
}

/// `fault.target`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultTarget {
    /// The process that turns the ring.
    Plant,
    /// The process of the position controller.
    Guidance,
    /// The process of the attitude controller.
    AttitudeMpc,
    /// The process of the control allocation.
    Mixer,
    /// Topic of the plant.
    State,
    /// Topic of guidance.
    Reference,
    /// Topic of attitude-mpc.
    Controls,
    /// Topic of the mixer.
    Actuators,
    /// What is measured of X, Y, Z.
    Position,
    /// What is measured of u, v, w.
    Velocity,
    /// What is measured of phi, theta, psi.
    Attitude,
    /// What is measured of p, q, r.
    Rates,
    /// The rotor that tilts.
    Rotor1,
    /// The rear rotor at the right.
    Rotor2,
    /// The rear rotor at the left.
    Rotor3,
    /// The servo that tilts rotor 1.
    Tilt,
    /// The air.
    Wind,
    /// What is carried, at the centre of mass.
    Payload,
    /// The solver inside attitude-mpc.
    #[serde(alias = "solver")]
    Mpc,
}

/// `fault.kind`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// SIGKILL.
    Kill,
    /// SIGSTOP: it hangs.
    Stop,
    /// It takes longer: a process to answer, a sensor or an actuator to follow.
    Slow,
    /// It burns its processor at its own priority.
    Hog,
    /// It ends by itself, and not well.
    Exit,
    /// Messages are lost, each by itself.
    Drop,
    /// Messages are lost in a row, once, at the fault's beginning.
    Burst,
    /// Messages come late.
    Delay,
    /// Messages come twice.
    Duplicate,
    /// A message comes after the one that follows it.
    Reorder,
    /// Bits are flipped.
    Corrupt,
    /// The numbers are none.
    Garbage,
    /// The stamps tell an older time.
    Stale,
    /// Only some of the messages come.
    Rate,
    /// Nothing comes of it.
    Off,
    /// It stays as it was when the fault began.
    Stuck,
    /// A sensor, or what a node demands, with a bias, a factor or the wrong sign; an actuator with less effect.
    Wrong,
    /// A sensor that tells what was true some time ago.
    Delayed,
    /// A sensor that is off now and then.
    Intermittent,
    /// A sensor with more noise.
    Noise,
    /// An actuator that reaches only a part of its range.
    Saturated,
    /// Wind that sets in at once.
    Step,
    /// Wind that comes and goes as one minus cosine over the fault's duration (MIL-F-8785C).
    Gust,
    /// More mass.
    Mass,
    /// The solver is given constraints that contradict each other.
    Infeasible,
    /// The solver is given numbers that are none.
    Nan,
    /// The solver is granted a single iteration.
    #[serde(rename = "iteration cap", alias = "iteration-cap", alias = "iteration_cap")]
    IterationCap,
}

/// `fault.how`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Wrong {
    /// `value` is added.
    Bias,
    /// `value` multiplies.
    Scale,
    /// The sign is turned.
    Sign,
}

impl FaultTarget {
    /// All of them in their order, as the file spells them.
    pub const ALL: [(Self, &'static str); 19] = [
        (Self::Plant, "plant"),
        (Self::Guidance, "guidance"),
        (Self::AttitudeMpc, "attitude-mpc"),
        (Self::Mixer, "mixer"),
        (Self::State, "state"),
        (Self::Reference, "reference"),
        (Self::Controls, "controls"),
        (Self::Actuators, "actuators"),
        (Self::Position, "position"),
        (Self::Velocity, "velocity"),
        (Self::Attitude, "attitude"),
        (Self::Rates, "rates"),
        (Self::Rotor1, "rotor1"),
        (Self::Rotor2, "rotor2"),
        (Self::Rotor3, "rotor3"),
        (Self::Tilt, "tilt"),
        (Self::Wind, "wind"),
        (Self::Payload, "payload"),
        (Self::Mpc, "mpc"),
    ];

    /// As the file spells it.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// The topic that it is, if it is one.
    pub fn topic(self) -> Option<Topic> {
        let topics = [Self::State, Self::Reference, Self::Controls, Self::Actuators];
        topics.iter().position(|topic| *topic == self).map(|i| Topic::ALL[i])
    }

    /// The topic on which the process speaks that it is, if it is one.
    pub fn process(self) -> Option<Topic> {
        let processes = [Self::Plant, Self::Guidance, Self::AttitudeMpc, Self::Mixer];
        processes.iter().position(|process| *process == self).map(|i| Topic::ALL[i])
    }

    /// Whether it is a rotor or the tilt.
    pub fn is_an_actuator(self) -> bool {
        matches!(self, Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt)
    }

    /// The kinds it can suffer.
    pub fn kinds(self) -> &'static [FaultKind] {
        use FaultKind as K;
        match self {
            Self::Plant | Self::Guidance | Self::AttitudeMpc | Self::Mixer => {
                &[K::Kill, K::Stop, K::Slow, K::Hog, K::Exit]
            }
            Self::State => {
                &[K::Drop, K::Burst, K::Delay, K::Duplicate, K::Reorder, K::Corrupt, K::Garbage, K::Stale, K::Rate]
            }
            Self::Reference | Self::Controls | Self::Actuators => &[
                K::Drop,
                K::Burst,
                K::Delay,
                K::Duplicate,
                K::Reorder,
                K::Corrupt,
                K::Garbage,
                K::Stale,
                K::Rate,
                K::Wrong,
            ],
            Self::Position | Self::Velocity | Self::Attitude | Self::Rates => {
                &[K::Off, K::Stuck, K::Garbage, K::Wrong, K::Slow, K::Delayed, K::Intermittent, K::Noise]
            }
            Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt => {
                &[K::Off, K::Stuck, K::Wrong, K::Slow, K::Saturated]
            }
            Self::Wind => &[K::Step, K::Gust],
            Self::Payload => &[K::Mass],
            Self::Mpc => &[K::Infeasible, K::Nan, K::IterationCap],
        }
    }
}

impl Fault {
    /// A fault of the default size.
    pub fn new(target: FaultTarget, kind: FaultKind, at_s: f64, for_s: Option<f64>) -> Self {
        Self {
            at_s,
            for_s,
            target,
            kind,
            ms: None,
            value: None,
            vector: None,
            probability: None,
            count: None,
            how: None,
        }
    }

    /// The keys of its size that mean something to its kind.
    pub fn keys(&self) -> &'static [&'static str] {
        use FaultKind as K;
        match self.kind {
            K::Kill | K::Stop | K::Hog | K::Exit | K::Off | K::Stuck | K::Infeasible | K::Nan | K::IterationCap => &[],
            K::Slow | K::Delay | K::Stale | K::Delayed => &["ms"],
            K::Drop | K::Duplicate | K::Reorder | K::Garbage | K::Intermittent => &["probability"],
            K::Burst | K::Rate => &["count"],
            K::Corrupt => &["count", "probability"],
            K::Wrong if self.target.is_an_actuator() => &["value"],
            K::Wrong if self.wrong() == Wrong::Sign => &["how"],
            K::Wrong => &["how", "value"],
            K::Noise | K::Saturated | K::Mass => &["value"],
            K::Step | K::Gust => &["vector"],
        }
    }

    /// In which way it is wrong.
    pub fn wrong(&self) -> Wrong {
        self.how.unwrap_or(if self.target.topic().is_some() { Wrong::Sign } else { Wrong::Bias })
    }

    /// The keys of a size that were given.
    pub fn given(&self) -> impl Iterator<Item = &'static str> {
        let given = [
            ("ms", self.ms.is_some()),
            ("value", self.value.is_some()),
            ("vector", self.vector.is_some()),
            ("probability", self.probability.is_some()),
            ("count", self.count.is_some()),
            ("how", self.how.is_some()),
        ];
        given.into_iter().filter(|(_, is_given)| *is_given).map(|(key, _)| key)
    }

    /// The ticks on which it is at work: from the first at or after its beginning to before the first at or after its end.
    pub fn ticks(&self, sample_s: f64) -> std::ops::Range<u64> {
        // A time that is a tick but for rounding is that tick.
        let tick_of = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        tick_of(self.at_s)..self.for_s.map_or(u64::MAX, |for_s| tick_of(self.at_s + for_s))
    }

    /// Whether it is done at once and has no end: a process that dies.
    pub fn is_momentary(&self) -> bool {
        matches!(self.kind, FaultKind::Kill | FaultKind::Exit)
    }

    /// Whether it is at work on `tick`, at a sample time \[s\].
    pub fn strikes(&self, tick: u64, sample_s: f64) -> bool {
        self.ticks(sample_s).contains(&tick)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_list_of_targets_has_all_under_their_names() {
        for (i, (target, name)) in FaultTarget::ALL.into_iter().enumerate() {
            assert_eq!((target as usize, target.name()), (i, name));
            assert_eq!(toml::Value::try_from(target), Ok(name.into()));
        }
        assert_eq!(FaultTarget::ALL.len(), FaultTarget::Mpc as usize + 1, "the last one");
    }

    #[test]
    fn a_fault_strikes_from_its_first_tick_to_before_its_end() {
        let fault = |at_s, for_s| Fault::new(FaultTarget::Mpc, FaultKind::Nan, at_s, for_s);
        let struck = |fault: &Fault| (0..1000).filter(|tick| fault.strikes(*tick, 0.01)).collect::<Vec<_>>();
        assert_eq!(struck(&fault(0.29, Some(0.03))), [29, 30, 31]);
        assert_eq!(struck(&fault(0.291, Some(0.01))), [30]);
        assert_eq!(struck(&fault(9.98, None)), [998, 999]);
        assert!(struck(&fault(1.0, Some(0.0))).is_empty());
    }
}
