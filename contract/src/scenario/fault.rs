//! `[[fault]]`: what goes wrong, and when. A function of the tick and the run's seed, so that a faulty run repeats.
//!
//! | group | target | kinds |
//! |---|---|---|
//! | process | plant guidance attitude-mpc mixer | kill stop slow hog exit |
//! | topic | state reference controls actuators | drop burst delay duplicate reorder corrupt garbage stale rate |
//! | sensor | position velocity attitude rates | off stuck garbage wrong slow delayed intermittent noise |
//! | actuator | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated |
//! | environment | wind, payload | step gust, mass |
//! | solver | mpc | infeasible, nan, iteration cap |
//! | clock, host | clock, host | offset, disk-full shm-removed |
//! | intruder | a topic | second-publisher wrong-layout wrong-user |
//!
//! A kind that a target cannot suffer is refused. The size of a fault has a default ([`Fault::ms`] and its neighbours).

use serde::{Deserialize, Serialize};

use crate::Topic;

/// One `[[fault]]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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
    /// Whose clock is off, whose segments are removed: a process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub process: Option<FaultTarget>,
    /// A time \[ms\]: how late (slow, delay, delayed), how old (stale), the time constant (slow sensor or actuator), how
    /// far ahead (offset; behind when negative).
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
    /// In which way a sensor is wrong.
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
    /// What one process reads of `CLOCK_MONOTONIC`.
    Clock,
    /// The machine.
    Host,
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
    /// A sensor with a bias, a factor or the wrong sign; an actuator with less effect.
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
    /// The clock is ahead, or behind.
    Offset,
    /// The log cannot be written any more.
    DiskFull,
    /// The names of a process's segments are gone from shared memory.
    ShmRemoved,
    /// Another process of the same user sends well-formed messages, with an epoch made up or stolen.
    SecondPublisher,
    /// A process with another idea of the messages wants to join.
    WrongLayout,
    /// A process of another user wants to join.
    WrongUser,
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

    /// The kinds it can suffer.
    pub fn kinds(self) -> &'static [FaultKind] {
        use FaultKind as K;
        match self {
            Self::Plant | Self::Guidance | Self::AttitudeMpc | Self::Mixer => {
                &[K::Kill, K::Stop, K::Slow, K::Hog, K::Exit]
            }
            Self::State | Self::Reference | Self::Controls | Self::Actuators => {
                #[rustfmt::skip]
                const KINDS: [K; 12] = [
                    K::Drop, K::Burst, K::Delay, K::Duplicate, K::Reorder, K::Corrupt, K::Garbage, K::Stale, K::Rate,
                    K::SecondPublisher, K::WrongLayout, K::WrongUser,
                ];
                &KINDS
            }
            Self::Position | Self::Velocity | Self::Attitude | Self::Rates => {
                &[K::Off, K::Stuck, K::Garbage, K::Wrong, K::Slow, K::Delayed, K::Intermittent, K::Noise]
            }
            Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt => {
                &[K::Off, K::Stuck, K::Wrong, K::Slow, K::Saturated]
            }
            Self::Wind => &[K::Step, K::Gust],
            Self::Payload => &[K::Mass],
            Self::Mpc => &[K::Infeasible, K::Nan, K::IterationCap],
            Self::Clock => &[K::Offset],
            Self::Host => &[K::DiskFull, K::ShmRemoved],
        }
    }
}

impl FaultKind {
    /// Whether it is a process that does not belong to the run.
    pub fn is_intrusion(self) -> bool {
        matches!(self, Self::SecondPublisher | Self::WrongLayout | Self::WrongUser)
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
            process: None,
            ms: None,
            value: None,
            vector: None,
            probability: None,
            count: None,
            how: None,
        }
    }

    /// The ticks on which it is at work: from the first at or after its beginning to before the first at or after its end.
    pub fn ticks(&self, sample_s: f64) -> std::ops::Range<u64> {
        // A time that is a tick but for rounding is that tick.
        let tick_of = |time_s: f64| (time_s / sample_s - 1e-6).ceil() as u64;
        tick_of(self.at_s)..self.for_s.map_or(u64::MAX, |for_s| tick_of(self.at_s + for_s))
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
    fn a_fault_strikes_from_its_first_tick_to_before_its_end() {
        let fault = |at_s, for_s| Fault::new(FaultTarget::Mpc, FaultKind::Nan, at_s, for_s);
        let struck = |fault: &Fault| (0..1000).filter(|tick| fault.strikes(*tick, 0.01)).collect::<Vec<_>>();
        assert_eq!(struck(&fault(0.29, Some(0.03))), [29, 30, 31]);
        assert_eq!(struck(&fault(0.291, Some(0.01))), [30]);
        assert_eq!(struck(&fault(9.98, None)), [998, 999]);
        assert!(struck(&fault(1.0, Some(0.0))).is_empty());
    }
}
