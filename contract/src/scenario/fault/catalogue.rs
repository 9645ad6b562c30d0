//! The catalogue of faults: which targets there are, and which kinds each of them can have.
//!
//! | group | target | kinds |
//! |---|---|---|
//! | process | plant guidance attitude-mpc mixer | kill stop slow hog exit |
//! | topic | state reference controls actuators | drop burst delay duplicate reorder corrupt garbage stale rate |
//! | demand | reference controls actuators | wrong |
//! | sensor | position velocity attitude rates | off stuck garbage wrong slow delayed intermittent noise |
//! | actuator | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated |
//! | environment | wind, payload | step gust, mass |
//! | solver | mpc | infeasible nan iteration-cap |
//! | clock, host | clock, host | offset, disk-full shm-removed |
//! | intruder | a topic | second-publisher wrong-layout wrong-user |

use serde::{Deserialize, Deserializer, Serialize};

use crate::Topic;
use crate::scenario::words::named;

/// `fault.target`
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultTarget {
    /// The process of the vehicle.
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
    /// The solver inside attitude-mpc; files may call it `solver`.
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
    /// It ends by itself, with an error.
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
    /// The numbers are NaN, infinite or random.
    Garbage,
    /// The stamps are of an older time.
    Stale,
    /// Only some of the messages come.
    Rate,
    /// A sensor measures nothing; an actuator is unpowered.
    Off,
    /// It stays as it was when the fault began.
    Stuck,
    /// A sensor, or what a node demands, with a bias, a factor or the wrong sign; an actuator with less effect.
    Wrong,
    /// A sensor that returns what was measured some time ago.
    Delayed,
    /// A sensor that is off now and then.
    Intermittent,
    /// A sensor with more noise.
    Noise,
    /// An actuator that reaches only a part of its range.
    Saturated,
    /// Wind that sets in and stays: at once, or as one minus cosine over `ms`, the discrete gust of flight control practice
    /// (MIL-F-8785C, section 3.7).
    Step,
    /// Wind that comes and goes as one minus cosine over the fault's duration, the discrete gust of certification
    /// (CS-25.341 and 14 CFR 25.341).
    Gust,
    /// More mass.
    Mass,
    /// The solver is given constraints that contradict each other.
    Infeasible,
    /// The solver is given NaN.
    Nan,
    /// The solver is granted a single iteration.
    IterationCap,
    /// The clock is ahead, or behind.
    Offset,
    /// The log cannot be written any more.
    DiskFull,
    /// The names of a process's segments are gone from shared memory.
    ShmRemoved,
    /// Another process of the same user sends well-formed messages, with an epoch made up or stolen.
    SecondPublisher,
    /// A process with another layout of the messages tries to join.
    WrongLayout,
    /// A process of another user tries to join.
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

/// The kinds that a topic can have. The first is not for STATE, which demands nothing.
#[rustfmt::skip]
const TOPIC_KINDS: [FaultKind; 13] = {
    use FaultKind as K;
    [
        K::Wrong, K::Drop, K::Burst, K::Delay, K::Duplicate, K::Reorder, K::Corrupt, K::Garbage, K::Stale, K::Rate,
        K::SecondPublisher, K::WrongLayout, K::WrongUser,
    ]
};

impl FaultTarget {
    /// All of them in their order, as the file spells them.
    pub const ALL: [(Self, &'static str); 21] = [
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
        (Self::Clock, "clock"),
        (Self::Host, "host"),
    ];

    /// What an error offers.
    const NAMES: [&'static str; 21] = {
        let mut names = [""; 21];
        let mut i = 0;
        while i < names.len() {
            names[i] = Self::ALL[i].1;
            i += 1;
        }
        names
    };

    /// As the file spells it.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// The topic of this name, if it is one.
    pub fn topic(self) -> Option<Topic> {
        let topics = [Self::State, Self::Reference, Self::Controls, Self::Actuators];
        topics.iter().position(|topic| *topic == self).map(|i| Topic::ALL[i])
    }

    /// The topic that the process of this name publishes, if it is one.
    pub fn process(self) -> Option<Topic> {
        let processes = [Self::Plant, Self::Guidance, Self::AttitudeMpc, Self::Mixer];
        processes.iter().position(|process| *process == self).map(|i| Topic::ALL[i])
    }

    /// Whether it is a rotor or the tilt.
    pub fn is_an_actuator(self) -> bool {
        matches!(self, Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt)
    }

    /// The kinds it can have.
    pub fn kinds(self) -> &'static [FaultKind] {
        use FaultKind as K;
        match self {
            Self::Plant | Self::Guidance | Self::AttitudeMpc | Self::Mixer => {
                &[K::Kill, K::Stop, K::Slow, K::Hog, K::Exit]
            }
            Self::State => &TOPIC_KINDS[1..],
            Self::Reference | Self::Controls | Self::Actuators => &TOPIC_KINDS,
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

impl<'de> Deserialize<'de> for FaultTarget {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        match String::deserialize(from)?.as_str() {
            "solver" => Ok(Self::Mpc),
            word => named(word, &Self::ALL, &Self::NAMES),
        }
    }
}

impl FaultKind {
    /// Whether it is a process that does not belong to the run.
    pub fn is_intrusion(self) -> bool {
        matches!(self, Self::SecondPublisher | Self::WrongLayout | Self::WrongUser)
    }
}
