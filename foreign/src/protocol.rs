//! Input and answer of each node: messages of the ring to the types of `trefoil.h`, and back.

use std::fmt::{self, Display, Formatter};
use std::mem::offset_of;

use bytemuck::Pod;
use contract::message::{
    ActuationMsg, Actuators, Ahead, Controls, Message, Reference, SolveStatus, State, guidance_flags,
};
use contract::topic::Topic;
use runtime::input::Input;
use runtime::node::Inputs;

use crate::abi::{
    TREFOIL_NEVER, TrefoilAttitudeAnswer, TrefoilAttitudeInput, TrefoilDemand, TrefoilGuidanceAnswer,
    TrefoilGuidanceInput, TrefoilMixerAnswer, TrefoilMixerInput, TrefoilPlantAnswer, TrefoilPlantInput,
    TrefoilReference, TrefoilSample,
};

/// Input and answer of one node.
pub trait Protocol: 'static {
    /// Topic that the node publishes.
    const TOPIC: Topic = <Self::Message as Message>::TOPIC;
    /// Inputs of the node.
    type Inputs: Inputs;
    /// Message that the node sends.
    type Message: Message;
    /// Input of a step.
    type Input: Pod;
    /// Answer of a step.
    type Answer: Pod;
    /// Places of the numbers of input and answer, by the names that a CasADi function has for them.
    const NAMES: [&'static [Place]; 2];
    /// Layout of input and answer.
    const LAYOUT: PortLayout =
        PortLayout { bytes: [size_of::<Self::Input>(), size_of::<Self::Answer>()], names: Self::NAMES };

    /// Makes the input of the step for sample `tick` at `time_s`.
    fn input(tick: u64, time_s: f64, inputs: &Self::Inputs) -> Self::Input;
    /// Makes the message of the answer to `input`.
    fn message(input: &Self::Input, answer: &Self::Answer) -> Self::Message;
}

/// Sizes of input and answer of a node \[byte\], and the names of their numbers.
pub struct PortLayout {
    pub bytes: [usize; 2],
    pub names: [&'static [Place]; 2],
}

/// Place of numbers in an input or answer.
pub struct Place {
    pub name: &'static str,
    /// First byte.
    pub at: usize,
    pub shape: MatrixShape,
}

/// Shape of a matrix of `f64`, whose values are kept column by column, as in CasADi and as in an array
/// `[columns][rows]` of C.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MatrixShape {
    pub rows: usize,
    pub columns: usize,
}

impl MatrixShape {
    /// Returns the number of values.
    pub fn count(self) -> usize {
        self.rows * self.columns
    }

    /// Returns whether a matrix of this shape and one of the shape `other` keep the same values in the same order: a
    /// vector may be a row or a column.
    pub fn fits(self, other: Self) -> bool {
        let is_vector = |Self { rows, columns }: Self| rows <= 1 || columns <= 1;
        self == other || is_vector(self) && is_vector(other) && self.count() == other.count()
    }
}

impl Display for MatrixShape {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "{} x {}", self.rows, self.columns)
    }
}

/// Makes the places of fields: `name = path in the type: rows`, or `rows x columns`.
macro_rules! places {
    ($type:ty { $($name:literal = $($field:ident).+ : $rows:literal $(x $columns:literal)?),* }) => {
        &[$(Place {
            name: $name,
            at: offset_of!($type, $($field).+),
            shape: MatrixShape { rows: $rows, columns: 1 $(* $columns)? },
        }),*]
    };
}

/// Protocol of guidance.
pub struct GuidanceProtocol;
/// Protocol of attitude-mpc.
pub struct AttitudeMpcProtocol;
/// Protocol of the mixer.
pub struct MixerProtocol;

