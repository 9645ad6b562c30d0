//! The catalogue of faults: all targets, and the kinds that each of them can have.
//!
//! | group | target | kinds |
//! |---|---|---|
//! | process | plant guidance attitude-mpc mixer | kill stop slow hog exit |
//! | topic | state reference controls actuators | drop burst delay duplicate reorder corrupt garbage stale rate |
//! | demand | reference controls actuators | wrong |
//! | sensor | position velocity attitude rates; of the EKF acceleration height field flow | off stuck garbage wrong slow delayed intermittent noise |
//! | actuator | rotor1 rotor2 rotor3 tilt | off stuck wrong slow saturated |
//! | environment | wind, payload | step gust, mass |
//! | solver | mpc | infeasible nan iteration-cap |
//! | clock, host | clock, host | offset, disk-full |

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use contract::topic::Topic;

/// Part of the stack that has a fault, `fault.target`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
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
    /// Measurement of X, Y, Z.
    Position,
    /// Measurement of u, v, w.
    Velocity,
    /// Measurement of phi, theta, psi.
    Attitude,
    /// Measurement of p, q, r.
    Rates,
    /// Specific force as the accelerometers of the EKF measure it.
    Acceleration,
    /// Height as the barometer of the EKF measures it.
    Height,
    /// Magnetic field as the magnetometer of the EKF measures it.
    Field,
    /// Velocity over the ground as the flow sensor of the EKF measures it.
    Flow,
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
    /// Payload at the centre of mass.
    Payload,
    /// The solver inside attitude-mpc.
    Mpc,
    /// `CLOCK_MONOTONIC` as one process reads it.
    Clock,
    /// The machine.
    Host,
}

/// Kind of a fault, `fault.kind`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// SIGKILL.
    Kill,
    /// SIGSTOP: the process hangs.
    Stop,
    /// Delay of a process's answers, or lag of a sensor or actuator.
    Slow,
    /// Process that burns its processor at its own priority.
    Hog,
    /// Process that ends by itself, with an error.
    Exit,
    /// Loss of single messages, each with a probability.
    Drop,
    /// Loss of several messages in a row, once, at the fault's beginning.
    Burst,
    /// Messages that arrive late.
    Delay,
    /// Messages that arrive twice.
    Duplicate,
    /// Messages that arrive after their successor.
    Reorder,
    /// Flipped bits in a message.
    Corrupt,
    /// Numbers that are NaN, infinite or random.
    Garbage,
    /// Stamps of an older sample.
    Stale,
    /// Lower rate: only every `count`-th message passes.
    Rate,
    /// Sensor that measures nothing, or actuator without power.
    Off,
    /// Sensor or actuator that stays as it was when the fault began.
    Stuck,
    /// Measurement or demand with a bias, a factor or the wrong sign; actuator with less effect.
    Wrong,
    /// Sensor that returns old measurements.
    Delayed,
    /// Sensor that is off on some ticks.
    Intermittent,
    /// Sensor with more noise.
    Noise,
    /// Actuator that reaches only a part of its range.
    Saturated,
    /// Wind that sets in and stays: at once, or as one minus cosine over `ms`, the discrete gust of flight control
    /// (MIL-F-8785C, section 3.7).
    Step,
    /// Wind that comes and goes as one minus cosine over the fault's duration, the discrete gust of certification
    /// (CS-25.341 and 14 CFR 25.341).
    Gust,
    /// Additional mass.
    Mass,
    /// Constraints of the solver that contradict each other.
    Infeasible,
    /// NaN in the input of the solver.
    Nan,
    /// Solver with a limit of one iteration.
    IterationCap,
    /// Clock that is ahead, or behind.
    Offset,
    /// Log that cannot be written any more.
    DiskFull,
}

/// Error of a sensor or topic that is wrong, `fault.how`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Wrong {
    /// `value` is added to the number.
    Bias,
    /// `value` multiplies the number.
    Scale,
    /// Sign is inverted.
    Sign,
}

/// Kinds that a topic can have. STATE has all but the first, because it demands nothing.
#[rustfmt::skip]
const TOPIC_KINDS: [FaultKind; 10] = {
    use FaultKind as K;
    [K::Wrong, K::Drop, K::Burst, K::Delay, K::Duplicate, K::Reorder, K::Corrupt, K::Garbage, K::Stale, K::Rate]
};

impl FaultTarget {
    /// All targets in the order of their discriminants, each with its name in the file.
    pub const ALL: [(Self, &'static str); 25] = [
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
        (Self::Acceleration, "acceleration"),
        (Self::Height, "height"),
        (Self::Field, "field"),
        (Self::Flow, "flow"),
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

    /// Name as the file spells it.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// Topic that has the fault; `None` if the target is no topic.
    pub fn topic(self) -> Option<Topic> {
        Topic::ALL.into_iter().find(|topic| topic.name() == self.name())
    }

    /// Topic that the faulty process publishes; `None` if the target is no process.
    pub fn process(self) -> Option<Topic> {
        Topic::of_node(self.name())
    }

    /// Returns whether the target is a sensor.
    pub fn is_a_sensor(self) -> bool {
        matches!(self, Self::Position | Self::Velocity | Self::Attitude | Self::Rates) || self.is_of_the_unit()
    }

    /// Returns whether the target is a sensor that only the EKF has.
    pub fn is_of_the_unit(self) -> bool {
        matches!(self, Self::Acceleration | Self::Height | Self::Field | Self::Flow)
    }

    /// Returns whether the target is a rotor or the tilt.
    pub fn is_an_actuator(self) -> bool {
        matches!(self, Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt)
    }

    /// Kinds of fault that the target can have.
    pub fn kinds(self) -> &'static [FaultKind] {
        use FaultKind as K;
        match self {
            Self::Plant | Self::Guidance | Self::AttitudeMpc | Self::Mixer => {
                &[K::Kill, K::Stop, K::Slow, K::Hog, K::Exit]
            }
            Self::State => &TOPIC_KINDS[1..],
            Self::Reference | Self::Controls | Self::Actuators => &TOPIC_KINDS,
            Self::Position
            | Self::Velocity
            | Self::Attitude
            | Self::Rates
            | Self::Acceleration
            | Self::Height
            | Self::Field
            | Self::Flow => &[K::Off, K::Stuck, K::Garbage, K::Wrong, K::Slow, K::Delayed, K::Intermittent, K::Noise],
            Self::Rotor1 | Self::Rotor2 | Self::Rotor3 | Self::Tilt => {
                &[K::Off, K::Stuck, K::Wrong, K::Slow, K::Saturated]
            }
            Self::Wind => &[K::Step, K::Gust],
            Self::Payload => &[K::Mass],
            Self::Mpc => &[K::Infeasible, K::Nan, K::IterationCap],
            Self::Clock => &[K::Offset],
            Self::Host => &[K::DiskFull],
        }
    }

    /// Kinds of fault that the target can be given while it flies; none for the clock and the host.
    pub fn kinds_in_flight(self) -> impl Iterator<Item = FaultKind> {
        let of_a_scenario = matches!(self, Self::Clock | Self::Host);
        self.kinds().iter().copied().filter(move |_| !of_a_scenario)
    }
}