impl Protocol for GuidanceProtocol {
    type Inputs = Input<State>;
    type Message = Reference;
    type Input = TrefoilGuidanceInput;
    type Answer = TrefoilGuidanceAnswer;
    const NAMES: [&'static [Place]; 2] = [
        places!(TrefoilGuidanceInput {
            "time" = time_s: 1, "position" = sample.position_m: 3, "velocity" = sample.velocity_mps: 3,
            "attitude" = sample.attitude_rad: 3, "rates" = sample.rates_radps: 3,
            "rotor_speed" = sample.rotor_speed: 3, "tilt" = sample.tilt_rad: 1
        }),
        places!(TrefoilGuidanceAnswer {
            "position_ref" = position_m: 3, "velocity_ref" = velocity_mps: 3, "attitude_ref" = attitude_rad: 3,
            "rates_ref" = rates_radps: 3, "w_ref" = w_mps: 1
        }),
    ];

    fn input(tick: u64, time_s: f64, states: &Self::Inputs) -> Self::Input {
        TrefoilGuidanceInput { tick, time_s, sample: sample(tick, states.known()) }
    }

    fn message(input: &Self::Input, answer: &Self::Answer) -> Reference {
        let TrefoilGuidanceAnswer { position_m, velocity_mps, attitude_rad, rates_radps, w_mps } = *answer;
        let flags = if input.sample.age_ticks == 0 { 0 } else { guidance_flags::STALE };
        Reference { position_m, velocity_mps, attitude_rad, rates_radps, w_mps, flags, ..Reference::default() }
    }
}

impl Protocol for AttitudeMpcProtocol {
    type Inputs = (Input<Reference>, Input<State>);
    type Message = Controls;
    type Input = TrefoilAttitudeInput;
    type Answer = TrefoilAttitudeAnswer;
    const NAMES: [&'static [Place]; 2] = [
        places!(TrefoilAttitudeInput {
            "time" = time_s: 1, "position" = sample.position_m: 3, "velocity" = sample.velocity_mps: 3,
            "attitude" = sample.attitude_rad: 3, "rates" = sample.rates_radps: 3,
            "rotor_speed" = sample.rotor_speed: 3, "tilt" = sample.tilt_rad: 1,
            "position_ref" = reference.position_m: 3, "velocity_ref" = reference.velocity_mps: 3,
            "attitude_ref" = reference.attitude_rad: 3, "rates_ref" = reference.rates_radps: 3,
            "w_ref" = reference.w_mps: 1, "preview_step" = reference.preview_step_s: 1,
            "preview" = reference.preview: 4 x 8
        }),
        places!(TrefoilAttitudeAnswer { "demand" = demand: 4 }),
    ];

    fn input(tick: u64, time_s: f64, (references, states): &Self::Inputs) -> Self::Input {
        let (sample, reference) = (sample(tick, states.known()), reference(tick, references.known()));
        TrefoilAttitudeInput { tick, time_s, sample, reference }
    }

    /// Makes CONTROLS. An invalid answer, or an answer to an old sample, is marked as stale, so that the mixer falls
    /// back.
    fn message(input: &Self::Input, answer: &Self::Answer) -> Controls {
        let status = match (answer.status, input.sample.age_ticks, input.reference.age_ticks) {
            (0, 0, 0) => SolveStatus::Explicit,
            (0, 0, _) => SolveStatus::NoReference,
            _ => SolveStatus::Stale,
        };
        Controls { demand: answer.demand, status: status as u64, ..Controls::default() }
    }
}

impl Protocol for MixerProtocol {
    type Inputs = (Input<Controls>, Input<State>);
    type Message = Actuators;
    type Input = TrefoilMixerInput;
    type Answer = TrefoilMixerAnswer;
    const NAMES: [&'static [Place]; 2] = [
        places!(TrefoilMixerInput {
            "time" = time_s: 1, "position" = sample.position_m: 3, "velocity" = sample.velocity_mps: 3,
            "attitude" = sample.attitude_rad: 3, "rates" = sample.rates_radps: 3,
            "rotor_speed" = sample.rotor_speed: 3, "tilt" = sample.tilt_rad: 1, "demand" = demand.demand: 4
        }),
        places!(TrefoilMixerAnswer { "rotor_speed" = rotor_speed: 3, "tilt" = tilt_rad: 1 }),
    ];

    fn input(tick: u64, time_s: f64, (demands, states): &Self::Inputs) -> Self::Input {
        let demand = TrefoilDemand { age_ticks: age(tick, demands.known()), demand: demands.known().demand };
        TrefoilMixerInput { tick, time_s, sample: sample(tick, states.known()), demand }
    }

    fn message(_input: &Self::Input, answer: &Self::Answer) -> Actuators {
        let TrefoilMixerAnswer { rotor_speed, tilt_rad } = *answer;
        Actuators { command: ActuationMsg { rotor_speed, tilt_rad }, ..Actuators::default() }
    }
}

/// Places of the numbers of the plant, as [`Protocol::NAMES`]. The plant answers to nothing and has no messages here.
pub const PLANT_NAMES: [&[Place]; 2] = [
    places!(TrefoilPlantInput { "time" = time_s: 1, "advance" = advance_s: 1, "rotor_speed" = rotor_speed: 3, "tilt" = tilt_rad: 1 }),
    places!(TrefoilPlantAnswer {
        "position" = position_m: 3, "velocity" = velocity_mps: 3, "attitude" = attitude_rad: 3, "rates" = rates_radps: 3,
        "rotor_speed" = rotor_speed: 3, "tilt" = tilt_rad: 1
    }),
];

/// Returns the age of the newest message at `tick` \[ticks\]; [`TREFOIL_NEVER`] if none has come.
fn age<M: Message>(tick: u64, newest: &M) -> u64 {
    let stamp = newest.stamp();
    if stamp.sequence == 0 { TREFOIL_NEVER } else { tick.saturating_sub(stamp.tick) }
}

/// Makes the sample that a node may see: the measured motion and the command in force.
fn sample(tick: u64, state: &State) -> TrefoilSample {
    let (measured, command) = (&state.measured, &state.command_in_force);
    TrefoilSample {
        age_ticks: age(tick, state),
        position_m: measured.position_m,
        velocity_mps: measured.velocity_mps,
        attitude_rad: measured.attitude_rad,
        rates_radps: measured.rates_radps,
        rotor_speed: command.rotor_speed,
        tilt_rad: command.tilt_rad,
    }
}

/// Makes the reference that a controller may see.
fn reference(tick: u64, newest: &Reference) -> TrefoilReference {
    let Reference { position_m, velocity_mps, attitude_rad, rates_radps, w_mps, .. } = *newest;
    TrefoilReference {
        age_ticks: age(tick, newest),
        position_m,
        velocity_mps,
        attitude_rad,
        rates_radps,
        w_mps,
        preview_step_s: newest.preview_step_ns as f64 * 1e-9,
        preview: newest.preview.map(|Ahead { w_mps, attitude_rad: [roll, pitch, yaw] }| [w_mps, roll, pitch, yaw]),
    }
}

#[cfg(test)]
mod tests {
    use contract::message::Stamp;

    use super::*;

    #[test]
    fn the_preview_has_a_row_for_each_time_in_the_order_w_roll_pitch_yaw() {
        let stamp = Stamp { tick: 5, sequence: 1, ..Stamp::default() };
        let mut newest = Reference { stamp, preview_step_ns: 25_000_000, ..Reference::default() };
        newest.preview[7] = Ahead { w_mps: 1.0, attitude_rad: [2.0, 3.0, 4.0] };
        let seen = reference(7, &newest);
        assert_eq!((seen.age_ticks, seen.preview_step_s, seen.preview[7]), (2, 0.025, [1.0, 2.0, 3.0, 4.0]));
        let place = AttitudeMpcProtocol::NAMES[0].iter().find(|place| place.name == "preview").expect("CasADi's name");
        assert_eq!((place.shape.rows, place.shape.columns), (seen.preview[0].len(), seen.preview.len()));
    }
}
